/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What gnomon view works with, from its options: the source, the camera, markers, the window.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "client/capture/sequence.h"
#include "client/cmd_view/viewer.h"

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
    v->dir = v->dir ? v->dir : GN_VIEWER_DEFAULT_DIR;
    fprintf(stderr, "%s: %s; the composites go to %s instead\n", v->feed.program->name,
            out_error->text, v->dir);
    *out_error = (struct gn_error){0};
    return 0;
}

static int open_poses(struct gn_viewer *v, const struct gn_options *options,
                      struct gn_error *out_error)
{
    int err = gn_poses_open(options, &v->camera, NULL, &v->poses, out_error);
    if (!err && gn_poses_find_body(v->poses, GN_BODY_WORLD) < 0)
        err = gn_error_set(out_error, -EINVAL,
                           "%s: there is no body called \"" GN_BODY_WORLD
                           "\", whose markers say where the world is",
                           gn_options_get_string(options, NULL, NULL, "markers"));
    return err;
}

int gn_viewer_open(struct gn_feed *r, const struct gn_options *options, struct gn_error *out_error)
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
        err = gn_poses_read_camera(camera_path, &v->camera, &has_place, out_error);
        if (!err && !has_place && !gn_poses_is_asked(options))
            err = gn_error_set(out_error, -EINVAL,
                               "nothing says where the camera is: give --marker DICT:ID:SIZE or "
                               "--markers FILE, or world_from_camera in %s",
                               camera_path);
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
