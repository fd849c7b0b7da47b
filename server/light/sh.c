/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/sh.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;

/*
 * Sums are kept in nine plain polynomials, 1, y, z, x, xy, yz, 3z^2 - 1, zx, x^2 - y^2; these
 * factors make the orthonormal basis of them: sqrt(1/pi)/2, sqrt(3/pi)/2, sqrt(15/pi)/2,
 * sqrt(5/pi)/4, sqrt(15/pi)/4.
 */
static const double basis_factor[9] = {
    0.28209479177387814, 0.48860251190291992, 0.48860251190291992,
    0.48860251190291992, 1.0925484305920792,  1.0925484305920792,
    0.31539156525252005, 1.0925484305920792,  0.54627421529603959,
};

/* A_l times the basis: the constants c1 to c5 of the paper's equation 12. */
static const double c1 = 0.42904276540489171, c2 = 0.51166335397324424, c3 = 0.74312386830112723,
                    c4 = 0.88622692545275794, c5 = 0.24770795610037571;

struct row_harmonics {
    double h[9][3];
};

struct projection_work {
    const struct gn_radiance_map *map;
    float *column;              // lat-long: [width][4] cos, sin of phi and of 2 phi
    struct row_harmonics *rows; // [height]
};

/*
 * The mean of a harmonic of band l over a small texel of solid angle w is (1 - l(l+1) w / 24) of
 * its value in the middle: the first term of the texel's own extent.
 */
static void project_row(const struct gn_radiance_map *map, int y, struct row_harmonics *out)
{
    size_t width = (size_t)map->radiance.width, start = (size_t)y * width;
    double sum[3][10] = {{0}};
    for (size_t i = start; i < start + width; i++) {
        double w = (double)map->solid_angle[i];
        if (!(w > 0))
            continue;
        const float *d = map->direction_world + 3 * i, *l = map->radiance.data + 3 * i;
        double dx = (double)d[0], dy = (double)d[1], dz = (double)d[2];
        double w1 = w * (1 - w / 12), w2 = w * (1 - w / 4);
        double b[10] = {w,
                        w1 * dy,
                        w1 * dz,
                        w1 * dx,
                        w2 * dx * dy,
                        w2 * dy * dz,
                        w2 * (3 * dz * dz - 1),
                        w2 * dz * dx,
                        w2 * (dx * dx - dy * dy)};
        for (int c = 0; c < 3; c++) {
            double v = (double)l[c];
            for (int k = 0; k < 10; k++) // the tenth is 0: pairs suit the machine
                sum[c][k] += b[k] * v;
        }
    }
    for (int k = 0; k < 9; k++)
        for (int c = 0; c < 3; c++)
            out->h[k][c] = sum[c][k];
}

/* Lat-long texels are boxes in theta and phi: their integrals are products, and exact. */
static void project_latlong_row(const struct projection_work *work, int y,
                                struct row_harmonics *out)
{
    const struct gn_image *image = &work->map->radiance;
    const float *l = gn_image_at(image, 0, y);
    double sum[5][3] = {{0}}; // of L times 1, cos phi, sin phi, cos 2 phi, sin 2 phi
    for (int x = 0; x < image->width; x++) {
        const float *f = work->column + 4 * (size_t)x;
        for (int c = 0; c < 3; c++) {
            double v = (double)l[3 * x + c];
            sum[0][c] += v;
            for (int k = 0; k < 4; k++)
                sum[k + 1][c] += (double)f[k] * v;
        }
    }
    double t0 = pi * y / image->height, t1 = pi * (y + 1) / image->height;
    double s0 = sin(t0), s1 = sin(t1), z0 = cos(t0), z1 = cos(t1);
    double c0 = z0 * z0 * z0, cc1 = z1 * z1 * z1;
    double sin_1 = z0 - z1, sin_cos = 0.5 * (s1 * s1 - s0 * s0);
    double sin_2 = 0.5 * (t1 - t0) - 0.25 * (sin(2 * t1) - sin(2 * t0));
    double sin_3 = (z0 - z1) - (c0 - cc1) / 3, sin_2_cos = (s1 * s1 * s1 - s0 * s0 * s0) / 3;
    double sin_cos_2 = (c0 - cc1) / 3;
    double step = 2 * pi / image->width, band1 = 2 * sin(0.5 * step), band2 = sin(step);
    for (int c = 0; c < 3; c++) {
        out->h[0][c] = sin_1 * step * sum[0][c];
        out->h[1][c] = sin_2 * band1 * sum[2][c];
        out->h[2][c] = sin_cos * step * sum[0][c];
        out->h[3][c] = sin_2 * band1 * sum[1][c];
        out->h[4][c] = 0.5 * sin_3 * band2 * sum[4][c];
        out->h[5][c] = sin_2_cos * band1 * sum[2][c];
        out->h[6][c] = (3 * sin_cos_2 - sin_1) * step * sum[0][c];
        out->h[7][c] = sin_2_cos * band1 * sum[1][c];
        out->h[8][c] = sin_3 * band2 * sum[3][c];
    }
}

