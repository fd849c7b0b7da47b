/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/teapot.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/vec.h"

const struct gn_rig_teapot_options gn_rig_teapot_coarse = {
    .around = 20,
    .along = {2, 2, 1, 1, 2, 2, 1},
    .tube_around = 8,
    .handle_along = 4,
    .spout_along = 4,
};

const struct gn_rig_teapot_options gn_rig_teapot_fine = {
    .around = 96,
    .along = {12, 12, 1, 8, 16, 12, 8},
    .tube_around = 32,
    .handle_along = 20,
    .spout_along = 20,
};

static void bernstein(double t, double out_b[static 4], double out_slope[static 4])
{
    double s = 1 - t;
    out_b[0] = s * s * s;
    out_b[1] = 3 * s * s * t;
    out_b[2] = 3 * s * t * t;
    out_b[3] = t * t * t;
    out_slope[0] = -3 * s * s;
    out_slope[1] = 3 * s * (s - 2 * t);
    out_slope[2] = 3 * t * (2 * s - t);
    out_slope[3] = 3 * t * t;
}

/* The point at (u along, v across) and du x dv, of any length. The ends of the parameters give the
 * control points to the bit, so that neighbouring patches meet without a crack. */
static void evaluate_patch(const double (*points)[4][3], double u, double v, double out_p[static 3],
                           double out_cross[static 3])
{
    double bu[4], su[4], bv[4], sv[4];
    double du[3] = {0}, dv[3] = {0};
    bernstein(u, bu, su);
    bernstein(v, bv, sv);
    memset(out_p, 0, 3 * sizeof(*out_p));
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 3; k++) {
                out_p[k] += bu[i] * bv[j] * points[i][j][k];
                du[k] += su[i] * bv[j] * points[i][j][k];
                dv[k] += bu[i] * sv[j] * points[i][j][k];
            }
    vec_cross(du, dv, out_cross);
}

/* As above with a unit normal. Where the derivatives vanish or run parallel (poles), the normal is
 * taken a thousandth of the patch further in. */
static void evaluate_surface(const double (*points)[4][3], double u, double v,
                             double out_p[static 3], double out_normal[static 3])
{
    double unused[3];
    evaluate_patch(points, u, v, out_p, out_normal);
    if (vec_length(out_normal) < 1e-9)
        evaluate_patch(points, u + (u < 0.5 ? 1e-3 : -1e-3), v, unused, out_normal);
    vec_normalize(out_normal);
}

static uint32_t add_vertex(struct gn_mesh *mesh, const double p[static 3], const double n[static 3])
{
    float *position = mesh->positions + 3 * (size_t)mesh->n_vertices;
    float *normal = mesh->normals + 3 * (size_t)mesh->n_vertices;
    for (int k = 0; k < 3; k++) {
        position[k] = (float)p[k] + 0.0f; // no negative zero: equal points have equal bits
        normal[k] = (float)n[k];
    }
    return (uint32_t)mesh->n_vertices++;
}

