/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon screen: streams pictures onto an emitter of the scene, such as a TV.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/halves.h"
#include "client/feed.h"
#include "proto/attr.h"

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
    GN_FEED_VIDEO_OPTION,
    GN_FEED_PACE_OPTIONS("Without it files go at 10, a video keeps its own times."),
};

static const struct gn_program program = {
    .name = "gnomon screen",
    .usage = "--stream NAME --files PATTERN|--video FILE [OPTION]...",
    .summary = "Streams pictures onto an emitter of the room's scene: a TV or a video wall that "
               "lights what is near it. The last picture stays when this ends.",
    .notes = "Examples:\n"
             "  gnomon screen --stream tv --files film --loop --rate 25\n"
             "  gnomon screen --stream tv --video film.mp4 --loop\n"
             "  gnomon screen --stream tv --files black.png --count 1\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

/** One run of the command. */
struct screen {
    struct gn_feed feed;
    struct gn_msg_emitter_frame frame; // what all have in common
    double scale;
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

static int send_capture(struct gn_feed *r, const struct gn_capture *capture,
                        struct gn_error *out_error)
{
    struct screen *s = (struct screen *)r;
    bool is_linear = capture->format == GN_CAPTURE_RGB_F32;
    const uint8_t *data = capture->data;
    size_t n_bytes = capture->data_bytes;
    double scale = 1;
    int err = gn_feed_wait(r, capture, out_error);
    if (!err)
        err = check_capture(capture, out_error);
    if (err)
        return err;
    if (is_linear) {
        if (gn_halves_fill(&s->halves, (const float *)(const void *)capture->data,
                           capture->data_bytes / sizeof(float), &scale) < 0)
            return gn_error_set(out_error, -ENOMEM, "%s: out of memory", capture->name);
        data = s->halves.data;
        n_bytes = capture->data_bytes / 2;
    }
    s->frame.sequence = (uint64_t)r->n_sent + 1;
    s->frame.capture_time_ns = gn_client_to_server_ns(r->client, gn_client_now_ns());
    s->frame.width = (uint32_t)capture->width;
    s->frame.height = (uint32_t)capture->height;
    s->frame.pixel_format = is_linear                            ? GN_MSG_PIXEL_FORMAT_RGB_F16
                            : capture->format == GN_CAPTURE_JPEG ? GN_MSG_PIXEL_FORMAT_JPEG
                                                                 : GN_MSG_PIXEL_FORMAT_RGB8;
    s->frame.scale = s->scale * scale;
    err = gn_client_send_emitter(r->client, &s->frame, data, n_bytes);
    if (err)
        return gn_cmd_set_fault(r->client, err, out_error);
    r->n_sent++;
    printf("picture %llu: %s, %dx%d\n", (unsigned long long)s->frame.sequence, capture->name,
           capture->width, capture->height);
    fflush(stdout);
    return 0;
}

static int report(struct gn_feed *r, int err, const struct gn_error *error)
{
    if (err)
        gn_cmd_fail(&program, error->text);
    if (err && err != -EINTR)
        return 1; // the server need not have taken what was sent
    printf("%ld pictures sent", r->n_sent);
    gn_feed_print_shift(r);
    printf("\n");
    return err ? 1 : 0;
}

static const char *find_misuse(const struct gn_options *options)
{
    const char *name = gn_options_get_string(options, NULL, NULL, "stream");
    if (strlen(name) >= sizeof((struct gn_msg_emitter_frame){0}.stream))
        return "--stream: names have at most 63 bytes";
    if (gn_options_is_set(options, NULL, NULL, "files") ==
        gn_options_is_set(options, NULL, NULL, "video"))
        return "give --files PATTERN or --video FILE, one of them";
    return NULL;
}

static int open_source(struct gn_feed *r, const struct gn_options *options,
                       struct gn_error *out_error)
{
    struct screen *s = (struct screen *)r;
    struct gn_file_list list = {0};
    const struct gn_file_source_options source_options = {.is_looped = r->is_looped};
    s->scale = gn_options_get_double(options, NULL, NULL, "scale");
    gn_wire_set_string(s->frame.stream, sizeof(s->frame.stream),
                       gn_options_get_string(options, NULL, NULL, "stream"));
    if (gn_options_is_set(options, NULL, NULL, "video"))
        return gn_feed_open_video(r, options, false, out_error);
    int err = gn_file_list_find(gn_options_get_string(options, NULL, NULL, "files"), r->rate_hz,
                                &list, out_error);
    if (!err)
        err = gn_feed_open_files(r, &list, &source_options, out_error);
    gn_file_list_finish(&list);
    return err;
}

int gn_cmd_screen(int argc, char *const argv[])
{
    static const struct gn_feed_command command = {
        .program = &program,
        .role = GN_MSG_ROLE_SCREEN,
        .find_misuse = find_misuse,
        .open = open_source,
        .send = send_capture,
        .report = report,
    };
    struct screen s = {0};
    int status = gn_feed_run(&command, &s.feed, argc, argv);
    gn_halves_finish(&s.halves);
    return status;
}
