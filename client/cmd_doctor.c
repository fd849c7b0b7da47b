/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon doctor: says what on this machine works.
 */
#include <inttypes.h>
#include <math.h>
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
#include "common/clock.h"
#include "common/thread.h"
#include "proto/attr.h"

/** More probes than a room takes. */
#define MAX_PROBES 64
/** The server sends its figures once a second; light may take a while. */
#define LISTEN_NS (GN_NS_PER_S / 2)
#define LISTEN_MAX_NS (3 * GN_NS_PER_S)
/** Light that is older is worth a look. */
#define OLD_S 10.0
/** As near as the server takes for one place, m. */
#define SAME_PLACE_M 0.01

static const struct gn_option option_table[] = {
    GN_CMD_SERVER_OPTIONS,
};

static const struct gn_program program = {
    .name = "gnomon doctor",
    .usage = "[OPTION]...",
    .summary =
        "Checks what a client needs: the server (reachable, version, clock), the probes that "
        "light its room, the cameras this machine has, what this build can read. Exits 0 "
        "only when nothing failed.",
    .notes = "Example:\n  gnomon doctor --server 127.0.0.1:7340\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

static void say(const char *mark, const char *what, const char *text)
{
    printf("%-6s %-10s %s\n", mark, what, text);
}

/** Light of one probe, as the server told it last. */
struct light {
    uint64_t session;
    int64_t capture_ns; // server's clock
    uint32_t n_lights;
    double position[3]; // m, world
};

/** What the server says of a room's probes and light. */
struct lighting {
    int n;
    struct light lights[MAX_PROBES];
    bool has_statistics;
    struct gn_msg_statistics statistics;
};

static void take_light(struct lighting *l, const struct gn_msg_lighting_state *m)
{
    int i = 0;
    while (i < l->n && l->lights[i].session != m->probe)
        i++;
    if (m->gone && i < l->n) {
        l->lights[i] = l->lights[--l->n];
    } else if (!m->gone && i < MAX_PROBES) {
        l->lights[i] = (struct light){m->probe, m->capture_time_ns, m->light_count, {0}};
        for (int k = 0; k < 3; k++)
            l->lights[i].position[k] = (double)m->probe_position_m[k];
        l->n += i == l->n;
    }
}

/** Listens until the server's figures come, and a little: a frame that rests is worked on now that
 * somebody asks for light. */
static int listen_for_light(struct gn_client *client, struct lighting *l,
                            struct gn_error *out_error)
{
    int64_t start_ns = gn_client_now_ns(), now_ns = start_ns;
    while (now_ns - start_ns < (l->has_statistics ? LISTEN_NS : LISTEN_MAX_NS) &&
           !gn_cmd_is_interrupted()) {
        struct gn_client_event event;
        int got = gn_client_poll(client, 100, &event);
        if (got < 0)
            return gn_cmd_set_fault(client, got, out_error);
        if (got > 0 && event.type == GN_WIRE_LIGHTING_STATE) {
            take_light(l, &event.message.lighting_state);
        } else if (got > 0 && event.type == GN_WIRE_STATISTICS) {
            l->statistics = event.message.statistics;
            l->has_statistics = true;
        } else if (got > 0) {
            int err = gn_cmd_take_event(&event, out_error);
            if (err)
                return err;
        }
        now_ns = gn_client_now_ns();
    }
    return 0;
}

static void print_age(double s, char *text, size_t size)
{
    if (s < 10)
        snprintf(text, size, "%.1f s", s);
    else if (s < 120)
        snprintf(text, size, "%.0f s", s);
    else if (s < 7200)
        snprintf(text, size, "%.0f min", s / 60);
    else
        snprintf(text, size, "%.0f h", s / 3600);
}

static const struct light *find_same_place(const struct lighting *l, int i)
{
    const double *a = l->lights[i].position;
    for (int k = 0; k < i; k++) {
        const double *b = l->lights[k].position;
        if (hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) < SAME_PLACE_M)
            return &l->lights[k];
    }
    return NULL;
}

/** What is missing where no probe has given light. */
static void say_no_light(const struct lighting *l)
{
    const struct gn_msg_statistics *s = &l->statistics;
    int64_t n_probes = s->has_probes ? (int64_t)s->probes - 1 : 0; // this program is one
    char text[256];
    if (!l->has_statistics)
        snprintf(text, sizeof(text), "nothing was heard of light in %d s",
                 (int)(LISTEN_MAX_NS / GN_NS_PER_S));
    else if (s->environment_frames_in > 0)
        snprintf(text, sizeof(text),
                 "no light since the room was opened: of %" PRIu64 " environment frames none gave "
                 "any; gnomon probe says why",
                 s->environment_frames_in);
    else if (n_probes > 0)
        snprintf(text, sizeof(text),
                 "no light since the room was opened: %" PRId64
                 " connected, and none has sent a frame",
                 n_probes);
    else
        snprintf(text, sizeof(text), "no light since the room was opened: %s; start gnomon probe",
                 s->has_probes ? "no probe is connected" : "no environment frame has come");
    say("none", "probes", text);
}

/** The probes that light the room: how old their light is, and what is odd about it. */
static bool check_probes(struct gn_client *client)
{
    struct lighting l = {0};
    struct gn_error error = {0};
    char text[512], age[32];
    if (listen_for_light(client, &l, &error) < 0) {
        say("FAILED", "probes", error.text);
        return false;
    }
    if (l.n == 0)
        say_no_light(&l);
    int64_t now_ns = gn_client_to_server_ns(client, gn_client_now_ns());
    for (int i = 0; i < l.n; i++) {
        const struct light *p = &l.lights[i], *twin = find_same_place(&l, i);
        double age_s = ((double)now_ns - (double)p->capture_ns) * 1e-9;
        print_age(fmax(age_s, 0), age, sizeof(age));
        int n = snprintf(
            text, sizeof(text), "session %" PRIu64 ": %u lights, %s old, at %.2f, %.2f, %.2f m",
            p->session, p->n_lights, age, p->position[0], p->position[1], p->position[2]);
        if (twin)
            snprintf(text + n, sizeof(text) - (size_t)n,
                     ", where session %" PRIu64 " is: the mean of both is taken", twin->session);
        else if (age_s > OLD_S)
            snprintf(text + n, sizeof(text) - (size_t)n, "; nothing newer has come");
        say(age_s > OLD_S ? "old" : "ok", i ? "" : "probes", text);
    }
    int64_t n_dark = l.statistics.has_probes ? (int64_t)l.statistics.probes - 1 - l.n : 0;
    if (l.n > 0 && n_dark > 0) {
        snprintf(text, sizeof(text), "%" PRId64 " more connected, without light so far", n_dark);
        say("none", "", text);
    }
    return true;
}

/** Connects, greets, measures the clock. Returns whether it worked. */
static bool check_server(const struct gn_options *options)
{
    const char *server = gn_options_get_string(options, NULL, NULL, "server");
    char text[512];
    struct gn_client *client = NULL;
    struct gn_error error = {0};
    // A probe that sends nothing: it takes no viewer's place.
    const struct gn_cmd_link link = {.program = &program,
                                     .options = options,
                                     .role = GN_MSG_ROLE_PROBE,
                                     .wants_light = true,
                                     .wants_statistics = true};
    if (gn_cmd_connect_as(&link, &client, &error) < 0) {
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
    bool is_ok = check_probes(client);
    gn_cmd_disconnect(&client);
    return is_ok;
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
