/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A 5 x 5 mean goes along the rows, then down the columns of what that gives, over one square at a
 * time: a cube map's face, else the picture. Beyond its border lies what the sphere shows there.
 */
#include <errno.h>

#include "server/light/luminance.h"
#include "server/light/partition_internal.h"

enum { REACH = 2, SIDE = 2 * REACH + 1 };

/** Sums along SIDE texels of a row, about each texel of the square. */
struct row_sums {
    double *energy; // of Y dOmega
    double *weight; // of dOmega
};

struct square {
    const struct gn_radiance_map *map;
    int first_row, width, height;
    double *energy, *weight;    // [width + 2 * REACH] of one row's texels
    struct row_sums sums[SIDE]; // of the last rows; row y at (y + REACH) % SIDE
};

static void read_texel(const struct square *s, size_t texel, int to)
{
    double w = (double)s->map->solid_angle[texel];
    s->weight[to] = w;
    s->energy[to] = w * gn_luminance(s->map->radiance.data + 3 * texel);
}

/* A texel of the square's border; nothing where the sphere shows none. */
static void read_beyond(const struct square *s, int x, int y)
{
    int inner_x = x < 0 ? 0 : x < s->width ? x : s->width - 1;
    int inner_y = y < 0 ? 0 : y < s->height ? y : s->height - 1;
    int at[2] = {inner_x, s->first_row + inner_y};
    s->energy[x + REACH] = s->weight[x + REACH] = 0;
    if (gn_projection_step(&s->map->projection, x - inner_x, y - inner_y, at))
        read_texel(s, (size_t)at[1] * (size_t)s->map->radiance.width + (size_t)at[0], x + REACH);
}

static void read_row(const struct square *s, int y)
{
    bool is_inside = y >= 0 && y < s->height;
    size_t start = is_inside ? (size_t)(s->first_row + y) * (size_t)s->width : 0;
    for (int x = 0; x < s->width && is_inside; x++)
        read_texel(s, start + (size_t)x, x + REACH);
    for (int x = -REACH; x < s->width + REACH; x++)
        if (!is_inside || x < 0 || x >= s->width)
            read_beyond(s, x, y);
}

static double sum_five(const double *v)
{
    return v[0] + v[1] + v[2] + v[3] + v[4];
}

static void sum_row(const struct square *s, int y)
{
    const struct row_sums *sums = &s->sums[(y + REACH) % SIDE];
    read_row(s, y);
    for (int x = 0; x < s->width; x++)
        sums->energy[x] = sum_five(s->energy + x);
    for (int x = 0; x < s->width; x++)
        sums->weight[x] = sum_five(s->weight + x);
}

static double get_max_of_row(const struct square *s, double max)
{
    const struct row_sums *r = s->sums;
    for (int x = 0; x < s->width; x++) {
        double energy =
            r[0].energy[x] + r[1].energy[x] + r[2].energy[x] + r[3].energy[x] + r[4].energy[x];
        double weight =
            r[0].weight[x] + r[1].weight[x] + r[2].weight[x] + r[3].weight[x] + r[4].weight[x];
        if (energy > max * weight)
            max = energy / weight;
    }
    return max;
}

int gn_partition_get_smoothed_max(const struct gn_radiance_map *map, struct gn_scratch *scratch,
                                  double *out_max)
{
    int width = map->radiance.width, height = map->radiance.height;
    bool is_cube = map->projection.type == GN_PROJECTION_CUBE;
    struct square s = {.map = map, .width = width, .height = is_cube ? width : height};
    size_t row = (size_t)width + 2 * REACH;
    double *memory = gn_scratch_take(scratch, 2 * (SIDE + 1) * row, sizeof(*memory)), max = 0;
    if (!memory)
        return -ENOMEM;
    s.energy = memory;
    s.weight = memory + row;
    for (int i = 0; i < SIDE; i++)
        s.sums[i] = (struct row_sums){memory + (2 * (size_t)i + 2) * row,
                                      memory + (2 * (size_t)i + 3) * row};
    for (; s.first_row < height; s.first_row += s.height) {
        for (int y = -REACH; y < s.height + REACH; y++) {
            sum_row(&s, y);
            if (y >= REACH)
                max = get_max_of_row(&s, max);
        }
    }
    *out_max = max;
    return 0;
}
