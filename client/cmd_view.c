/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon view: streams camera frames and poses from files and cameras, writes what comes back.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/sequence.h"
#include "client/viewer.h"
#include "common/clock.h"
#include "common/text.h"
#include "proto/attr.h"

/** How long a frame may wait for light, ms. */
#define LIGHT_WAIT_MS 5000
/** Where the composites go for which there is no window. */
#define DEFAULT_DIR "composites"

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    GN_FEED_OPTIONS,
    GN_LIVE_OPTIONS,
    GN_POSES_OPTIONS,
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
     .help = "Where the composited frames and view.json (every receipt) go; each round of --loop "
             "replaces the pictures of the one before. With --window it may be left out."},
    {.key = "window",
     .flag = "window",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Show the composites live; h lists the keys: figures, light, objects and shadows on "
             "and off, pictures kept, a recording. Without --out files begin again at the end, "
             "until q. A server that is lost is waited for. Where there is no display "
             "the composites go to --out, or to " DEFAULT_DIR ", and that is said."},
    {.key = "show",
     .flag = "show",
     .type = GN_OPTION_SET,
     .choices = "virtual|shadow",
     .default_value = "all",
     .help = "What of the virtual objects is in the composites: they themselves, their shadows."},
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
     .max = GN_VIEWER_MAX_OUTSTANDING,
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
    .usage = "--sequence DIR | {--files PATTERN | --video FILE | --gige ID | --v4l2 DEVICE} "
             "--camera FILE, "
             "--out DIR | --window [OPTION]...",
    .summary = "Streams camera frames and poses to a room and writes the composited frames that "
               "come back, with their receipts. Every frame comes back exactly once, as a result "
               "or as dropped with the reason. At the start it waits up to 5 s for light.",
    .notes = "Examples:\n"
             "  gnomon view --sequence .cache/rig/lamps --out composites\n"
             "  gnomon view --files 'shots/*.jpg' --camera camera.json --out composites\n"
             "  gnomon view --gige any --camera camera.json --out composites\n"
             "  gnomon view --files shots --camera camera.json --window\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

/** Where the camera is said to be where nobody knows: it looks up and sees nothing of any scene. */
static const struct gn_pose nowhere = {{1, 0, 0, 0}, {0, 0, 1e5}};

/** What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_options *options)
{
    bool has_dir = gn_options_is_set(options, NULL, NULL, "sequence");
    bool has_files = gn_options_is_set(options, NULL, NULL, "files");
    bool has_video = gn_options_is_set(options, NULL, NULL, "video");
    bool has_camera = gn_options_is_set(options, NULL, NULL, "camera");
    const char *misuse = gn_feed_find_misuse(options);
    if (!misuse)
        misuse = gn_poses_find_misuse(options);
    if (misuse)
        return misuse;
    if (!gn_options_is_set(options, NULL, NULL, "out") &&
        !gn_options_get_bool(options, NULL, NULL, "window"))
        return "give --out DIR, for the composites, or --window";
    if (has_dir + has_files + has_video + gn_live_count_asked(options) != 1 ||
        has_dir == has_camera)
        return "give --sequence DIR, or --files PATTERN, --video FILE or a camera (--gige ID, "
               "--v4l2 DEVICE) with --camera FILE";
    if (gn_options_get_double(options, NULL, NULL, "budget-ms") > 0 &&
        gn_options_get_enum(options, NULL, NULL, "quality") != 0)
        return "--budget-ms is for --quality interactive: the others' settings are not chosen";
    return NULL;
}

/** What light the frame waits for: that of its number, or, before the first result, any. */
static void set_light_wanted(struct gn_viewer *v, struct gn_msg_frame *frame)
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

/**
 * Says where the camera was when it took the picture: by the markers in it, by the source, or where
 * camera.json has it at rest. Without the world's markers the frame goes all the same, and comes
 * back as it is.
 */
