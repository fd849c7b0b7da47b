/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The movable objects of a room's scene: of each the newest pose. A pose that was captured before
 * the one that is there changes nothing; where its tracker leaves, an object stays where it is.
 */
#ifndef GN_SERVER_ROOM_POSES_H
#define GN_SERVER_ROOM_POSES_H

#include "common/error.h"
#include "proto/attr.h"
#include "server/room/figures.h"
#include "server/scene/scene.h"

/** A pose may be captured so much later than now: clocks are only nearly the same. */
#define GN_POSES_AHEAD_NS INT64_C(1000000000)

/** One object. */
struct gn_pose_slot {
    int64_t time_ns, received_ns;    // of its newest pose, server's clock
    uint64_t session_id;             // who sent it
    uint64_t n_poses;                // taken
    struct gn_time_window intervals; // ms between capture times
};

/** All-zero: none. Thread-safety: unsafe, but for the scene. */
struct gn_poses {
    const struct gn_scene *scene; // borrowed
    struct gn_pose_slot *slots;   // [scene->n_movable], owned
    struct gn_pose *poses;        // [scene->n_movable], owned: where they stand
    uint64_t version;             // of poses; 0: as in the scene
};

/** What becomes of a pose. */
enum gn_pose_verdict { GN_POSE_TAKEN, GN_POSE_LATE };

/** The scene must outlive them. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_poses_init(struct gn_poses *poses, const struct gn_scene *scene);
/** NULL-safe inside; zeroes. */
void gn_poses_finish(struct gn_poses *poses);

/** Index of the object, or -ENOENT and a sentence that lists those there are. */
GN_MUST_USE int gn_poses_find(const struct gn_poses *poses, const char *name,
                              struct gn_error *out_error);
/** Takes a pose, captured at time_ns, unless the one there is as new. */
enum gn_pose_verdict gn_poses_put(struct gn_poses *poses, int index, const struct gn_pose *pose,
                                  int64_t time_ns, int64_t now_ns, uint64_t session_id);
/** Figures of objects [first, first + cap); returns how many. Rates are left to the caller:
 * out_intervals. */
int gn_poses_get_figures(const struct gn_poses *poses, int first, int cap,
                         struct gn_mover_figures *out_figures,
                         struct gn_time_window *out_intervals);

#endif
