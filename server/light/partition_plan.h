/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The base division of a map: rings and sectors, which texels lie in which region, and the cells of
 * the directions that the map does not show. Depends on no pixel: shared by the frames of a stream.
 */
#ifndef GN_SERVER_LIGHT_PARTITION_PLAN_H
#define GN_SERVER_LIGHT_PARTITION_PLAN_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/attr.h"
#include "server/light/radiance_map.h"

/** How to divide. Compared byte by byte: zero it before use. */
struct gn_division {
    int rings;                    // of a hemisphere
    int sectors;                  // of each ring
    int dark_rings, dark_sectors; // of the coarser cells of dark regions and of the fill
    int is_equal_angle;           // rings of equal polar angle; else of equal solid angle
};

/** A part of the directions that the map does not show. */
struct gn_fill_cell {
    double solid_angle; // sr
    double toward[3];   // integral of the direction, world
};

/** Polar coordinates about the map's pole: a fisheye's optical axis, else the world's z. */
struct gn_polar_box {
    double low[2], high[2]; // theta in [0, pi], phi in [-pi, pi]
};

/** Most texels of a region's run. */
#define GN_REGION_RUN_MAX 16

/** n texels side by side in a row of the map. */
struct gn_texel_run {
    uint32_t texel, n;
};

/** Thread-safety: immutable after create; shared (ref). */
struct gn_partition_plan {
    _Atomic int references;
    struct gn_map_table *table; // shared (ref)
    struct gn_division division;
    double theta_max;               // rad, of what is divided
    int n_rings;                    // of it
    int n_regions;                  // n_rings * sectors
    int n_dark_cells;               // coarser cells of it
    double *solid_angle;            // [n_regions] sr shown, owned
    uint32_t *start;                // [n_regions + 1] into the following, owned
    struct gn_texel_run *run;       // by region: all texels that show something, owned
    float (*polar)[2];              // theta, phi of the same, their middles, owned
    int n_fill_cells;               // 0 where all is shown
    struct gn_fill_cell *fill_cell; // owned
};

/** The previous plan's reference where it fits (may be NULL), else a new one. 0 or -ENOMEM. */
GN_MUST_USE int gn_partition_plan_create(const struct gn_radiance_map *map,
                                         const struct gn_division *division,
                                         struct gn_partition_plan *previous,
                                         struct gn_partition_plan **out_plan);
struct gn_partition_plan *gn_partition_plan_ref(struct gn_partition_plan *plan);
/** NULL-safe; nulls *plan. */
void gn_partition_plan_unref(struct gn_partition_plan **plan);

/** theta, phi of a texel of the plan's map. */
void gn_partition_plan_get_polar(const struct gn_partition_plan *plan, uint32_t texel,
                                 double out_polar[static 2]);
/** The region of those polar coordinates. */
int gn_partition_plan_find_region(const struct gn_partition_plan *plan,
                                  const double polar[static 2]);
/** Its sides. */
void gn_partition_plan_get_box(const struct gn_partition_plan *plan, int region,
                               struct gn_polar_box *out_box);
/** The coarser cell it belongs to. */
int gn_partition_plan_get_dark_cell(const struct gn_partition_plan *plan, int region);
/** Polar coordinates of a unit world direction. */
void gn_partition_plan_get_world_polar(const struct gn_partition_plan *plan,
                                       const double dir_world[static 3],
                                       double out_polar[static 2]);

#endif
