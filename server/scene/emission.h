/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Checks of what a scene's objects send. Used by scene.c.
 */
#ifndef GN_SERVER_SCENE_EMISSION_H
#define GN_SERVER_SCENE_EMISSION_H

#include "server/scene/scene.h"

/** True where the object sends light, or will once its stream has a picture. */
bool gn_scene_is_emitter(const struct gn_scene_object *object);

/**
 * Checks what an object sends; a mesh with a stream gets its uvs here where it has none and is a
 * parallelogram of two triangles: the first corner is the picture's bottom left, the next ones go
 * round counter-clockwise. Returns 0, -EINVAL or -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_scene_check_emission(struct gn_scene_object *object, int index,
                                        struct gn_error *out_error);

#endif
