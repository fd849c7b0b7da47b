/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon probe: streams environment frames from files.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "client/capture/file.h"
#include "client/capture/sequence.h"
#include "client/cmd.h"
#include "common/clock.h"
#include "proto/attr.h"

/** Pictures per second where neither the files nor --rate say. */
#define DEFAULT_RATE_HZ 10.0

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    GN_CMD_REPLAY_OPTIONS,
    {.key = "setup",
     .flag = "setup",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "What the files show and how: projection, response, orientation, position, as JSON "
             "(docs/frames.md, \"Probe setup\"). Without it: a lat-long map of linear radiance. A "
             "sequence brings its own."},
    {.key = "projection",
     .flag = "projection",
     .type = GN_OPTION_ENUM,
     .choices = "latlong|angular|mirrorball|fisheye-equidistant|fisheye-equisolid|"
                "fisheye-orthographic|fisheye-stereographic",
     .help = "Instead of --setup, where everything else is at its default."},
    {.key = "first-sequence",
     .flag = "first-sequence",
     .type = GN_OPTION_DOUBLE,
     .min = 1,
     .max = 9e15,
     .default_value = "1",
     .value_name = "N",
     .help = "Number of the first environment frame; they count up. A viewer's --sync-light names "
             "them."},
};

static const struct gn_program program = {
    .name = "gnomon probe",
    .usage = "--sequence DIR | --files PATTERN [OPTION]...",
    .summary =
        "Streams environment frames to a room: what a camera behind a fisheye or in front of "
        "a mirror ball sees of the light. The server makes the room's lighting state of the "
        "newest.",
    .notes = "Examples:\n"
             "  gnomon probe --files studio.exr --loop --rate 1\n"
             "  gnomon probe --files 'fisheye/*.png' --setup fisheye.json --rate 15\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

static void make_projection(const struct gn_projection *p, struct gn_msg_projection *out)
{
    static const enum gn_msg_projection_type types[GN_PROJECTION_COUNT] = {
        [GN_PROJECTION_LATLONG] = GN_MSG_PROJECTION_TYPE_LATLONG,
        [GN_PROJECTION_ANGULAR] = GN_MSG_PROJECTION_TYPE_ANGULAR,
        [GN_PROJECTION_MIRRORBALL] = GN_MSG_PROJECTION_TYPE_MIRROR_BALL,
        [GN_PROJECTION_FISHEYE_EQUIDISTANT] = GN_MSG_PROJECTION_TYPE_EQUIDISTANT,
        [GN_PROJECTION_FISHEYE_EQUISOLID] = GN_MSG_PROJECTION_TYPE_EQUISOLID,
        [GN_PROJECTION_FISHEYE_ORTHOGRAPHIC] = GN_MSG_PROJECTION_TYPE_ORTHOGRAPHIC,
        [GN_PROJECTION_FISHEYE_STEREOGRAPHIC] = GN_MSG_PROJECTION_TYPE_STEREOGRAPHIC,
        [GN_PROJECTION_FISHEYE_KANNALA_BRANDT] = GN_MSG_PROJECTION_TYPE_KANNALA_BRANDT,
    };
    *out = (struct gn_msg_projection){
        .type = types[p->type],
        .center_x_px = p->center[0],
        .center_y_px = p->center[1],
        .radius_px = p->radius,
        .theta_max = p->theta_max,
        .k1 = p->k[0],
        .k2 = p->k[1],
        .k3 = p->k[2],
        .k4 = p->k[3],
    };
}

static void make_frame(const struct gn_probe_setup *setup, struct gn_msg_environment_frame *out)
{
    memset(out, 0, sizeof(*out));
    out->has_projection = true;
    make_projection(&setup->projection, &out->projection);
    out->has_response = true;
    gn_cmd_make_response(&setup->response, &out->response);
    memcpy(out->matrix_to_rec709, setup->response.to_rec709, sizeof(setup->response.to_rec709));
    out->scale = setup->response.scale;
    out->has_world_from_probe = true;
    gn_cmd_make_transform(&setup->world_from_probe, &out->world_from_probe);
}

/** Opens what --sequence or --files names, with its setup. */
static int open_source(const struct gn_options *options, const struct gn_cmd_pace *pace,
                       struct gn_probe_setup *setup, struct gn_source **out,
                       struct gn_error *out_error)
{
    const char *dir = gn_options_get_string(options, NULL, NULL, "sequence");
    const char *pattern = gn_options_get_string(options, NULL, NULL, "files");
    const char *setup_path = gn_options_get_string(options, NULL, NULL, "setup");
    const char *projection = gn_options_get_string(options, NULL, NULL, "projection");
    if (!dir == !pattern)
        return gn_error_set(out_error, -EINVAL,
                            "give --sequence DIR or --files PATTERN, one of them");
    if ((dir && (setup_path || projection)) || (setup_path && projection))
        return gn_error_set(
            out_error, -EINVAL,
            "the setup comes from --sequence, --setup or --projection, one of them");
    struct gn_sequence sequence = {0};
    struct gn_file_list list = {0};
    int err = 0;
    gn_probe_setup_init(setup);
    if (dir) {
        err = gn_sequence_read(dir, &sequence, out_error);
        *setup = sequence.probe;
        list = sequence.environments;
        memset(&sequence.environments, 0, sizeof(sequence.environments));
    } else {
        if (setup_path)
            err = gn_probe_setup_read_file(setup_path, setup, out_error);
        else if (projection)
            err = gn_projection_from_name(projection, &setup->projection.type);
        if (!err)
            err = gn_file_list_find(pattern, pace->rate_hz, &list, out_error);
    }
    struct gn_file_source_options source_options = {
        .is_looped = pace->is_looped, .is_12_bit = setup->is_12_bit, .is_8_bit_16 = true};
    if (!err)
        err = gn_file_source_open(&list, &source_options, out);
    gn_sequence_finish(&sequence);
    gn_file_list_finish(&list);
    return err;
}

static enum gn_msg_pixel_format get_pixel_format(enum gn_capture_format format)
{
    switch (format) {
    case GN_CAPTURE_RGB_F32:
        return GN_MSG_PIXEL_FORMAT_RGB_F32;
    case GN_CAPTURE_MONO12:
        return GN_MSG_PIXEL_FORMAT_MONO12;
    case GN_CAPTURE_RGB12:
        return GN_MSG_PIXEL_FORMAT_RGB12;
    case GN_CAPTURE_MONO16:
        return GN_MSG_PIXEL_FORMAT_MONO16;
    case GN_CAPTURE_RGB16:
        return GN_MSG_PIXEL_FORMAT_RGB16;
    case GN_CAPTURE_JPEG:
        return GN_MSG_PIXEL_FORMAT_JPEG;
    case GN_CAPTURE_RGB8:
        break;
    }
    return GN_MSG_PIXEL_FORMAT_UNSPECIFIED;
}

/** Serves the connection until the time has come. 0, -EINTR (Ctrl-C), or the connection's error. */
static int wait_until(struct gn_client *client, int64_t due_ns)
{
    for (;;) {
        if (gn_cmd_is_interrupted())
            return -EINTR;
        int64_t left_ns = due_ns - gn_clock_get_monotonic_ns();
        int timeout_ms = left_ns <= 0          ? 0
                         : left_ns > 200000000 ? 200
                                               : (int)(left_ns / 1000000) + 1;
        struct gn_client_event event;
        int got = gn_client_poll(client, timeout_ms, &event);
        if (got == -EINTR)
            continue;
        if (got < 0)
            return got;
        if (got > 0 && event.type == GN_WIRE_ERROR) {
            fprintf(stderr, "gnomon probe: the server: %s\n", event.message.error.sentence);
            if (event.message.error.fatal)
                return -ECONNRESET;
        }
        if (got == 0 && left_ns <= 0)
            return 0;
    }
}

static int send_all(struct gn_client *client, struct gn_source *source,
                    const struct gn_cmd_pace *pace, struct gn_msg_environment_frame *frame)
{
    uint64_t first = frame->sequence;
    long n = 0;
    for (; !pace->n_wanted || n < pace->n_wanted; n++) {
        struct gn_capture capture;
        struct gn_error error = {0};
        int got = gn_source_read(source, &capture, &error);
        if (got < 0)
            return gn_cmd_fail(&program, error.text);
        if (got == 0)
            break;
        int err = wait_until(client, gn_cmd_pace_get_due_ns(pace, n, capture.time_s));
        if (err == -EINTR)
            break;
        frame->sequence = first + (uint64_t)n;
        frame->capture_time_ns = gn_client_to_server_ns(client, gn_client_now_ns());
        frame->width = (uint32_t)capture.width;
        frame->height = (uint32_t)capture.height;
        frame->pixel_format = get_pixel_format(capture.format);
        if (!err)
            err = gn_client_send_environment(client, frame, capture.data, capture.data_bytes);
        if (err)
            return gn_cmd_fail(&program, gn_client_get_fault(client));
        printf("environment frame %llu: %s, %dx%d\n", (unsigned long long)frame->sequence,
               capture.name, capture.width, capture.height);
        fflush(stdout);
    }
    // An ERROR about the last frame is on its way, if there is one.
    int err = wait_until(client, gn_clock_get_monotonic_ns() + 200000000);
    if (err && err != -EINTR)
        return gn_cmd_fail(&program, gn_client_get_fault(client));
    printf("%ld environment frames sent\n", n);
    return 0;
}

int gn_cmd_probe(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    int run = gn_cmd_load(&program, argc, argv, &options);
    if (run <= 0)
        return run ? 2 : 0;
    gn_cmd_catch_signals();
    struct gn_error error = {0};
    struct gn_source *source = NULL;
    struct gn_client *client = NULL;
    struct gn_probe_setup setup;
    struct gn_cmd_pace pace;
    bool has_times = gn_options_is_set(options, NULL, NULL, "sequence");
    gn_cmd_pace_init(&pace, options, has_times ? 0 : DEFAULT_RATE_HZ);
    int status = 1;
    if (open_source(options, &pace, &setup, &source, &error)) {
        gn_cmd_fail(&program, error.text);
    } else if (gn_cmd_connect(&program, options, GN_MSG_ROLE_PROBE, &client) == 0) {
        struct gn_msg_environment_frame frame;
        make_frame(&setup, &frame);
        frame.sequence = (uint64_t)gn_options_get_double(options, NULL, NULL, "first-sequence");
        status = send_all(client, source, &pace, &frame);
        gn_cmd_disconnect(&client);
    }
    gn_source_close(&source);
    gn_options_destroy(&options);
    return status;
}
