/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Parts of scene.json that manifest.c leaves to others.
 */
#ifndef GN_SERVER_SCENE_MANIFEST_H
#define GN_SERVER_SCENE_MANIFEST_H

#include "common/json.h"
#include "server/scene/scene.h"

/** "material" of an object, which may be absent. 0 or a negative errno and a sentence; what was
 * read till then is the object's. */
GN_MUST_USE int gn_manifest_read_material(const struct gn_json *item,
                                          struct gn_scene_object *object,
                                          struct gn_error *out_error);

/** "emission", "emission_stream" and "emission_scale" of a material into the object. 0 or a
 * negative errno and a sentence; what was read till then is the object's. */
GN_MUST_USE int gn_manifest_read_emission(const struct gn_json *material,
                                          struct gn_scene_object *object,
                                          struct gn_error *out_error);

/** "lights" of the root, which may be absent: *out_lights is NULL or the caller's to free. */
GN_MUST_USE int gn_manifest_read_lights(const struct gn_json *root,
                                        struct gn_scene_light **out_lights, int *out_n_lights,
                                        struct gn_error *out_error);

#endif
