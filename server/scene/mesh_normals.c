/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "server/scene/mesh_import.h"

/** Unit normal of a triangle times twice its area. */
static void get_area_normal(const struct gn_mesh *mesh, const uint32_t index[static 3],
                            double out[static 3])
{
    const float *a = mesh->positions + 3 * (size_t)index[0];
    double u[3];
    double v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = (double)mesh->positions[3 * (size_t)index[1] + (size_t)k] - a[k];
        v[k] = (double)mesh->positions[3 * (size_t)index[2] + (size_t)k] - a[k];
    }
    out[0] = u[1] * v[2] - u[2] * v[1];
    out[1] = u[2] * v[0] - u[0] * v[2];
    out[2] = u[0] * v[1] - u[1] * v[0];
}

static bool is_unit(const float n[static 3])
{
    float length = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    return fabsf(length - 1.0f) < 1e-4f;
}

int gn_mesh_mend_normals(struct gn_mesh *mesh)
{
    int n_bad = 0;
    for (int i = 0; i < mesh->n_vertices; i++)
        n_bad += !is_unit(mesh->normals + 3 * (size_t)i);
    if (n_bad == 0)
        return 0;
    double *sums = calloc((size_t)mesh->n_vertices, 3 * sizeof(*sums));
    if (!sums)
        return -ENOMEM;
    for (int i = 0; i < mesh->n_triangles; i++) {
        const uint32_t *triangle = mesh->triangles + 3 * (size_t)i;
        double normal[3];
        get_area_normal(mesh, triangle, normal);
        for (int k = 0; k < 9; k++)
            sums[3 * (size_t)triangle[k / 3] + (size_t)(k % 3)] += normal[k % 3];
    }
    for (int i = 0; i < mesh->n_vertices; i++) {
        float *n = mesh->normals + 3 * (size_t)i;
        if (is_unit(n))
            continue;
        const double *s = sums + 3 * (size_t)i;
        double length = sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
        bool ok = length > 0.0 && isfinite(length);
        for (int k = 0; k < 3; k++)
            n[k] = ok ? (float)(s[k] / length) : (float)(k == 2); // in no triangle of any area
    }
    free(sums);
    return 0;
}