static void add_triangle(struct gn_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *t = mesh->triangles + 3 * (size_t)mesh->n_triangles++;
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

/* Two triangles, or one where the upper or lower edge has shrunk to a pole. */
static void add_band(struct gn_mesh *mesh, uint32_t first, int along, int around, bool top_pole,
                     bool bottom_pole)
{
    for (int i = 0; i < along; i++)
        for (int j = 0; j < around; j++) {
            uint32_t row = first + (uint32_t)(i * around), below = row + (uint32_t)around;
            uint32_t j0 = (uint32_t)j, j1 = (uint32_t)((j + 1) % around);
            if (!(bottom_pole && i == along - 1))
                add_triangle(mesh, row + j0, below + j0, below + j1);
            if (!(top_pole && i == 0))
                add_triangle(mesh, row + j0, below + j1, row + j1);
        }
}

static void add_body_band(struct gn_mesh *mesh, int band, int along, int around)
{
    double quarter[4][4][3];
    uint32_t first = (uint32_t)mesh->n_vertices;
    bool top_pole = band == GN_RIG_TEAPOT_KNOB, bottom_pole = band == GN_RIG_TEAPOT_BOTTOM;
    for (int i = 0; i < 4; i++) {
        const double *row = gn_rig_teapot_bands[band][i];
        double r = row[0], k = row[1], z = row[2];
        const double turn[4][3] = {{r, 0, z}, {r, k, z}, {k, r, z}, {0, r, z}};
        memcpy(quarter[i], turn, sizeof(turn));
    }
    for (int i = 0; i <= along; i++)
        for (int j = 0; j < around; j++) {
            double p[3], n[3];
            int steps = around / 4, turns = j / steps;
            // The knob is widest a third of the way down: there its cuts are denser.
            double u = top_pole ? pow((double)i / along, 1.5) : (double)i / along;
            evaluate_surface((const double(*)[4][3])quarter, u, (double)(j % steps) / steps, p, n);
            if (top_pole && i == 0)
                memcpy(n, (const double[3]){0, 0, 1}, sizeof(n));
            if (bottom_pole && i == along)
                memcpy(n, (const double[3]){0, 0, -1}, sizeof(n));
            for (int t = 0; t < turns; t++) { // quarter turns, exact
                double px = p[0], nx = n[0];
                p[0] = -p[1], p[1] = px;
                n[0] = -n[1], n[1] = nx;
            }
            add_vertex(mesh, p, n);
        }
    add_band(mesh, first, along, around, top_pole, bottom_pole);
}

/* A fan over the closed ring of vertices that starts at `ring`, facing the side from which the ring
 * runs counter-clockwise, or with `turned` the other. */
static void add_cap(struct gn_mesh *mesh, uint32_t ring, int around, bool turned)
{
    double p[3][3], e1[3], e2[3], n[3];
    uint32_t first = (uint32_t)mesh->n_vertices;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            p[i][k] = mesh->positions[3 * (ring + (uint32_t)(i * around / 3)) + (uint32_t)k];
    vec_subtract(p[1], p[0], e1);
    vec_subtract(p[2], p[0], e2);
    vec_cross(e1, e2, n);
    vec_normalize(n);
    if (turned)
        vec_scale(n, -1, n);
    for (int j = 0; j < around; j++) {
        double q[3];
        for (int k = 0; k < 3; k++)
            q[k] = mesh->positions[3 * (ring + (uint32_t)j) + (uint32_t)k];
        add_vertex(mesh, q, n);
    }
    for (uint32_t j = 1; j + 1 < (uint32_t)around; j++)
        add_triangle(mesh, first, first + j + (turned ? 1 : 0), first + j + (turned ? 0 : 1));
}

/* Handle or spout: two patches of half sections, mirrored at y = 0, closed by caps. The published
 * rows of both run so that du x dv points inwards. */
static void add_tube(struct gn_mesh *mesh, const double patches[static 2][4][4][3], int along,
                     int around)
{
    uint32_t first = (uint32_t)mesh->n_vertices;
    int half = around / 2, rows = 2 * along;
    for (int i = 0; i <= rows; i++)
        for (int j = 0; j < around; j++) {
            double p[3], n[3];
            int patch = i < along ? 0 : 1, across = j <= half ? j : around - j;
            evaluate_surface(patches[patch], (double)(i - patch * along) / along,
                             (double)across / half, p, n);
            vec_scale(n, -1, n);
            if (j > half)
                p[1] = -p[1], n[1] = -n[1];
            if (j == 0 || j == half)
                p[1] = 0, n[1] = 0;
            vec_normalize(n);
            add_vertex(mesh, p, n);
        }
    int first_triangle = mesh->n_triangles;
    add_band(mesh, first, rows, around, false, false);
    for (int t = first_triangle; t < mesh->n_triangles; t++) {
        uint32_t *tri = mesh->triangles + 3 * (size_t)t, swap = tri[1];
        tri[1] = tri[2];
        tri[2] = swap;
    }
    add_cap(mesh, first, around, true);
    add_cap(mesh, first + (uint32_t)(rows * around), around, false);
}

static bool in_range(int value, int low, int high, int multiple)
{
    return value >= low && value <= high && value % multiple == 0;
}

int gn_rig_teapot_create(const struct gn_rig_teapot_options *o, struct gn_mesh *out_mesh)
{
    int vertices, bands = 0;
    bool good = in_range(o->around, 8, 512, 4) && in_range(o->tube_around, 4, 256, 2) &&
                in_range(o->handle_along, 1, 128, 1) && in_range(o->spout_along, 1, 128, 1);
    for (int b = 0; b < GN_RIG_TEAPOT_BANDS; b++) {
        good = good && in_range(o->along[b], 1, 128, 1);
        bands += o->along[b] + 1;
    }
    if (!good)
        return -EINVAL;
    vertices = bands * o->around + (2 * o->handle_along + 2 * o->spout_along + 6) * o->tube_around;

    struct gn_mesh mesh = {0};
    mesh.positions = calloc((size_t)vertices, 3 * sizeof(*mesh.positions));
    mesh.normals = calloc((size_t)vertices, 3 * sizeof(*mesh.normals));
    mesh.triangles = calloc((size_t)vertices, 6 * sizeof(*mesh.triangles)); // two a vertex at most
    if (!mesh.positions || !mesh.normals || !mesh.triangles) {
        gn_mesh_finish(&mesh);
        return -ENOMEM;
    }
    for (int b = 0; b < GN_RIG_TEAPOT_BANDS; b++)
        add_body_band(&mesh, b, o->along[b], o->around);
    add_tube(&mesh, gn_rig_teapot_handle, o->handle_along, o->tube_around);
    add_tube(&mesh, gn_rig_teapot_spout, o->spout_along, o->tube_around);
    *out_mesh = mesh;
    return 0;
}
