/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/mesh.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Largest texture coordinate: what lies between two of them is finite.
#define MAX_UV 1e30

void gn_mesh_finish(struct gn_mesh *mesh)
{
    free(mesh->positions);
    free(mesh->normals);
    free(mesh->uvs);
    free(mesh->triangles);
    free(mesh->albedos);
    free(mesh->tangents);
    free(mesh->materials);
    free(mesh->material);
    for (int i = 0; i < mesh->n_textures; i++)
        gn_texture_finish(&mesh->textures[i]);
    free(mesh->textures);
    free(mesh->ignored);
    *mesh = (struct gn_mesh){0};
}

static bool are_finite(const float *values, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i]))
            return false;
    }
    return true;
}

static bool are_uvs(const float uv[static 2])
{
    return fabs((double)uv[0]) <= MAX_UV && fabs((double)uv[1]) <= MAX_UV;
}

static int check_vertices(const struct gn_mesh *mesh, struct gn_error *out_error)
{
    for (int i = 0; i < mesh->n_vertices; i++) {
        if (!are_finite(mesh->positions + 3 * (size_t)i, 3))
            return gn_error_set(out_error, -EINVAL, "vertex %d is not finite", i);
        if (mesh->uvs && !are_uvs(mesh->uvs + 2 * (size_t)i))
            return gn_error_set(out_error, -EINVAL,
                                "texture coordinates %d are not finite or beyond %g", i, MAX_UV);
        if (!mesh->normals)
            continue;
        const float *n = mesh->normals + 3 * (size_t)i;
        double length = sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]);
        if (!(fabs(length - 1.0) < 1e-3))
            return gn_error_set(out_error, -EINVAL, "normal %d has length %g; it must be 1", i,
                                length);
    }
    return 0;
}

static int check_tangents(const struct gn_mesh *mesh, struct gn_error *out_error)
{
    for (int i = 0; mesh->tangents && i < mesh->n_vertices; i++) {
        const float *t = mesh->tangents + 4 * (size_t)i;
        double length = sqrt((double)t[0] * t[0] + (double)t[1] * t[1] + (double)t[2] * t[2]);
        if (!(fabs(length - 1.0) < 1e-3) || (t[3] != 1.0f && t[3] != -1.0f))
            return gn_error_set(out_error, -EINVAL,
                                "tangent %d has length %g and sign %g; they must be 1 and 1 or -1",
                                i, length, (double)t[3]);
    }
    return 0;
}

static int check_materials(struct gn_mesh *mesh, struct gn_error *out_error)
{
    if (!mesh->material)
        return 0;
    if (!mesh->materials || mesh->n_materials < 1 || mesh->n_materials > GN_MESH_MAX_MATERIALS)
        return gn_error_set(out_error, -EINVAL, "%d materials; a mesh may have 1 to %d",
                            mesh->n_materials, GN_MESH_MAX_MATERIALS);
    for (int i = 0; i < mesh->n_materials; i++) {
        struct gn_error reason = {0};
        if (gn_mesh_material_check(&mesh->materials[i], &reason) < 0)
            return gn_error_set(out_error, -EINVAL, "material %d: %s", i, reason.text);
    }
    for (int i = 0; i < mesh->n_triangles; i++) {
        if (mesh->material[i] >= mesh->n_materials)
            return gn_error_set(out_error, -EINVAL, "triangle %d names material %d of %d", i,
                                mesh->material[i], mesh->n_materials);
    }
    return 0;
}

static int check_triangles(const struct gn_mesh *mesh, struct gn_error *out_error)
{
    for (int i = 0; i < mesh->n_triangles; i++) {
        for (int k = 0; k < 3; k++) {
            uint32_t index = mesh->triangles[3 * (size_t)i + (size_t)k];
            if (index >= (uint32_t)mesh->n_vertices)
                return gn_error_set(out_error, -EINVAL,
                                    "triangle %d names vertex %u, but there are only %d", i,
                                    (unsigned)index, mesh->n_vertices);
            if (!mesh->albedos)
                continue;
            float albedo = mesh->albedos[3 * (size_t)i + (size_t)k];
            if (!(albedo >= 0.0f && albedo <= 1.0f))
                return gn_error_set(out_error, -EINVAL,
                                    "triangle %d has albedo %g; it must lie in [0, 1]", i,
                                    (double)albedo);
        }
    }
    return 0;
}

