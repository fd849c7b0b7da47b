/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Rigid poses and 4x4 matrices in double. Names say the frames: world_from_camera maps a point in
 * camera coordinates to world coordinates. Matrices are row-major, double m[16], last row 0 0 0 1.
 * Axes of every frame: docs/frames.md. Thread-safety of all functions: safe.
 */
#ifndef GN_COMMON_POSE_H
#define GN_COMMON_POSE_H

#include <stdbool.h>

#include "proto/attr.h"

/** A rigid motion: unit quaternion w, x, y, z (Hamilton) and translation in metres. */
struct gn_pose {
    double rotation[4];    // w, x, y, z; unit
    double translation[3]; // m
};

/** m = the matrix of the pose. */
void gn_pose_to_matrix(const struct gn_pose *pose, double out_m[static 16]);

/**
 * The rigid motion nearest to m: its 3x3 part is replaced by its polar factor (by SVD), a
 * uniform scale within 10 % is dropped. Returns 0, or -EDOM and a reason (static string, may be
 * NULL) where m is not finite, mirrored (det < 0), singular or sheared (smallest singular value
 * < 0.9 of the largest), scaled by more than 10 %, or its last row is not 0 0 0 1.
 * *out_pose is untouched then: the last good pose stays. The quaternion has w >= 0.
 */
GN_MUST_USE int gn_pose_from_matrix(const double m[static 16], struct gn_pose *out_pose,
                                    const char **out_reason);

/**
 * Normalises the quaternion. -EDOM where it or the translation is not finite, or its norm is
 * outside [0.9, 1.1].
 */
GN_MUST_USE int gn_pose_normalize(struct gn_pose *pose);

/** out = a * b, i.e. first b, then a; out may alias a or b. */
void gn_pose_multiply(const struct gn_pose *a, const struct gn_pose *b, struct gn_pose *out);
/** out = the inverse motion; out may alias pose. */
void gn_pose_invert(const struct gn_pose *pose, struct gn_pose *out);
/**
 * The motion a share t in [0, 1] of the way from a to b: spherical interpolation along the shorter
 * arc (q and -q are one rotation), straight for the translation. out may alias a or b.
 */
void gn_pose_interpolate(const struct gn_pose *a, const struct gn_pose *b, double t,
                         struct gn_pose *out);
/** Rotates v by the pose's quaternion (no translation); out may alias v. */
void gn_pose_rotate(const struct gn_pose *pose, const double v[static 3], double out[static 3]);
/** Rotates and translates the point; out may alias p. */
void gn_pose_transform(const struct gn_pose *pose, const double p[static 3], double out[static 3]);

/** out = a * b for 4x4 row-major; out may alias a or b. */
void gn_mat4_multiply(const double a[static 16], const double b[static 16], double out[static 16]);
/** General affine inverse; false where |det| of the 3x3 part is not finite or zero. */
GN_MUST_USE bool gn_mat4_invert(const double m[static 16], double out[static 16]);
/** Point times affine matrix. */
void gn_mat4_transform_point(const double m[static 16], const double p[static 3],
                             double out[static 3]);
/** The identity. */
void gn_mat4_identity(double out_m[static 16]);

#endif
