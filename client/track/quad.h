/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Squares as a camera sees them: places on them, light in the picture. Thread-safety: safe.
 */
#ifndef GN_CLIENT_TRACK_QUAD_H
#define GN_CLIENT_TRACK_QUAD_H

#include <stdbool.h>
#include <stdint.h>

/** A grey picture and what its codes mean. Borrowed pixels. */
struct gn_grey {
    const uint8_t *pixels; // [height][width]
    int width;
    int height;
    float linear[256]; // of each code
};

/** Picture position of (u, v) of a square with these corners, which are (0, 0), (1, 0), (1, 1) and
 * (0, 1) of it (Heckbert 1989, 2.2.3). */
void gn_quad_map(double corners_px[4][2], double u, double v, double out_px[static 2]);

/** The length of its shortest side, px. */
double gn_quad_get_side(double corners_px[4][2]);

/** The light in the middle of each of n x n cells of a square, from its first corner; false where
 * one lies at the picture's border. */
bool gn_quad_sample_cells(const struct gn_grey *grey, int n, double corners_px[4][2],
                          double *out_light);

/** Linear light at a picture position, between the centres of four pixels, which must exist. */
double gn_grey_sample(const struct gn_grey *grey, double x, double y);

#endif
