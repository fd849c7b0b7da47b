/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/pyramid.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "common/octahedral.h"
#include "server/light/luminance.h"

/** A tent over 2 x 2 cells is as wide as 1.5^2 of them evenly (1 / the integral of its square). */
#define TENT_CELLS 2.25

/** Levels of a pyramid with no finer cells than the map's texels. */
static int count_levels(const struct gn_radiance_map *map)
{
    double texels = (double)map->projection.width * map->projection.height;
    int levels = 5;
    while (levels < GN_PYRAMID_MAX_LEVELS && pow(4, levels) <= texels)
        levels++;
    return levels;
}

static int get_side(const struct gn_pyramid *pyramid, int level)
{
    return 1 << (pyramid->n_levels - 1 - level);
}

static int allocate(struct gn_pyramid *pyramid)
{
    size_t n = 0;
    for (int l = 0; l < pyramid->n_levels; l++)
        n += (size_t)get_side(pyramid, l) * (size_t)get_side(pyramid, l);
    float(*cells)[3] = calloc(n, sizeof(*cells));
    for (int l = 0; cells && l < pyramid->n_levels; l++) {
        pyramid->levels[l] = cells;
        cells += (size_t)get_side(pyramid, l) * (size_t)get_side(pyramid, l);
    }
    return cells ? 0 : -ENOMEM;
}

static int to_cell(double x, int side)
{
    int i = (int)(x * side);
    return i < 0 ? 0 : i >= side ? side - 1 : i;
}

/** Adds each texel to its cell; weights[side][side]: solid angle. */
static void add_texels(struct gn_pyramid *pyramid, const struct gn_radiance_map *map,
                       double (*sums)[4])
{
    int side = get_side(pyramid, 0);
    size_t n = (size_t)map->projection.width * (size_t)map->projection.height;
    for (size_t i = 0; i < n; i++) {
        const float *d = map->direction_world + 3 * i;
        const double dir[3] = {d[0], d[1], d[2]};
        double uv[2];
        if (!(map->solid_angle[i] > 0))
            continue;
        gn_octahedral_from_direction(dir, uv);
        double *sum =
            sums[(size_t)to_cell(uv[1], side) * (size_t)side + (size_t)to_cell(uv[0], side)];
        for (int k = 0; k < 3; k++)
            sum[k] += (double)map->solid_angle[i] * map->radiance.data[3 * i + (size_t)k];
        sum[3] += map->solid_angle[i];
    }
}

static int fill_finest(struct gn_pyramid *pyramid, const struct gn_radiance_map *map)
{
    int side = get_side(pyramid, 0);
    double(*sums)[4] = calloc((size_t)side * (size_t)side, sizeof(*sums));
    if (!sums)
        return -ENOMEM;
    add_texels(pyramid, map, sums);
    for (int i = 0; i < side * side; i++) {
        float *cell = pyramid->levels[0][i];
        double dir[3];
        for (int k = 0; k < 3 && sums[i][3] > 0; k++)
            cell[k] = (float)(sums[i][k] / sums[i][3]);
        if (sums[i][3] > 0)
            continue;
        gn_octahedral_to_direction((i % side + 0.5) / side, (i / side + 0.5) / side, dir);
        const float narrow[3] = {(float)dir[0], (float)dir[1], (float)dir[2]};
        gn_radiance_map_get_radiance(map, narrow, cell);
    }
    free(sums);
    return 0;
}

static void fill_level(struct gn_pyramid *pyramid, int level)
{
    int side = get_side(pyramid, level);
    float(*fine)[3] = pyramid->levels[level - 1];
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            for (int k = 0; k < 3; k++) {
                double sum = 0;
                for (int q = 0; q < 4; q++)
                    sum += fine[(2 * y + q / 2) * 2 * side + 2 * x + q % 2][k];
                pyramid->levels[level][y * side + x][k] = (float)(0.25 * sum);
            }
        }
    }
}

int gn_pyramid_create(const struct gn_radiance_map *map, struct gn_pyramid **out_pyramid)
{
    *out_pyramid = NULL;
    struct gn_pyramid *pyramid = calloc(1, sizeof(*pyramid));
    if (!pyramid)
        return -ENOMEM;
    atomic_init(&pyramid->references, 1);
    pyramid->n_levels = count_levels(map);
    int ret = allocate(pyramid);
    if (ret == 0)
        ret = fill_finest(pyramid, map);
    if (ret < 0) {
        gn_pyramid_unref(&pyramid);
        return ret;
    }
    for (int level = 1; level < pyramid->n_levels; level++)
        fill_level(pyramid, level);
    *out_pyramid = pyramid;
    return 0;
}

struct gn_pyramid *gn_pyramid_ref(struct gn_pyramid *pyramid)
{
    atomic_fetch_add_explicit(&pyramid->references, 1, memory_order_relaxed);
    return pyramid;
}

