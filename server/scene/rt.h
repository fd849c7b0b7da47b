/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Rays against triangles. rt_embree.c is the only file of the project that names Embree.
 * Closed meshes are watertight, along shared edges too; only of the rays that aim at a vertex to
 * the last bit do some slip through (0.7 % of such in a sphere of 40,000 triangles). World
 * coordinates, metres. Two sets of geometry: real (only felt) and virtual (drawn); a ray asks one
 * set or both.
 */
#ifndef GN_SERVER_SCENE_RT_H
#define GN_SERVER_SCENE_RT_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "server/scene/mesh.h"

/** Which geometry a ray meets. */
enum gn_rt_set { GN_RT_REAL = 1, GN_RT_VIRTUAL = 2, GN_RT_ALL = 3 };

/** How many rays a packet holds. */
#define GN_RT_PACKET 16

/** A committed scene for rays. Thread-safety: immutable after gn_rt_commit; then rays are safe. */
struct gn_rt;

/** Largest coordinate a vertex may have in world, m. */
#define GN_RT_MAX_COORDINATE 1e11

/** Where a ray met a surface. */
struct gn_rt_hit {
    float distance;    // m, along the unit direction
    float point[3];    // m, world: on the triangle itself, more exact than org + distance dir
    float clearance;   // m, > 0: how far from point a new ray starts: gn_rt_offset_origin
    float normal[3];   // geometric, unit, of the triangle's winding (not turned to the ray), world
    float u, v;        // barycentric: p = (1-u-v) p0 + u p1 + v p2
    uint32_t object;   // the id given to gn_rt_add_mesh
    uint32_t triangle; // index in that mesh
};

/** n rays in structure-of-arrays form, all active lanes share nothing. Unused lanes: valid[i] = 0.
 */
struct gn_rt_packet {
    _Alignas(64) float org_x[GN_RT_PACKET];
    _Alignas(64) float org_y[GN_RT_PACKET];
    _Alignas(64) float org_z[GN_RT_PACKET];
    _Alignas(64) float dir_x[GN_RT_PACKET];
    _Alignas(64) float dir_y[GN_RT_PACKET];
    _Alignas(64) float dir_z[GN_RT_PACKET];
    _Alignas(64) float t_near[GN_RT_PACKET];  // m
    _Alignas(64) float t_far[GN_RT_PACKET];   // m; INFINITY for distant lights
    _Alignas(64) int32_t valid[GN_RT_PACKET]; // -1 traced, 0 not
};

/** Creates an empty scene. Returns 0, -ENOMEM, -EIO (the tracer could not start). */
GN_MUST_USE int gn_rt_create(struct gn_rt **out_rt, struct gn_error *out_error);
/** NULL-safe; nulls *rt. */
void gn_rt_destroy(struct gn_rt **rt);

/**
 * Adds a mesh to a set; vertices are transformed to world once. The mesh is copied. object is given
 * back in hits. Returns 0, -EINVAL (singular or non-finite matrix, already committed), -ENOMEM.
 */
GN_MUST_USE int gn_rt_add_mesh(struct gn_rt *rt, enum gn_rt_set set, uint32_t object,
                               const struct gn_mesh *mesh,
                               const double world_from_object[static 16],
                               struct gn_error *out_error);

/** Builds the trees; pool (may be NULL) helps. Returns 0 or -EIO. Nothing may be added after. */
GN_MUST_USE int gn_rt_commit(struct gn_rt *rt, struct gn_pool *pool, struct gn_error *out_error);

/** Axis-aligned bounds of a set in world m. False where the set is empty. */
bool gn_rt_get_bounds(const struct gn_rt *rt, enum gn_rt_set set, float out_min[static 3],
                      float out_max[static 3]);

/** The nearest hit in (t_near, t_far). dir unit. False: nothing, *out_hit untouched. */
bool gn_rt_intersect(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                     const float dir[static 3], float t_near, float t_far,
                     struct gn_rt_hit *out_hit);

/** True where anything lies in (t_near, t_far). dir unit. */
bool gn_rt_is_occluded(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                       const float dir[static 3], float t_near, float t_far);

/** Up to 16 occlusion rays at once; bit i of the result: lane i is valid and occluded. */
uint32_t gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                              const struct gn_rt_packet *packet);

/**
 * Moves a hit point off its surface, by the hit's clearance along the geometric normal, to the side
 * that `toward` points to: far enough that a new ray does not meet the same surface, not farther.
 *   clearance = 2^-23 (4 max|p| + 16 max|v_i - p|), |.| the largest coordinate
 * bounds what rounds: the point and the new origin (half an ulp of each coordinate, twice), and the
 * tracer's own v_i - origin and their products (a few ulp of the triangle's size). It holds no
 * constant length, so it fits a scene of any size anywhere. Steps that know only the point
 * (Waechter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing
 * Gems, 2019, chapter 6) avoid acne as well, but lift by 1/65536 m near the origin: 1.5 % of an
 * object of a millimetre. Checked by tests/numeric/rt_offset.c.
 */
void gn_rt_offset_origin(const float point[static 3], const float normal[static 3], float clearance,
                         const float toward[static 3], float out_org[static 3]);

#endif