static void project_item(void *context, int y, int worker)
{
    (void)worker;
    struct projection_work *work = context;
    work->rows[y] = (struct row_harmonics){{{0}}};
    if (work->column)
        project_latlong_row(work, y, &work->rows[y]);
    else
        project_row(work->map, y, &work->rows[y]);
}

/* Turns one channel's harmonics from probe to world axes: band 1 is a vector, band 2 a symmetric
 * matrix without trace. */
static void rotate_harmonics(const double r[static 9], double h[static 9][3], int c)
{
    double v[3] = {h[3][c], h[1][c], h[2][c]}, zz = h[6][c] / 3;
    double xx = 0.5 * (h[8][c] - zz), yy = -0.5 * (h[8][c] + zz);
    double q[9] = {xx, h[4][c], h[7][c], h[4][c], yy, h[5][c], h[7][c], h[5][c], zz};
    double rv[3] = {0}, rq[9] = {0}, rqr[9] = {0};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            rv[i] += r[3 * i + j] * v[j];
            for (int k = 0; k < 3; k++)
                rq[3 * i + j] += r[3 * i + k] * q[3 * k + j];
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                rqr[3 * i + j] += rq[3 * i + k] * r[3 * j + k];
    h[3][c] = rv[0];
    h[1][c] = rv[1];
    h[2][c] = rv[2];
    h[4][c] = rqr[1];
    h[5][c] = rqr[5];
    h[6][c] = 3 * rqr[8];
    h[7][c] = rqr[2];
    h[8][c] = rqr[0] - rqr[4];
}

static int make_columns(struct projection_work *work)
{
    int width = work->map->radiance.width;
    work->column = malloc(4 * (size_t)width * sizeof(*work->column));
    if (!work->column)
        return -ENOMEM;
    for (int x = 0; x < width; x++) {
        double phi = pi - 2 * pi * (x + 0.5) / width;
        float *f = work->column + 4 * (size_t)x;
        f[0] = (float)cos(phi);
        f[1] = (float)sin(phi);
        f[2] = (float)cos(2 * phi);
        f[3] = (float)sin(2 * phi);
    }
    return 0;
}

int gn_sh_project_map(const struct gn_radiance_map *map, struct gn_pool *pool,
                      double out_sh[static 9][3])
{
    struct projection_work work = {.map = map};
    bool is_latlong = map->projection.type == GN_PROJECTION_LATLONG;
    work.rows = malloc((size_t)map->radiance.height * sizeof(*work.rows));
    if (!work.rows || (is_latlong && make_columns(&work) < 0)) {
        free(work.rows);
        return -ENOMEM;
    }
    gn_pool_run(pool, map->radiance.height, project_item, &work);
    struct row_harmonics sum = {{{0}}};
    for (int y = 0; y < map->radiance.height; y++)
        for (int k = 0; k < 9; k++)
            for (int c = 0; c < 3; c++)
                sum.h[k][c] += work.rows[y].h[k][c];
    for (int c = 0; c < 3; c++) {
        if (is_latlong)
            rotate_harmonics(map->table->world_from_probe, sum.h, c);
        for (int k = 0; k < 9; k++)
            out_sh[k][c] = basis_factor[k] *
                           (sum.h[k][c] + map->table->fill_harmonics[k] * (double)map->fill[c]);
    }
    free(work.column);
    free(work.rows);
    return 0;
}

void gn_sh_get_irradiance(const double sh[static 9][3], const double normal[static 3],
                          double out_irradiance[static 3])
{
    double x = normal[0], y = normal[1], z = normal[2];
    for (int c = 0; c < 3; c++)
        out_irradiance[c] = c4 * sh[0][c] + 2 * c2 * (sh[1][c] * y + sh[2][c] * z + sh[3][c] * x) +
                            2 * c1 * (sh[4][c] * x * y + sh[5][c] * y * z + sh[7][c] * x * z) +
                            (c3 * z * z - c5) * sh[6][c] + c1 * (x * x - y * y) * sh[8][c];
}

int gn_sh_make_irradiance_map(const double sh[static 9][3], int width, int height,
                              struct gn_image *out_map)
{
    int rc = gn_image_init(out_map, width, height, 3);
    if (rc < 0)
        return rc;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double theta = pi * (y + 0.5) / height, phi = pi - 2 * pi * (x + 0.5) / width;
            double n[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)}, e[3];
            gn_sh_get_irradiance(sh, n, e);
            for (int c = 0; c < 3; c++)
                gn_image_at(out_map, x, y)[c] = e[c] > 0 ? (float)e[c] : 0;
        }
    }
    return 0;
}
