/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Products of vectors in double. Thread-safety: safe.
 */
#ifndef GN_COMMON_VEC3_H
#define GN_COMMON_VEC3_H

static inline double gn_vec3_dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** out: neither a nor b. */
static inline void gn_vec3_cross(const double a[static 3], const double b[static 3],
                                 double out[static 3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