void gn_pyramid_unref(struct gn_pyramid **pyramid)
{
    struct gn_pyramid *p = *pyramid;
    *pyramid = NULL;
    if (!p || atomic_fetch_sub_explicit(&p->references, 1, memory_order_acq_rel) != 1)
        return;
    free(p->levels[0]);
    free(p);
}

/** A cell that may lie one beyond an edge: across it the square is its own mirror image about the
 * edge's middle. */
static const float *get_cell(const struct gn_pyramid *pyramid, int level, int x, int y)
{
    int side = get_side(pyramid, level);
    if (x < 0 || x >= side) {
        x = x < 0 ? 0 : side - 1;
        y = side - 1 - y;
    }
    if (y < 0 || y >= side) {
        y = y < 0 ? 0 : side - 1;
        x = side - 1 - x;
    }
    return pyramid->levels[level][y * side + x];
}

static void add_level(const struct gn_pyramid *pyramid, int level, const double uv[static 2],
                      double weight, double sum[static 3])
{
    int side = get_side(pyramid, level);
    double x = uv[0] * side - 0.5;
    double y = uv[1] * side - 0.5;
    int x0 = (int)floor(x);
    int y0 = (int)floor(y);
    for (int q = 0; q < 4; q++) {
        const float *cell = get_cell(pyramid, level, x0 + q % 2, y0 + q / 2);
        double share = (q % 2 ? x - x0 : 1 - (x - x0)) * (q / 2 ? y - y0 : 1 - (y - y0));
        for (int k = 0; k < 3; k++)
            sum[k] += weight * share * (double)cell[k];
    }
}

void gn_pyramid_get_radiance(const struct gn_pyramid *pyramid, const struct gn_radiance_map *map,
                             const float dir_world[static 3], double solid_angle,
                             float out_radiance[static 3])
{
    const double dir[3] = {dir_world[0], dir_world[1], dir_world[2]};
    double uv[2];
    double sum[3] = {0};
    double side = get_side(pyramid, 0);
    double cells = fmax(solid_angle, 1e-12) * side * side / (4 * M_PI);
    double level = 0.5 * log2(cells / TENT_CELLS);
    if (level <= -1) {
        gn_radiance_map_get_radiance(map, dir_world, out_radiance);
        return;
    }
    level = fmin(level, pyramid->n_levels - 1);
    int lower = (int)floor(level);
    double share = level - lower;
    gn_octahedral_from_direction(dir, uv);
    if (lower < 0) {
        float own[3];
        gn_radiance_map_get_radiance(map, dir_world, own);
        for (int k = 0; k < 3; k++)
            sum[k] = (1 - share) * (double)own[k];
    } else {
        add_level(pyramid, lower, uv, 1 - share, sum);
    }
    if (share > 0)
        add_level(pyramid, lower + 1, uv, share, sum);
    for (int k = 0; k < 3; k++)
        out_radiance[k] = (float)sum[k];
}

bool gn_pyramid_sample(const struct gn_pyramid *pyramid, const double u[static 2],
                       float out_dir_world[static 3])
{
    double p = u[0];
    double q = u[1];
    int x = 0;
    int y = 0;
    for (int level = pyramid->n_levels - 2; level >= 0; level--) {
        int side = get_side(pyramid, level);
        float(*cells)[3] = pyramid->levels[level];
        double quarter[4];
        for (int i = 0; i < 4; i++)
            quarter[i] = gn_luminance(cells[(2 * y + i / 2) * side + 2 * x + i % 2]);
        double lower = quarter[0] + quarter[1];
        double sum = lower + quarter[2] + quarter[3];
        if (!(sum > 0))
            return false;
        int row = q * sum >= lower;
        double share = row ? (sum - lower) / sum : lower / sum;
        q = fmin((row ? q - lower / sum : q) / share, 1 - 0x1p-53);
        double in_row = quarter[2 * row] + quarter[2 * row + 1];
        double left = quarter[2 * row] / in_row;
        int column = p >= left;
        p = fmin((column ? (p - left) / (1 - left) : p / left), 1 - 0x1p-53);
        x = 2 * x + column;
        y = 2 * y + row;
    }
    double dir[3];
    double side = get_side(pyramid, 0);
    gn_octahedral_to_direction((x + p) / side, (y + q) / side, dir);
    for (int k = 0; k < 3; k++)
        out_dir_world[k] = (float)dir[k];
    return true;
}

double gn_pyramid_get_pdf(const struct gn_pyramid *pyramid, const float dir_world[static 3])
{
    const double dir[3] = {dir_world[0], dir_world[1], dir_world[2]};
    double uv[2];
    int side = get_side(pyramid, 0);
    double whole = gn_luminance(pyramid->levels[pyramid->n_levels - 1][0]);
    gn_octahedral_from_direction(dir, uv);
    const float *cell = pyramid->levels[0][to_cell(uv[1], side) * side + to_cell(uv[0], side)];
    return whole > 0 ? gn_luminance(cell) / (4 * M_PI * whole) : 0;
}
