/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon view: streams camera frames and poses from files and cameras, writes what comes back.
 */
#include <errno.h>
#include <stdio.h>

#include "client/cmd_view/viewer.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    GN_FEED_OPTIONS,
    GN_LIVE_OPTIONS,
    GN_LIVE_EXPOSURE_OPTION,
    GN_POSES_OPTIONS,
    {.key = "camera",
     .flag = "camera",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help =
         "With --files or a camera: camera.json with intrinsics (docs/frames.md), and, where no "
         "markers are looked for, the pose of a camera at rest. A sequence brings its own."},
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
             "until q. A server that is not there is waited for. Where there is no display "
             "the composites go to --out, or to " GN_VIEWER_DEFAULT_DIR ", and that is said."},
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
    if (gn_options_get_enum(options, NULL, NULL, "result") == 0 &&
        !gn_options_is_default(options, NULL, NULL, "jpeg-quality"))
        return "--jpeg-quality is for --result jpeg: PNG loses nothing";
    if (gn_options_get_double(options, NULL, NULL, "budget-ms") > 0 &&
        gn_options_get_enum(options, NULL, NULL, "quality") != 0)
        return "--budget-ms is for --quality interactive: the others' settings are not chosen";
    return NULL;
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

static int connect_to(struct gn_feed *r, struct gn_error *out_error)
{
    return gn_viewer_connect((struct gn_viewer *)r, out_error);
}

static int begin(struct gn_feed *r, struct gn_error *out_error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    int err = gn_viewer_send_camera(v, out_error);
    if (v->show)
        gn_show_set_room(v->show, gn_client_get_welcome(r->client)->room);
    if (!err && v->dir)
        err = gn_record_open(v->dir, &v->record, out_error);
    return err || !v->dir || !v->poses ? err : gn_poses_write_to(v->poses, v->dir, out_error);
}

/** Whether all went its way and yet nothing came of it, and why. */
static int check_outcome(const struct gn_viewer *v, struct gn_error *out_error)
{
    if (v->n_results == 0 && v->n_dropped > 0)
        return gn_error_set(out_error, -ENODATA, "no frame was rendered: %s%s", v->last_drop,
                            v->is_unlit ? "; is a gnomon probe running?" : "");
    if (v->n_unplaced > 0 && v->n_unplaced == v->feed.n_sent)
        return gn_error_set(
            out_error, -ENODATA,
            "no picture says where the camera is, so nothing virtual was drawn: is a "
            "marker of \"" GN_BODY_WORLD "\", whole and with its white margin, in "
            "sight? --debug-markers DIR draws what was found");
    return 0;
}

static int report(struct gn_feed *r, int err, const struct gn_error *error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    struct gn_error outcome = {0}, record_error = {0};
    gn_show_close(&v->show);
    err = v->is_closed ? 0 : err;
    if (!err && !v->is_closed) {
        err = check_outcome(v, &outcome);
        error = err ? &outcome : error;
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
    if (v->n_empty > 0 && v->n_empty == v->n_wanting)
        printf("no virtual object was in any picture: is the camera where it should be? Sizes and "
               "places are in metres\n");
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
        .open = gn_viewer_open,
        .connect = connect_to,
        .begin = begin,
        .serve = wait_for_room,
        .send = gn_viewer_send,
        .end = wait_for_answers,
        .report = report,
    };
    struct gn_viewer v = {0};
    int status = gn_feed_run(&command, &v.feed, argc, argv);
    gn_poses_close(&v.poses);
    gn_show_close(&v.show); // where it never came to a report
    return status;
}
