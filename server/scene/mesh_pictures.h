/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures that a glTF file names: in the file, or PNG and JPEG files in its folder or below. Names
 * and bytes are the file's: not trusted.
 */
#ifndef GN_SERVER_SCENE_MESH_PICTURES_H
#define GN_SERVER_SCENE_MESH_PICTURES_H

#include <stdbool.h>

#include "server/scene/mesh.h"

struct aiScene;
struct gn_known_picture;

/** One file's pictures while it is read. Set the first four, then init. */
struct gn_mesh_pictures {
    const char *path; // the mesh file's
    const struct aiScene *scene;
    struct gn_mesh *mesh;           // gets the textures
    struct gn_error *error;         // may be NULL
    char lost[200];                 // the first that cannot be read, and why; "": none
    struct gn_known_picture *known; // [GN_MESH_MAX_TEXTURES], owned: there already, or cannot be
    int n_known;
    long texels_left;
    bool is_refused; // one lies outside the folder, and the error says so
};

/** Returns 0 or -ENOMEM; finish it in any case. */
GN_MUST_USE int gn_mesh_pictures_init(struct gn_mesh_pictures *pictures);
/** The textures stay: they are the mesh's. */
void gn_mesh_pictures_finish(struct gn_mesh_pictures *pictures);

/**
 * The texture of that name, read where it is new; *out NULL: it cannot be read. Returns 0, or
 * -EINVAL (it lies outside the folder), -EFBIG (one too many), -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_mesh_pictures_get(struct gn_mesh_pictures *pictures, const char *name,
                                     bool is_srgb, const struct gn_texture **out);

#endif
