/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The light between several probes: each probe's light with a weight that depends on the lit point
 * alone: the inverse square of its distance from the probe, normalised (Shepard, "A two-dimensional
 * interpolation function for irregularly-spaced data", ACM National Conference 1968). Continuous
 * everywhere; at a probe's place exactly its own light.
 */
#ifndef GN_SERVER_LIGHT_BLEND_H
#define GN_SERVER_LIGHT_BLEND_H

#include "proto/attr.h"
#include "server/light/state.h"

/**
 * One state of n [1, GN_PROBES_MAX] probes' states, each without others: the first's light with the
 * rest as its others; its times and figures are those of states[newest]. Of one: that state itself.
 * The caller keeps its references; *out_state is a new one. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_lighting_state_join(struct gn_lighting_state *const *states, int n, int newest,
                                       struct gn_lighting_state **out_state);

/** A state and its others. Borrows the state. Thread-safety: immutable after init. */
struct gn_blend {
    int n; // [1, GN_PROBES_MAX]; the first is the state itself
    const struct gn_lighting_state *state[GN_PROBES_MAX];
    double position[GN_PROBES_MAX][3]; // m, world
};

void gn_blend_init(struct gn_blend *blend, const struct gn_lighting_state *state);
/** out_weights[n] >= 0, of sum 1, at a point in world. Probes in one place share evenly. */
void gn_blend_get_weights(const struct gn_blend *blend, const float point[static 3],
                          double out_weights[static GN_PROBES_MAX]);
/** Radiance[3] that reaches the point from a unit direction where nothing is in the way: of the
 * maps, weighted. One probe: its map's own bits. */
void gn_blend_get_radiance(const struct gn_blend *blend, const float point[static 3],
                           const float dir_world[static 3], float out_radiance[static 3]);
/** Radiance[3] that probes measured of a point on a modelled real surface (global model): of those
 * that see it, by their weights there. False, and nothing is written: none does. */
bool gn_blend_get_radiance_at(const struct gn_blend *blend, const float point[static 3],
                              float out_radiance[static 3]);

#endif
