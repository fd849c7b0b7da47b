/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon track: streams the poses of a movable object, from a file or along a circle.
 */
#include "client/cmd_track/cmd_track.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/feed.h"
#include "client/poses.h"
#include "common/file.h"
#include "proto/attr.h"

/** Most bytes of a file of poses. */
#define MAX_FILE_BYTES ((size_t)256 << 20)
#define ORBIT_PERIOD_S 4.0

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    {.key = "object",
     .flag = "object",
     .type = GN_OPTION_STRING,
     .value_name = "NAME",
     .is_required = true,
     .help = "Which object: the name of one with \"movable\": true in the room's scene.json."},
    {.key = "poses",
     .flag = "poses",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Where it is when: a line of JSON for each pose, {\"time_s\": 0.02, "
             "\"world_from_object\": [16 numbers, row-major]}, times rising. Nearly rigid matrices "
             "are mended; mirrored, singular and stretched ones refused."},
    {.key = "orbit",
     .flag = "orbit",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 1e5,
     .value_name = "RADIUS",
     .help =
         "Instead, to try things out: once in 4 s around the world's z axis at this distance in "
         "metres, at height 0, until Ctrl-C or --count."},
    {.key = "files",
     .flag = "files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "With markers: a folder's pictures, or a pattern in quotes such as 'frames/*.png'."},
    GN_FEED_VIDEO_OPTION,
    GN_LIVE_OPTIONS,
    GN_LIVE_EXPOSURE_OPTION,
    {.key = "camera",
     .flag = "camera",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "With markers: camera.json with intrinsics (docs/frames.md), and where the camera is "
             "if no marker of the world says that."},
    GN_POSES_OPTIONS,
    {.key = "predict-ms",
     .flag = "predict-ms",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 100,
     .default_value = "0",
     .value_name = "MS",
     .help = "With markers: send where the object will be so long after the picture, by constant "
             "speed: about the time until the poses are seen."},
    GN_FEED_PACE_OPTIONS("Without it a file of poses keeps its own times; an orbit goes at 60, "
                         "pictures at 10."),
};

static const struct gn_program program = {
    .name = "gnomon track",
    .usage = "--object NAME --poses FILE|--orbit RADIUS|{--markers FILE --camera FILE --files "
             "PATTERN|--gige ID} [OPTION]...",
    .summary = "Moves an object of the room's scene: by a file of poses, along a circle, or by "
               "markers on it that a camera sees. It stays at its last pose when this ends.",
    .notes = "Examples:\n"
             "  gnomon track --object teapot --orbit 0.2\n"
             "  gnomon track --object teapot --poses path.jsonl --rate 60\n"
             "  gnomon track --object teapot --markers markers.json --camera camera.json \\\n"
             "      --gige any\n"
             "  gnomon track --object cup --marker 4x4_50:7:0.03 --camera at-rest.json \\\n"
             "      --v4l2 any\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

struct timed_pose {
    double time_s;
    struct gn_pose pose;
};

/** One run of the command. */
struct track {
    struct gn_feed feed;
    struct gn_msg_pose message;
    struct timed_pose *poses; // [n], owned; NULL: an orbit
    long n;
    double orbit_m;
};

static int read_line(struct track *t, const char *line, size_t size, const char *name,
                     struct gn_error *out_error)
{
    static const char *const keys[] = {"time_s", "world_from_object"};
    struct gn_json root = {0};
    struct timed_pose *pose = &t->poses[t->n];
    int err = gn_json_load_text(line, size, name, &root, out_error);
    if (!err)
        err = gn_json_check_keys(&root, keys, GN_ARRAY_LEN(keys), out_error);
    if (!err)
        err = gn_json_get_double(&root, "time_s", -1e9, 1e9, &pose->time_s, out_error);
    if (!err && t->n > 0 && pose->time_s <= t->poses[t->n - 1].time_s)
        err = gn_json_refuse(&root, "time_s", out_error, "%g s does not come after %g s",
                             pose->time_s, t->poses[t->n - 1].time_s);
    if (!err)
        err = gn_pose_read_json(&root, "world_from_object", &pose->pose, out_error);
    gn_json_finish(&root);
    t->n += err == 0;
    return err;
}

static int read_poses(struct track *t, const char *path, struct gn_error *out_error)
{
    char *text = NULL;
    size_t size = 0;
    int err = gn_file_read_text(path, MAX_FILE_BYTES, &text, &size, out_error);
    if (err)
        return err;
    size_t n_lines = 1;
    for (const char *c = text; *c; c++)
        n_lines += *c == '\n';
    t->poses = calloc(n_lines, sizeof(*t->poses));
    if (!t->poses)
        err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    long number = 1;
    for (const char *line = text; !err && *line; number++) {
        size = strcspn(line, "\n");
        char name[512];
        snprintf(name, sizeof(name), "%s, line %ld", path, number);
        if (strspn(line, " \t\r") < size)
            err = read_line(t, line, size, name, out_error);
        line += size + (line[size] == '\n');
    }
    free(text);
    if (!err && t->n == 0)
        err = gn_error_set(out_error, -EINVAL, "%s: no pose in it", path);
    return err;
}

/** The pose that is next, its time after the first. */
static struct timed_pose get_pose(const struct track *t)
{
    long i = t->feed.n_sent;
    if (t->poses)
        return (struct timed_pose){t->poses[i].time_s - t->poses[0].time_s, t->poses[i].pose};
    double time_s = (double)i / t->feed.rate_hz;
    double angle = 2 * 3.14159265358979323846 * time_s / ORBIT_PERIOD_S;
    return (struct timed_pose){time_s,
                               {{cos(angle / 2), 0, 0, sin(angle / 2)},
                                {t->orbit_m * cos(angle), t->orbit_m * sin(angle), 0}}};
}

static int send_all(struct track *t, struct gn_error *out_error)
{
    struct gn_feed *r = &t->feed;
    while (!(t->poses && r->n_sent == t->n) && !(r->n_wanted > 0 && r->n_sent == r->n_wanted)) {
        struct timed_pose pose = get_pose(t);
        const struct gn_capture due = {.time_s = pose.time_s};
        int err = gn_feed_wait(r, &due, out_error);
        if (err)
            return err;
        gn_cmd_make_transform(&pose.pose, &t->message.world_from_object);
        t->message.has_world_from_object = true;
        t->message.time_ns = gn_client_to_server_ns(r->client, gn_client_now_ns());
        err = gn_client_send_pose(r->client, &t->message);
        if (err)
            return gn_cmd_set_fault(r->client, err, out_error);
        r->n_sent++;
    }
    return gn_feed_wait_last(r, out_error); // what is wrong with the last ones is said only now
}

/** What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_options *options, const struct gn_msg_pose *message)
{
    const char *name = gn_options_get_string(options, NULL, NULL, "object");
    if (!name[0] || strlen(name) >= sizeof(message->object))
        return "--object: names have 1 to 63 bytes";
    if (gn_cmd_find_misuse(options))
        return gn_cmd_find_misuse(options);
    if (gn_options_is_set(options, NULL, NULL, "files") ||
        gn_options_is_set(options, NULL, NULL, "video") ||
        gn_options_is_set(options, NULL, NULL, "camera") || gn_live_count_asked(options) > 0)
        return "a camera's pictures are looked at for markers: give --markers FILE or --marker "
               "DICT:ID:SIZE";
    if (gn_poses_find_misuse(options))
        return gn_poses_find_misuse(options);
    if (gn_options_is_set(options, NULL, NULL, "poses") ==
        gn_options_is_set(options, NULL, NULL, "orbit"))
        return "give one of --poses, --orbit, and markers with a camera";
    if (gn_options_is_set(options, NULL, NULL, "start-at") ||
        gn_options_get_bool(options, NULL, NULL, "loop") ||
        gn_options_get_double(options, NULL, NULL, "predict-ms") > 0)
        return "--start-at, --loop and --predict-ms are for --markers and --marker";
    return NULL;
}

static int prepare(struct track *t, const struct gn_options *options, struct gn_error *out_error)
{
    const char *path = gn_options_get_string(options, NULL, NULL, "poses");
    gn_wire_set_string(t->message.object, sizeof(t->message.object),
                       gn_options_get_string(options, NULL, NULL, "object"));
    t->feed.program = &program;
    t->feed.rate_hz = path ? 0 : 60;
    if (gn_options_is_set(options, NULL, NULL, "rate"))
        t->feed.rate_hz = gn_options_get_double(options, NULL, NULL, "rate");
    t->feed.n_wanted = (long)gn_options_get_int(options, NULL, NULL, "count");
    if (path)
        return read_poses(t, path, out_error);
    t->orbit_m = gn_options_get_double(options, NULL, NULL, "orbit");
    return 0;
}

/** Runs with sensible options; the exit status. */
static int run(struct track *t, const struct gn_options *options)
{
    struct gn_error error = {0};
    struct gn_feed *r = &t->feed;
    gn_cmd_catch_signals();
    int rc = prepare(t, options, &error);
    if (rc == 0)
        rc = gn_cmd_connect(&program, options, GN_MSG_ROLE_TRACKER, &r->client, &error);
    if (rc == 0) {
        r->clock_ns = gn_client_now_ns();
        rc = send_all(t, &error);
    }
    // An orbit's end.
    bool is_done = rc == 0 || (rc == -EINTR && r->client && !t->poses && r->n_wanted == 0);
    if (!is_done)
        gn_cmd_fail(&program, rc == -EINTR && r->client ? "interrupted" : error.text);
    if (r->client && (is_done || rc == -EINTR)) {
        printf("%ld poses sent", r->n_sent);
        gn_feed_print_shift(r);
        printf("\n");
    }
    gn_cmd_disconnect(&r->client);
    free(t->poses);
    return is_done ? 0 : 1;
}

int gn_cmd_track(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct track t = {0};
    int rc = gn_cmd_load(&program, argc, argv, &options);
    if (rc <= 0)
        return rc < 0 ? 2 : 0;
    if (gn_poses_is_asked(options)) {
        gn_options_destroy(&options);
        return gn_cmd_track_camera(&program, argc, argv);
    }
    const char *misuse = find_misuse(options, &t.message);
    int status = 2;
    if (misuse)
        gn_cmd_fail(&program, misuse);
    else
        status = run(&t, options);
    gn_options_destroy(&options);
    return status;
}
