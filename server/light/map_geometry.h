/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where the light of a map's texels starts: the points of the modelled real geometry that the probe
 * looks at (the global model). Depends on the probe's pose and projection and on the scene, not on
 * pixels: made once, shared by all maps of the stream.
 */
#ifndef GN_SERVER_LIGHT_MAP_GEOMETRY_H
#define GN_SERVER_LIGHT_MAP_GEOMETRY_H

#include <stdbool.h>

#include "common/pool.h"
#include "proto/attr.h"
#include "server/light/map_table.h"
#include "server/scene/scene.h"

/** Thread-safety: immutable after create; shared (ref). */
struct gn_map_geometry {
    _Atomic int references;
    const struct gn_scene *scene; // borrowed until destroyed; its real objects
    struct gn_map_table *table;   // shared (ref): whose texels
    double position[3];           // m, of the probe in world
    float *nearness;              // [height][width] 1/m, owned: 1 / distance from the probe of the
                                  // surface at the texel's centre; 0: none there
    float *normal;                // [height][width][3], owned: unit, of that surface, to the
                                  // probe's side; 0 where none
    int n_covered;                // texels with a surface
};

/**
 * The geometry of that table's texels: the previous one's reference where it fits (may be NULL).
 * Returns 0 or -ENOMEM. Same bits whatever the pool's size.
 */
GN_MUST_USE int gn_map_geometry_create(const struct gn_scene *scene, struct gn_map_table *table,
                                       const double position[static 3],
                                       struct gn_map_geometry *previous, struct gn_pool *pool,
                                       struct gn_map_geometry **out_geometry);
struct gn_map_geometry *gn_map_geometry_ref(struct gn_map_geometry *geometry);
/** NULL-safe; nulls *geometry. */
void gn_map_geometry_unref(struct gn_map_geometry **geometry);

/**
 * What the probe sees in a unit world direction: distance in m, INFINITY where no real surface is,
 * and that surface's normal (unit, to the probe's side; 0 where none).
 */
void gn_map_geometry_look(const struct gn_map_geometry *geometry, const float dir_world[static 3],
                          float *out_distance, float out_normal[static 3]);
/** True where no real surface lies between the probe and the point, which may be on one. *out_dir:
 * unit, from the probe to the point. */
bool gn_map_geometry_sees(const struct gn_map_geometry *geometry, const float point[static 3],
                          float out_dir[static 3]);

#endif
