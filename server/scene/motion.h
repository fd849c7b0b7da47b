/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Objects that move: rigid poses of a scene's movable objects make snapshots of it. A snapshot is
 * a scene like any, which shares all but the places of its movable objects with the scene it was
 * made of; it is immutable while anybody holds it. A few are made and used again and again, so that
 * one can be prepared while another is rendered, and no memory is taken once they are there.
 */
#ifndef GN_SERVER_SCENE_MOTION_H
#define GN_SERVER_SCENE_MOTION_H

#include "server/scene/scene.h"

/** Most snapshots of a scene that are held at one time. */
#define GN_SCENE_SNAPSHOTS_MAX 4

/** Shared (ref). */
struct gn_scene_snapshot;
/** Thread-safety: one thread makes snapshots; any holds them. */
struct gn_motion;

/** scene is borrowed until destroy. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_motion_create(const struct gn_scene *scene, struct gn_motion **out_motion,
                                 struct gn_error *out_error);
/** Nobody may hold a snapshot any more. NULL-safe; nulls *motion. */
void gn_motion_destroy(struct gn_motion **motion);

/**
 * A snapshot with poses[i], world_from_object, of scene->movable[i]; unit quaternions. The
 * reference is the caller's. Costs O(movable objects), whatever their triangles. Returns 0, -EINVAL
 * and a sentence (a pose that rt does not take), -EBUSY (all snapshots are held), -ENOMEM, -EIO.
 */
GN_MUST_USE int gn_motion_make_snapshot(struct gn_motion *motion, const struct gn_pose *poses,
                                        struct gn_scene_snapshot **out_snapshot,
                                        struct gn_error *out_error);

/** The snapshot's scene, immutable, as long as the reference is held. */
const struct gn_scene *gn_scene_snapshot_get(const struct gn_scene_snapshot *snapshot);
/** Thread-safety: safe. */
struct gn_scene_snapshot *gn_scene_snapshot_ref(struct gn_scene_snapshot *snapshot);
/** NULL-safe; nulls *snapshot. Thread-safety: safe. */
void gn_scene_snapshot_unref(struct gn_scene_snapshot **snapshot);

/** Index i of scene->movable[i] of that name; -1: there is none. */
int gn_scene_find_movable(const struct gn_scene *scene, const char *name);

/** For gn_scene_create: splits a movable object's matrix into what stays with it and where it
 * stands. Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_motion_split_matrix(struct gn_scene_object *object, struct gn_error *out_error);
/** For gn_scene_create: lists the movable objects and checks their names. Returns 0, -EINVAL,
 * -ENOMEM. */
GN_MUST_USE int gn_motion_list_movable(struct gn_scene *scene, int n_objects,
                                       struct gn_error *out_error);
/** Places an object: world_from_object and its normal matrix. */
void gn_motion_place(struct gn_scene_object *object, const struct gn_pose *world_from_object);

#endif
