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
#include "server/light/scratch.h"

/** How to draw. */
struct gn_map_sampling {
    int n_wanted;  // about so many samples, where power is 0
    double power;  // Y dOmega that each stands for, W/m^2; 0: the map's over n_wanted
    bool is_plain; // importance Y, not Y dOmega/dA: power is then of Y times a texel's mean dOmega
    bool is_relaxed;      // moved by the correction table
    const uint64_t *kept; // [n_kept] ids of samples of the last frame, rising; may be NULL: they go
    int n_kept;           // at 0.95 of their importance, others come at 1.05
};

/** Samples in the tiles' own order, in lists of the scratch. Thread-safety: unsafe. */
struct gn_map_samples {
    int n, capacity;
    uint32_t *texel; // [n] index into the map; many samples may share a bright one
    uint64_t *id;    // [n] of their tiles, below 2^62; the same in each map of the size
    double power;    // Y dOmega that each stands for
};

/**
 * Samples of the map with the importance Y dOmega/dA per unit of picture area, which makes each
 * stand for the same power. The wanted number is missed by a few percent, more below 64, and left
 * so. A moved sample stays in the light that it was accepted for: it is not moved to where less
 * than half of the importance is. A black map gives none. samples must be zeroed. Returns 0
 * or -ENOMEM.
 */
GN_MUST_USE int gn_map_samples_draw(const struct gn_radiance_map *map,
                                    const struct gn_map_sampling *sampling,
                                    struct gn_scratch *scratch, struct gn_map_samples *samples);

#endif
