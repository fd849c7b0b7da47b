/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Mesh files through Assimp. Assimp is not trusted: each count, index and number it returns is
 * checked here before it is used.
 */
#include "server/scene/mesh.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "common/pose.h"
#include "server/scene/mesh_import.h"

// Largest mesh file, bytes: Assimp reads it whole, and takes some ten times as much.
#define MAX_FILE_BYTES (1L << 30)
// Deepest nesting of nodes.
#define MAX_DEPTH 256
// Albedo of triangles without a material where others of the file have one.
#define DEFAULT_ALBEDO 0.5f

/** What one walk over the nodes counts, and the next one fills. */
struct importer {
    const char *path;
    const struct aiScene *scene;
    struct gn_error *error; // may be NULL
    bool has_normals;       // some mesh of the file has: all get them
    bool has_uvs;           // some mesh of the file has: all get them, 0 where they have none
    bool has_albedos;       // some mesh of the file has a material: all get albedos
    bool has_materials;     // glTF: instead of albedos
    bool has_tangents;      // glTF: some mesh of the file has
    long n_vertices;
    long n_triangles;
    struct gn_mesh *mesh; // NULL while counting
};

static bool has_suffix(const char *path, const char *suffix)
{
    size_t n = strlen(path);
    size_t m = strlen(suffix);
    return n > m && strcasecmp(path + n - m, suffix) == 0;
}

static int check_file(const char *path, struct gn_error *out_error)
{
    struct stat info;
    if (stat(path, &info) != 0)
        return gn_error_set(out_error, -errno, "%s: cannot read the mesh: %s", path,
                            strerror(errno));
    if (!S_ISREG(info.st_mode))
        return gn_error_set(out_error, -EINVAL, "%s: not a regular file", path);
    if (info.st_size > MAX_FILE_BYTES)
        return gn_error_set(out_error, -EFBIG, "%s: mesh file of %lld bytes; at most %ld are read",
                            path, (long long)info.st_size, MAX_FILE_BYTES);
    if (!has_suffix(path, ".obj") && !has_suffix(path, ".gltf") && !has_suffix(path, ".glb") &&
        !has_suffix(path, ".ply"))
        return gn_error_set(out_error, -EINVAL,
                            "%s: unknown kind of mesh file; .obj, .gltf, .glb and .ply are read",
                            path);
    return has_suffix(path, ".ply") ? gn_mesh_check_ply_header(path, out_error) : 0;
}

/** Only triangles are taken; points and lines are no surface. */
static bool is_triangle(const struct aiFace *face)
{
    return face->mNumIndices == 3 && face->mIndices;
}

/** A mesh without normals in a file with some: vertices of its own for each triangle, so that it
 * stays flat. */
static bool is_unshared(const struct importer *im, const struct aiMesh *part)
{
    return im->has_normals && !part->mNormals;
}

/** False where the part has no material but Assimp's own default. */
static bool get_albedo(const struct importer *im, const struct aiMesh *part, float out_albedo[3])
{
    const struct aiScene *scene = im->scene;
    if (part->mMaterialIndex >= scene->mNumMaterials || !scene->mMaterials ||
        !scene->mMaterials[part->mMaterialIndex])
        return false;
    const struct aiMaterial *material = scene->mMaterials[part->mMaterialIndex];
    struct aiString name;
    if (aiGetMaterialString(material, AI_MATKEY_NAME, &name) == AI_SUCCESS &&
        strcmp(name.data, AI_DEFAULT_MATERIAL_NAME) == 0)
        return false;
    struct aiColor4D color;
    if (aiGetMaterialColor(material, AI_MATKEY_COLOR_DIFFUSE, &color) != AI_SUCCESS)
        return false;
    out_albedo[0] = color.r;
    out_albedo[1] = color.g;
    out_albedo[2] = color.b;
    return true;
}

