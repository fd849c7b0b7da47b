/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon probe: streams environment frames from files and cameras.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/halves.h"
#include "client/capture/sequence.h"
#include "client/feed.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    GN_FEED_OPTIONS,
    GN_LIVE_OPTIONS,
    GN_LIVE_EXPOSURE_OPTION,
    {.key = "setup",
     .flag = "setup",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help =
         "What the files show and how: projection, response, orientation, position, as JSON "
         "(docs/frames.md, \"Probe setup\"). Without it: a lat-long map of linear radiance, EXR or "
         "Radiance. A sequence brings its own."},
    {.key = "projection",
     .flag = "projection",
     .type = GN_OPTION_ENUM,
     .choices = GN_PROJECTION_NAMES,
     .value_name = "NAME",
     .help = "Instead of --setup, where everything else is at its default."},
    {.key = "first-sequence",
     .flag = "first-sequence",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 2e9,
     .default_value = "1",
     .value_name = "N",
     .help = "Number of the first environment frame; they count up. A viewer's --sync-light names "
             "them."},
};

static const struct gn_program program = {
    .name = "gnomon probe",
    .usage = "--sequence DIR | --files PATTERN | --video FILE | --gige ID | --v4l2 DEVICE "
             "[OPTION]...",
    .summary =
        "Streams environment frames to a room: what a camera behind a fisheye or in front of "
        "a mirror ball sees of the light. The server makes the room's lighting state of the "
        "newest.",
    .notes = "Examples:\n"
             "  gnomon probe --files studio.exr --loop --rate 1\n"
             "  gnomon probe --files 'fisheye/*.png' --setup fisheye.json --rate 15\n"
             "  gnomon probe --gige any --setup fisheye.json --exposure-us 8000\n",
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
        [GN_PROJECTION_CUBE] = GN_MSG_PROJECTION_TYPE_CUBE,
        [GN_PROJECTION_OCTAHEDRAL] = GN_MSG_PROJECTION_TYPE_OCTAHEDRAL,
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
        .vignetting_a = p->vignetting[0],
        .vignetting_b = p->vignetting[1],
        .vignetting_c = p->vignetting[2],
    };
}

static void make_frame(const struct gn_probe_setup *setup, struct gn_msg_environment_frame *out)
{
    memset(out, 0, sizeof(*out));
    out->has_projection = true;
    make_projection(&setup->projection, &out->projection);
    out->has_response = true;
    gn_cmd_make_response(&setup->response, &out->response);
    if (setup->response.type == GN_RESPONSE_TABLE)
        out->response.table_entries = (uint32_t)setup->response.table_size;
    memcpy(out->matrix_to_rec709, setup->response.to_rec709, sizeof(setup->response.to_rec709));
    out->scale = setup->response.scale;
    out->has_world_from_probe = true;
    gn_cmd_make_transform(&setup->world_from_probe, &out->world_from_probe);
}