/** True where the triangle spans no plane. Exact: differences of floats and the products' signs
 * survive in double. */
static bool is_degenerate(const struct gn_mesh *mesh, const uint32_t index[static 3])
{
    const float *a = mesh->positions + 3 * (size_t)index[0];
    const float *b = mesh->positions + 3 * (size_t)index[1];
    const float *c = mesh->positions + 3 * (size_t)index[2];
    double u[3];
    double v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = (double)b[k] - a[k];
        v[k] = (double)c[k] - a[k];
    }
    double x = u[1] * v[2] - u[2] * v[1];
    double y = u[2] * v[0] - u[0] * v[2];
    double z = u[0] * v[1] - u[1] * v[0];
    return x * x + y * y + z * z == 0.0;
}

static int drop_degenerate(struct gn_mesh *mesh)
{
    int kept = 0;
    for (int i = 0; i < mesh->n_triangles; i++) {
        const uint32_t *index = mesh->triangles + 3 * (size_t)i;
        if (is_degenerate(mesh, index))
            continue;
        memmove(mesh->triangles + 3 * (size_t)kept, index, 3 * sizeof(*index));
        if (mesh->albedos)
            memmove(mesh->albedos + 3 * (size_t)kept, mesh->albedos + 3 * (size_t)i,
                    3 * sizeof(float));
        if (mesh->material)
            mesh->material[kept] = mesh->material[i];
        kept++;
    }
    int dropped = mesh->n_triangles - kept;
    mesh->n_triangles = kept;
    return dropped;
}

int gn_mesh_check(struct gn_mesh *mesh, int *out_dropped, struct gn_error *out_error)
{
    if (mesh->n_triangles < 1 || mesh->n_vertices < 3 || !mesh->positions || !mesh->triangles)
        return gn_error_set(out_error, -EINVAL, "the mesh is empty: it has no triangle");
    if (mesh->n_triangles > GN_MESH_MAX_TRIANGLES)
        return gn_error_set(out_error, -EINVAL, "%d triangles; at most %d are taken",
                            mesh->n_triangles, GN_MESH_MAX_TRIANGLES);
    int ret = check_vertices(mesh, out_error);
    if (ret == 0)
        ret = check_triangles(mesh, out_error);
    if (ret == 0)
        ret = check_tangents(mesh, out_error);
    if (ret == 0)
        ret = check_materials(mesh, out_error);
    if (ret < 0)
        return ret;
    int dropped = drop_degenerate(mesh);
    if (mesh->n_triangles == 0)
        return gn_error_set(out_error, -EINVAL, "the mesh is empty: all %d triangles have no area",
                            dropped);
    if (out_dropped)
        *out_dropped = dropped;
    return 0;
}

static void print_obj(const struct gn_mesh *mesh, FILE *file)
{
    for (int i = 0; i < mesh->n_vertices; i++) {
        const float *p = mesh->positions + 3 * (size_t)i;
        fprintf(file, "v %.9g %.9g %.9g\n", (double)p[0], (double)p[1], (double)p[2]);
    }
    for (int i = 0; mesh->normals && i < mesh->n_vertices; i++) {
        const float *n = mesh->normals + 3 * (size_t)i;
        fprintf(file, "vn %.9g %.9g %.9g\n", (double)n[0], (double)n[1], (double)n[2]);
    }
    for (int i = 0; i < mesh->n_triangles; i++) {
        const uint32_t *t = mesh->triangles + 3 * (size_t)i;
        unsigned a = (unsigned)t[0] + 1;
        unsigned b = (unsigned)t[1] + 1;
        unsigned c = (unsigned)t[2] + 1;
        if (mesh->normals)
            fprintf(file, "f %u//%u %u//%u %u//%u\n", a, a, b, b, c, c);
        else
            fprintf(file, "f %u %u %u\n", a, b, c);
    }
}

int gn_mesh_write_obj(const struct gn_mesh *mesh, const char *path, struct gn_error *out_error)
{
    FILE *file = fopen(path, "we");
    if (!file)
        return gn_error_set(out_error, -errno, "%s: cannot write: %s", path, strerror(errno));
    print_obj(mesh, file);
    bool failed = ferror(file) != 0;
    if (fclose(file) != 0 || failed)
        return gn_error_set(out_error, -EIO, "%s: cannot write: disk full or taken away", path);
    return 0;
}
