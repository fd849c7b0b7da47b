/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon doctor: says what on this machine works.
 */
#include <stdio.h>
#include <string.h>

#include <jansson.h>
#include <openexr.h>
#include <png.h>
#include <unistd.h>

#include "client/capture/gige.h"
#include "client/capture/v4l2.h"
#include "client/cmd.h"
#include "client/feature.h"
#include "client/view/window.h"
#include "client/vision/markers.h"
#include "common/thread.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    GN_CMD_SERVER_OPTIONS,
};

static const struct gn_program program = {
    .name = "gnomon doctor",
    .usage = "[OPTION]...",
    .summary = "Checks what a client needs: the server (reachable, version, clock), the cameras "
               "this machine has, what this build can read. Exits 0 only when nothing failed.",
    .notes = "Example:\n  gnomon doctor --server 127.0.0.1:7340\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

static void say(const char *mark, const char *what, const char *text)
{
    printf("%-6s %-10s %s\n", mark, what, text);
}

/** Connects, greets, measures the clock. Returns whether it worked. */
static bool check_server(const struct gn_options *options)
{
    const char *server = gn_options_get_string(options, NULL, NULL, "server");
    char text[512];
    struct gn_client *client = NULL;
    struct gn_error error = {0};
    // A probe that sends nothing: it takes no viewer's place.
    if (gn_cmd_connect(&program, options, GN_MSG_ROLE_PROBE, &client, &error) < 0) {
        say("FAILED", "server", error.text);
        return false;
    }
    const struct gn_msg_welcome *w = gn_client_get_welcome(client);
    snprintf(text, sizeof(text), "%s: %s %s, protocol %u, room '%s'", server, w->server_name,
             w->server_version, w->version, w->room);
    say("ok", "server", text);
    snprintf(text, sizeof(text), "%.3f ms ahead of ours, round trip %.3f ms",
             (double)gn_client_get_clock_offset_ns(client) * 1e-6,
             (double)gn_client_get_round_trip_ns(client) * 1e-6);
    say("ok", "clock", text);
    snprintf(text, sizeof(text), "pictures up to %ux%u, environment frames up to %ux%u",
             w->max_picture_width, w->max_picture_height, w->max_environment_width,
             w->max_environment_height);
    say("ok", "limits", text);
    if (w->holdable_fps > 0)
        snprintf(text, sizeof(text), "one more viewer gets %.1f frames/s at 640x480",
                 (double)w->holdable_fps);
    else
        snprintf(text, sizeof(text), "not measured yet: no frame has been rendered in this room");
    say("ok", "rate", text);
    gn_cmd_disconnect(&client);
    return true;
}

static void check_libraries(void)
{
    int major = 0, minor = 0, patch = 0;
    const char *extra = NULL;
    char text[256];
    exr_get_library_version(&major, &minor, &patch, &extra);
    snprintf(text, sizeof(text), "OpenEXR %d.%d.%d, libpng %s, libjpeg-turbo, jansson %s", major,
             minor, patch, png_get_libpng_ver(NULL), jansson_version_str());
    say("ok", "libraries", text);
    say("ok", "files", "EXR, Radiance, PNG, JPEG; sequences of the capture rig");
}

/** A row of the table of optional parts; name NULL: another line of the one above. */
static void say_part(const char *mark, const char *name, const char *text)
{
    printf("%-6s %-10s %-9s %s\n", mark, name ? name : "",
           name ? strcmp(mark, "absent") == 0 ? "no" : "yes" : "", text);
}

/** What finding cameras has come to. */
struct part {
    const char *name;
    int n; // cameras
};

static void say_gige(void *context, const char *id, const char *model, const char *address)
{
    struct part *part = context;
    char text[512];
    snprintf(text, sizeof(text), "%s: %s, at %s", id, model, address);
    say_part("ok", part->n++ ? NULL : part->name, text);
}

static void find_gige(const char *name)
{
    if (gn_gige_find(say_gige, &(struct part){.name = name}) == 0)
        say_part("none", name,
                 "no GigE Vision camera answers in the networks of this machine; one behind a "
                 "router is opened by its address");
}

static void say_v4l2(void *context, int indent, const char *line)
{
    struct part *part = context;
    if (indent)
        printf("%-27s   %s\n", "", line);
    else
        say_part("ok", part->n++ ? NULL : part->name, line);
}

/** A camera that only others may open is the commonest reason to see none. */
static void find_v4l2(const char *name)
{
    char path[32], text[128];
    if (gn_v4l2_describe_all(say_v4l2, &(struct part){.name = name}) > 0)
        return;
    for (int i = 0; i < 64; i++) {
        snprintf(path, sizeof(path), "/dev/video%d", i);
        if (access(path, F_OK) == 0 && access(path, R_OK | W_OK) != 0) {
            snprintf(text, sizeof(text),
                     "%s is not yours to open; right would be to be in its group: ls -l %s", path,
                     path);
            say_part("none", name, text);
            return;
        }
    }
    say_part("none", name, "no /dev/video* of this machine captures video");
}

static void find_display(const char *name)
{
    struct gn_error error = {0};
    if (gn_window_find_display(&error) < 0)
        say_part("none", name, error.text);
    else
        say_part("ok", name, "there is a display");
}

/** Every optional part: built in, and what of it is on this machine; or how to come by it. */
static void check_parts(void)
{
    printf("\n%-6s %-10s %-9s %s\n", "", "optional", "built in", "on this machine");
    for (int id = 0; id < GN_FEATURE_COUNT; id++) {
        const struct gn_feature *f = gn_feature_get((enum gn_feature_id)id);
        struct gn_error error = {0};
        if (!f->is_built) {
            gn_feature_refuse((enum gn_feature_id)id, &error);
            say_part("absent", f->name, error.text);
        } else if (id == GN_FEATURE_GIGE) {
            find_gige(f->name);
        } else if (id == GN_FEATURE_V4L2) {
            find_v4l2(f->name);
        } else if (id == GN_FEATURE_WINDOW) {
            find_display(f->name);
        } else {
            char text[128];
            snprintf(text, sizeof(text), "%s%s%s", f->gives, id == GN_FEATURE_VISION ? ", by " : "",
                     id == GN_FEATURE_VISION ? gn_vision_get_version() : "");
            say_part("ok", f->name, text);
        }
    }
}

int gn_cmd_doctor(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    int run = gn_cmd_load(&program, argc, argv, &options);
    if (run <= 0)
        return run ? 2 : 0;
    gn_cmd_catch_signals();
    char text[128];
    snprintf(text, sizeof(text), "gnomon %s, protocol %d, %d processors", GN_VERSION,
             GN_PROTO_VERSION_MAX, gn_thread_get_cpu_count());
    say("ok", "client", text);
    bool is_ok = check_server(options);
    check_libraries();
    check_parts();
    gn_options_destroy(&options);
    return is_ok ? 0 : 1;
}
