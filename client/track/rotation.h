/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Rotations as vectors: axis times angle (the exponential map of SO(3)). Thread-safety: safe.
 */
#ifndef GN_CLIENT_TRACK_ROTATION_H
#define GN_CLIENT_TRACK_ROTATION_H

/** The unit quaternion of a rotation vector (rad). */
void gn_rotation_exp(const double vector[static 3], double out_q[static 4]);
/** The rotation vector of a unit quaternion, at most pi long; q and -q give the same. */
void gn_rotation_log(const double q[static 4], double out_vector[static 3]);
/** The rotation vector from a to b in a's own axes: log(a^-1 b). */
void gn_rotation_between(const double a[static 4], const double b[static 4],
                         double out_vector[static 3]);
/** The angle between two rotations, rad, [0, pi]. */
double gn_rotation_get_angle(const double a[static 4], const double b[static 4]);
/** q = q exp(vector), normalised. */
void gn_rotation_turn(double q[static 4], const double vector[static 3]);

#endif
