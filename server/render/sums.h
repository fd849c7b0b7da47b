/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the passes of a progressive picture add up to. The passes are dealt out to REPLICATES
 * sequences that are independent of each other, each of which is evenly spread in itself; how far
 * the sequences' pictures lie apart says how far their mean is off. They are told apart at one
 * pixel of each cell, chosen without a pattern; everywhere else only the sum is kept.
 *
 * Sums are floats: at most 1024 terms of one sign, so a sum is off by at most 1024 x 2^-24 = 6e-5
 * of itself, a sixteenth of the error at which a picture counts as converged.
 */
#ifndef GN_SERVER_RENDER_SUMS_H
#define GN_SERVER_RENDER_SUMS_H

#include "server/render/render.h"

/** Independent sequences of passes. */
#define REPLICATES 4
/** Most passes that are summed. */
#define PASSES_MAX 1024

struct sample;

/** Of one pixel, of all its rays. */
struct pixel_sum {
    float base[3], lost[3], gain[3], radiance[3];
    float n_virtual; // rays that met a virtual object
};

/** Of a row of watched pixels. */
struct sums_row {
    double shadow, shadow_apart; // squares of: standard error; difference to the start
    double put, put_apart;
    double n_shadow, n_put, put_sum;
};

/** Zeroed: no memory. Thread-safety: unsafe but for gn_sums_add. */
struct sums {
    int width, height;
    int n_passes;
    struct pixel_sum *total; // [h][w], owned
    int cell;                // side of a cell, pixels
    int cells_x, cells_y;
    struct pixel_sum *watched; // [cells_y][cells_x][REPLICATES], owned
    struct sums_row *rows;     // [cells_y], owned
};

/** What the sums are worth. */
struct sums_error {
    double shadow; // of the factor times the real share of the pixel: standard error, RMS over
                   // pixels and channels that a shadow or its start changes
    double put;    // of virtual + added radiance, RMS over pixels that have some, over its mean
    double shadow_share; // [0, 1] of the sums in the best mean of sums and start; 1 - that: the
    double put_share;    // start's
};

/** Zeroes; takes memory only where the size is new. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_sums_begin(struct sums *sums, int width, int height);
void gn_sums_finish(struct sums *sums);
/** A sample of pass n_passes. Several threads may add samples of different pixels. */
void gn_sums_add(struct sums *sums, int x, int y, const struct sample *sample);
/** After a multiple of REPLICATES passes, at least 2 of each: how good the sums are, by themselves
 * and against the picture that was there at the start. */
void gn_sums_judge(struct sums *sums, const struct gn_layers *start, struct gn_pool *pool,
                   struct sums_error *out_error);
/** The picture: start + share (sums' - start). Depth stays. */
void gn_sums_resolve(const struct sums *sums, const struct gn_layers *start,
                     const struct sums_error *error, struct gn_pool *pool,
                     struct gn_layers *layers);

#endif
