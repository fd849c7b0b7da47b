/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Compiled once for each processor, with GN_KERNELS its name: loops for the vectoriser. */
#include "server/render/kernels/kernels.h"

#include <stdbool.h>
#include <string.h>

#define LANES GN_KERNEL_LANES
#define ALL_LANES ((1 << LANES) - 1)
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
static void weigh(const struct gn_kernel_sum *sum, int light, int mask, const float *weights,
                  float out[static LANES])
{
    const float dir[3] = {sum->dir[0][light], sum->dir[1][light], sum->dir[2][light]};
    get_cosines(&sum->surfaces, dir, out);
    for (int i = 0; i < LANES && sum->unweighted; i++)
        out[i] = out[i] > 0 ? 1.0f : 0;
    for (int i = 0; i < LANES && mask != ALL_LANES; i++)
        out[i] = mask >> i & 1 ? out[i] : 0;
    for (int i = 0; i < LANES && weights; i++)
        out[i] *= weights[i];
}

static void sum_lights(const struct gn_kernel_sum *sum, double out[static 3][LANES])
{
    memset(out, 0, 3 * LANES * sizeof(double));
    for (int l = 0, part = 0; l < sum->n; l++) {
        const float *weights = NULL;
        float w[LANES];
        double wide[LANES];
        int mask = sum->mask ? sum->mask[l] : ALL_LANES;
        if (mask == 0)
            continue;
        if (sum->n_parts > 1) {
            while (l >= sum->ends[part])
                part++;
            weights = sum->weights + part * sum->weights_stride;
        }
        weigh(sum, l, mask, weights, w);
        for (int i = 0; i < LANES; i++)
            wide[i] = w[i];
        for (int k = 0; k < 3; k++) {
            double irradiance = sum->irradiance[k][l];
            for (int i = 0; i < LANES; i++)
                out[k][i] += irradiance * wide[i];
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

/** The highest of n points over 8 planes, along normals. Vectors: of arrays, the loop over points
 * has to stay outside, where compilers make none of the lanes. */
static void get_highest(const struct gn_kernel_horizons *horizons, int first, double sign,
                        const float *const p[static 3], const uint16_t *index, int n,
                        double out[static 8])
{
    typedef double lanes __attribute__((vector_size(64)));
    typedef int64_t bits __attribute__((vector_size(64)));
    lanes normal[3];
    lanes base = {0};
    lanes highest = base - 1e300;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 8; i++) {
            normal[k][i] = sign * (double)horizons->normal[k][first + i];
            base[i] += normal[k][i] * (double)horizons->org[k][first + i];
        }
    }
    for (int j = 0; j < n; j++) {
        int v = index[j];
        lanes height = normal[0] * (double)p[0][v] + normal[1] * (double)p[1][v] +
                       normal[2] * (double)p[2][v] - base;
        bits is_higher = height > highest;
        highest = (lanes)(((bits)height & is_higher) | ((bits)highest & ~is_higher));
    }
    memcpy(out, &highest, sizeof(highest));
}

static unsigned get_above(const struct gn_kernel_horizons *horizons, double sign,
                          const float *const p[static 3], const uint16_t *index, int n,
                          double slack)
{
    double highest[LANES];
    int32_t flags[LANES];
    get_highest(horizons, 0, sign, p, index, n, highest);
    get_highest(horizons, 8, sign, p, index, n, highest + 8);
    for (int i = 0; i < LANES; i++)
        flags[i] = highest[i] > -slack;
    return pack(flags);
}

/** Slabs: a ray from p of one box meets another one where one from the origin meets that less p:
 * the union over all p is the box of differences. */
static unsigned meet_boxes(const struct gn_kernel_boxes *boxes, const float min[static 3],
                           const float max[static 3], const float dir[static 3])
{
    float t0[LANES];
    float t1[LANES];
    int32_t flags[LANES];
    for (int i = 0; i < LANES; i++) {
        t0[i] = 0;
        t1[i] = FAR;
        flags[i] = 1;
    }
    for (int k = 0; k < 3; k++) {
        bool is_across = dir[k] < 1e-12f && dir[k] > -1e-12f;
        float inverse = is_across ? 0 : 1.0f / dir[k];
        for (int i = 0; i < LANES; i++) {
            float lo = boxes->min[k][i] - max[k];
            float hi = boxes->max[k][i] - min[k];
            float a = lo * inverse;
            float b = hi * inverse;
            flags[i] &= is_across ? (lo <= 0) & (hi >= 0) : 1;
            t0[i] = is_across ? t0[i] : max2(t0[i], min2(a, b));
            t1[i] = is_across ? t1[i] : min2(t1[i], max2(a, b));
        }
    }
    // Rounding of the products: a few parts in 2^24; boxes are widened by far more (renderer.c).
    for (int i = 0; i < LANES; i++)
        flags[i] &= t0[i] <= t1[i] * (1 + 4e-6f);
    return pack(flags);
}

static void turn(const double m[static 9], const float *const from[static 3],
                 float *const to[static 3])
{
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < LANES; i++)
            to[k][i] = (float)(m[3 * k] * (double)from[0][i] + m[3 * k + 1] * (double)from[1][i] +
                               m[3 * k + 2] * (double)from[2][i]);
    }
}

static unsigned get_overlaps(const struct gn_kernel_planes *planes, float side,
                             const float min[static 3], const float max[static 3])
{
    int32_t flags[LANES];
    for (int i = 0; i < LANES; i++)
        flags[i] = 1;
    for (int j = 0; j < 2; j++) {
        const float *const *axis = planes->axis[j];
        for (int i = 0; i < LANES; i++) {
            float low = planes->offset[j][i];
            float high = low;
            for (int k = 0; k < 3; k++) {
                float a = axis[k][i] * min[k];
                float b = axis[k][i] * max[k];
                low += min2(a, b);
                high += max2(a, b);
            }
            flags[i] &= (high >= 0) & (low < side);
        }
    }
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
    .turn = turn,
    .get_above = get_above,
    .meet_boxes = meet_boxes,
    .get_overlaps = get_overlaps,
    .get_cells = get_cells,
};
