/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The inside of rt, for the files rt_embree*.c only: they are the only ones that name Embree.
 * Geometry that never moves is in scenes of its own, so that tracing it costs the same whether
 * something moves or not; a mesh that moves has a tree of its own in its own coordinates, and an
 * instance of it in small scenes that are all that is built anew when a pose changes. A ray asks
 * first the one, then the other.
 */
#ifndef GN_SERVER_SCENE_RT_EMBREE_H
#define GN_SERVER_SCENE_RT_EMBREE_H

#ifdef GN_HAVE_EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "server/scene/rt.h"

struct rt_bounds {
    float min[3];
    float max[3];
};

/** Min > max. */
#define RT_BOUNDS_EMPTY                                                                            \
    ((struct rt_bounds){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}})

/** The triangles of one geometry; Embree's buffers, alive as long as the scenes. */
struct rt_mesh {
    uint32_t object;
    bool mirrored;             // the matrix turns the winding round
    bool is_thin;              // some triangle is 64 times as long as wide, or more
    const float *vertices;     // [][3] m; world, a mover's: its own coordinates
    const uint32_t *triangles; // [][3]
};

/** A mesh that moves, in coordinates about the middle of its box: small numbers, little rounding.
 */
struct rt_mover {
    enum gn_rt_set set;
    struct rt_mesh mesh;
    RTCScene scene;          // its own tree
    struct rt_bounds bounds; // of its vertices
    double middle[3];        // of its box in object coordinates, m: the origin of its own ones
    struct gn_pose pose;     // where it stands at first
};

/** Where a mover stands. */
struct rt_stand {
    float world_from_own[12]; // as Embree has it: columns x, y, z, translation
    float reach;              // m, the largest coordinate of its box in world
};

struct gn_rt {
    RTCDevice device;            // shared (ref)
    const struct gn_rt *source;  // whose meshes and movers these are; NULL: its own
    RTCScene scenes[3];          // what rests; index: set - 1; NULL: nothing (after commit)
    RTCScene moving[3];          // instances; NULL: nothing
    struct rt_bounds resting[3]; // bounds of what rests; min > max: empty
    struct rt_bounds bounds[3];  // of all
    int n_meshes;
    int capacity;
    struct rt_mesh *meshes; // [capacity]; index = geometry id in every scene
    int n_movers;
    int movers_capacity;
    struct rt_mover *movers; // [movers_capacity]; index = instance id in every scene
    struct rt_stand *stands; // [n_movers], owned
    RTCGeometry *instances;  // [n_movers], owned
    bool is_committed;
};

/** 0, or the errno of what went wrong in this thread's last Embree calls. */
GN_MUST_USE int gn_rt_check_device(RTCDevice device, const char *what, struct gn_error *out_error);
/** The process's one device; NULL: it could not start. */
RTCDevice gn_rt_acquire_device(void);
void gn_rt_release_device(void);
/** Widens bounds by more. */
void gn_rt_widen_bounds(struct rt_bounds *bounds, const struct rt_bounds *more);
/** Makes the instances of rt's movers where they stand at first. Returns 0, -ENOMEM, -EIO. */
GN_MUST_USE int gn_rt_make_instances(struct gn_rt *rt, struct gn_error *out_error);
/** Releases what gn_rt_make_instances made. */
void gn_rt_finish_instances(struct gn_rt *rt);

#endif
