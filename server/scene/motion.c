/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/motion.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "server/scene/emission.h"

struct gn_scene_snapshot {
    atomic_int references; // 0: free to be made anew
    struct gn_scene scene; // objects and rt are the snapshot's own, all else is shared
};

struct gn_motion {
    const struct gn_scene *scene; // borrowed
    uint64_t version;             // of the last snapshot
    int n;
    struct gn_scene_snapshot *snapshots[GN_SCENE_SNAPSHOTS_MAX]; // [n], owned
};

int gn_motion_split_matrix(struct gn_scene_object *object, struct gn_error *out_error)
{
    const double *m = object->world_from_object;
    double unscaled[16];
    double inverse[16];
    double det = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                 m[2] * (m[4] * m[9] - m[5] * m[8]);
    if (!isfinite(det) || det == 0)
        return gn_error_set(out_error, -EINVAL, "world_from_object: singular matrix");
    if (det < 0)
        return gn_error_set(out_error, -EINVAL,
                            "world_from_object mirrors; a movable object's may turn, move and "
                            "scale: mirror the mesh");
    double scale = cbrt(det);
    memcpy(unscaled, m, sizeof(unscaled));
    for (int i = 0; i < 12; i++) {
        if (i % 4 != 3)
            unscaled[i] /= scale;
    }
    if (gn_pose_from_matrix(unscaled, &object->pose, NULL) < 0)
        return gn_error_set(out_error, -EINVAL,
                            "world_from_object stretches or shears by more than 10 %%; a movable "
                            "object's may turn, move, and scale alike in all directions");
    gn_pose_to_matrix(&object->pose, unscaled);
    if (!gn_mat4_invert(unscaled, inverse))
        return gn_error_set(out_error, -EINVAL, "world_from_object: singular matrix");
    gn_mat4_multiply(inverse, m, object->object_from_mesh);
    // What is left of the translation is rounding; it would not stay small where the pose does.
    for (int k = 0; k < 3; k++)
        object->object_from_mesh[4 * k + 3] = 0;
    return 0;
}

void gn_motion_place(struct gn_scene_object *object, const struct gn_pose *world_from_object)
{
    object->pose = *world_from_object;
    gn_pose_to_matrix(world_from_object, object->world_from_object);
    gn_mat4_multiply(object->world_from_object, object->object_from_mesh,
                     object->world_from_object);
    gn_scene_fill_normal_matrix(object);
}

int gn_motion_list_movable(struct gn_scene *scene, int n_objects, struct gn_error *out_error)
{
    int n = 0;
    for (int i = 0; i < n_objects; i++)
        n += scene->objects[i].is_movable;
    if (n == 0)
        return 0;
    scene->movable = malloc((size_t)n * sizeof(*scene->movable));
    if (!scene->movable)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    for (int i = 0; i < n_objects; i++) {
        const struct gn_scene_object *object = &scene->objects[i];
        if (!object->is_movable)
            continue;
        if (!object->name || !object->name[0] || strlen(object->name) > GN_SCENE_MAX_MOVABLE_NAME)
            return gn_error_set(out_error, -EINVAL,
                                "object %d: a movable object's name has 1 to %d bytes", i,
                                GN_SCENE_MAX_MOVABLE_NAME);
        if (gn_scene_is_emitter(object))
            return gn_error_set(out_error, -EINVAL,
                                "object %d (%s): a movable object cannot send light yet: leave "
                                "\"movable\" or its emission out",
                                i, object->name);
        for (int k = 0; k < n_objects; k++) {
            const char *other = scene->objects[k].name;
            if (k != i && other && strcmp(object->name, other) == 0)
                return gn_error_set(out_error, -EINVAL,
                                    "objects %d and %d are both named \"%s\" and poses could not "
                                    "tell which moves: give each its \"name\"",
                                    i < k ? i : k, i < k ? k : i, other);
        }
        scene->movable[scene->n_movable++] = i;
    }
    return 0;
}

