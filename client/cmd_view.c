/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon view: streams camera frames and poses from files and cameras, writes what comes back.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/sequence.h"
#include "client/feed.h"
#include "client/view/record.h"
#include "common/clock.h"
#include "common/text.h"
#include "proto/attr.h"

/** How long a frame's answer is waited for; of reference quality, which takes minutes. */
#define ANSWER_NS (60 * GN_NS_PER_S)
#define REFERENCE_ANSWER_NS (3600 * GN_NS_PER_S)
/** How long a frame may wait for light, ms. */
#define LIGHT_WAIT_MS 5000
/** Most frames on their way at once. */
#define MAX_OUTSTANDING 16

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    GN_FEED_OPTIONS,
    GN_LIVE_OPTIONS,
    {.key = "camera",
     .flag = "camera",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help =
         "With --files or a camera: camera.json with intrinsics and the pose of a camera at rest "
         "(docs/frames.md). A sequence brings its own."},
    {.key = "out",
     .flag = "out",
     .type = GN_OPTION_STRING,
     .value_name = "DIR",
     .is_required = true,
     .help = "Where the composited frames and view.json (every receipt) go; each round of --loop "
             "replaces the pictures of the one before."},
    {.key = "result",
     .flag = "result",
     .type = GN_OPTION_ENUM,
     .choices = "png|jpeg",
     .default_value = "png",
     .help = "What is asked of the server and written: png (lossless) or jpeg."},
    {.key = "jpeg-quality",
     .flag = "jpeg-quality",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 100,
     .default_value = "90",
     .help = "For --result jpeg."},
    {.key = "budget-ms",
     .flag = "budget-ms",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = GN_LIMIT_BUDGET_MS,
     .default_value = "0",
     .help = "Time for each frame in the server, for which it chooses lights, rays and shadow; 0: "
             "the room's own budget, if any. For --quality interactive."},
    {.key = "quality",
     .flag = "quality",
     .type = GN_OPTION_ENUM,
     .choices = "interactive|seed|reference",
     .default_value = "interactive",
     .help = "How the server renders: interactive; seed, the 2007 paper to the letter; reference, "
             "every texel with exact visibility, slow."},
    {.key = "outstanding",
     .flag = "outstanding",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = MAX_OUTSTANDING,
     .default_value = "1",
     .help = "Frames that may be on their way at once. With 1 a frame waits for the result of the "
             "one before; with more, frames that the server has not begun are replaced by newer "
             "ones and come back as dropped."},
    {.key = "match",
     .flag = "match",
     .type = GN_OPTION_SET,
     .choices = GN_MATCH_NAMES,
     .default_value = "all",
     .help = "What of the camera the server is told, so that virtual pixels are given the same "
             "(docs/frames.md)."},
    {.key = "sync-light",
     .flag = "sync-light",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 2e9,
     .value_name = "N",
     .help = "Have picture k wait for the light of environment frame N + k, k from 0, for at most "
             "5 s: replays are then lit as they were recorded. See probe --first-sequence."},
};