static int check_part(struct importer *im, unsigned index, const struct aiMesh **out_part)
{
    const struct aiScene *scene = im->scene;
    if (index >= scene->mNumMeshes || !scene->mMeshes || !scene->mMeshes[index])
        return gn_error_set(im->error, -EINVAL, "%s: a node names mesh %u of %u", im->path, index,
                            scene->mNumMeshes);
    const struct aiMesh *part = scene->mMeshes[index];
    if ((part->mNumVertices > 0 && !part->mVertices) || (part->mNumFaces > 0 && !part->mFaces))
        return gn_error_set(im->error, -EINVAL, "%s: mesh %u has no data", im->path, index);
    if (im->has_materials && part->mMaterialIndex >= scene->mNumMaterials)
        return gn_error_set(im->error, -EINVAL, "%s: mesh %u names material %u of %u", im->path,
                            index, part->mMaterialIndex, scene->mNumMaterials);
    *out_part = part;
    return 0;
}

static int count_part(struct importer *im, const struct aiMesh *part)
{
    long n_triangles = 0;
    for (unsigned i = 0; i < part->mNumFaces; i++)
        n_triangles += is_triangle(&part->mFaces[i]);
    im->n_triangles += n_triangles;
    im->n_vertices += is_unshared(im, part) ? 3 * n_triangles : (long)part->mNumVertices;
    if (im->n_triangles > GN_MESH_MAX_TRIANGLES || im->n_vertices > 3L * GN_MESH_MAX_TRIANGLES)
        return gn_error_set(im->error, -EFBIG,
                            "%s: too large: more than %d triangles, or three vertices for each",
                            im->path, GN_MESH_MAX_TRIANGLES);
    return 0;
}

static void transform_position(const double m[static 16], const struct aiVector3D *v, float out[3])
{
    double p[3] = {v->x, v->y, v->z};
    gn_mat4_transform_point(m, p, p);
    for (int k = 0; k < 3; k++)
        out[k] = (float)p[k];
}

/** Normals turn by the inverse transpose; of any length yet, even zero or not finite. */
static void transform_normal(const double inverse[static 16], const struct aiVector3D *v,
                             float out[3])
{
    double n[3];
    double sum = 0.0;
    for (int k = 0; k < 3; k++) {
        n[k] = inverse[k] * v->x + inverse[4 + k] * v->y + inverse[8 + k] * v->z;
        sum += n[k] * n[k];
    }
    double scale = 1.0 / sqrt(sum);
    for (int k = 0; k < 3; k++)
        out[k] = (float)(n[k] * scale);
}

static double dot3(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** The tangent turned with the mesh, unit, and the side of n x t on which the bitangent is; where
 * there is none, any tangent. */
static void fill_tangent(const struct aiMesh *part, unsigned index, const double m[static 16],
                         const float normal[static 3], float out[static 4])
{
    const double n[3] = {normal[0], normal[1], normal[2]};
    double t[3] = {0};
    double b[3] = {0};
    for (int k = 0; k < 3 && part->mTangents && part->mBitangents; k++) {
        const struct aiVector3D *v = &part->mTangents[index];
        const struct aiVector3D *w = &part->mBitangents[index];
        t[k] = m[4 * k] * v->x + m[4 * k + 1] * v->y + m[4 * k + 2] * v->z;
        b[k] = m[4 * k] * w->x + m[4 * k + 1] * w->y + m[4 * k + 2] * w->z;
    }
    const double cross[3] = {n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2],
                             n[0] * t[1] - n[1] * t[0]};
    double length = sqrt(dot3(t, t));
    bool ok = length > 0 && isfinite(length);
    for (int k = 0; k < 3; k++)
        out[k] = ok ? (float)(t[k] / length) : (float)(k == 0);
    out[3] = dot3(cross, b) < 0 ? -1.0f : 1.0f;
}

/** Appends a vertex of the part; its normal, too, where the file has them. */
static uint32_t add_vertex(struct importer *im, const struct aiMesh *part, unsigned index,
                           const double m[static 16], const double inverse[static 16])
{
    size_t at = 3 * (size_t)im->mesh->n_vertices;
    transform_position(m, &part->mVertices[index], im->mesh->positions + at);
    if (part->mNormals)
        transform_normal(inverse, &part->mNormals[index], im->mesh->normals + at);
    if (im->mesh->tangents)
        fill_tangent(part, index, m, im->mesh->normals + at,
                     im->mesh->tangents + 4 * (size_t)im->mesh->n_vertices);
    const struct aiVector3D *uvs = part->mTextureCoords[0];
    if (uvs && im->mesh->uvs) {
        im->mesh->uvs[2 * (size_t)im->mesh->n_vertices] = uvs[index].x;
        im->mesh->uvs[2 * (size_t)im->mesh->n_vertices + 1] = uvs[index].y;
    }
    return (uint32_t)im->mesh->n_vertices++;
}

