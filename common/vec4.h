/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Four floats side by side, and how three interleaved channels of four texels become such. */
#ifndef GN_COMMON_VEC4_H
#define GN_COMMON_VEC4_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/** The language's operators work lane by lane. */
typedef float gn_vec4 __attribute__((vector_size(16)));
/** What comparing them gives: -1 or 0 in each lane. */
typedef int32_t gn_mask4 __attribute__((vector_size(16)));

static inline gn_vec4 gn_vec4_load(const float *at)
{
    gn_vec4 v;
    memcpy(&v, at, sizeof(v));
    return v;
}

static inline void gn_vec4_store(float *at, gn_vec4 v)
{
    memcpy(at, &v, sizeof(v));
}

/** Whether any lane is. */
static inline bool gn_mask4_has_any(gn_mask4 mask)
{
    return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
}

/** Four vectors [3] one after the other, as x, y and z. */
static inline void gn_vec4_split(const float *at, gn_vec4 out[static 3])
{
    gn_vec4 a = gn_vec4_load(at), b = gn_vec4_load(at + 4), c = gn_vec4_load(at + 8);
    gn_vec4 t = __builtin_shufflevector(a, b, 1, 2, 4, 5),
            u = __builtin_shufflevector(b, c, 2, 3, 5, 6);
    out[0] = __builtin_shufflevector(a, u, 0, 3, 4, 6);
    out[1] = __builtin_shufflevector(t, u, 0, 2, 5, 7);
    out[2] = __builtin_shufflevector(t, c, 1, 3, 4, 7);
}

#endif
