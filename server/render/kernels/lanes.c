/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Compiled once for each processor, with GN_KERNELS its name: loops for the vectoriser. */
#include "server/render/kernels/kernels.h"

#include <string.h>

#define LANES GN_KERNEL_LANES
// As far outside the cells as a place is told.
#define FAR_CELL 1e6f
// A length; directions' inverses stop short of infinity.
#define FAR 1e28f
// m; a box's sides are no nearer to the origin, outwards, so that 0 times an inverse is none.
#define NEAR 1e-15f

#define NAME_OF_(x) #x
#define NAME_OF(x) NAME_OF_(x)
#define TABLE_(x) gn_kernels_##x
#define TABLE(x) TABLE_(x)

extern const struct gn_kernels TABLE(GN_KERNELS);

static inline float min2(float a, float b)
{
    return a < b ? a : b;
}

static inline float max2(float a, float b)
{
    return a > b ? a : b;
}

static unsigned pack(const int32_t flags[static LANES])
{
    int32_t mask = 0;
    for (int i = 0; i < LANES; i++)
        mask |= (flags[i] & 1) << i;
    return (unsigned)mask;
}

static void get_cosines(const struct gn_kernel_surfaces *surfaces, const float dir[static 3],
                        float out[static LANES])
{
    const float *const *s = surfaces->shading;
    const float *const *g = surfaces->geometric;
    for (int i = 0; i < LANES; i++) {
        float c = s[0][i] * dir[0] + s[1][i] * dir[1] + s[2][i] * dir[2];
        float d = g[0][i] * dir[0] + g[1][i] * dir[1] + g[2][i] * dir[2];
        c = d > 0 ? c : 0;
        out[i] = c > 0 ? c : 0;
    }
}

static unsigned get_lit(const struct gn_kernel_surfaces *surfaces, const float dir[static 3])
{
    float cosines[LANES];
    int32_t flags[LANES];
    get_cosines(surfaces, dir, cosines);
    for (int i = 0; i < LANES; i++)
        flags[i] = cosines[i] > 0;
    return pack(flags);
}

/** Weights of a light's irradiance in the lanes. */
static void weigh(const struct gn_kernel_sum *sum, int light, const float *weights,
                  float out[static LANES])
{
    const float dir[3] = {sum->dir[0][light], sum->dir[1][light], sum->dir[2][light]};
    int32_t hidden = sum->hidden[light];
    get_cosines(&sum->surfaces, dir, out);
    for (int i = 0; i < LANES && sum->unweighted; i++)
        out[i] = out[i] > 0 ? 1.0f : 0;
    for (int i = 0; i < LANES && hidden; i++)
        out[i] = hidden >> i & 1 ? 0 : out[i];
    for (int i = 0; i < LANES && weights; i++)
        out[i] *= weights[i];
}

static void sum_lights(const struct gn_kernel_sum *sum, double out_open[static 3][LANES],
                       double out_cut[static 3][LANES])
{
    memset(out_open, 0, 3 * LANES * sizeof(double));
    memset(out_cut, 0, 3 * LANES * sizeof(double));
    for (int l = 0, part = 0; l < sum->n; l++) {
        const float *weights = NULL;
        float w[LANES];
        double wide[LANES];
        if (sum->n_parts > 1) {
            while (l >= sum->ends[part])
                part++;
            weights = sum->weights + part * sum->weights_stride;
        }
        weigh(sum, l, weights, w);
        for (int i = 0; i < LANES; i++)
            wide[i] = w[i];
        for (int k = 0; k < 3; k++) {
            double irradiance = sum->irradiance[k][l];
            double *to = out_open[k];
            for (int i = 0; i < LANES; i++)
                to[i] += irradiance * wide[i];
        }
        int64_t cut = sum->cut[l];
        if (cut == 0)
            continue;
        for (int i = 0; i < LANES; i++)
            wide[i] = cut >> i & 1 ? wide[i] : 0;
        for (int k = 0; k < 3; k++) {
            double irradiance = sum->irradiance[k][l];
            double *to = out_cut[k];
            for (int i = 0; i < LANES; i++)
                to[i] += irradiance * wide[i];
        }
    }
}

static void keep_below(float t[static LANES], float side, const float inverse[static LANES])
{
    for (int i = 0; i < LANES; i++)
        t[i] = min2(t[i], side * inverse[i]);
}

static void keep_above(float t[static LANES], float side, const float inverse[static LANES])
{
    for (int i = 0; i < LANES; i++)
        t[i] = max2(t[i], side * inverse[i]);
}

/*
 * A ray from the origin with a direction of the box D = [a, b] meets the box [lo, hi] only if there
 * is a t > 0 with t a <= hi and t b >= lo on each axis: six bounds of t. Where hi >= 0 the first is
 * t <= hi / a for a > 0, else none; where hi < 0 it is t >= hi / a for a < 0, else there is no t.
 */
static unsigned meet(const struct direction_boxes *boxes, const float min[static 3],
                     const float max[static 3])
{
    float t0[LANES];
    float t1[LANES];
    int32_t flags[LANES];
    for (int i = 0; i < LANES; i++) {
        t0[i] = 0;
        t1[i] = FAR;
    }
    for (int k = 0; k < 3; k++) {
        float hi = max[k];
        float lo = min[k];
        if (hi >= 0)
            keep_below(t1, max2(hi, NEAR), boxes->min_rises[k]);
        else
            keep_above(t0, hi, boxes->min_falls[k]);
        if (lo <= 0)
            keep_below(t1, min2(lo, -NEAR), boxes->max_falls[k]);
        else
            keep_above(t0, lo, boxes->max_rises[k]);
    }
    for (int i = 0; i < LANES; i++)
        flags[i] = t0[i] <= t1[i] * (1 + 4e-6f);
    return pack(flags);
}

static void get_cells(const float axis[static 3], float offset, const float *const p[static 3],
                      int32_t out[static LANES])
{
    for (int i = 0; i < LANES; i++) {
        float x = axis[0] * p[0][i] + axis[1] * p[1][i] + axis[2] * p[2][i] + offset;
        x = x > -FAR_CELL ? x : -FAR_CELL;
        x = x < FAR_CELL ? x : FAR_CELL;
        out[i] = (int32_t)x;
    }
}

const struct gn_kernels TABLE(GN_KERNELS) = {
    .name = NAME_OF(GN_KERNELS),
    .get_cosines = get_cosines,
    .get_lit = get_lit,
    .sum_lights = sum_lights,
    .meet = meet,
    .get_cells = get_cells,
};
