/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Near light in the passes: lamps and pieces of emissive meshes at finite positions. A light of the
 * room (real) belongs into the shadow's sums U and S; one of a virtual object adds to real
 * surfaces.
 */
#ifndef GN_SERVER_RENDER_NEAR_H
#define GN_SERVER_RENDER_NEAR_H

#include "server/light/blend.h"
#include "server/light/pieces.h"
#include "server/render/render.h"

struct frame;
struct sample;
struct scratch;
struct tile_figures;

/** Distances below this count as this, m: no light is infinite. */
#define NEAR_MIN_DISTANCE 1e-6
/** Rays end this share of their length before the light: it never shadows itself. */
#define NEAR_SHARE 4e-7

/** How one near light reaches a point. */
struct box;
struct near_ray {
    float dir[3];  // unit, to the light; 0: the point is where the light is
    float length;  // m, of the ray that must be free; 0: nothing is in the way
    double weight; // 1/m^2: irradiance at normal incidence = weight * intensity
};

/** The near lights of a frame and, for the reference, the pieces that they stand for. */
struct near_lights {
    int n;
    const struct gn_near_light *lights; // [n], borrowed
    int n_real, n_virtual;              // by role
    int n_placed;                       // the first ones: placed lights, each of a probe
    int ends[GN_PROBES_MAX];            // of each probe's placed lights
    // Reference only, where the state has an emission: its own, finer pieces.
    const struct gn_pieces *pieces; // NULL: none
    int first_piece;                // lights[first_piece + i] is of pieces[i]
    double *cdf;                    // [n] of luminance, rising to 1, for bounces
};

/** The light as seen from p; false where it gives nothing there. Not yet with the cosine there. */
bool gn_near_aim(const struct gn_near_light *light, const float p[static 3],
                 struct near_ray *out_ray);

/** Adds what emissive surfaces that the virtual samples show send themselves. */
void gn_near_add_emission(const struct frame *frame, struct sample *sample);
/** The same of a real surface: what no shadow dims, out_radiance[3]. */
void gn_near_get_emission(const struct frame *frame, const struct gn_surface *surface,
                          double out_radiance[static 3]);

/** Lights the virtual samples of scratch. */
void gn_near_shade(const struct frame *frame, struct scratch *scratch, int n,
                   struct tile_figures *figures);
/** Which near lights do virtual objects hide; sets is_cut. And what virtual lights add: gain. */
void gn_near_find_cut(const struct frame *frame, struct scratch *scratch,
                      struct tile_figures *figures);
/** Which do real objects hide from the wanted receivers. */
void gn_near_find_hidden(const struct frame *frame, struct scratch *scratch,
                         struct tile_figures *figures);
/** Adds to the sums open and cut of the wanted receivers. */
void gn_near_sum(const struct frame *frame, struct scratch *scratch, struct tile_figures *figures);

/** Can any near light change a real surface in the box? */
bool gn_near_can_cast(const struct frame *frame, const struct box *box);

/**
 * Global model: a state's light at a finite distance as a near light: a piece of a real surface
 * that sends by Lambert's law what the probe measured. As wide as the light's spread, so that it
 * is smooth near by.
 */
struct placed_lights {
    int n, limit;
    int ends[GN_PROBES_MAX];      // of each probe's
    struct gn_near_light *lights; // owned; GN_NEAR_LIGHTS_MAX, or NULL
};
/** Empties the list; room is left for the state's own near lights. 0 or -ENOMEM. */
GN_MUST_USE int gn_placed_reserve(struct placed_lights *placed, const struct gn_blend *blend);
/** False, and nothing is added, where the light is distant or the list is full. */
bool gn_placed_add(struct placed_lights *placed, const struct gn_lighting_state *state,
                   const struct gn_light *light, const double irradiance[static 3]);
/** Weight of near light l at the sample: its probe's, or 1. */
double gn_placed_get_weight(const struct frame *frame, const struct sample *sample, int l);

/** What the renderer keeps for the near lights of its frames. Thread-safety: unsafe. */
struct near_store {
    struct gn_emitters *fine;     // of the reference; made at its first frame
    struct gn_emission *emission; // what `fine` sends, shared
    double *cdf;
    int capacity;
    struct placed_lights placed; // and behind them the state's near lights
};
/** The state's near light for one frame; borrows state and store. 0, or -ENOMEM and the like. */
GN_MUST_USE int gn_near_prepare(struct near_store *store, const struct gn_scene *scene,
                                const struct gn_lighting_state *state, bool is_reference,
                                struct near_lights *out_near);
void gn_near_store_finish(struct near_store *store);

/* near_reference.c: exact irradiance of each piece, visibility to a random point of it. */

void gn_near_reference_shade(const struct frame *frame, struct sample *sample,
                             struct tile_figures *figures);
/** Does a virtual object hide any of the room's near light from it? */
bool gn_near_reference_is_cut(const struct frame *frame, const struct sample *sample,
                              struct tile_figures *figures);
/** Adds to U (sums[0]) and S (sums[1]); even: without the cosine at the receiver. */
void gn_near_reference_sum(const struct frame *frame, const struct sample *sample, bool even,
                           double sums[static 2][3], struct tile_figures *figures);
/** Adds what virtual lights send to a real sample to its gain. */
void gn_near_reference_gain(const struct frame *frame, struct sample *sample,
                            struct tile_figures *figures);
/** Irradiance of a receiver by one of the room's near lights, chosen by u [0, 1) and seen at a
 * point by `random`, over its probability: adds what real objects let through to sums[0], and what
 * of it virtual ones cut to sums[1]; 0 where the light chosen is a virtual one's. */
void gn_near_reference_ask(const struct frame *frame, const struct sample *sample, bool even,
                           double u, uint64_t random, double sums[static 2][3], uint64_t *rays);
/** Irradiance of a surface by one near light chosen by `random`, over its probability; the light's
 * role. For walks. */
void gn_near_reference_try(const struct frame *frame, const struct gn_surface *surface,
                           const float org[static 3], enum gn_rt_set set, uint64_t random,
                           double out_irradiance[static 3], enum gn_rt_set *out_role,
                           uint64_t *rays);

#endif
