/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Sums over texels in a row of the map: each texel is read once, and whatever is made of whole runs
 * afterwards is made of their sums.
 */
#ifndef GN_SERVER_LIGHT_PATCH_RUN_H
#define GN_SERVER_LIGHT_PATCH_RUN_H

#include "server/light/lights.h"
#include "server/light/luminance.h"

/** What a run holds, in units of the map's light (gn_run_get_unit). */
struct gn_run_sum {
    float irradiance[3]; // of L dOmega
    float own_spread;    // of Y dOmega dOmega
    float toward[3];     // of Y dOmega d
    float n_lit;         // texels with light
};

/** Where a run's light starts, in maps with geometry. */
struct gn_run_place {
    float normal[3]; // of Y dOmega n
    float nearness;  // of Y dOmega / distance
};

/** Sums of the runs of a map. */
struct gn_run_sums {
    struct gn_run_sum *sum;     // [n]
    struct gn_run_place *place; // [n] of a map with geometry, else NULL
    double unit;
};

/** A power of 2 near the map's largest luminance: as sums are in such units, light of any scale
 * gives the same. */
double gn_run_get_unit(const struct gn_radiance_map *map);

/** Fills the sums of n runs from the first on, and adds them all to the patch, which gets no solid
 * angle. Sums are good to 1e-6. */
void gn_run_sums_fill(struct gn_run_sums *sums, const struct gn_radiance_map *map,
                      const struct gn_texel_run *runs, uint32_t first, uint32_t n,
                      struct gn_patch *patch);

/** Sums over runs, in the same units. Zeroed: none. */
struct gn_run_total {
    double irradiance[3], own_spread, toward[3], n_lit;
    double normal[3], nearness;
};

static inline void gn_run_total_add(struct gn_run_total *total, const struct gn_run_sums *sums,
                                    uint32_t run)
{
    const struct gn_run_sum *s = &sums->sum[run];
    for (int c = 0; c < 3; c++) {
        total->irradiance[c] += (double)s->irradiance[c];
        total->toward[c] += (double)s->toward[c];
    }
    total->own_spread += (double)s->own_spread;
    total->n_lit += (double)s->n_lit;
    if (!sums->place)
        return;
    total->nearness += (double)sums->place[run].nearness;
    for (int c = 0; c < 3; c++)
        total->normal[c] += (double)sums->place[run].normal[c];
}

/** Adds the total to the patch, but no solid angle. */
void gn_run_total_get(const struct gn_run_total *total, const struct gn_run_sums *sums,
                      struct gn_patch *patch);

/** Y dOmega of a run. */
static inline double gn_run_sums_get_energy(const struct gn_run_sums *sums, uint32_t run)
{
    return sums->unit * gn_luminance(sums->sum[run].irradiance);
}

#endif
