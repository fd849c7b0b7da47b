/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Compact lights: spots of a map so small and so strong that they are better kept whole, as discs,
 * than cut into lights or put into harmonics: the sun, a bare bulb far away.
 */
#ifndef GN_SERVER_LIGHT_COMPACT_H
#define GN_SERVER_LIGHT_COMPACT_H

#include <stdint.h>

#include "proto/attr.h"
#include "server/light/radiance_map.h"

/** Most spots of a map. */
#define GN_COMPACT_MAX 16

/** All-zero is the default. */
struct gn_compact_options {
    double max_radius; // rad, (0, 0.5], default 1 degree: of the largest disc
    double min_share;  // of the map's and the fill's sum of Y dOmega, (0, 1], default 0.05
    int max_n;         // [1, GN_COMPACT_MAX], default GN_COMPACT_MAX
};

/** One spot: what its texels have above their background. */
struct gn_compact_light {
    double dir_world[3];   // unit, its energy's centroid
    double angular_radius; // rad, of the disc of even radiance that is as spread out
    double irradiance[3];  // RGB at normal incidence, W/m^2: sum of (L - background) dOmega, >= 0
    double energy;         // luminance of that
    double share;          // of the map's and the fill's sum of Y dOmega
    double solid_angle;    // sr, of its texels
    float background[3];   // radiance of the texels around it, at most its own mean
    int first, n;          // its texels in the list
};

/** The spots of a map, by falling energy. Thread-safety: unsafe. */
struct gn_compact_lights {
    int n;
    struct gn_compact_light light[GN_COMPACT_MAX];
    int n_texels;
    uint32_t *texel; // [n_texels] index into the map, by spot, owned
};

/**
 * Finds the spots: about the brightest texel, those within 2 max_radius of it and above a 64th of
 * it (or a 16th, a 4th, where that leaves a disc small enough). Needs one pass over the map, and
 * none where no texel is bright enough. options may be NULL; bad values are our bug (assert).
 * out_lights may be uninitialised; it is empty on failure. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_compact_find(const struct gn_radiance_map *map,
                                const struct gn_compact_options *options,
                                struct gn_compact_lights *out_lights);
void gn_compact_finish(struct gn_compact_lights *lights);

/**
 * What the spots leave: a map like the other but for the spots' texels, which have the background,
 * and for the figures' sums; both add up to the map per channel. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_compact_get_rest(const struct gn_compact_lights *lights,
                                    const struct gn_radiance_map *map, struct gn_pool *pool,
                                    struct gn_radiance_map **out_rest);

#endif
