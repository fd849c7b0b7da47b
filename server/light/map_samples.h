/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Hierarchical importance samples of a radiance map: Penrose points on the square that holds its
 * picture, in the map's own projection.
 */
#ifndef GN_SERVER_LIGHT_MAP_SAMPLES_H
#define GN_SERVER_LIGHT_MAP_SAMPLES_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/attr.h"
#include "server/light/radiance_map.h"

/** Samples in the tiles' own order; a list grows as they come. Thread-safety: unsafe. */
struct gn_map_samples {
    int n, capacity;
    uint32_t *texel; // [n] index into the map; many samples may share a bright one; owned
};

/**
 * About n_wanted samples of the map with the importance Y dOmega/dA per unit of picture area
 * (is_plain: Y), which makes each stand for the same power. The count misses by a few percent, more
 * below 64, and is left so. A black map gives none. samples must be zeroed; finish frees.
 * Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_map_samples_draw(const struct gn_radiance_map *map, int n_wanted, bool is_plain,
                                    struct gn_map_samples *samples);
void gn_map_samples_finish(struct gn_map_samples *samples);

#endif
