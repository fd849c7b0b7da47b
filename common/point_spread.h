/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Layers as a camera with a blur sees them, strip by strip of a picture.
 *
 * A sharp picture is (1 - A)(s B + d) + V: virtual V and its coverage A, shadow factor s, added d,
 * background B. Where B varies little over the spread P,
 *   P * picture = (1 - P*A - P*L) P*B + P*G + P*V,  L = (1 - A)(1 - s),  G = (1 - A) d,
 * and P*B is what the camera delivered: it is not touched. So V, A, L and G are spread, each alone:
 * light that the object hides leaks nowhere, and where all are 0 the result is exactly 0.
 *
 * P is the discrete analogue of the Gaussian (Lindeberg, IEEE PAMI 12(3), 1990): of any deviation,
 * also below a pixel's side, its variance is exact. What lies outside the picture counts as its
 * border pixels.
 */
#ifndef GN_COMMON_POINT_SPREAD_H
#define GN_COMMON_POINT_SPREAD_H

#include "common/image.h"
#include "proto/attr.h"

/** Most pixels that a spread reaches. */
#define GN_SPREAD_MAX_RADIUS 40
/** What is spread: V and A; L; G. */
#define GN_SPREAD_PARTS 3

/** Weights of distances 0 to radius; w[0] + 2 (w[1] + ...) = 1. */
struct gn_spread_kernel {
    int radius; // 0: nothing is spread
    float weights[GN_SPREAD_MAX_RADIUS + 1];
};

/** deviation px [0, GN_MATCH_MAX_BLUR_PX]; less than 1e-4 of the weight is left out. */
void gn_spread_make_kernel(double deviation, struct gn_spread_kernel *out_kernel);

/** One worker's rows. Zeroed before its first use. Thread-safety: unsafe. */
struct gn_spread {
    int width, n_rows, radius;        // that memory is there for
    float *memory;                    // owned
    float *packed;                    // [width + 2 radius][4], one row before it is spread
    float *wide[GN_SPREAD_PARTS];     // [n_rows + 2 radius][width][channels], spread along rows
    float *row[GN_SPREAD_PARTS];      // [width][channels], spread both ways
    int (*spans)[GN_SPREAD_PARTS][2]; // [n_rows + 2 radius], owned; begin and end of what is not 0
};

/** Takes memory for strips of n_rows rows, if it is not there. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_spread_reserve(struct gn_spread *spread, int width, int n_rows, int radius);
/** Frees and zeroes. */
void gn_spread_finish(struct gn_spread *spread);

/** Spreads rows [y, y + n_rows) and what reaches into them along the rows. shadow and added may be
 * NULL: 1 and 0. All of one size, the width that was reserved. */
void gn_spread_load(struct gn_spread *spread, const struct gn_spread_kernel *kernel,
                    const struct gn_image *virtual_rgba, const struct gn_image *shadow,
                    const struct gn_image *added, int y, int n_rows);

/** Row i of the loaded strip into spread->row, of pixels [*out_begin, *out_end); the rest is 0 and
 * not written. */
void gn_spread_get_row(struct gn_spread *spread, const struct gn_spread_kernel *kernel, int i,
                       int *out_begin, int *out_end);

#endif
