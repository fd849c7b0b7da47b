/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Parts of reading a mesh file that mesh_file.c leaves to others.
 */
#ifndef GN_SERVER_SCENE_MESH_IMPORT_H
#define GN_SERVER_SCENE_MESH_IMPORT_H

#include "server/scene/mesh.h"

struct aiScene;

/** Refuses PLY headers that Assimp reads for ever or takes all memory for: without end, with more
 * elements than the file has bytes, or with lists counted in 32 bits. 0 or a negative errno. */
GN_MUST_USE int gn_mesh_check_ply_header(const char *path, struct gn_error *out_error);

/** Where a normal of the file's is none (zero, not finite), the mean of the vertex's triangles.
 * Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_mesh_mend_normals(struct gn_mesh *mesh);

/**
 * glTF: the scene's materials and their pictures into *mesh, in the scene's order, and in
 * mesh->ignored what the file asks for that is not done, pictures that cannot be read among it.
 * Pictures are PNG or JPEG, in the file or in files in its folder or below. Returns 0, or a
 * negative errno and a sentence naming the file: a picture outside its folder, too many or too
 * large, a number out of range.
 */
GN_MUST_USE int gn_mesh_read_materials(const char *path, const struct aiScene *scene,
                                       struct gn_mesh *mesh, struct gn_error *out_error);

#endif