static int fill_part(struct importer *im, const struct aiMesh *part, const double m[static 16],
                     const double inverse[static 16], bool is_mirrored)
{
    struct gn_mesh *mesh = im->mesh;
    bool unshared = is_unshared(im, part);
    uint32_t base = (uint32_t)mesh->n_vertices;
    for (unsigned i = 0; !unshared && i < part->mNumVertices; i++)
        add_vertex(im, part, i, m, inverse);
    float albedo[3] = {DEFAULT_ALBEDO, DEFAULT_ALBEDO, DEFAULT_ALBEDO};
    (void)get_albedo(im, part, albedo);
    for (unsigned i = 0; i < part->mNumFaces; i++) {
        const struct aiFace *face = &part->mFaces[i];
        if (!is_triangle(face))
            continue;
        uint32_t *triangle = mesh->triangles + 3 * (size_t)mesh->n_triangles;
        for (int k = 0; k < 3; k++) {
            // A mirror turns the winding round: turned back, so that outside stays outside.
            unsigned index = face->mIndices[is_mirrored ? 2 - k : k];
            if (index >= part->mNumVertices)
                return gn_error_set(im->error, -EINVAL, "%s: a triangle names vertex %u of %u",
                                    im->path, index, part->mNumVertices);
            triangle[k] = unshared ? add_vertex(im, part, index, m, inverse) : base + index;
        }
        if (mesh->albedos)
            memcpy(mesh->albedos + 3 * (size_t)mesh->n_triangles, albedo, sizeof(albedo));
        if (mesh->material)
            mesh->material[mesh->n_triangles] = (uint16_t)part->mMaterialIndex;
        mesh->n_triangles++;
    }
    return 0;
}

static void get_matrix(const struct aiMatrix4x4 *a, double out[static 16])
{
    const double m[16] = {a->a1, a->a2, a->a3, a->a4, a->b1, a->b2, a->b3, a->b4,
                          a->c1, a->c2, a->c3, a->c4, a->d1, a->d2, a->d3, a->d4};
    memcpy(out, m, sizeof(m));
}

static bool is_affine(const double m[static 16])
{
    for (int i = 0; i < 16; i++) {
        if (!isfinite(m[i]))
            return false;
    }
    return m[12] == 0.0 && m[13] == 0.0 && m[14] == 0.0 && m[15] == 1.0;
}

static double get_determinant(const double m[static 16])
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

static int walk_node(struct importer *im, const struct aiNode *node, const double parent[static 16],
                     int depth)
{
    if (depth > MAX_DEPTH)
        return gn_error_set(im->error, -EINVAL, "%s: nodes nested deeper than %d", im->path,
                            MAX_DEPTH);
    if (!node || (node->mNumMeshes > 0 && !node->mMeshes) ||
        (node->mNumChildren > 0 && !node->mChildren))
        return gn_error_set(im->error, -EINVAL, "%s: a node has no data", im->path);
    double m[16];
    double inverse[16];
    get_matrix(&node->mTransformation, m);
    gn_mat4_multiply(parent, m, m);
    if (!is_affine(m) || (node->mNumMeshes > 0 && !gn_mat4_invert(m, inverse)))
        return gn_error_set(im->error, -EINVAL,
                            "%s: a node's transform is singular, projective or not finite",
                            im->path);
    for (unsigned i = 0; i < node->mNumMeshes; i++) {
        const struct aiMesh *part = NULL;
        int ret = check_part(im, node->mMeshes[i], &part);
        if (ret == 0)
            ret = im->mesh ? fill_part(im, part, m, inverse, get_determinant(m) < 0.0)
                           : count_part(im, part);
        if (ret < 0)
            return ret;
    }
    for (unsigned i = 0; i < node->mNumChildren; i++) {
        int ret = walk_node(im, node->mChildren[i], m, depth + 1);
        if (ret < 0)
            return ret;
    }
    return 0;
}

