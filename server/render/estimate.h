/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How far a frame's shadow is from the truth, found by asking the truth at a few pixels. The lights
 * are not looked at: whatever is wrong with them, or with the sums that the quality makes of them,
 * is in the estimate.
 *
 * At a pixel, two sets of random directions, independent of each other and drawn from the map in
 * proportion to its luminance, give two ratios R1, R2 of the reference's kind, each with the
 * texel-exact factor R as its mean (but for the ratio's bias, of the order of one over their
 * number). So with F the frame's factor the mean of (F - R1) (F - R2) is (F - R)^2: the noise of
 * the two sets cancels, where that of (F - R1)^2 would stay. Its mean over pixels spread through
 * the picture is the squared error.
 */
#ifndef GN_SERVER_RENDER_ESTIMATE_H
#define GN_SERVER_RENDER_ESTIMATE_H

#include "server/render/internal.h"

/** Directions of a set, a (0, 2)-net in base 2. */
#define ESTIMATE_SET 256
/** Sets; a pixel takes two of them. */
#define ESTIMATE_SETS 16
/** About so many pixels of a picture are asked. */
#define ESTIMATE_PIXELS 512
/** With fewer affected ones among them the error is not known. */
#define ESTIMATE_LEAST 16

/** One set's directions of a probe's map, of equal probability. */
struct estimate_set {
    _Alignas(64) float dir[3][ESTIMATE_SET];        // unit, world
    _Alignas(64) float irradiance[3][ESTIMATE_SET]; // at normal incidence, W/m^2; the sets' means
                                                    // add up to the map's
};

/** Memory that frames share. */
struct estimate {
    struct estimate_set sets[GN_PROBES_MAX][ESTIMATE_SETS];
    double *rows; // [capacity + 1] luminance of the rows above, owned
    int capacity;
};
void gn_estimate_finish(struct estimate *estimate);

/**
 * RMS error of the frame's shadow factor over the pixels and channels it affects: real ones where
 * the factor is, or should be, below 0.995 in a channel. < 0 where that is not known: no map, light
 * at finite places, or too few such pixels. Where the mean is less than its own standard error,
 * that error takes its place. After gn_tiles_render(). Same bits whatever the pool's size. Returns
 * 0 or -ENOMEM.
 */
GN_MUST_USE int gn_estimate_make(struct estimate *estimate, const struct frame *frame,
                                 struct gn_pool *pool, struct gn_render_report *report);

#endif
