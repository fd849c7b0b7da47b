/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What stands on the rig's table: meshes with their finishes, and their rays. World = marker frame,
 * m. The demo room has 814 triangles, as the test scene of the paper has (section 5.3).
 */
#ifndef GN_TESTS_RIG_ROOM_H
#define GN_TESTS_RIG_ROOM_H

#include <stdbool.h>

#include "common/error.h"
#include "common/pool.h"
#include "server/scene/mesh.h"
#include "server/scene/rt.h"
#include "tests/rig/emitters.h"
#include "tests/rig/gloss.h"

#define GN_RIG_MAX_OBJECTS 16
/** Triangles of the demo room, teapot included. */
#define GN_RIG_DEMO_TRIANGLES 814
/** Side of the marker's black square, m. */
#define GN_RIG_MARKER_SIDE 0.08

enum gn_rig_finish {
    GN_RIG_DIFFUSE = 0,
    GN_RIG_MIRROR, // albedo: reflectance
    GN_RIG_WOOD,   // diffuse, planks over x and y; albedo: their mean
    GN_RIG_MARKER, // diffuse, the marker printed on paper; albedo: its mean
    GN_RIG_GGX,    // gloss.h; albedo: the base colour
    GN_RIG_GLASS,  // a closed mesh of smooth glass; albedo: what a passage of its surface leaves
};

/** One object. Its matrix may turn, move and scale all axes alike, nothing else. */
struct gn_rig_object {
    const char *name; // static
    enum gn_rt_set role;
    enum gn_rig_finish finish;
    double albedo[3];                // unless the mesh has albedos
    double emission[3];              // W/(sr m^2), sent from its outside; diffuse objects only
    double roughness, metallic, ior; // of ggx and, the ior, of glass
    struct gn_rig_gloss *gloss;      // of ggx, from commit on; owned
    struct gn_mesh mesh;             // owned
    double world_from_object[16];
};

/** Thread-safety: immutable after gn_rig_room_commit. */
struct gn_rig_room {
    int n_objects;
    struct gn_rig_object objects[GN_RIG_MAX_OBJECTS];
    int n_lamps;
    struct gn_rig_lamp lamps[GN_RIG_MAX_LAMPS];
    struct gn_rig_emitters emitters; // of the objects, from commit on; owned
    struct gn_rt *rt;                // owned
};

/** A point on a surface, as the rig shades it. */
struct gn_rig_surface {
    double point[3];
    double clearance;           // m, the hit's
    double normal_geometric[3]; // turned to where the ray came from
    double normal_shading[3];   // interpolated, turned to the same side; light comes from above it
    double lift[3];             // m, from the point to the smooth surface the normals tell of
    double albedo[3];
    double own_albedo[3]; // the tracer's: of ggx, before albedo became the diffuse base's
    double emission[3];   // to where the ray came from
    bool is_mirror;
    bool is_glass;
    bool is_front;                    // seen from outside
    double ior;                       // of glass
    const struct gn_rig_gloss *gloss; // of ggx; borrowed, else NULL
    bool is_virtual;
};

/** Takes the mesh in *object (zeroed for the caller). -ENOSPC where the room is full. */
GN_MUST_USE int gn_rig_room_add(struct gn_rig_room *room, struct gn_rig_object *object);
/** Builds the rays' trees. 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_rig_room_commit(struct gn_rig_room *room, struct gn_pool *pool,
                                   struct gn_error *out_error);
/** Frees all and zeroes *room. */
void gn_rig_room_finish(struct gn_rig_room *room);

/** The demo room, not yet committed; fine: with a smooth teapot instead of the coarse one. */
GN_MUST_USE int gn_rig_room_init_demo(bool fine, struct gn_rig_room *out_room,
                                      struct gn_error *out_error);
int gn_rig_room_count_triangles(const struct gn_rig_room *room);

/** What a ray along unit dir met. */
void gn_rig_room_get_surface(const struct gn_rig_room *room, const double dir[static 3],
                             const struct gn_rt_hit *hit, struct gn_rig_surface *out_surface);

/** Writes scene.json and one OBJ (with an MTL where it has several colours) per object into
 * directory. The floats are written so that they read back to the bit. */
GN_MUST_USE int gn_rig_room_write(const struct gn_rig_room *room, const char *directory,
                                  struct gn_error *out_error);

/** Albedo of the finish at a world point: the printed marker, the planks. */
void gn_rig_finish_get_albedo(enum gn_rig_finish finish, const double point[static 3],
                              double out_albedo[static 3]);

/** Published sRGB codes (X-Rite) of the chart's 24 patches, row by row from "dark skin"; decoded
 * they are the reflectances. */
extern const double gn_rig_colorchecker[24][3];

#endif
