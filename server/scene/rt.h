/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Rays against triangles. The files rt_embree* are the only ones of the project that name Embree.
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
#include "common/pose.h"
#include "proto/attr.h"
#include "server/scene/mesh.h"

/** Which geometry a ray meets. */
enum gn_rt_set { GN_RT_REAL = 1, GN_RT_VIRTUAL = 2, GN_RT_ALL = 3 };

/** How many rays a packet holds. */
#define GN_RT_PACKET 16

/**
 * A committed scene for rays. Thread-safety: immutable after gn_rt_commit (a posed one: between two
 * calls of gn_rt_set_poses); then rays are safe.
 */
struct gn_rt;

/** Largest coordinate a vertex may have in world, m. */
#define GN_RT_MAX_COORDINATE 1e11

/** Share of the largest coordinate of a mover's box by which rounding may move it; a bound. */
#define GN_RT_MOVED_ROUNDING (8 * 1.1920929e-7f)

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

/** What a packet's rays have met, as the tracer has it; the rest of a hit costs more than the ray.
 */
struct gn_rt_packet_hits {
    uint32_t met; // bit i: lane i is valid and has met something; other lanes say nothing
    float distance[GN_RT_PACKET];
    float u[GN_RT_PACKET], v[GN_RT_PACKET];
    uint32_t object[GN_RT_PACKET];
    uint32_t triangle[GN_RT_PACKET];
    uint32_t mesh[GN_RT_PACKET];  // rt's own number of the mesh,
    uint32_t mover[GN_RT_PACKET]; // or of what moves; UINT32_MAX: rests
};

/** Creates an empty scene. Returns 0, -ENOMEM, -EIO (the tracer could not start). */
GN_MUST_USE int gn_rt_create(struct gn_rt **out_rt, struct gn_error *out_error);
/** NULL-safe; nulls *rt. */
void gn_rt_destroy(struct gn_rt **rt);

/**
 * Adds a mesh to a set; vertices are transformed to world once. The mesh is copied; one with
 * cut-outs is also borrowed until gn_rt_destroy: rays pass where it is cut out. object is given
 * back in hits. Returns 0, -EINVAL (singular or non-finite matrix, already committed), -ENOMEM.
 */
GN_MUST_USE int gn_rt_add_mesh(struct gn_rt *rt, enum gn_rt_set set, uint32_t object,
                               const struct gn_mesh *mesh,
                               const double world_from_object[static 16],
                               struct gn_error *out_error);

/**
 * Adds a mesh that can move. object_from_mesh is what stays with it (scale), world_from_object
 * where it stands until a posed scene says otherwise. Movers are counted in the order they are
 * added. The rest as gn_rt_add_mesh.
 */
GN_MUST_USE int gn_rt_add_mover(struct gn_rt *rt, enum gn_rt_set set, uint32_t object,
                                const struct gn_mesh *mesh,
                                const double object_from_mesh[static 16],
                                const struct gn_pose *world_from_object,
                                struct gn_error *out_error);

/** Builds the trees; pool (may be NULL) helps. Returns 0, -ENOMEM, -EIO, -EINVAL (done already, or
 * a mover stands beyond GN_RT_MAX_COORDINATE). Nothing may be added after. */
GN_MUST_USE int gn_rt_commit(struct gn_rt *rt, struct gn_pool *pool, struct gn_error *out_error);

/**
 * A scene that shares everything with a committed one, which must outlive it, but where its movers
 * stand: at first as in the source. Costs O(movers), whatever their triangles. Destroyed like any.
 * Returns 0, -EINVAL, -ENOMEM, -EIO.
 */
GN_MUST_USE int gn_rt_create_posed(const struct gn_rt *source, struct gn_rt **out_rt,
                                   struct gn_error *out_error);

/**
 * Sets where all movers of a posed scene stand: poses[i] of the i-th, unit quaternions. Only while
 * nobody sends rays into it. Returns 0, -EINVAL (not a posed scene, beyond GN_RT_MAX_COORDINATE;
 * nothing moved), -EIO.
 */
GN_MUST_USE int gn_rt_set_poses(struct gn_rt *rt, const struct gn_pose *poses,
                                struct gn_error *out_error);

/** Axis-aligned bounds of a set in world m. False where the set is empty. */
bool gn_rt_get_bounds(const struct gn_rt *rt, enum gn_rt_set set, float out_min[static 3],
                      float out_max[static 3]);

/** The nearest hit in (t_near, t_far). dir unit. False: nothing, *out_hit untouched. */
bool gn_rt_intersect(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                     const float dir[static 3], float t_near, float t_far,
                     struct gn_rt_hit *out_hit);

/** The nearest hits of up to 16 rays at once. A hit's last bits may differ from those that
 * gn_rt_intersect finds. */
void gn_rt_intersect16(const struct gn_rt *rt, enum gn_rt_set set,
                       const struct gn_rt_packet *packet, struct gn_rt_packet_hits *out_hits);
/** All of one of them; lane is set in hits->met. */
void gn_rt_get_hit(const struct gn_rt *rt, const struct gn_rt_packet_hits *hits, int lane,
                   struct gn_rt_hit *out_hit);
/** Bounds of all their points, m, world; min > max: none. */
void gn_rt_bound_points(const struct gn_rt *rt, const struct gn_rt_packet_hits *hits,
                        float out_min[static 3], float out_max[static 3]);

/** True where anything lies in (t_near, t_far). dir unit. */
bool gn_rt_is_occluded(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                       const float dir[static 3], float t_near, float t_far);

/** Up to 16 occlusion rays at once; bit i of the result: lane i is valid and occluded. */
uint32_t gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                              const struct gn_rt_packet *packet);

/**
 * Moves a hit point off its surface, by the hit's clearance along the geometric normal, to the side
 * that `toward` points to: far enough that a new ray does not meet the same surface, not farther.
 *   clearance = 2^-23 (4 max|p| + 16 max|v_i - p| + 8 m), |.| the largest coordinate
 * bounds what rounds: the point and the new origin (half an ulp of each coordinate, twice), the
 * tracer's own v_i - origin and their products (a few ulp of the triangle's size), and for a mover,
 * m the largest coordinate of its box in world, the way into its own coordinates: two sums of three
 * products that are at most m each, and the rounded inverse (for what rests, m is 0). It holds no
 * constant length, so it fits a scene of any size anywhere. Steps that know only the point
 * (Waechter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing
 * Gems, 2019, chapter 6) avoid acne as well, but lift by 1/65536 m near the origin: 1.5 % of an
 * object of a millimetre. Checked by tests/numeric/rt_offset.c.
 */
void gn_rt_offset_origin(const float point[static 3], const float normal[static 3], float clearance,
                         const float toward[static 3], float out_org[static 3]);

#endif