static int place_frame(struct gn_viewer *v, const struct gn_capture *capture,
                       struct gn_msg_frame *frame, struct gn_error *out_error)
{
    struct gn_pose pose =
        capture->has_pose ? capture->world_from_camera : v->camera.world_from_camera;
    int n_seen = v->poses ? gn_poses_take(v->poses, capture, out_error) : 0;
    if (n_seen < 0)
        return n_seen;
    if (v->show)
        gn_show_set_wishes(v->show, frame);
    if (v->poses && !gn_poses_get_camera(v->poses, &pose)) {
        pose = nowhere;
        frame->no_virtual = frame->no_shadow = true;
        v->n_unplaced++;
    }
    if (v->show)
        gn_show_put_pose(v->show, &pose);
    gn_cmd_make_transform(&pose, &frame->views[0].world_from_camera);
    return 0;
}

static int send_frame(struct gn_feed *r, const struct gn_capture *capture,
                      struct gn_error *out_error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    int err = gn_viewer_serve(v, gn_feed_get_due_ns(r, capture), v->max_outstanding - 1, out_error);
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
    struct gn_viewer_pending *p = gn_viewer_get_free(v);
    struct gn_msg_frame frame = v->frame;
    frame.id = (uint64_t)r->n_sent + 1;
    frame.capture_time_ns = gn_feed_get_capture_ns(r, capture);
    frame.views_count = 1;
    frame.views[0] = (struct gn_msg_frame_view){
        .has_world_from_camera = true,
        .picture_format = is_jpeg ? GN_MSG_PICTURE_FORMAT_JPEG : GN_MSG_PICTURE_FORMAT_RGB8,
        .payload_length = (uint32_t)capture->data_bytes,
    };
    err = place_frame(v, capture, &frame, out_error);
    if (err)
        return err;
    set_light_wanted(v, &frame);
    *p = (struct gn_viewer_pending){.id = frame.id, .sent_ns = gn_client_now_ns()};
    snprintf(p->name, sizeof(p->name), "%s", capture->name);
    err = gn_client_send_frame(r->client, &frame, capture->data, capture->data_bytes);
    if (err) {
        bool is_ours = err == -EDOM || err == -EMSGSIZE;
        gn_cmd_set_fault(r->client, err, out_error);
        if (is_ours || !v->show)
            return err;
    }
    r->n_sent++;
    v->n_outstanding++;
    return err ? gn_viewer_reconnect(v, err, out_error) : 0;
}

/** So that the picture that is read then is the newest when it is sent. */
static int wait_for_room(struct gn_feed *r, struct gn_error *out_error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    return gn_viewer_serve(v, 0, v->max_outstanding - 1, out_error);
}

static int wait_for_answers(struct gn_feed *r, struct gn_error *out_error)
{
    return gn_viewer_serve((struct gn_viewer *)r, 0, 0, out_error);
}

static void set_frame_options(struct gn_viewer *v, const struct gn_options *options)
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
    unsigned shown = gn_options_get_set(options, NULL, NULL, "show");
    v->frame.no_virtual = !(shown & 1);
    v->frame.no_shadow = !(shown & 2);
}

/** Where there is no display, files take the window's place. */
static int open_window(struct gn_viewer *v, const struct gn_options *options,
                       struct gn_error *out_error)
{
    if (!gn_options_get_bool(options, NULL, NULL, "window"))
        return 0;
    const struct gn_show_options show_options = {.width = v->camera.width,
                                                 .height = v->camera.height,
                                                 .dir = v->dir,
                                                 .no_virtual = v->frame.no_virtual,
                                                 .no_shadow = v->frame.no_shadow};
    int err = gn_show_open(&show_options, &v->show, out_error);
    v->feed.link.wants_light = !err;
    if (err != -ENODEV)
        return err;
    v->dir = v->dir ? v->dir : DEFAULT_DIR;
    fprintf(stderr, "%s: %s; the composites go to %s instead\n", program.name, out_error->text,
            v->dir);
    *out_error = (struct gn_error){0};
    return 0;
}

static int open_poses(struct gn_viewer *v, const struct gn_options *options,
                      struct gn_error *out_error)
{
    int err = gn_poses_open(options, &v->camera, false, &v->poses, out_error);
    if (!err && gn_poses_find_body(v->poses, GN_BODY_WORLD) < 0)
        err = gn_error_set(out_error, -EINVAL,
                           "%s: there is no body called \"" GN_BODY_WORLD
                           "\", whose markers say where the world is",
                           gn_options_get_string(options, NULL, NULL, "markers"));
    return err;
}

