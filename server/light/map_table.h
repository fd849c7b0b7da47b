/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What depends on a stream's projection and orientation only, not on its pixels: where each texel
 * looks, how much of the sphere it covers. Made once, shared by all maps of the stream.
 */
#ifndef GN_SERVER_LIGHT_MAP_TABLE_H
#define GN_SERVER_LIGHT_MAP_TABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/pool.h"
#include "common/pose.h"
#include "common/projection.h"
#include "proto/attr.h"
#include "server/light/scratch.h"

struct gn_change_windows; // server/light/temporal_change.h
struct gn_radiance_map;   // server/light/radiance_map.h

/** Texels on a side of a block. */
#define GN_MAP_BLOCK 8
/** Freed maps that are kept: a frame makes one, and one more where small suns are taken out of it.
 */
#define GN_MAP_SPARES 2
/** Most patches along a map's side: squares of texels whose sums say where the light is. */
#define GN_MAP_PATCHES 48

/** Thread-safety: immutable after create but for what is spare, which is atomic; shared (ref). */
struct gn_map_table {
    _Atomic int references;
    struct gn_projection projection;
    double rotation[4];         // world_from_probe: quaternion w, x, y, z
    double world_from_probe[9]; // the same, row-major
    float *solid_angle;         // [height][width] sr, owned
    float *direction_probe;     // [height][width][3] unit, owned
    float *direction_world;     // [height][width][3] unit, owned
    float (*block)[4];          // [block rows][blocks of a row], owned: the middle of the world
                                // directions of GN_MAP_BLOCK^2 texels, and how far the farthest of
                                // them lies from it; below 0: none of them shows light
    int *span;                  // [height][2] first texel that shows light, one past the last
    float *gain;                // [height][width], owned: 1 / vignetting; NULL: 1
    const float *weight;        // [height][width] sr that a texel's light stands for: its own and
                                // that of the rim's texels that take it; 0 for those
    bool has_row_weights;       // weight is the same along each row
    float *up_weight;           // [height][width], owned: the same, each part times max(0, d .
                                // axis); NULL where nothing is filled
    float *own_weight;          // weight, where it is not solid_angle; owned
    int n_rim;                  // texels cut by the circle whose centres lie outside it
    uint32_t *rim;              // [n_rim][2]: such a texel, the inner one it takes its light of
    int patch_side;             // texels, of the map's GN_MAP_PATCHES^2 patches at most
    struct gn_change_windows *windows; // which patches lie in which window; owned
    double shown_solid_angle;          // sr
    double fill_solid_angle;           // sr, of the directions not shown
    double fill_harmonics[25]; // integral over them of the basis of server/light/sh.h, order 4,
                               // probe axes
    double axis_world[3];      // optical axis; z of the frame of a whole sphere's picture
    _Atomic(struct gn_radiance_map *) spare[GN_MAP_SPARES]; // freed maps, their pixels and rows, or
                                                            // NULL; taken by the next ones
    gn_scratch_place scratch;                               // working memory between frames
};

/**
 * The table of that projection and orientation: the previous one's reference where it fits (may be
 * NULL). projection must be inited. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_map_table_create(const struct gn_projection *projection,
                                    const double rotation[static 4], struct gn_map_table *previous,
                                    struct gn_pool *pool, struct gn_map_table **out_table);
/** Blocks along a side of so many texels. */
static inline int gn_map_table_get_blocks(int side)
{
    return (side + GN_MAP_BLOCK - 1) / GN_MAP_BLOCK;
}
/** Fills table->block; for server/light/map_table.c. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_map_table_bound_blocks(struct gn_map_table *table, struct gn_pool *pool);
struct gn_map_table *gn_map_table_ref(struct gn_map_table *table);
/** NULL-safe; nulls *table. */
void gn_map_table_unref(struct gn_map_table **table);

#endif
