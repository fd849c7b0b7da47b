/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Triangle meshes: what rt traces, and their files through Assimp (OBJ, glTF 2.0, PLY).
 * Coordinates are taken as the file has them.
 */
#ifndef GN_SERVER_SCENE_MESH_H
#define GN_SERVER_SCENE_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "proto/attr.h"
#include "server/scene/material.h"

/** Most triangles one mesh may have. */
#define GN_MESH_MAX_TRIANGLES (1 << 25)
/** Most materials and pictures of one mesh. */
#define GN_MESH_MAX_MATERIALS 4096
#define GN_MESH_MAX_TEXTURES 256
/** Most texels of one mesh's pictures together. */
#define GN_MESH_MAX_TEXELS (1L << 27)

/** An indexed triangle mesh in object coordinates, m. Caller's memory, our arrays (malloc). */
struct gn_mesh {
    int n_vertices;
    int n_triangles;
    float *positions;    // [n_vertices][3], finite
    float *normals;      // [n_vertices][3], unit; may be NULL: flat
    float *uvs;          // [n_vertices][2], v upwards, within 1e30; may be NULL: none
    uint32_t *triangles; // [n_triangles][3], each < n_vertices; counter-clockwise seen from outside
    float *albedos;      // [n_triangles][3], [0, 1]; may be NULL: the object's material
    // Of a glTF file; the object's own material comes before them, they before albedos.
    float *tangents; // [n_vertices][4], unit and the bitangent's sign; may be NULL: no normal maps
    int n_materials;
    struct gn_mesh_material *materials; // [n_materials]; may be NULL: none
    uint16_t *material;                 // [n_triangles], each < n_materials; NULL: no materials
    int n_textures;
    struct gn_texture *textures; // [n_textures]
    char *ignored;               // what the file asks for that is not done, one line; may be NULL
};

/** True where parts of triangles may be cut out by their material's alpha. */
bool gn_mesh_has_cutouts(const struct gn_mesh *mesh);
/** True where such a mesh is not there; u, v barycentric as of gn_rt_hit. Its base colour's alpha
 * by the picture's finest level. Thread-safety: safe. */
bool gn_mesh_is_cut_out(const struct gn_mesh *mesh, uint32_t triangle, float u, float v);

/** Frees the arrays and zeroes *mesh. */
void gn_mesh_finish(struct gn_mesh *mesh);

/**
 * Checks indices, finiteness and counts; drops triangles of zero area (counted in *out_dropped, may
 * be NULL). Returns 0 or -EINVAL and a sentence: an empty mesh is an error.
 */
GN_MUST_USE int gn_mesh_check(struct gn_mesh *mesh, int *out_dropped, struct gn_error *out_error);

/**
 * Reads all triangles of an OBJ, glTF 2.0 (.gltf, .glb) or PLY file into one mesh, polygons cut
 * into triangles, node transforms applied, points and lines left out. Normals are the file's own,
 * and where it has none the mesh is flat: nothing is smoothed by guess. Unusable normals (zero, not
 * finite) become the mean of their triangles'. Albedos are the materials' diffuse or base colours,
 * taken as linear Rec.709; NULL where the file has no material. Of glTF the materials are read as
 * its section 3.9 has them, with their pictures (PNG and JPEG, in the file or in its folder and
 * below), instead of albedos. Texture coordinates are kept (the first set; v = 0 is the picture's
 * bottom edge), vertex colours not read.
 * Returns 0 or a negative errno and a sentence naming the file: not finite, empty, too large, a
 * colour outside [0, 1], a picture outside the file's folder, a kind of file that is not read.
 */
GN_MUST_USE int gn_mesh_read_file(const char *path, struct gn_mesh *out_mesh,
                                  struct gn_error *out_error);

/** Writes Wavefront OBJ (positions, normals where present). Returns 0 or a negative errno. */
GN_MUST_USE int gn_mesh_write_obj(const struct gn_mesh *mesh, const char *path,
                                  struct gn_error *out_error);

#endif
