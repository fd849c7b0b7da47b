/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/meshes.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

static struct gn_mesh allocate(int n_vertices, int n_triangles, bool has_normals)
{
    struct gn_mesh mesh = {.n_vertices = n_vertices, .n_triangles = n_triangles};
    mesh.positions = calloc((size_t)n_vertices, 3 * sizeof(float));
    mesh.triangles = calloc((size_t)n_triangles, 3 * sizeof(uint32_t));
    if (has_normals)
        mesh.normals = calloc((size_t)n_vertices, 3 * sizeof(float));
    if (!mesh.positions || !mesh.triangles || (has_normals && !mesh.normals))
        abort();
    return mesh;
}

struct gn_mesh gn_test_make_plane(float size, int n)
{
    struct gn_mesh mesh = allocate((n + 1) * (n + 1), 2 * n * n, false);
    for (int j = 0; j <= n; j++) {
        for (int i = 0; i <= n; i++) {
            float *p = mesh.positions + 3 * (size_t)(j * (n + 1) + i);
            p[0] = size * ((float)i / (float)n - 0.5f);
            p[1] = size * ((float)j / (float)n - 0.5f);
        }
    }
    uint32_t *t = mesh.triangles;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            uint32_t a = (uint32_t)(j * (n + 1) + i);
            uint32_t b = a + (uint32_t)n + 1;
            const uint32_t cell[6] = {a, a + 1, b + 1, a, b + 1, b};
            memcpy(t, cell, sizeof(cell));
            t += 6;
        }
    }
    return mesh;
}

struct gn_mesh gn_test_make_sphere(float radius, int n)
{
    int sectors = 2 * n;
    struct gn_mesh mesh = allocate((n - 1) * sectors + 2, 2 * sectors * (n - 1), true);
    uint32_t south = (uint32_t)mesh.n_vertices - 1;
    mesh.normals[2] = 1.0f;
    mesh.normals[3 * (size_t)south + 2] = -1.0f;
    for (int j = 1; j < n; j++) {
        for (int i = 0; i < sectors; i++) {
            double theta = PI * j / n;
            double phi = 2.0 * PI * i / sectors;
            float *normal = mesh.normals + 3 * (size_t)(1 + (j - 1) * sectors + i);
            normal[0] = (float)(sin(theta) * cos(phi));
            normal[1] = (float)(sin(theta) * sin(phi));
            normal[2] = (float)cos(theta);
        }
    }
    for (int i = 0; i < 3 * mesh.n_vertices; i++)
        mesh.positions[i] = radius * mesh.normals[i];
    uint32_t *t = mesh.triangles;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < sectors; i++) {
            int next = (i + 1) % sectors;
            uint32_t a = j == 0 ? 0 : (uint32_t)(1 + (j - 1) * sectors + i);
            uint32_t b = j == 0 ? 0 : (uint32_t)(1 + (j - 1) * sectors + next);
            uint32_t c = j == n - 1 ? south : (uint32_t)(1 + j * sectors + i);
            uint32_t d = j == n - 1 ? south : (uint32_t)(1 + j * sectors + next);
            const uint32_t lower[3] = {a, c, d};
            const uint32_t upper[3] = {a, d, b};
            if (j < n - 1) { // at the south pole c is d
                memcpy(t, lower, sizeof(lower));
                t += 3;
            }
            if (j > 0) { // at the north pole a is b
                memcpy(t, upper, sizeof(upper));
                t += 3;
            }
        }
    }
    return mesh;
}

struct gn_mesh gn_test_make_cube(float size)
{
    static const uint32_t triangles[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                           2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    struct gn_mesh mesh = allocate(8, 12, false);
    for (int i = 0; i < 8; i++) {
        for (int k = 0; k < 3; k++)
            mesh.positions[3 * i + k] = (i >> k & 1) ? size / 2 : -size / 2;
    }
    memcpy(mesh.triangles, triangles, sizeof(triangles));
    return mesh;
}

void gn_test_random_direction(uint64_t *state, float out_dir[3])
{
    double z = 2.0 * gn_test_random_unit(state) - 1.0;
    double phi = 2.0 * PI * gn_test_random_unit(state);
    double r = sqrt(1.0 - z * z);
    out_dir[0] = (float)(r * cos(phi));
    out_dir[1] = (float)(r * sin(phi));
    out_dir[2] = (float)z;
}
