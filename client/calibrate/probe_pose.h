/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where a probe is and how it looks, from markers at known places that it sees: the pose from which
 * their corners lie in the directions that were measured. Thread-safety: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_PROBE_POSE_H
#define GN_CLIENT_CALIBRATE_PROBE_POSE_H

#include <stdbool.h>

#include "common/error.h"
#include "common/pose.h"
#include "proto/attr.h"

#define GN_PROBE_POSE_MAX_SIGHTINGS 1024

/** Above these an answer is refused: rad. */
#define GN_PROBE_POSE_MAX_ERROR (0.5 / 57.29577951308232)
#define GN_PROBE_POSE_MAX_RMS (0.5 / 57.29577951308232)
/** The other pose that flat markers allow must fit worse by this difference of the sums of squares
 * in units of the corners' errors. */
#define GN_PROBE_POSE_MIN_MARGIN 25.0

/** A marker in a picture. */
struct gn_probe_sighting {
    double corners_world[4][3]; // m
    double dirs_probe[4][3];    // unit
    double error_rad;           // of each direction, on each of two axes; > 0
    int marker;                 // sightings of the same marker have the same
    double rms_rad;             // out: how far its corners are off, per axis
    bool is_used;               // out: false: it does not fit what the others say
};

struct gn_probe_pose {
    struct gn_pose world_from_probe;
    double rms_rad;   // of the used corners, per axis
    double error_rad; // standard deviation of the orientation about its worst axis
    double error_m;   // of the place along its worst axis
    double margin;    // by which the next best pose fits worse, see above; INFINITY: there is none
    int n_used;       // sightings
};

/**
 * Begins with both poses that each of up to 24 sightings allows by itself (IPPE, by OpenCV), brings
 * each to where most sightings agree (least squares with Cauchy's weights, narrowing), leaves out
 * sightings that are off by five times the rest, and ends with plain least squares by Gauss-Newton
 * and QR. Errors follow from the Jacobian and what the corners are off, but not less than
 * error_rad; pictures of one marker are taken to have that in common: more of them do not lower it.
 * n in [1, GN_PROBE_POSE_MAX_SIGHTINGS]. Returns 0; -EDOM and a sentence where sightings disagree,
 * two poses fit, or the answer is more uncertain than the bounds above (*out has the figures then,
 * too; n_used 0: none); -ENOSYS (no OpenCV), -ENOMEM.
 */
GN_MUST_USE int gn_probe_pose_fit(struct gn_probe_sighting *sightings, int n,
                                  struct gn_probe_pose *out, struct gn_error *out_error);

#endif
