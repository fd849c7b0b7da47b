/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon screen: streams pictures onto an emitter of the scene, such as a TV.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/file.h"
#include "client/cmd.h"
#include "client/capture/halves.h"
#include "common/clock.h"
#include "proto/attr.h"

/** Pictures per second where --rate does not say. */
#define DEFAULT_RATE_HZ 10.0

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    {.key = "stream",
     .flag = "stream",
     .type = GN_OPTION_STRING,
     .value_name = "NAME",
     .is_required = true,
     .help = "Which screen: the \"emission_stream\" of a material in the room's scene.json."},
    {.key = "files",
     .flag = "files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .is_required = true,
     .help = "What it shows: a picture, a folder's pictures, or a pattern in quotes such as "
             "'film/*.jpg', in the order of their names. PNG of 8 bits and JPEG are sRGB, EXR and "
             "Radiance linear; up to 2048 pixels a side."},
    {.key = "scale",
     .flag = "scale",
     .type = GN_OPTION_DOUBLE,
     .min = 1e-12,
     .max = 1e12,
     .default_value = "1",
     .value_name = "X",
     .help = "How bright: factor on the linear picture and the scene's emission_scale."},
    GN_CMD_PACE_OPTIONS("Without it they go at 10."),
};

static const struct gn_program program = {
    .name = "gnomon screen",
    .usage = "--stream NAME --files PATTERN [OPTION]...",
    .summary = "Streams pictures onto an emitter of the room's scene: a TV or a video wall that "
               "lights what is near it. The last picture stays when this ends.",
    .notes = "Examples:\n"
             "  gnomon screen --stream tv --files film --loop --rate 25\n"
             "  gnomon screen --stream tv --files black.png --count 1\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

/** One run of the command. */
struct screen {
    struct gn_client *client;
    struct gn_source *source;
    struct gn_msg_emitter_frame frame; // what all have in common
    double scale;
    int64_t clock_ns; // when the clock was measured
    long n_sent;
    struct gn_halves halves;
};

static int check_capture(const struct gn_capture *capture, struct gn_error *out_error)
{
    if (capture->width > GN_LIMIT_EMITTER_SIDE_PX || capture->height > GN_LIMIT_EMITTER_SIDE_PX)
        return gn_error_set(out_error, -EINVAL,
                            "%s is %dx%d, a screen's picture has at most %d a "
                            "side: make it smaller",
                            capture->name, capture->width, capture->height,
                            GN_LIMIT_EMITTER_SIDE_PX);
    if (capture->format != GN_CAPTURE_RGB8 && capture->format != GN_CAPTURE_JPEG &&
        capture->format != GN_CAPTURE_RGB_F32)
        return gn_error_set(out_error, -EINVAL,
                            "%s has 16 bits: PNG of 8 bits, JPEG, EXR and "
                            "Radiance are right",
                            capture->name);
    return 0;
}

static int send_capture(struct screen *s, const struct gn_capture *capture,
                        struct gn_error *out_error)
{
    bool is_linear = capture->format == GN_CAPTURE_RGB_F32;
    const uint8_t *data = capture->data;
    size_t n_bytes = capture->data_bytes;
    double scale = 1;
    int err = check_capture(capture, out_error);
    if (err)
        return err;
    if (is_linear) {
        if (gn_halves_fill(&s->halves, (const float *)(const void *)capture->data,
                           capture->data_bytes / sizeof(float), &scale) < 0)
            return gn_error_set(out_error, -ENOMEM, "%s: out of memory", capture->name);
        data = s->halves.data;
        n_bytes = capture->data_bytes / 2;
    }
    s->frame.sequence = (uint64_t)s->n_sent + 1;
    s->frame.capture_time_ns = gn_client_to_server_ns(s->client, gn_client_now_ns());
    s->frame.width = (uint32_t)capture->width;
    s->frame.height = (uint32_t)capture->height;
    s->frame.pixel_format = is_linear                            ? GN_MSG_PIXEL_FORMAT_RGB_F16
                            : capture->format == GN_CAPTURE_JPEG ? GN_MSG_PIXEL_FORMAT_JPEG
                                                                 : GN_MSG_PIXEL_FORMAT_RGB8;
    s->frame.scale = s->scale * scale;
    err = gn_client_send_emitter(s->client, &s->frame, data, n_bytes);
    if (err)
        return gn_cmd_set_fault(s->client, err, out_error);
    s->n_sent++;
    printf("picture %llu: %s, %dx%d\n", (unsigned long long)s->frame.sequence, capture->name,
           capture->width, capture->height);
    fflush(stdout);
    return 0;
}

static int stream(struct screen *s, struct gn_cmd_pace *pace, struct gn_error *out_error)
{
    while (!pace->n_wanted || s->n_sent < pace->n_wanted) {
        struct gn_capture capture;
        int got = gn_source_read(s->source, &capture, out_error);
        if (got < 0)
            return got;
        if (got == 0)
            break;
        int err =
            gn_cmd_serve_until(s->client, &s->clock_ns,
                               gn_cmd_pace_get_due_ns(pace, s->n_sent, capture.time_s), out_error);
        if (!err)
            err = send_capture(s, &capture, out_error);
        if (err)
            return err;
    }
    // An ERROR about the last picture is on its way, if there is one.
    return gn_cmd_serve_until(s->client, &s->clock_ns,
                              gn_clock_get_monotonic_ns() + GN_CMD_LAST_WORDS_NS, out_error);
}

/** Runs with everything open; the exit status. */
static int run(struct screen *s, struct gn_cmd_pace *pace)
{
    struct gn_error error = {0};
    int err = stream(s, pace, &error);
    bool is_ended = !err || (err == -EINTR && pace->is_looped);
    if (err == -EINTR && !is_ended)
        gn_error_set(&error, err, "interrupted");
    if (!is_ended)
        gn_cmd_fail(&program, error.text);
    if (!is_ended && err != -EINTR)
        return 1; // the server need not have taken what was sent
    printf("%ld pictures sent", s->n_sent);
    gn_cmd_pace_print(pace);
    printf("\n");
    return is_ended ? 0 : 1;
}

static int open_source(const struct gn_options *options, const struct gn_cmd_pace *pace,
                       struct gn_source **out, struct gn_error *out_error)
{
    struct gn_file_list list = {0};
    const struct gn_file_source_options source_options = {.is_looped = pace->is_looped};
    int err = gn_file_list_find(gn_options_get_string(options, NULL, NULL, "files"), pace->rate_hz,
                                &list, out_error);
    if (!err && gn_file_source_open(&list, &source_options, out) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    gn_file_list_finish(&list);
    return err;
}

int gn_cmd_screen(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    int go = gn_cmd_load(&program, argc, argv, &options);
    if (go <= 0)
        return go ? 2 : 0;
    gn_cmd_catch_signals();
    struct gn_error error = {0};
    struct screen s = {.scale = gn_options_get_double(options, NULL, NULL, "scale")};
    struct gn_cmd_pace pace;
    const char *name = gn_options_get_string(options, NULL, NULL, "stream");
    int status = 1;
    gn_cmd_pace_init(&pace, &program, options, DEFAULT_RATE_HZ);
    if (strlen(name) >= sizeof(s.frame.stream)) {
        gn_cmd_fail(&program, "--stream: names have at most 63 bytes");
        status = 2;
    } else if (open_source(options, &pace, &s.source, &error) < 0 ||
               gn_cmd_connect(&program, options, GN_MSG_ROLE_SCREEN, &s.client, &error) < 0) {
        gn_cmd_fail(&program, error.text);
    } else {
        gn_wire_set_string(s.frame.stream, sizeof(s.frame.stream), name);
        s.clock_ns = gn_clock_get_monotonic_ns();
        status = run(&s, &pace);
    }
    gn_halves_finish(&s.halves);
    gn_cmd_disconnect(&s.client);
    gn_source_close(&s.source);
    gn_options_destroy(&options);
    return status;
}