/** What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_options *options)
{
    bool has_dir = gn_options_is_set(options, NULL, NULL, "sequence");
    bool has_setup = gn_options_is_set(options, NULL, NULL, "setup");
    bool has_projection = gn_options_is_set(options, NULL, NULL, "projection");
    bool has_files = gn_options_is_set(options, NULL, NULL, "files");
    bool has_video = gn_options_is_set(options, NULL, NULL, "video");
    const char *misuse = gn_feed_find_misuse(options);
    if (misuse)
        return misuse;
    if (has_dir + has_files + has_video + gn_live_count_asked(options) != 1)
        return "give --sequence DIR, --files PATTERN, --video FILE or a camera (--gige ID, --v4l2 "
               "DEVICE), one of them";
    if (has_dir + has_setup + has_projection > 1)
        return "the setup comes from --sequence, --setup or --projection, one of them";
    return NULL;
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
        return GN_MSG_PIXEL_FORMAT_RGB8;
    }
    return GN_MSG_PIXEL_FORMAT_UNSPECIFIED;
}

/** Refuses what can be seen to be wrong before it is sent. */
static int check_capture(const struct gn_probe_setup *setup, const struct gn_capture *capture,
                         struct gn_error *out_error)
{
    struct gn_projection p = setup->projection;
    const char *reason = NULL;
    if (capture->format != GN_CAPTURE_RGB_F32 && !setup->has_response)
        return gn_error_set(out_error, -EINVAL,
                            "%s holds codes, not light: --setup must give their \"response\"",
                            capture->name);
    if ((p.width && p.width != capture->width) || (p.height && p.height != capture->height))
        return gn_error_set(out_error, -EINVAL, "%s is %dx%d, but the setup says %dx%d",
                            capture->name, capture->width, capture->height, p.width, p.height);
    p.width = capture->width;
    p.height = capture->height;
    if (gn_projection_init(&p, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "%s (%dx%d): the projection does not fit: %s",
                            capture->name, p.width, p.height, reason);
    return 0;
}

/** Memory that grows to the largest picture. */
struct buffer {
    uint8_t *data; // owned
    size_t n_bytes;
};

static bool reserve(struct buffer *buffer, size_t n_bytes)
{
    if (n_bytes <= buffer->n_bytes)
        return true;
    uint8_t *data = realloc(buffer->data, n_bytes);
    if (!data)
        return false;
    *buffer = (struct buffer){data, n_bytes};
    return true;
}

/** One run of the command. */
struct probe {
    struct gn_feed feed;
    struct gn_probe_setup setup;
    struct gn_msg_environment_frame frame; // what all have in common
    uint64_t first_sequence;
    struct gn_halves halves;
    bool has_told_halves, has_told_light;
    struct buffer masked;  // a picture, its masks filled
    struct buffer payload; // the response's table and a picture
};

/** Pixels of one picture as they are sent. */
struct pixels {
    enum gn_msg_pixel_format format;
    double scale; // of the values
    const uint8_t *data;
    size_t n_bytes;
};

/**
 * Halves where they say the same, or where floats would not fit into a message; else as they are.
 */
static int get_pixels(struct probe *p, const struct gn_capture *capture, struct pixels *out,
                      struct gn_error *out_error)
{
    *out =
        (struct pixels){get_pixel_format(capture->format), 1, capture->data, capture->data_bytes};
    if (capture->format != GN_CAPTURE_RGB_F32)
        return 0;
    size_t n = capture->data_bytes / sizeof(float);
    const float *values = (const float *)(const void *)capture->data;
    bool is_exact = gn_halves_are_exact(values, n);
    if (!is_exact && capture->data_bytes <= GN_LIMIT_ENVIRONMENT_BYTES)
        return 0;
    double scale;
    if (gn_halves_fill(&p->halves, values, n, &scale) < 0)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", capture->name);
    if (!is_exact && !p->has_told_halves) {
        p->has_told_halves = true;
        printf("%s: too large for floats, sent as half floats times %g: exact to 0.05 %%, below "
               "%.3g to %.3g\n",
               capture->name, scale, scale * 0x1p-14, scale * 0x1p-25);
    }
    *out = (struct pixels){GN_MSG_PIXEL_FORMAT_RGB_F16, scale, p->halves.data, 2 * n};
    return 0;
}

/** Copies the picture and fills the setup's masks. *capture then shows the copy. */
static int fill_masks(struct probe *p, struct gn_capture *capture, struct gn_error *out_error)
{
    const struct gn_probe_setup *setup = &p->setup;
    bool is_mono = capture->format == GN_CAPTURE_MONO12 || capture->format == GN_CAPTURE_MONO16;
    if (setup->n_masks == 0)
        return 0;
    if (capture->format == GN_CAPTURE_JPEG)
        return gn_error_set(out_error, -EINVAL,
                            "%s: a mask needs pixels, and this is a JPEG; let the camera send "
                            "uncompressed pictures, or leave out \"mask\"",
                            capture->name);
    if (!reserve(&p->masked, capture->data_bytes))
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", capture->name);
    memcpy(p->masked.data, capture->data, capture->data_bytes);
    capture->data = p->masked.data;
    gn_probe_mask_fill(setup->masks, setup->n_masks, p->masked.data, capture->width,
                       capture->height, is_mono ? 1 : 3,
                       capture->format == GN_CAPTURE_RGB_F32 ? GN_PROBE_MASK_F32
                       : capture->format == GN_CAPTURE_RGB8  ? GN_PROBE_MASK_U8
                                                             : GN_PROBE_MASK_U16);
    return 0;
}

/** Puts the response's table, if it has one, before the pixels, as the wire wants it. */
static int add_table(struct probe *p, struct pixels *pixels, struct gn_error *out_error)
{
    const struct gn_response *r = &p->setup.response;
    size_t n = r->type == GN_RESPONSE_TABLE ? sizeof(float) * (size_t)r->table_size : 0;
    if (n == 0)
        return 0;
    if (!reserve(&p->payload, n + pixels->n_bytes))
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    memcpy(p->payload.data, r->table, n);
    memcpy(p->payload.data + n, pixels->data, pixels->n_bytes);
    pixels->data = p->payload.data;
    pixels->n_bytes += n;
    return 0;
}

/** Opens what --sequence, --files, --video or a camera's option names, with its setup. */
static int open_source(struct gn_feed *r, const struct gn_options *options,
                       struct gn_error *out_error)
{
    struct probe *p = (struct probe *)r;
    struct gn_probe_setup *setup = &p->setup;
    const char *dir = gn_options_get_string(options, NULL, NULL, "sequence");
    const char *pattern = gn_options_get_string(options, NULL, NULL, "files");
    const char *setup_path = gn_options_get_string(options, NULL, NULL, "setup");
    const char *projection = gn_options_get_string(options, NULL, NULL, "projection");
    struct gn_sequence sequence = {0};
    struct gn_file_list list = {0};
    bool is_live = gn_live_count_asked(options) > 0;
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
        if (!err && pattern)
            err = gn_file_list_find(pattern, r->rate_hz, &list, out_error);
    }
    gn_sequence_finish(&sequence);
    make_frame(setup, &p->frame);
    p->first_sequence = (uint64_t)gn_options_get_int(options, NULL, NULL, "first-sequence");
    const struct gn_file_source_options source_options = {
        .is_looped = r->is_looped, .is_12_bit = setup->is_12_bit, .is_8_bit_16 = true};
    const struct gn_live_options wanted = {.width = setup->projection.width,
                                           .height = setup->projection.height};
    if (!err && is_live)
        err = gn_live_open(options, &wanted, &r->source, out_error);
    else if (!err && gn_options_is_set(options, NULL, NULL, "video"))
        err = gn_feed_open_video(r, options, true, out_error);
    else if (!err)
        err = gn_feed_open_files(r, &list, &source_options, out_error);
    gn_file_list_finish(&list);
    return err;
}