int gn_scene_find_movable(const struct gn_scene *scene, const char *name)
{
    for (int i = 0; i < scene->n_movable; i++) {
        if (strcmp(scene->objects[scene->movable[i]].name, name) == 0)
            return i;
    }
    return -1;
}

int gn_motion_create(const struct gn_scene *scene, struct gn_motion **out_motion,
                     struct gn_error *out_error)
{
    *out_motion = calloc(1, sizeof(**out_motion));
    if (!*out_motion)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    (*out_motion)->scene = scene;
    return 0;
}

static void free_snapshot(struct gn_scene_snapshot *snapshot)
{
    gn_rt_destroy(&snapshot->scene.rt);
    free(snapshot->scene.objects);
    free(snapshot);
}

void gn_motion_destroy(struct gn_motion **motion)
{
    struct gn_motion *self = *motion;
    *motion = NULL;
    if (!self)
        return;
    for (int i = 0; i < self->n; i++) {
        assert(atomic_load(&self->snapshots[i]->references) == 0);
        free_snapshot(self->snapshots[i]);
    }
    free(self);
}

static int add_snapshot(struct gn_motion *motion, struct gn_error *out_error)
{
    const struct gn_scene *scene = motion->scene;
    struct gn_scene_snapshot *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->scene = *scene;
    s->scene.rt = NULL;
    s->scene.objects = malloc((size_t)scene->n_objects * sizeof(*scene->objects));
    int ret = s->scene.objects ? gn_rt_create_posed(scene->rt, &s->scene.rt, out_error)
                               : gn_error_set(out_error, -ENOMEM, "out of memory");
    if (ret < 0) {
        free_snapshot(s);
        return ret;
    }
    memcpy(s->scene.objects, scene->objects, (size_t)scene->n_objects * sizeof(*scene->objects));
    motion->snapshots[motion->n++] = s;
    return 0;
}

/** One that nobody holds; NULL: there is none. */
static struct gn_scene_snapshot *find_free(const struct gn_motion *motion)
{
    for (int i = 0; i < motion->n; i++) {
        // What its last holder read happened before this.
        if (atomic_load_explicit(&motion->snapshots[i]->references, memory_order_acquire) == 0)
            return motion->snapshots[i];
    }
    return NULL;
}

int gn_motion_make_snapshot(struct gn_motion *motion, const struct gn_pose *poses,
                            struct gn_scene_snapshot **out_snapshot, struct gn_error *out_error)
{
    *out_snapshot = NULL;
    struct gn_scene_snapshot *s = find_free(motion);
    if (!s && motion->n == GN_SCENE_SNAPSHOTS_MAX)
        return gn_error_set(out_error, -EBUSY, "all %d snapshots of the scene are in use",
                            GN_SCENE_SNAPSHOTS_MAX);
    int ret = s ? 0 : add_snapshot(motion, out_error);
    if (ret < 0)
        return ret;
    s = s ? s : motion->snapshots[motion->n - 1];
    ret = gn_rt_set_poses(s->scene.rt, poses, out_error);
    if (ret < 0)
        return ret;
    for (int i = 0; i < s->scene.n_movable; i++)
        gn_motion_place(&s->scene.objects[s->scene.movable[i]], &poses[i]);
    s->scene.version = ++motion->version;
    atomic_store_explicit(&s->references, 1, memory_order_relaxed);
    *out_snapshot = s;
    return 0;
}

const struct gn_scene *gn_scene_snapshot_get(const struct gn_scene_snapshot *snapshot)
{
    return &snapshot->scene;
}

struct gn_scene_snapshot *gn_scene_snapshot_ref(struct gn_scene_snapshot *snapshot)
{
    atomic_fetch_add_explicit(&snapshot->references, 1, memory_order_relaxed);
    return snapshot;
}

void gn_scene_snapshot_unref(struct gn_scene_snapshot **snapshot)
{
    struct gn_scene_snapshot *s = *snapshot;
    *snapshot = NULL;
    if (s)
        atomic_fetch_sub_explicit(&s->references, 1, memory_order_acq_rel);
}
