/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Caustics of virtual mirrors and glass on real surfaces, at reference quality, by photons.
 */
#ifndef GN_SERVER_RENDER_CAUSTICS_H
#define GN_SERVER_RENDER_CAUSTICS_H

#include "server/render/internal.h"

struct splat;

/** A ball about a virtual object that may throw caustics. */
struct caustic_target {
    uint32_t object;
    double center[3], radius; // m, world
};

/** What the renderer keeps for it. Zeroed at first. Thread-safety: unsafe. */
struct caustics {
    struct caustic_target *targets; // [n_targets] of the frame, owned
    int n_targets;
    struct splat *splats; // owned
    int *counts;          // [chunks of a round], owned
    uint64_t *rays;       // [chunks of a round], owned
    double *sums;         // [n_pixels][3], owned
    size_t n_pixels;
};
void gn_caustics_finish(struct caustics *caustics);

/** What is asked of the photons of one frame. */
struct photon_job {
    const struct frame *frame;
    const struct caustics *caustics;
    uint64_t n; // photons
    uint64_t first_chunk;
    double shift[3];
    double distant_share; // probability that a photon is the map's
    double squares;       // sum of the balls' radius^2, m^2
    double lamps;         // sum of the lamps' powers into the balls, W in luminance
};

struct photon {
    float org[3], dir[3];
    double flux[3]; // W
    struct gn_surface surface;
};

/* photons.c */

/** Lists the targets of the frame's scene, and what light may go there. */
void gn_photons_prepare(struct caustics *caustics, const struct frame *frame,
                        struct photon_job *out_job);
/** The start of photon i, aimed at an object; *out_light: of the map's, -1: a lamp's. False:
 * nothing is sent, or it is hidden from there. */
bool gn_photons_send(const struct photon_job *job, uint64_t i, struct photon *photon,
                     uint32_t *out_object, int *out_light, uint64_t *rays);

/* caustics.c */

/** Adds the caustics to the layer `added` of a frame that is done, and counts; nothing where the
 * plan leaves them out. The same bits whatever the pool's size. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_caustics_add(struct caustics *caustics, struct frame *frame,
                                struct gn_pool *pool);

#endif
