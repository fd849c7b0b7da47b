/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Near light: a scene's lamps and emissive meshes as lights at finite positions. A mesh is divided
 * once into pieces that stay where they are; the picture streamed onto it changes their radiance.
 */
#ifndef GN_SERVER_LIGHT_EMITTERS_H
#define GN_SERVER_LIGHT_EMITTERS_H

#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"
#include "server/scene/scene.h"

/** Most near lights of a scene. */
#define GN_NEAR_LIGHTS_MAX 4096
/** Pieces of all emissive meshes together where nothing is asked for. */
#define GN_EMITTER_PIECES_DEFAULT 32
/** `object` of a light of the scene's list. */
#define GN_NEAR_NO_OBJECT UINT32_MAX

/**
 * A light at a finite position. It gives a surface at distance d, cosine c there,
 *   a piece of a mesh:  E = intensity c_light c / (d^2 + radius^2), nothing behind its normal;
 *   a lamp:             E = intensity c / max(d, radius)^2.
 */
struct gn_near_light {
    float position_world[3]; // m; of a piece: on the mesh, moved off it by its clearance
    float normal_world[3];   // unit: it sends in proportion to the cosine; 0: all around alike
    float intensity[3];      // W/sr along the normal, or all around
    float radius;            // m; piece: of the disc of equal area; lamp: of its sphere, 0: a point
    enum gn_rt_set role;     // GN_RT_REAL: light of the room; GN_RT_VIRTUAL: of a virtual object
    uint32_t object;         // the scene's emissive object, or GN_NEAR_NO_OBJECT
    uint64_t id;             // its own in the scene, > 0, the same from picture to picture
};

/** A streamed picture. Thread-safety: immutable; shared (ref). */
struct gn_emission_picture {
    _Atomic int references;
    struct gn_image image; // [h][w][3], linear Rec.709, >= 0, finite; row 0 is v = 1
};

/** What all emitters of a scene send at one time. Thread-safety: immutable after create; shared. */
struct gn_emission {
    _Atomic int references;
    int n_lights;
    struct gn_near_light *lights; // [n_lights], owned; the scene's lights, then pieces; dark ones
                                  // are there, too
    int n_objects;                // of the scene
    struct gn_emission_picture **pictures; // [n_objects], each shared; NULL: none, as most
};
struct gn_emission *gn_emission_ref(struct gn_emission *emission);
/** NULL-safe; nulls *emission. */
void gn_emission_unref(struct gn_emission **emission);

/**
 * Radiance that the surface sends from where it was hit, W/(sr m^2): 0 behind an emitter. The
 * picture is looked up bilinearly. emission may be NULL: the material's own.
 */
void gn_emission_get_radiance(const struct gn_emission *emission, const struct gn_scene *scene,
                              const struct gn_surface *surface, float out_radiance[static 3]);

/** Options; all-zero is the default. */
struct gn_emitter_options {
    int n_pieces; // of all emissive meshes together, [1, GN_NEAR_LIGHTS_MAX], default
                  // GN_EMITTER_PIECES_DEFAULT; a mesh that faces several ways has one for each of
                  // up to 6 in any case
};

struct gn_pieces; // server/light/pieces.h

/** The emitters of a scene and their pictures. Thread-safety: unsafe. */
struct gn_emitters;

/**
 * Divides the scene's emissive meshes. scene is borrowed until gn_emitters_destroy. A scene without
 * any light is fine: it has no near light. Returns 0, -EINVAL or -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_emitters_create(const struct gn_scene *scene,
                                   const struct gn_emitter_options *options,
                                   struct gn_emitters **out_emitters, struct gn_error *out_error);
/** NULL-safe; nulls *emitters. */
void gn_emitters_destroy(struct gn_emitters **emitters);

/** Streams that the scene names ("emission_stream"), in the order of their first object. */
int gn_emitters_get_stream_count(const struct gn_emitters *emitters);
/** The name of one; NULL where there is none of that index. Borrowed. */
const char *gn_emitters_get_stream_name(const struct gn_emitters *emitters, int stream);
/** The index of a stream, or -ENOENT. */
int gn_emitters_find_stream(const struct gn_emitters *emitters, const char *name);

/**
 * Lays a picture over all meshes of a stream; it is copied. linear_rgb[h][w][3] linear Rec.709; the
 * mesh sends emission_scale times it. NaN and negative values become 0, what is above 1e12 that.
 * Pieces take the exact mean over them of the picture's constant pixels, and send it from the
 * centroid of its luminance. NULL: no picture; the mesh sends its own emission again.
 * Returns 0, -EINVAL (no such stream, not 3 channels, empty), -ENOMEM: then all is as before.
 */
GN_MUST_USE int gn_emitters_set_picture(struct gn_emitters *emitters, int stream,
                                        const struct gn_image *linear_rgb,
                                        struct gn_error *out_error);

/** Lays the pictures of another division of the same scene over this one's meshes; shares them.
 * Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_emitters_take_pictures(struct gn_emitters *emitters,
                                          const struct gn_emission *from);

/** The pieces, in the order of the emission's lights after the scene's. Borrowed. */
const struct gn_pieces *gn_emitters_get_pieces(const struct gn_emitters *emitters);

/** What the emitters send now: the caller's reference, or NULL where the scene has no near light.
 */
struct gn_emission *gn_emitters_get_emission(const struct gn_emitters *emitters);

#endif
