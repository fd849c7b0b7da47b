/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon track with a camera: moves an object by the markers on it.
 */
#include "client/cmd_track/cmd_track.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "client/feed.h"
#include "client/poses.h"
#include "common/clock.h"

/** One run of the command. */
struct track_camera {
    struct gn_feed feed;
    struct gn_camera camera;
    struct gn_poses *poses;
    struct gn_pose_filter filter; // of world_from_object
    bool is_steady;
    int body;
    struct gn_msg_pose message;
    int64_t ahead_ns;
    long n_poses, n_worldless; // pictures; that show the object, but no marker of the world
};

static const char *find_misuse(const struct gn_options *options)
{
    int n_recordings = gn_options_is_set(options, NULL, NULL, "files") +
                       gn_options_is_set(options, NULL, NULL, "video");
    const char *name = gn_options_get_string(options, NULL, NULL, "object");
    const char *misuse = gn_feed_find_misuse(options);
    if (!misuse)
        misuse = gn_cmd_find_misuse(options);
    if (!misuse)
        misuse = gn_poses_find_misuse(options);
    if (misuse)
        return misuse;
    if (!name[0] || strlen(name) >= sizeof(((struct gn_msg_pose *)0)->object))
        return "--object: names have 1 to 63 bytes";
    if (n_recordings + gn_live_count_asked(options) != 1 ||
        !gn_options_is_set(options, NULL, NULL, "camera") || !gn_poses_is_asked(options))
        return "to track by markers give --markers FILE or --marker DICT:ID:SIZE, --camera FILE, "
               "and --files PATTERN, --video FILE or a camera";
    if (!gn_options_get_bool(options, NULL, NULL, "steady") &&
        gn_options_get_double(options, NULL, NULL, "predict-ms") > 0)
        return "--predict-ms predicts from steady poses: leave out --no-steady";
    return NULL;
}

static int open_source(struct track_camera *t, const struct gn_options *options,
                       struct gn_error *out_error)
{
    const struct gn_live_options wanted = {.width = t->camera.width, .height = t->camera.height};
    if (gn_live_count_asked(options) > 0)
        return gn_live_open(options, &wanted, &t->feed.source, out_error);
    if (gn_options_is_set(options, NULL, NULL, "video"))
        return gn_feed_open_video(&t->feed, options, false, out_error);
    const struct gn_file_source_options files = {.is_looped = t->feed.is_looped};
    struct gn_file_list list = {0};
    int err = gn_file_list_find(gn_options_get_string(options, NULL, NULL, "files"),
                                t->feed.rate_hz, &list, out_error);
    if (!err)
        err = gn_feed_open_files(&t->feed, &list, &files, out_error);
    gn_file_list_finish(&list);
    return err;
}

static int open_all(struct gn_feed *feed, const struct gn_options *options,
                    struct gn_error *out_error)
{
    struct track_camera *t = (struct track_camera *)feed;
    const char *name = gn_options_get_string(options, NULL, NULL, "object");
    bool has_place = false;
    gn_wire_set_string(t->message.object, sizeof(t->message.object), name);
    t->ahead_ns = (int64_t)(gn_options_get_double(options, NULL, NULL, "predict-ms") * 1e6);
    t->is_steady = gn_options_get_bool(options, NULL, NULL, "steady");
    t->filter.options = GN_POSE_FILTER_DEFAULTS;
    int err = gn_poses_read_camera(gn_options_get_string(options, NULL, NULL, "camera"), &t->camera,
                                   &has_place, out_error);
    if (!err)
        err = gn_poses_open(options, &t->camera, name, &t->poses, out_error);
    if (err)
        return err;
    t->body = gn_poses_find_body(t->poses, name);
    if (t->body < 0)
        return gn_error_set(out_error, -EINVAL, "%s: there is no body called \"%s\", the object",
                            gn_options_get_string(options, NULL, NULL, "markers"), name);
    if (gn_poses_find_body(t->poses, GN_BODY_WORLD) < 0 && !has_place) {
        const char *list = gn_options_get_string(options, NULL, NULL, "markers");
        return gn_error_set(out_error, -EINVAL,
                            "nothing says where the camera is: give a body \"" GN_BODY_WORLD
                            "\" in %s, or world_from_camera in %s",
                            list ? list : "a file of --markers",
                            gn_options_get_string(options, NULL, NULL, "camera"));
    }
    return open_source(t, options, out_error);
}

/** The object's pose in the last picture. False where it, or the world, was not seen. */
static bool get_object(struct track_camera *t, int64_t time_ns, struct gn_pose *out)
{
    if (gn_poses_find_body(t->poses, GN_BODY_WORLD) < 0) {
        if (!gn_poses_get_in_camera(t->poses, t->body, out))
            return false;
        gn_pose_multiply(&t->camera.world_from_camera, out, out);
    } else if (!gn_poses_get_body(t->poses, t->body, out)) {
        t->n_worldless += gn_poses_get_in_camera(t->poses, t->body, out);
        return false;
    }
    int step = gn_pose_filter_update(&t->filter, time_ns, out);
    if (step < 0 || step == GN_POSE_FILTER_SKIPPED)
        return step >= 0;
    struct gn_pose measured = *out;
    if (!gn_pose_filter_predict(&t->filter, time_ns + t->ahead_ns, out) || !t->is_steady)
        *out = measured;
    return true;
}

static int send_pose(struct gn_feed *feed, const struct gn_capture *capture,
                     struct gn_error *out_error)
{
    struct track_camera *t = (struct track_camera *)feed;
    int err = gn_feed_wait(feed, capture, out_error);
    int n_seen = err ? err : gn_poses_take(t->poses, capture, out_error);
    if (n_seen < 0)
        return n_seen;
    struct gn_pose pose;
    feed->n_sent++;
    if (!get_object(t, gn_poses_get_time_ns(capture), &pose))
        return 0;
    gn_cmd_make_transform(&pose, &t->message.world_from_object);
    t->message.has_world_from_object = true;
    t->message.time_ns = gn_feed_get_capture_ns(feed, capture);
    err = gn_client_send_pose(feed->client, &t->message);
    t->n_poses += !err;
    return err ? gn_cmd_set_fault(feed->client, err, out_error) : 0;
}

static int report(struct gn_feed *feed, int err, const struct gn_error *error)
{
    struct track_camera *t = (struct track_camera *)feed;
    struct gn_error unseen = {0};
    if (!err && t->n_poses == 0) {
        err = t->n_worldless > 0
                  ? gn_error_set(&unseen, -ENODATA,
                                 "%ld pictures show the object's markers, none of them a marker of "
                                 "\"" GN_BODY_WORLD "\", which says where the camera is",
                                 t->n_worldless)
                  : gn_error_set(&unseen, -ENODATA, "the object's markers were in no picture");
        error = &unseen;
    }
    if (err)
        gn_cmd_fail(feed->program, error->text);
    printf("%ld poses sent of %ld pictures", t->n_poses, feed->n_sent);
    gn_feed_print_shift(feed);
    printf("\n");
    gn_poses_print(t->poses, stdout);
    return err ? 1 : 0;
}

int gn_cmd_track_camera(const struct gn_program *program, int argc, char *const argv[])
{
    const struct gn_feed_command command = {
        .program = program,
        .role = GN_MSG_ROLE_TRACKER,
        .find_misuse = find_misuse,
        .open = open_all,
        .send = send_pose,
        .report = report,
    };
    struct track_camera t = {0};
    int status = gn_feed_run(&command, &t.feed, argc, argv);
    gn_poses_close(&t.poses);
    return status;
}