static int allocate(struct importer *im, struct gn_mesh *mesh)
{
    size_t n_vertices = (size_t)im->n_vertices;
    size_t n_triangles = (size_t)im->n_triangles;
    mesh->positions = calloc(n_vertices, 3 * sizeof(*mesh->positions));
    mesh->triangles = calloc(n_triangles, 3 * sizeof(*mesh->triangles));
    if (!mesh->positions || !mesh->triangles)
        return -ENOMEM;
    if (im->has_normals && !(mesh->normals = calloc(n_vertices, 3 * sizeof(*mesh->normals))))
        return -ENOMEM;
    if (im->has_uvs && !(mesh->uvs = calloc(n_vertices, 2 * sizeof(*mesh->uvs))))
        return -ENOMEM;
    if (im->has_tangents && !(mesh->tangents = calloc(n_vertices, 4 * sizeof(*mesh->tangents))))
        return -ENOMEM;
    if (im->has_materials && !(mesh->material = calloc(n_triangles, sizeof(*mesh->material))))
        return -ENOMEM;
    if (im->has_albedos && !(mesh->albedos = calloc(n_triangles, 3 * sizeof(*mesh->albedos))))
        return -ENOMEM;
    return 0;
}

/** What the meshes have between them, before anything is counted. */
static void find_attributes(struct importer *im)
{
    for (unsigned i = 0; im->scene->mMeshes && i < im->scene->mNumMeshes; i++) {
        const struct aiMesh *part = im->scene->mMeshes[i];
        float albedo[3];
        im->has_normals |= part && part->mNormals;
        im->has_uvs |= part && part->mTextureCoords[0];
        im->has_albedos |= part && !im->has_materials && get_albedo(im, part, albedo);
        im->has_tangents |=
            part && im->has_materials && part->mTangents && part->mBitangents && part->mNormals;
    }
}

static int import(struct importer *im, struct gn_mesh *mesh)
{
    double identity[16];
    gn_mat4_identity(identity);
    find_attributes(im);
    int ret = walk_node(im, im->scene->mRootNode, identity, 0);
    if (ret < 0)
        return ret;
    if (im->n_triangles == 0)
        return gn_error_set(im->error, -EINVAL, "%s: the mesh is empty: it has no triangle",
                            im->path);
    if (im->has_materials &&
        (ret = gn_mesh_read_materials(im->path, im->scene, mesh, im->error)) < 0)
        return ret;
    ret = allocate(im, mesh);
    if (ret < 0)
        return gn_error_set(im->error, ret, "%s: no memory for %ld triangles", im->path,
                            im->n_triangles);
    im->mesh = mesh;
    ret = walk_node(im, im->scene->mRootNode, identity, 0);
    if (ret == 0 && mesh->normals && (ret = gn_mesh_mend_normals(mesh)) < 0)
        return gn_error_set(im->error, ret, "%s: out of memory", im->path);
    if (ret < 0)
        return ret;
    struct gn_error reason = {0};
    ret = gn_mesh_check(mesh, NULL, &reason);
    if (ret < 0)
        return gn_error_set(im->error, ret, "%s: %s", im->path, reason.text);
    return 0;
}

int gn_mesh_read_file(const char *path, struct gn_mesh *out_mesh, struct gn_error *out_error)
{
    struct gn_mesh mesh = {0};
    int ret = check_file(path, out_error);
    if (ret < 0)
        return ret;
    bool is_gltf = has_suffix(path, ".gltf") || has_suffix(path, ".glb");
    const struct aiScene *scene = aiImportFile(
        path, aiProcess_ValidateDataStructure | aiProcess_Triangulate |
                  aiProcess_JoinIdenticalVertices | (is_gltf ? aiProcess_CalcTangentSpace : 0u));
    if (!scene)
        return gn_error_set(out_error, -EINVAL, "%s: cannot read the mesh: %s", path,
                            aiGetErrorString());
    struct importer im = {
        .path = path, .scene = scene, .error = out_error, .has_materials = is_gltf};
    ret = import(&im, &mesh);
    aiReleaseImport(scene);
    if (ret < 0) {
        gn_mesh_finish(&mesh);
        return ret;
    }
    *out_mesh = mesh;
    return 0;
}