static int open_source(struct gn_feed *r, const struct gn_options *options,
                       struct gn_error *out_error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    const char *dir = gn_options_get_string(options, NULL, NULL, "sequence");
    const char *pattern = gn_options_get_string(options, NULL, NULL, "files");
    const char *camera_path = gn_options_get_string(options, NULL, NULL, "camera");
    struct gn_sequence sequence = {0};
    struct gn_file_list list = {0};
    bool is_live = gn_live_count_asked(options) > 0, has_place = true;
    int err;
    if (dir) {
        err = gn_sequence_read(dir, &sequence, out_error);
        v->camera = sequence.camera;
        list = sequence.pictures;
        memset(&sequence.pictures, 0, sizeof(sequence.pictures));
    } else {
        err = gn_poses_is_asked(options)
                  ? gn_poses_read_camera(camera_path, &v->camera, &has_place, out_error)
                  : gn_camera_read_file(camera_path, &v->camera, out_error);
        if (!err && v->camera.response.type == GN_RESPONSE_TABLE)
            err = gn_error_set(out_error, -EINVAL,
                               "%s: camera frames travel with no table as response; right would "
                               "be a formula, as gnomon calibrate response --as gamma finds it",
                               camera_path);
        if (!err && pattern)
            err = gn_file_list_find(pattern, r->rate_hz, &list, out_error);
    }
    gn_match_keep(gn_options_get_set(options, NULL, NULL, "match"), &v->camera);
    gn_sequence_finish(&sequence);
    v->dir = gn_options_get_string(options, NULL, NULL, "out");
    set_frame_options(v, options);
    if (!err && gn_poses_is_asked(options))
        err = open_poses(v, options, out_error);
    if (!err)
        err = open_window(v, options, out_error);
    // What is only looked at goes on until somebody has seen enough.
    bool is_loop_said = strcmp(gn_options_get_source(options, NULL, NULL, "loop"), "default") != 0;
    if (v->show && !v->dir && !is_loop_said)
        r->is_looped = true;
    const struct gn_file_source_options source_options = {.is_looped = r->is_looped};
    const struct gn_live_options wanted = {
        .is_8_bit = true, .width = v->camera.width, .height = v->camera.height};
    if (!err && is_live)
        return gn_live_open(options, &wanted, &r->source, out_error);
    if (!err && gn_options_is_set(options, NULL, NULL, "video"))
        return gn_feed_open_video(r, options, false, out_error);
    if (!err)
        err = gn_file_list_check_names(&list, out_error);
    if (!err)
        err = gn_feed_open_files(r, &list, &source_options, out_error);
    gn_file_list_finish(&list);
    return err;
}

static int begin(struct gn_feed *r, struct gn_error *out_error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    int err = gn_viewer_send_camera(v, out_error);
    if (!err && v->show) {
        char title[256];
        snprintf(title, sizeof(title), "gnomon: room %s - h lists the keys",
                 gn_client_get_welcome(r->client)->room);
        gn_text_clean(title);
        gn_show_set_title(v->show, title);
    }
    if (!err && v->dir)
        err = gn_record_open(v->dir, &v->record, out_error);
    return err || !v->dir || !v->poses ? err : gn_poses_write_to(v->poses, v->dir, out_error);
}

static int report(struct gn_feed *r, int err, const struct gn_error *error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    struct gn_error drop_error = {0}, record_error = {0};
    gn_show_close(&v->show);
    err = v->is_closed ? 0 : err;
    if (!err && !v->is_closed && v->n_results == 0 && v->n_dropped > 0) {
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
    if (v->n_reconnected > 0)
        printf("; connected again %d time%s, %ld frame%s lost", v->n_reconnected,
               v->n_reconnected == 1 ? "" : "s", v->n_lost, v->n_lost == 1 ? "" : "s");
    if (v->dir)
        printf("; in %s", v->dir);
    printf("\n");
    if (v->n_unplaced > 0)
        printf("%ld frames without the world's markers: sent to come back as they are\n",
               v->n_unplaced);
    gn_poses_print(v->poses, stdout);
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
    struct gn_viewer v = {0};
    int status = gn_feed_run(&command, &v.feed, argc, argv);
    gn_poses_close(&v.poses);
    gn_show_close(&v.show); // where it never came to a report
    return status;
}
