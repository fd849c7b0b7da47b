/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/sequence.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "common/json.h"

#define FORMAT "gnomon-sequence 1"

/** A path of the file is relative to its folder. */
static int join(const char *dir, const char *name, char *out, size_t size)
{
    int n =
        name[0] == '/' ? snprintf(out, size, "%s", name) : snprintf(out, size, "%s/%s", dir, name);
    return n < 0 || (size_t)n >= size ? -ENAMETOOLONG : 0;
}

static int add_file(const struct gn_json *frame, const char *dir, const char *key, double time_s,
                    struct gn_file_list *list, struct gn_file_entry **out_entry,
                    struct gn_error *out_error)
{
    const char *name = NULL;
    char path[4096];
    int ret = gn_json_get_string(frame, key, &name, out_error);
    if (ret < 0)
        return ret;
    if (join(dir, name, path, sizeof(path)) < 0)
        return gn_json_refuse(frame, key, out_error, "the path is too long");
    ret = gn_file_list_add(list, path, out_entry);
    if (ret < 0)
        return gn_error_set(out_error, ret, "%s: %s", path, strerror(-ret));
    (*out_entry)->time_s = time_s;
    return 0;
}

static int read_frame(const struct gn_json *frame, const char *dir, double *last_time_s,
                      struct gn_sequence *out, struct gn_error *out_error)
{
    double time_s = 0;
    struct gn_pose pose;
    struct gn_file_entry *entry = NULL;
    int ret = gn_json_get_double(frame, "time_s", 0, 1e9, &time_s, out_error);
    if (ret == 0 && time_s < *last_time_s)
        ret = gn_json_refuse(frame, "time_s", out_error, "earlier than the frame before");
    if (ret == 0)
        ret = gn_pose_read_json(frame, "world_from_camera", &pose, out_error);
    if (ret == 0)
        ret = add_file(frame, dir, "picture", time_s, &out->pictures, &entry, out_error);
    if (ret < 0)
        return ret;
    entry->has_pose = true;
    entry->world_from_camera = pose;
    *last_time_s = time_s;
    return add_file(frame, dir, "environment", time_s, &out->environments, &entry, out_error);
}

static int read_root(const struct gn_json *root, const char *dir, struct gn_sequence *out,
                     struct gn_error *out_error)
{
    const char *format = NULL;
    struct gn_json camera, probe, frames;
    int ret = gn_json_get_string(root, "format", &format, out_error);
    if (ret == 0 && strcmp(format, FORMAT) != 0)
        ret = gn_json_refuse(root, "format", out_error, "'%s' is none we read; right would be '%s'",
                             format, FORMAT);
    if (ret == 0)
        ret = gn_json_get_object(root, "camera", &camera, out_error);
    if (ret == 0)
        ret = gn_camera_read_json(&camera, false, &out->camera, out_error);
    if (ret == 0)
        ret = gn_json_get_object(root, "environment", &probe, out_error);
    if (ret == 0)
        ret = gn_probe_setup_read_json(&probe, &out->probe, out_error);
    if (ret == 0)
        ret = gn_json_get_array(root, "frames", 1, GN_FILE_SOURCE_MAX, &frames, out_error);
    if (ret < 0)
        return ret;
    double last_time_s = 0;
    for (size_t i = 0; ret == 0 && i < json_array_size(frames.value); i++) {
        struct gn_json frame;
        ret = gn_json_get_item(&frames, i, &frame, out_error);
        if (ret == 0)
            ret = read_frame(&frame, dir, &last_time_s, out, out_error);
    }
    return ret;
}

int gn_sequence_read(const char *dir, struct gn_sequence *out, struct gn_error *out_error)
{
    memset(out, 0, sizeof(*out));
    char path[4096];
    if (join(dir, "sequence.json", path, sizeof(path)) < 0)
        return gn_error_set(out_error, -ENAMETOOLONG, "%s: the path is too long", dir);
    struct gn_json root;
    int ret = gn_json_load_file(path, &root, out_error);
    if (ret < 0)
        return ret;
    ret = read_root(&root, dir, out, out_error);
    gn_json_finish(&root);
    if (ret < 0)
        gn_sequence_finish(out);
    return ret;
}

void gn_sequence_finish(struct gn_sequence *sequence)
{
    gn_file_list_finish(&sequence->pictures);
    gn_file_list_finish(&sequence->environments);
    memset(sequence, 0, sizeof(*sequence));
}
