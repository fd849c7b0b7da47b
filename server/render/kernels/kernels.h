/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The renderer's hot loops over 16 lanes. One plain C source (lanes.c), compiled for several
 * processors; the fastest that this one runs is chosen. All give the same bits: no product is fused
 * with a sum, and each lane's sums have the lights' order.
 */
#ifndef GN_SERVER_RENDER_KERNELS_KERNELS_H
#define GN_SERVER_RENDER_KERNELS_KERNELS_H

#include <stdint.h>

#define GN_KERNEL_LANES 16

/** Boxes of 16 sets of unit directions, widened against rounding; an empty set's has no direction
 * in it, only 0. */
struct direction_boxes {
    _Alignas(64) float min[3][GN_KERNEL_LANES];
    _Alignas(64) float max[3][GN_KERNEL_LANES];
    _Alignas(64) float min_rises[3][GN_KERNEL_LANES]; // 1 / min where it is > 0, else huge
    _Alignas(64) float min_falls[3][GN_KERNEL_LANES]; // 1 / min where it is < 0, else -huge
    _Alignas(64) float max_rises[3][GN_KERNEL_LANES];
    _Alignas(64) float max_falls[3][GN_KERNEL_LANES];
};

/** Both normals of 16 surfaces, each [16]. */
struct gn_kernel_surfaces {
    const float *shading[3];
    const float *geometric[3];
};

/** Lights at 16 surfaces. */
struct gn_kernel_sum {
    struct gn_kernel_surfaces surfaces;
    int n;                      // lights
    const float *dir[3];        // [n] each, unit
    const float *irradiance[3]; // [n] each
    const uint16_t *mask;       // [n] bit i: lane i takes the light; NULL: all do
    int unweighted;             // true: no cosine, all lights above the horizon count alike
    int n_parts;                // lights' parts, that of each ends at ends[part]; 1: no weights
    const int *ends;
    const float *weights; // [n_parts][weights_stride]: of a part, first 16
    int weights_stride;
};

/** Two axes of 16 planes, each [16]. */
struct gn_kernel_planes {
    const float *axis[2][3];
    const float *offset[2];
};

/** Planes of 16 points across normals, each [16]. */
struct gn_kernel_horizons {
    const float *org[3];
    const float *normal[3];
};

/** 16 boxes, m; each [16]. */
struct gn_kernel_boxes {
    const float *min[3];
    const float *max[3];
};

struct gn_kernels {
    const char *name;
    /** Cosine of the shading normal and dir; 0 where either normal looks away. */
    void (*get_cosines)(const struct gn_kernel_surfaces *surfaces, const float dir[static 3],
                        float out[static GN_KERNEL_LANES]);
    /** Bit i: that is > 0. */
    unsigned (*get_lit)(const struct gn_kernel_surfaces *surfaces, const float dir[static 3]);
    /** Irradiance per channel, of the lights that the mask takes. */
    void (*sum_lights)(const struct gn_kernel_sum *sum, double out[static 3][16]);
    /** Bit i: unless all rays from the origin with a direction of box i surely miss the box. */
    unsigned (*meet)(const struct direction_boxes *boxes, const float min[static 3],
                     const float max[static 3]);
    /** Bit i: some of the points p[3][index[n]] is above the i-th plane by more than -slack. sign
     * -1: under it, by that. */
    unsigned (*get_above)(const struct gn_kernel_horizons *horizons, double sign,
                          const float *const p[static 3], const uint16_t *index, int n,
                          double slack);
    /** Row-major matrix m[9] times 16 vectors. */
    void (*turn)(const double m[static 9], const float *const from[static 3],
                 float *const to[static 3]);
    /** Bit i: unless all rays of direction dir (unit) from points of the box surely miss the i-th
     * box. No number is NaN, none of the boxes' is infinite. */
    unsigned (*meet_boxes)(const struct gn_kernel_boxes *boxes, const float min[static 3],
                           const float max[static 3], const float dir[static 3]);
    /** Bit i: unless axis . p + offset of all points p of the box is outside [0, side), by one of
     * the i-th plane's axes. */
    unsigned (*get_overlaps)(const struct gn_kernel_planes *planes, float side,
                             const float min[static 3], const float max[static 3]);
    /** axis . p + offset of 16 points, rounded towards 0; far outside [0, 64) anything there. */
    void (*get_cells)(const float axis[static 3], float offset, const float *const p[static 3],
                      int32_t out[static GN_KERNEL_LANES]);
};

/** The fastest for this processor. Thread-safety: safe. */
const struct gn_kernels *gn_kernels_get(void);
/** The i-th that this processor runs, the plain one first; NULL: there are no more. For tests. */
const struct gn_kernels *gn_kernels_get_at(int i);

#endif