static const struct gn_program program = {
    .name = "gnomon view",
    .usage =
        "--sequence DIR | {--files PATTERN | --gige ID | --v4l2 DEVICE} --camera FILE, --out DIR "
        "[OPTION]...",
    .summary = "Streams camera frames and poses to a room and writes the composited frames that "
               "come back, with their receipts. Every frame comes back exactly once, as a result "
               "or as dropped with the reason. At the start it waits up to 5 s for light.",
    .notes = "Examples:\n"
             "  gnomon view --sequence .cache/rig/lamps --out composites\n"
             "  gnomon view --files 'shots/*.jpg' --camera camera.json --out composites\n"
             "  gnomon view --gige any --camera camera.json --out composites\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

/** A frame that has been sent and not answered. id 0: free. */
struct pending {
    uint64_t id;
    int64_t sent_ns;
    char name[GN_FILE_NAME_BYTES];
};

/** One run of the command. */
struct view {
    struct gn_feed feed;
    const char *dir; // borrowed from the options
    struct gn_record *record;
    struct gn_camera camera;
    struct gn_msg_frame frame; // what all frames have in common
    uint64_t sync_light;       // 0: not asked for
    int64_t first_sent_ns;
    int max_outstanding;
    int n_outstanding;
    struct pending pending[MAX_OUTSTANDING];
    long n_results, n_dropped;
    double latency_sum_ms, latency_max_ms;
    char last_drop[256]; // why a frame was dropped
};

/** What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_options *options)
{
    bool has_dir = gn_options_is_set(options, NULL, NULL, "sequence");
    bool has_files = gn_options_is_set(options, NULL, NULL, "files");
    bool has_camera = gn_options_is_set(options, NULL, NULL, "camera");
    const char *misuse = gn_feed_find_misuse(options);
    if (misuse)
        return misuse;
    if (has_dir + has_files + gn_live_count_asked(options) != 1 || has_dir == has_camera)
        return "give --sequence DIR, or --files PATTERN or a camera (--gige ID, --v4l2 DEVICE) "
               "with --camera FILE";
    if (gn_options_get_double(options, NULL, NULL, "budget-ms") > 0 &&
        gn_options_get_enum(options, NULL, NULL, "quality") != 0)
        return "--budget-ms is for --quality interactive: the others' settings are not chosen";
    return NULL;
}

static int send_camera(struct view *v)
{
    const struct gn_camera *c = &v->camera;
    struct gn_msg_camera message = {
        .width = (uint32_t)c->width,
        .height = (uint32_t)c->height,
        .fx = c->fx,
        .fy = c->fy,
        .cx = c->cx,
        .cy = c->cy,
        .k1 = c->distortion[0],
        .k2 = c->distortion[1],
        .p1 = c->distortion[2],
        .p2 = c->distortion[3],
        .k3 = c->distortion[4],
        .has_response = true,
        .scale = c->response.scale,
        .blur_px = c->match.blur_px,
    };
    memcpy(message.noise_slope, c->match.noise_slope, sizeof(message.noise_slope));
    memcpy(message.noise_offset, c->match.noise_offset, sizeof(message.noise_offset));
    gn_cmd_make_response(&c->response, &message.response);
    memcpy(message.matrix_to_rec709, c->response.to_rec709, sizeof(c->response.to_rec709));
    return gn_client_send_camera(v->feed.client, &message);
}

static struct pending *find_pending(struct view *v, uint64_t id)
{
    for (int i = 0; i < MAX_OUTSTANDING; i++) {
        if (v->pending[i].id == id)
            return &v->pending[i];
    }
    return NULL;
}

/** Takes what the server says about one frame. */
static int take_answer(struct view *v, const struct gn_client_event *event,
                       struct gn_error *out_error)
{
    bool is_result = event->type == GN_WIRE_RESULT;
    uint64_t id = is_result ? event->message.result.id : event->message.dropped.id;
    struct pending *p = id ? find_pending(v, id) : NULL;
    if (!p)
        return gn_error_set(out_error, -EPROTO, "frame %llu came back though it was not out",
                            (unsigned long long)id);
    int err;
    if (is_result) {
        double latency_ms = (double)(event->received_ns - p->sent_ns) * 1e-6;
        const struct gn_msg_receipt *r = &event->message.result.receipt;
        err = gn_record_add_result(v->record, p->name, &event->message.result, event->payload,
                                   latency_ms, out_error);
        v->n_results++;
        v->latency_sum_ms += latency_ms;
        v->latency_max_ms = fmax(v->latency_max_ms, latency_ms);
        printf("frame %llu: %s, %.1f ms, %u lights, light %llu\n", (unsigned long long)id, p->name,
               latency_ms, r->lights_used, (unsigned long long)r->lighting_sequence);
    } else {
        const struct gn_msg_dropped *d = &event->message.dropped;
        err = gn_record_add_dropped(v->record, p->name, d, out_error);
        v->n_dropped++;
        snprintf(v->last_drop, sizeof(v->last_drop), "%s",
                 d->sentence[0] ? d->sentence : gn_wire_get_drop_text(d->reason));
        gn_text_clean(v->last_drop);
        printf("frame %llu: %s, dropped: %s\n", (unsigned long long)id, p->name, v->last_drop);
    }
    fflush(stdout);
    p->id = 0;
    v->n_outstanding--;
    return err;
}

/** Refuses to wait any longer for a frame that is out. */
static int check_answers(const struct view *v, struct gn_error *out_error)
{
    int64_t now_ns = gn_client_now_ns();
    int64_t limit_ns =
        v->frame.quality == GN_MSG_QUALITY_REFERENCE ? REFERENCE_ANSWER_NS : ANSWER_NS;
    for (int i = 0; i < MAX_OUTSTANDING; i++) {
        const struct pending *p = &v->pending[i];
        if (p->id && now_ns - p->sent_ns > limit_ns)
            return gn_error_set(out_error, -ETIMEDOUT, "frame %llu (%s) was not answered in %d s",
                                (unsigned long long)p->id, p->name, (int)(limit_ns / GN_NS_PER_S));
    }
    return 0;
}

/**
 * Takes events until due_ns and until no more than max_left frames are out. 0, -EINTR (Ctrl-C), or
 * an error and its sentence.
 */
static int serve(struct view *v, int64_t due_ns, int max_left, struct gn_error *out_error)
{
    for (;;) {
        if (gn_cmd_is_interrupted())
            return -EINTR;
        int timeout_ms = gn_feed_get_timeout_ms(due_ns);
        bool is_due = timeout_ms == 0;
        if (is_due && v->n_outstanding > max_left)
            timeout_ms = 200;
        struct gn_client_event event;
        int err, got = gn_client_poll(v->feed.client, timeout_ms, &event);
        if (got < 0)
            err = gn_cmd_set_fault(v->feed.client, got, out_error);
        else if (got == 0)
            err = gn_feed_keep_clock(&v->feed, out_error);
        else if (event.type == GN_WIRE_RESULT || event.type == GN_WIRE_DROPPED)
            err = take_answer(v, &event, out_error);
        else
            err = gn_cmd_take_event(&event, out_error);
        if (!err)
            err = check_answers(v, out_error);
        if (err || (is_due && got == 0 && v->n_outstanding <= max_left))
            return err;
    }
}

/** What light the frame waits for: that of its number, or, before the first result, any. */
static void set_light_wanted(struct view *v, struct gn_msg_frame *frame)
{
    int64_t now_ns = gn_client_now_ns();
    if (v->feed.n_sent == 0)
        v->first_sent_ns = now_ns;
    int64_t left_ms = LIGHT_WAIT_MS - (now_ns - v->first_sent_ns) / GN_NS_PER_MS;
    if (v->sync_light) {
        frame->lighting_min_sequence = v->sync_light + (uint64_t)v->feed.n_sent;
        frame->lighting_wait_ms = LIGHT_WAIT_MS;
    } else if (v->n_results == 0 && left_ms > 0) {
        frame->lighting_wait_ms = (uint32_t)left_ms;
    }
}

static int send_frame(struct gn_feed *r, const struct gn_capture *capture,
                      struct gn_error *out_error)
{
    struct view *v = (struct view *)r;
    int err = serve(v, gn_feed_get_due_ns(r, capture), v->max_outstanding - 1, out_error);
    if (err)
        return err;
    bool is_jpeg = capture->format == GN_CAPTURE_JPEG;
    if (!is_jpeg && capture->format != GN_CAPTURE_RGB8)
        return gn_error_set(out_error, -EINVAL,
                            "%s is no 8-bit picture; camera frames are 8-bit PNG or JPEG",
                            capture->name);
    if (capture->width != v->camera.width || capture->height != v->camera.height)
        return gn_error_set(out_error, -EINVAL, "%s is %dx%d, but the camera is %dx%d",
                            capture->name, capture->width, capture->height, v->camera.width,
                            v->camera.height);
    struct pending *p = find_pending(v, 0);
    struct gn_msg_frame frame = v->frame;
    frame.id = (uint64_t)r->n_sent + 1;
    frame.capture_time_ns = gn_feed_get_capture_ns(r, capture);
    frame.views_count = 1;
    frame.views[0] = (struct gn_msg_frame_view){
        .has_world_from_camera = true,
        .picture_format = is_jpeg ? GN_MSG_PICTURE_FORMAT_JPEG : GN_MSG_PICTURE_FORMAT_RGB8,
        .payload_length = (uint32_t)capture->data_bytes,
    };
    gn_cmd_make_transform(capture->has_pose ? &capture->world_from_camera
                                            : &v->camera.world_from_camera,
                          &frame.views[0].world_from_camera);
    set_light_wanted(v, &frame);
    *p = (struct pending){.id = frame.id, .sent_ns = gn_client_now_ns()};
    snprintf(p->name, sizeof(p->name), "%s", capture->name);
    err = gn_client_send_frame(r->client, &frame, capture->data, capture->data_bytes);
    if (err)
        return gn_cmd_set_fault(r->client, err, out_error);
    r->n_sent++;
    v->n_outstanding++;
    return 0;
}

/** So that the picture that is read then is the newest when it is sent. */
static int wait_for_room(struct gn_feed *r, struct gn_error *out_error)
{
    struct view *v = (struct view *)r;
    return serve(v, 0, v->max_outstanding - 1, out_error);
}

static int wait_for_answers(struct gn_feed *r, struct gn_error *out_error)
{
    return serve((struct view *)r, 0, 0, out_error);
}

static void set_frame_options(struct view *v, const struct gn_options *options)
{
    bool is_jpeg = gn_options_get_enum(options, NULL, NULL, "result") == 1;
    v->frame.result_format = is_jpeg ? GN_MSG_PICTURE_FORMAT_JPEG : GN_MSG_PICTURE_FORMAT_RGB8;
    v->frame.jpeg_quality =
        is_jpeg ? (uint32_t)gn_options_get_int(options, NULL, NULL, "jpeg-quality") : 0;
    v->frame.budget_ms = (float)gn_options_get_double(options, NULL, NULL, "budget-ms");
    static const enum gn_msg_quality qualities[] = {GN_MSG_QUALITY_INTERACTIVE, GN_MSG_QUALITY_SEED,
                                                    GN_MSG_QUALITY_REFERENCE};
    v->frame.quality = qualities[gn_options_get_enum(options, NULL, NULL, "quality")];
    v->max_outstanding = gn_options_get_int(options, NULL, NULL, "outstanding");
    if (gn_options_is_set(options, NULL, NULL, "sync-light"))
        v->sync_light = (uint64_t)gn_options_get_int(options, NULL, NULL, "sync-light");
}

static int open_source(struct gn_feed *r, const struct gn_options *options,
                       struct gn_error *out_error)
{
    struct view *v = (struct view *)r;
    const char *dir = gn_options_get_string(options, NULL, NULL, "sequence");
    const char *pattern = gn_options_get_string(options, NULL, NULL, "files");
    const char *camera_path = gn_options_get_string(options, NULL, NULL, "camera");
    struct gn_sequence sequence = {0};
    struct gn_file_list list = {0};
    bool is_live = gn_live_count_asked(options) > 0;
    int err;
    if (dir) {
        err = gn_sequence_read(dir, &sequence, out_error);
        v->camera = sequence.camera;
        list = sequence.pictures;
        memset(&sequence.pictures, 0, sizeof(sequence.pictures));
    } else {
        err = gn_camera_read_file(camera_path, &v->camera, out_error);
        if (!err && !is_live)
            err = gn_file_list_find(pattern, r->rate_hz, &list, out_error);
    }
    gn_match_keep(gn_options_get_set(options, NULL, NULL, "match"), &v->camera);
    gn_sequence_finish(&sequence);
    v->dir = gn_options_get_string(options, NULL, NULL, "out");
    set_frame_options(v, options);
    const struct gn_file_source_options source_options = {.is_looped = r->is_looped};
    const struct gn_live_options wanted = {
        .is_8_bit = true, .width = v->camera.width, .height = v->camera.height};
    if (!err && is_live)
        return gn_live_open(options, &wanted, &r->source, out_error);
    if (!err)
        err = gn_file_list_check_names(&list, out_error);
    if (!err)
        err = gn_feed_open_files(r, &list, &source_options, out_error);
    gn_file_list_finish(&list);
    return err;
}

static int begin(struct gn_feed *r, struct gn_error *out_error)
{
    struct view *v = (struct view *)r;
    int err = send_camera(v);
    return err ? gn_cmd_set_fault(r->client, err, out_error)
               : gn_record_open(v->dir, &v->record, out_error);
}

static int report(struct gn_feed *r, int err, const struct gn_error *error)
{
    struct view *v = (struct view *)r;
    struct gn_error drop_error = {0}, record_error = {0};
    if (!err && v->n_results == 0 && v->n_dropped > 0) {
        err = gn_error_set(&drop_error, -ENODATA, "no frame was rendered: %s", v->last_drop);
        error = &drop_error;
    }
    struct gn_source_counts counts;
    gn_source_get_counts(r->source, &counts);
    int record_err = gn_record_close(&v->record, r->n_sent, r->is_complete,
                                     r->source->is_live ? &counts : NULL, &record_error);
    if (err || record_err)
        gn_cmd_fail(&program, err ? error->text : record_error.text);
    printf("%ld frames sent, %ld results, %ld dropped", r->n_sent, v->n_results, v->n_dropped);
    if (v->n_results)
        printf("; %.1f ms from sending to result (mean), %.1f at most",
               v->latency_sum_ms / (double)v->n_results, v->latency_max_ms);
    gn_feed_print_shift(r);
    printf("; in %s\n", v->dir);
    return err || record_err ? 1 : 0;
}

int gn_cmd_view(int argc, char *const argv[])
{
    static const struct gn_feed_command command = {
        .program = &program,
        .role = GN_MSG_ROLE_VIEWER,
        .takes_sequences = true,
        .find_misuse = find_misuse,
        .open = open_source,
        .begin = begin,
        .serve = wait_for_room,
        .send = send_frame,
        .end = wait_for_answers,
        .report = report,
    };
    struct view v = {0};
    return gn_feed_run(&command, &v.feed, argc, argv);
}
