/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Lights drawn from the whole map: few at a time, other ones each time, their expectation the
 * reference's own list. A texel is drawn by its share of the light, the mean over the channels of
 * share, so no channel is weighted by more than three. The shares are laid end to end along a
 * Hilbert curve over the picture and cut into as many strata as lights are wanted: one light of
 * each. A stratum's points follow Kronecker's golden-ratio sequence from draw to draw, which fills
 * it evenly at every length; each sequence begins somewhere else in each stratum.
 */
#ifndef GN_SERVER_RENDER_DRAW_H
#define GN_SERVER_RENDER_DRAW_H

#include "proto/attr.h"
#include "server/light/blend.h"

struct light_list;
struct places;

/** One probe's map. */
struct draw_map {
    const struct gn_radiance_map *map; // borrowed
    double total[3];                   // W/m^2, of texels and fill
    double luminance;                  // of the texels
    double fill_scale;                 // of the fill's cells; 0: no fill
    int n_squares;                     // of 16 x 16 texels
    int n_squares_x;
    int n_items;      // squares, then groups of the fill's cells
    int capacity;     // of what follows
    uint32_t *square; // [n_squares] in the curve's order, owned
    double *cdf;      // [n_items] rising sum of shares, owned
};

/** Zeroed: nothing made. Thread-safety: unsafe to make; then immutable. */
struct draw {
    int n; // maps
    struct draw_map maps[GN_PROBES_MAX];
};

/** Takes memory only where a map is larger than any before. O(texels). Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_draw_make(struct draw *draw, const struct gn_blend *blend);
void gn_draw_finish(struct draw *draw);
/**
 * Fills lists that have room for n and more: draw `index` of sequence `sequence`, about n lights in
 * all, those of a modelled surface in places. Light drawn twice is one light of twice the power.
 * list->total is the maps' own.
 */
void gn_draw_lights(const struct draw *draw, int sequence, int index, int n,
                    struct light_list *list, struct places *places);
/** In [0, 1), evenly and with no pattern, of two numbers. */
double gn_draw_hash(uint64_t a, uint64_t b);

#endif
