/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A scene: real and virtual objects with materials, read from scene.json, and their rays.
 */
#ifndef GN_SERVER_SCENE_SCENE_H
#define GN_SERVER_SCENE_SCENE_H

#include <stdbool.h>

#include "common/error.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "server/scene/material.h"
#include "server/scene/mesh.h"
#include "server/scene/rt.h"

/** Most objects a manifest may list. */
#define GN_SCENE_MAX_OBJECTS 4096
/** Most triangles of either role. */
#define GN_SCENE_MAX_TRIANGLES (1 << 27)

/** How real light reaches the scene (the paper's sections 3.2 and 3.1). */
enum gn_scene_model {
    GN_MODEL_LOCAL = 0,  // all light is distant
    GN_MODEL_GLOBAL = 1, // what probes see of the real objects starts at them
};

/** Most objects that send light. */
#define GN_SCENE_MAX_EMITTERS 512
/** Most lights of the scene's list. */
#define GN_SCENE_MAX_LIGHTS 1024
/** Largest emission, W/(sr m^2), and intensity, W/sr. */
#define GN_SCENE_MAX_EMISSION 1e12
/** Longest name of a movable object: a POSE has room for it. */
#define GN_SCENE_MAX_MOVABLE_NAME 63
/** Longest name of a stream. */
#define GN_SCENE_MAX_STREAM 63

/** One object. `mesh` in object coordinates. */
struct gn_scene_object {
    char *name;          // the mesh's file name or the manifest's "name"; owned
    enum gn_rt_set role; // GN_RT_REAL or GN_RT_VIRTUAL
    struct gn_material material;
    bool has_material; // false: the mesh's own materials or albedos, or diffuse 0.5
    /**
     * Radiance that it sends from its outside, W/(sr m^2), >= 0; diffuse objects only. With a
     * stream: what it sends while there is no picture. The outside is where triangles are seen
     * counter-clockwise in the mesh, also where the matrix mirrors.
     */
    float emission[3];
    char *emission_stream; // name of the pictures laid over the mesh's uvs; owned, may be NULL
    float emission_scale;  // W/(sr m^2) of a linear picture value of 1, > 0; with a stream
    double world_from_object[16]; // of the mesh's coordinates
    double normal_matrix[9]; // inverse transpose of the 3x3 part, row-major, for shading normals
    /**
     * A movable object (motion.h) stands at a pose that others may change; its mesh's scale stays
     * with it: world_from_object = pose object_from_mesh. Both are made from world_from_object.
     */
    bool is_movable;
    struct gn_pose pose;
    double object_from_mesh[16];
    struct gn_mesh mesh; // owned
};

/** A lamp of the scene's list: it sends alike all around. */
struct gn_scene_light {
    double position[3];  // m, world, each at most GN_RT_MAX_COORDINATE
    float intensity[3];  // W/sr, [0, GN_SCENE_MAX_EMISSION]
    float radius;        // m, of its sphere, >= 0: what is nearer to it hides none of it
    enum gn_rt_set role; // GN_RT_REAL: a lamp of the room; GN_RT_VIRTUAL: its light is added
};

/** Thread-safety: immutable after create. */
struct gn_scene {
    enum gn_scene_model model;
    int n_objects;
    struct gn_scene_object *objects; // [n_objects], owned; index = object id in rt
    struct gn_rt *rt;                // owned, committed
    int n_lights;
    struct gn_scene_light *lights; // [n_lights], owned
    int n_movable;
    int *movable;     // [n_movable], owned: indices of objects; in this order rt's movers
    uint64_t version; // of where they stand: 0 as in the manifest; each snapshot has its own
    int n_real_triangles;
    int n_virtual_triangles;
    unsigned real_materials; // bit 1 << type: some triangle is of it
    unsigned virtual_materials;
};

