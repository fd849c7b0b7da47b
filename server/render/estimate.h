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
 * the picture is the squared error. Lamps and emissive meshes are in the sets by points of theirs,
 * drawn in proportion to their power for each pixel and set anew.
 */
#ifndef GN_SERVER_RENDER_ESTIMATE_H
#define GN_SERVER_RENDER_ESTIMATE_H

#include "server/render/internal.h"

/** Directions of a set, a (0, 2)-net in base 2. */
#define ESTIMATE_SET 256
/** Near lights that a pixel tries for each of its sets. */
#define ESTIMATE_NEAR 32
/** Sets; a pixel takes two of them. */
#define ESTIMATE_SETS 16
/** About so many pixels of a picture are asked. */
#define ESTIMATE_PIXELS 512
/** With fewer affected ones among them the error is not known. */
#define ESTIMATE_LEAST 16

struct near_lights;

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

/** Mixes all bits. Source: Steele et al., "Fast splittable pseudorandom number generators", 2014,
 * with the constants of Stafford's variant 13. */
uint64_t gn_estimate_mix(uint64_t x);
/** True where the probe's map can be drawn from: not in the global model, whose light starts at
 * finite places. */
bool gn_estimate_can_draw(const struct gn_radiance_map *map);
/** Fills the first n_sets of a probe, other ones for each part. *out_power: the map's luminance.
 * Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_estimate_draw(struct estimate *estimate, int part, int n_sets, int probe,
                                 const struct gn_radiance_map *map, double *out_power);

/**
 * RMS error of the frame's shadow factor over the pixels and channels it affects: real ones where
 * the factor is, or should be, below 0.995 in a channel. < 0 where that is not known: no light, the
 * global model, whose light starts at finite places, or too few such pixels. Where the mean is less
 * than its own standard error, that error takes its place. near: the reference's near lights, for
 * frames that need them. Adds the plan's line. After gn_tiles_render(). Same bits whatever the
 * pool's size. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_estimate_make(struct estimate *estimate, const struct frame *frame,
                                 const struct near_lights *near, struct gn_pool *pool,
                                 struct gn_render_report *report);
/** Does the frame need the reference's near lights for that? */
bool gn_estimate_needs_near(const struct frame *frame);

#endif
