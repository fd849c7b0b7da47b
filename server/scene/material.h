/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What surfaces are made of: scene.json's materials and those of mesh files.
 */
#ifndef GN_SERVER_SCENE_MATERIAL_H
#define GN_SERVER_SCENE_MATERIAL_H

#include "common/error.h"
#include "proto/attr.h"
#include "server/scene/texture.h"

enum gn_material_type {
    GN_MATERIAL_DIFFUSE = 0,
    GN_MATERIAL_MIRROR = 1,
    GN_MATERIAL_GLASS = 2, // a closed mesh of a clear dielectric
    GN_MATERIAL_GGX = 3,   // metal, or a diffuse base under a dielectric's surface
    GN_MATERIAL_TYPES
};

/** Index of refraction where none is given. */
#define GN_MATERIAL_DEFAULT_IOR 1.5f
/** Largest index of refraction; 1 is the smallest. */
#define GN_MATERIAL_MAX_IOR 4.0f

/** What an object is made of. */
struct gn_material {
    enum gn_material_type type;
    float albedo[3]; // [0, 1]; diffuse, mirror: reflectance; glass: share of what comes through
                     // that each passage of its surface leaves; ggx: the base colour
    float roughness; // ggx, glass: [0, 1], its square is alpha of the GGX distribution
    float metallic;  // ggx: [0, 1]
    float ior;       // ggx, glass: [1, GN_MATERIAL_MAX_IOR]; 0: GN_MATERIAL_DEFAULT_IOR
};

/**
 * A material of a mesh file, as glTF 2.0 has it (its section 3.9): each number is a factor on what
 * the picture holds. R, G, B of base colour and emissive are sRGB, all else linear; metallic is B
 * and roughness G of their picture.
 */
struct gn_mesh_material {
    struct gn_material factors;
    float alpha;        // [0, 1]
    float alpha_cutoff; // where alpha is less, nothing is there; 0: everywhere something is,
                        // above 1: nowhere
    float normal_scale; // of the normal map's x and y
    float emission[3];  // W/(sr m^2), [0, GN_SCENE_MAX_EMISSION]; from both sides
    struct gn_texture_slot base_color, metallic_roughness, normal, emissive;
};

/** Checks ranges and fills in the default ior. Returns 0, or -EINVAL and a sentence without
 * place. */
GN_MUST_USE int gn_material_check(struct gn_material *material, struct gn_error *out_error);
/** The same; pictures are not looked at. */
GN_MUST_USE int gn_mesh_material_check(struct gn_mesh_material *material,
                                       struct gn_error *out_error);

#endif
