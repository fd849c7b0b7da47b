/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What depends on a stream's projection and orientation only, not on its pixels: where each texel
 * looks, how much of the sphere it covers. Made once, shared by all maps of the stream.
 */
#ifndef GN_SERVER_LIGHT_MAP_TABLE_H
#define GN_SERVER_LIGHT_MAP_TABLE_H

#include <stdint.h>

#include "common/pool.h"
#include "common/pose.h"
#include "common/projection.h"
#include "proto/attr.h"

/** Thread-safety: immutable after create but for the spare pixels, which are atomic; shared (ref).
 */
struct gn_map_table {
    _Atomic int references;
    struct gn_projection projection;
    double rotation[4];         // world_from_probe: quaternion w, x, y, z
    double world_from_probe[9]; // the same, row-major
    float *solid_angle;         // [height][width] sr, owned
    float *direction_probe;     // [height][width][3] unit, owned
    float *direction_world;     // [height][width][3] unit, owned
    int n_rim;                  // texels cut by the circle whose centres lie outside it
    uint32_t *rim;              // [n_rim][2]: such a texel, the inner one it takes its light of
    double shown_solid_angle;   // sr
    double fill_solid_angle;    // sr, of the directions not shown
    double fill_harmonics[25];  // integral over them of the basis of server/light/sh.h, order 4,
                                // probe axes
    double axis_world[3];       // optical axis; z of the frame of a whole sphere's picture
    _Atomic(float *) spare;     // pixels of a freed map, or NULL; taken by the next one
};

/**
 * The table of that projection and orientation: the previous one's reference where it fits (may be
 * NULL). projection must be inited. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_map_table_create(const struct gn_projection *projection,
                                    const double rotation[static 4], struct gn_map_table *previous,
                                    struct gn_pool *pool, struct gn_map_table **out_table);
struct gn_map_table *gn_map_table_ref(struct gn_map_table *table);
/** NULL-safe; nulls *table. */
void gn_map_table_unref(struct gn_map_table **table);

#endif