/** Says once that floats, light as it seems, are taken for codes, which end at 1. */
static void tell_light(struct probe *p, const struct gn_capture *capture)
{
    if (p->has_told_light || capture->format != GN_CAPTURE_RGB_F32 ||
        p->setup.response.type == GN_RESPONSE_LINEAR)
        return;
    const float *values = (const float *)(const void *)capture->data;
    float largest = 0;
    for (size_t i = 0; i < capture->data_bytes / sizeof(float); i++)
        largest = values[i] > largest ? values[i] : largest;
    if (largest <= 1)
        return;
    p->has_told_light = true;
    fprintf(stderr,
            "%s: %s has values up to %.4g, and codes end at 1: if it is light, the setup must "
            "not give a \"response\" other than linear\n",
            program.name, capture->name, (double)largest);
}

static int send_capture(struct gn_feed *r, const struct gn_capture *capture,
                        struct gn_error *out_error)
{
    struct probe *p = (struct probe *)r;
    struct pixels pixels;
    struct gn_capture shown = *capture;
    int err = check_capture(&p->setup, capture, out_error);
    if (!err)
        tell_light(p, capture);
    if (!err)
        err = gn_feed_wait(r, capture, out_error);
    if (!err)
        err = fill_masks(p, &shown, out_error);
    if (!err)
        err = get_pixels(p, &shown, &pixels, out_error);
    if (!err)
        err = add_table(p, &pixels, out_error);
    if (err)
        return err;
    double setup_scale = p->setup.response.scale == 0 ? 1 : p->setup.response.scale;
    p->frame.scale = setup_scale * pixels.scale;
    p->frame.sequence = p->first_sequence + (uint64_t)r->n_sent;
    p->frame.capture_time_ns = gn_feed_get_capture_ns(r, capture);
    p->frame.width = (uint32_t)capture->width;
    p->frame.height = (uint32_t)capture->height;
    p->frame.pixel_format = pixels.format;
    err = gn_client_send_environment(r->client, &p->frame, pixels.data, pixels.n_bytes);
    if (err)
        return gn_cmd_set_fault(r->client, err, out_error);
    r->n_sent++;
    printf("environment frame %llu: %s, %dx%d\n", (unsigned long long)p->frame.sequence,
           capture->name, capture->width, capture->height);
    fflush(stdout);
    return 0;
}

static int report(struct gn_feed *r, int err, const struct gn_error *error)
{
    if (err)
        gn_cmd_fail(&program, error->text);
    printf("%ld environment frames sent", r->n_sent);
    gn_feed_print_shift(r);
    printf("\n");
    return err ? 1 : 0;
}

int gn_cmd_probe(int argc, char *const argv[])
{
    static const struct gn_feed_command command = {
        .program = &program,
        .role = GN_MSG_ROLE_PROBE,
        .takes_sequences = true,
        .find_misuse = find_misuse,
        .open = open_source,
        .send = send_capture,
        .report = report,
    };
    struct probe p = {0};
    int status = gn_feed_run(&command, &p.feed, argc, argv);
    gn_halves_finish(&p.halves);
    free(p.masked.data);
    free(p.payload.data);
    return status;
}
