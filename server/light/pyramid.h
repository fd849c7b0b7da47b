/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A radiance map's means over ever larger parts of the sphere, for light that comes to a surface
 * out of a cone; and random directions by its luminance. Made only where glossy virtual materials
 * need it.
 */
#ifndef GN_SERVER_LIGHT_PYRAMID_H
#define GN_SERVER_LIGHT_PYRAMID_H

#include "server/light/radiance_map.h"

/** Most levels: a finest side of 512. */
#define GN_PYRAMID_MAX_LEVELS 10

/**
 * Squares of cells, each with the same solid angle 4 pi / side^2 (common/octahedral.h); the finest
 * holds about as many as the map has texels, a cell's radiance being the mean over the texels whose
 * centres lie in it; each next level the mean over four. Thread-safety: immutable after create;
 * shared (ref).
 */
struct gn_pyramid {
    _Atomic int references;
    int n_levels; // level l has side 1 << (n_levels - 1 - l); the last 1
    float (*levels[GN_PYRAMID_MAX_LEVELS])[3]; // [side][side], W/(sr m^2); one block, owned
};

/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_pyramid_create(const struct gn_radiance_map *map,
                                  struct gn_pyramid **out_pyramid);
struct gn_pyramid *gn_pyramid_ref(struct gn_pyramid *pyramid);
/** NULL-safe; nulls *pyramid. */
void gn_pyramid_unref(struct gn_pyramid **pyramid);

/**
 * Mean radiance over about solid_angle, sr, around a unit direction: between the two levels that,
 * bilinear in each, are next to that wide; below the finest between it and the map's own radiance,
 * which alone counts from a quarter of its width on.
 */
void gn_pyramid_get_radiance(const struct gn_pyramid *pyramid, const struct gn_radiance_map *map,
                             const float dir_world[static 3], double solid_angle,
                             float out_radiance[static 3]);

/** A unit direction with a density in proportion to the finest level's luminance, by u[2] in
 * [0, 1): quarter by quarter (Clarberg et al., "Wavelet Importance Sampling", SIGGRAPH 2005).
 * False: all is black. */
bool gn_pyramid_sample(const struct gn_pyramid *pyramid, const double u[static 2],
                       float out_dir_world[static 3]);
/** That density, 1/sr; 0 where all is black. */
double gn_pyramid_get_pdf(const struct gn_pyramid *pyramid, const float dir_world[static 3]);

#endif
