/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Three-vectors in double for the rig, written apart from the server's mathematics.
 * Outputs may alias inputs except for vec_cross.
 */
#ifndef GN_TESTS_RIG_VEC_H
#define GN_TESTS_RIG_VEC_H

#include <math.h>

#define GN_RIG_PI 3.14159265358979323846

static inline double vec_dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void vec_cross(const double a[static 3], const double b[static 3],
                             double out[static 3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void vec_subtract(const double a[static 3], const double b[static 3],
                                double out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static inline void vec_scale(const double a[static 3], double s, double out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] * s;
}

static inline double vec_length(const double a[static 3])
{
    return sqrt(vec_dot(a, a));
}

static inline void vec_normalize(double a[static 3])
{
    vec_scale(a, 1 / vec_length(a), a);
}

/** out = m v for a row-major 3x3 matrix; out may not alias v. */
static inline void vec_transform(const double m[static 9], const double v[static 3],
                                 double out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = m[3 * k] * v[0] + m[3 * k + 1] * v[1] + m[3 * k + 2] * v[2];
}

#endif
