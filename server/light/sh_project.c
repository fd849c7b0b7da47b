/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * From a map to its harmonics. Sums run in float over blocks of 64 texels, four side by side, and
 * in double over the blocks: what the floats round away stays under 1e-6 of the light, which
 * tests/unit/sh.c measures. All is added in one order whatever the pool's size.
 */
#include <errno.h>

#include "server/light/map_table.h"
#include "server/light/sh_internal.h"

typedef gn_vec4 vec;

enum {
    LANES = GN_SH_LANES,
    BLOCK = GN_SH_BLOCK,
    ROWS_PER_ITEM = 16 // rows that one item of the pool sums
};

struct projection_work {
    const struct gn_radiance_map *map;
    int order;
    float *columns;           // lat-long, else NULL
    struct gn_sh_sums *items; // [n_items]
};

/* Vectors of a block of texels. */
struct block {
    int n;
    vec p[GN_SH_MAX][BLOCK]; // the polynomials, times the solid angle
    vec light[3][BLOCK];
};

/* The mean of a harmonic of band l over a small texel of solid angle w is (1 - l(l+1) w / 24) of
 * its value in the middle: the first term of the texel's own extent. */
static inline void add_band(const vec *p, vec w, int l, struct block *block)
{
    const vec weight = w * (1.0f - w * ((float)(l * (l + 1)) / 24.0f));
    for (int k = l * l; k < (l + 1) * (l + 1); k++)
        block->p[k][block->n] = p[k] * weight;
}

/* Four texels: their solid angles, directions and light. */
static inline void add_texels(const float *solid_angle, const float *direction, const float *light,
                              int order, struct block *block)
{
    const vec w = gn_vec4_load(solid_angle), one = {1, 1, 1, 1};
    if (!(w[0] + w[1] + w[2] + w[3] > 0))
        return;
    vec d[3], rgb[3], p[GN_SH_MAX];
    gn_vec4_split(direction, d);
    gn_vec4_split(light, rgb);
    const vec xx = d[0] * d[0], yy = d[1] * d[1], zz = d[2] * d[2];
    GN_SH_POLYNOMIALS_2(p, one, d[0], d[1], d[2], xx, yy, zz);
    if (order > 2)
        GN_SH_POLYNOMIALS_4(p, d[0], d[1], d[2], xx, yy, zz);
    add_band(p, w, 0, block);
    add_band(p, w, 1, block);
    add_band(p, w, 2, block);
    if (order > 2) {
        add_band(p, w, 3, block);
        add_band(p, w, 4, block);
    }
    for (int c = 0; c < 3; c++)
        block->light[c][block->n] = rgb[c];
    block->n++;
}

static double add_lanes(vec v)
{
    return ((double)v[0] + (double)v[1]) + ((double)v[2] + (double)v[3]);
}

/* Two polynomials share the loads of the light; with k == m it is one. */
static void add_pair(const struct block *block, int k, int m, struct gn_sh_sums *sums)
{
    vec rk = {0}, gk = {0}, bk = {0}, rm = {0}, gm = {0}, bm = {0};
    for (int i = 0; i < block->n; i++) {
        vec r = block->light[0][i], g = block->light[1][i], b = block->light[2][i];
        rk += block->p[k][i] * r;
        gk += block->p[k][i] * g;
        bk += block->p[k][i] * b;
        rm += block->p[m][i] * r;
        gm += block->p[m][i] * g;
        bm += block->p[m][i] * b;
    }
    sums->p[k][0] += add_lanes(rk);
    sums->p[k][1] += add_lanes(gk);
    sums->p[k][2] += add_lanes(bk);
    if (m == k)
        return;
    sums->p[m][0] += add_lanes(rm);
    sums->p[m][1] += add_lanes(gm);
    sums->p[m][2] += add_lanes(bm);
}

static void add_block(const struct block *block, int order, struct gn_sh_sums *sums)
{
    int n = gn_sh_get_count(order);
    for (int k = 0; k < n; k += 2)
        add_pair(block, k, k + 1 < n ? k + 1 : k, sums);
}

/* order: a number known at the call, for which the compiler unrolls all. */
static inline void add_row(const struct gn_radiance_map *map, int y, int order,
                           struct gn_sh_sums *sums)
{
    int width = map->radiance.width, whole = width - width % LANES;
    size_t start = (size_t)y * (size_t)width;
    const float *w = map->solid_angle + start, *l = map->radiance.data + 3 * start;
    const float *d = map->table->direction_probe + 3 * start;
    struct block block;
    block.n = 0;
    for (int x = 0; x < whole; x += LANES) {
        add_texels(w + x, d + 3 * x, l + 3 * x, order, &block);
        if (block.n == BLOCK) {
            add_block(&block, order, sums);
            block.n = 0;
        }
    }
    if (whole < width) { // the last few, filled up with texels that cover nothing
        float tail[7 * LANES] = {0};
        size_t n = (size_t)(width - whole) * sizeof(float);
        memcpy(tail, w + whole, n);
        memcpy(tail + LANES, d + 3 * whole, 3 * n);
        memcpy(tail + 4 * LANES, l + 3 * whole, 3 * n);
        add_texels(tail, tail + LANES, tail + 4 * LANES, order, &block);
    }
    add_block(&block, order, sums);
}

static void project_item(void *context, int item, int worker)
{
    (void)worker;
    struct projection_work *work = context;
    const struct gn_image *image = &work->map->radiance;
    struct gn_sh_sums sums = {{{0}}};
    int first = ROWS_PER_ITEM * item, end = first + ROWS_PER_ITEM;
    for (int y = first; y < end && y < image->height; y++) {
        if (work->columns)
            gn_sh_add_latlong_row(image, y, work->order, work->columns, &sums);
        else if (work->order == 2)
            add_row(work->map, y, 2, &sums);
        else
            add_row(work->map, y, 4, &sums);
    }
    work->items[item] = sums;
}

int gn_sh_project_map(const struct gn_radiance_map *map, int order, struct gn_pool *pool,
                      double out_sh[static GN_SH_MAX][3])
{
    int n_items = (map->radiance.height + ROWS_PER_ITEM - 1) / ROWS_PER_ITEM, rc = -ENOMEM;
    bool is_latlong = map->projection.type == GN_PROJECTION_LATLONG;
    struct projection_work work = {.map = map, .order = order};
    struct gn_scratch *scratch = gn_scratch_borrow(&map->table->scratch);
    if (!scratch)
        return -ENOMEM;
    work.items = gn_scratch_take(scratch, (size_t)n_items, sizeof(*work.items));
    if (is_latlong)
        work.columns = gn_sh_make_columns(map->radiance.width, order, scratch);
    if (!work.items || (is_latlong && !work.columns))
        goto out;
    gn_pool_run(pool, n_items, project_item, &work);
    struct gn_sh_sums sum = {{{0}}};
    for (int i = 0; i < n_items; i++)
        for (int k = 0; k < GN_SH_MAX; k++)
            for (int c = 0; c < 3; c++)
                sum.p[k][c] += work.items[i].p[k][c];
    for (int k = 0; k < GN_SH_MAX; k++)
        for (int c = 0; c < 3; c++)
            out_sh[k][c] = gn_sh_factor[k] * sum.p[k][c];
    for (int k = 0; k < gn_sh_get_count(order); k++)
        for (int c = 0; c < 3; c++)
            out_sh[k][c] += map->table->fill_harmonics[k] * (double)map->fill[c];
    gn_sh_rotate(order, map->table->world_from_probe, out_sh);
    rc = 0;
out:
    gn_scratch_give_back(&map->table->scratch, &scratch);
    return rc;
}
