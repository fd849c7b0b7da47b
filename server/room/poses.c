/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/poses.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/scene/motion.h"

int gn_poses_init(struct gn_poses *poses, const struct gn_scene *scene)
{
    size_t n = (size_t)scene->n_movable;
    *poses = (struct gn_poses){.scene = scene};
    if (n == 0)
        return 0;
    poses->slots = calloc(n, sizeof(*poses->slots));
    poses->poses = calloc(n, sizeof(*poses->poses));
    if (!poses->slots || !poses->poses) {
        gn_poses_finish(poses);
        return -ENOMEM;
    }
    for (size_t i = 0; i < n; i++)
        poses->poses[i] = scene->objects[scene->movable[i]].pose;
    return 0;
}

void gn_poses_finish(struct gn_poses *poses)
{
    free(poses->slots);
    free(poses->poses);
    *poses = (struct gn_poses){0};
}

int gn_poses_find(const struct gn_poses *poses, const char *name, struct gn_error *out_error)
{
    const struct gn_scene *scene = poses->scene;
    int index = gn_scene_find_movable(scene, name);
    char names[256] = "";
    size_t used = 0;
    if (index >= 0)
        return index;
    if (scene->n_movable == 0)
        return gn_error_set(out_error, -ENOENT, "object '%s': no object of the scene is movable",
                            name);
    for (int i = 0; i < scene->n_movable && used < sizeof(names) - 1; i++) {
        int n = snprintf(names + used, sizeof(names) - used, "%s%s", i ? ", " : "",
                         scene->objects[scene->movable[i]].name);
        used = n > 0 && used + (size_t)n < sizeof(names) ? used + (size_t)n : sizeof(names) - 1;
    }
    return gn_error_set(out_error, -ENOENT, "object '%s': the scene's movable objects are %s", name,
                        names);
}

enum gn_pose_verdict gn_poses_put(struct gn_poses *poses, int index, const struct gn_pose *pose,
                                  int64_t time_ns, int64_t now_ns, uint64_t session_id)
{
    struct gn_pose_slot *slot = &poses->slots[index];
    if (slot->n_poses > 0 && time_ns <= slot->time_ns)
        return GN_POSE_LATE;
    if (slot->n_poses > 0)
        gn_time_window_add(&slot->intervals, ((double)time_ns - (double)slot->time_ns) * 1e-6);
    slot->time_ns = time_ns;
    slot->received_ns = now_ns;
    slot->session_id = session_id;
    slot->n_poses++;
    poses->poses[index] = *pose;
    poses->version++;
    return GN_POSE_TAKEN;
}

int gn_poses_get_figures(const struct gn_poses *poses, int first, int cap,
                         struct gn_mover_figures *out_figures, struct gn_time_window *out_intervals)
{
    const struct gn_scene *scene = poses->scene;
    int n = 0;
    for (int i = first; i < scene->n_movable && n < cap; i++, n++) {
        const struct gn_pose_slot *slot = &poses->slots[i];
        const struct gn_scene_object *object = &scene->objects[scene->movable[i]];
        out_figures[n] = (struct gn_mover_figures){
            .is_virtual = object->role == GN_RT_VIRTUAL,
            .session_id = slot->session_id,
            .n_poses = slot->n_poses,
            .time_ns = slot->time_ns,
        };
        snprintf(out_figures[n].name, sizeof(out_figures[n].name), "%s", object->name);
        memcpy(out_figures[n].position, poses->poses[i].translation,
               sizeof(out_figures[n].position));
        out_intervals[n] = slot->intervals;
    }
    return n;
}