/**
 * Reads scene.json (docs/frames.md) and all meshes, and commits:
 *   {"objects": [{"mesh": "a.obj", "role": "virtual" or "real", "name": "a",
 *                 "material": {"type": "diffuse", "mirror", "glass" or "ggx",
 *                              "albedo": [r, g, b], "roughness": 0, "metallic": 0, "ior": 1.5,
 *                              "emission": [r, g, b], "emission_stream": "tv",
 *                              "emission_scale": 1},
 *                 "world_from_object": [16 numbers, row-major], "movable": false}],
 *    "lights": [{"type": "point", "position": [x, y, z], "intensity": [r, g, b], "radius": 0,
 *                "role": "real" or "virtual"}]}
 * Of an object only mesh and role must be there, of a light type, position and intensity. Paths are
 * relative to the file. Without a material, or with a diffuse one without albedo, the mesh's own
 * colours count, or 0.5; a mirror's albedo is 1 unless said. The matrix may scale, shear and
 * mirror; absent, it is the identity. A movable object needs a name of its own of at most
 * GN_SCENE_MAX_MOVABLE_NAME bytes, and its matrix may turn, move and scale alike in all directions;
 * it cannot send light, nor be real in the global model. An unknown key, role or material, a
 * missing mesh, a singular matrix, light that is negative or above GN_SCENE_MAX_EMISSION, a mesh
 * without uvs under a stream, a scene without objects is refused with the file, the place and what
 * would be right. Returns 0 or a negative errno.
 */
GN_MUST_USE int gn_scene_read_file(const char *path, struct gn_pool *pool,
                                   struct gn_scene **out_scene, struct gn_error *out_error);

/**
 * The same from objects in memory: takes the array and all in it on success (zeroed for the
 * caller); on failure it stays the caller's.
 */
GN_MUST_USE int gn_scene_create(struct gn_scene_object *objects, int n_objects,
                                struct gn_pool *pool, struct gn_scene **out_scene,
                                struct gn_error *out_error);

/** Replaces the lights of a scene that nobody uses yet; copies. 0, -EINVAL, -ENOMEM. */
GN_MUST_USE int gn_scene_set_lights(struct gn_scene *scene, const struct gn_scene_light *lights,
                                    int n_lights, struct gn_error *out_error);

/** Sets the model of a scene that nobody uses yet. 0, or -EINVAL: a real object is movable in the
 * global model. */
GN_MUST_USE int gn_scene_set_model(struct gn_scene *scene, enum gn_scene_model model,
                                   struct gn_error *out_error);

/** From world_from_object; for motion.c. */
void gn_scene_fill_normal_matrix(struct gn_scene_object *object);

/** NULL-safe; nulls *scene. */
void gn_scene_destroy(struct gn_scene **scene);

/** What the shading needs to know of a hit. */
struct gn_surface {
    float point[3];            // m, world
    float clearance;           // m, for gn_rt_offset_origin
    float normal_geometric[3]; // unit, the triangle's, turned to the side the ray came from
    /**
     * What light may come from: unit, to the geometric normal's side. Interpolated where the mesh
     * has normals, since it then stands for a smooth surface, which a mesh does not hide from light
     * that only its facet turns away from; else the geometric one.
     */
    float normal_horizon[3];
    float normal_shading[3]; // unit; the horizon's, or by a normal map
    float lift[3];           // m, from point to the smooth surface, outwards; 0 where there is none
    float albedo[3];
    float emission[3]; // W/(sr m^2), of the mesh file's material
    float roughness, metallic, ior;
    enum gn_material_type material;
    enum gn_rt_set role;
    uint32_t object;
    bool is_front; // seen from the mesh's outside, where it may send light
    float uv[2];   // the mesh's; 0 where it has none
};

/** Evaluates a hit of a ray with unit direction dir; pictures by their finest level. Thread-safety:
 * safe. */
void gn_scene_get_surface(const struct gn_scene *scene, const float dir[static 3],
                          const struct gn_rt_hit *hit, struct gn_surface *out_surface);
/** The same with pictures averaged over a footprint across the ray, m. */
void gn_scene_get_surface_filtered(const struct gn_scene *scene, const float dir[static 3],
                                   const struct gn_rt_hit *hit, float footprint,
                                   struct gn_surface *out_surface);

/** Where rays start that leave the surface to the side it is seen from. */
void gn_surface_get_origin(const struct gn_surface *surface, float out_org[static 3]);
/** Where rays start that go through the surface. */
void gn_surface_get_origin_behind(const struct gn_surface *surface, float out_org[static 3]);

#endif
