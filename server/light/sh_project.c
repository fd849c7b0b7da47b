/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * From a map to its harmonics. Sums run in float over blocks of 64 texels, four side by side, and
 * in double over the blocks: what the floats round away stays under 1e-6 of the light, which
 * tests/unit/sh.c measures. All is added in one order whatever the pool's size.
 */
#include <errno.h>
#include <stdlib.h>

#include "server/light/map_table.h"
#include "server/light/sh_internal.h"

typedef gn_sh_vec vec;

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

/*
 * Four texels from t on, n of them there. The mean of a harmonic of band l over a small texel of
 * solid angle w is (1 - l(l+1) w / 24) of its value in the middle: the first term of the texel's
 * own extent.
 */
static void add_texels(const struct gn_radiance_map *map, size_t t, int n, int order,
                       struct block *block)
{
    vec w = {0}, x = {0}, y = {0}, z = {0}, light[3] = {{0}}, p[GN_SH_MAX];
    float any = 0;
    for (int i = 0; i < n; i++, t++) {
        const float *d = map->table->direction_probe + 3 * t, *l = map->radiance.data + 3 * t;
        w[i] = map->solid_angle[t];
        any += w[i];
        x[i] = d[0];
        y[i] = d[1];
        z[i] = d[2];
        for (int c = 0; c < 3; c++)
            light[c][i] = l[c];
    }
    if (!(any > 0))
        return;
    const vec one = {1, 1, 1, 1};
    GN_SH_POLYNOMIALS_2(p, one, x, y, z);
    if (order > 2)
        GN_SH_POLYNOMIALS_4(p, x, y, z);
    for (int l = 0; l <= order; l++) {
        vec weight = w * (1.0f - w * ((float)(l * (l + 1)) / 24.0f));
        for (int k = l * l; k < (l + 1) * (l + 1); k++)
            block->p[k][block->n] = p[k] * weight;
    }
    for (int c = 0; c < 3; c++)
        block->light[c][block->n] = light[c];
    block->n++;
}

static void add_block(const struct block *block, int order, struct gn_sh_sums *sums)
{
    for (int k = 0; k < gn_sh_get_count(order); k++) {
        vec r = {0}, g = {0}, b = {0};
        for (int i = 0; i < block->n; i++) {
            r += block->p[k][i] * block->light[0][i];
            g += block->p[k][i] * block->light[1][i];
            b += block->p[k][i] * block->light[2][i];
        }
        for (int i = 0; i < LANES; i++) {
            sums->p[k][0] += (double)r[i];
            sums->p[k][1] += (double)g[i];
            sums->p[k][2] += (double)b[i];
        }
    }
}

static void add_row(const struct gn_radiance_map *map, int y, int order, struct gn_sh_sums *sums)
{
    int width = map->radiance.width;
    size_t start = (size_t)y * (size_t)width;
    struct block block;
    block.n = 0;
    for (int x = 0; x < width; x += LANES) {
        add_texels(map, start + (size_t)x, width - x < LANES ? width - x : LANES, order, &block);
        if (block.n == BLOCK || x + LANES >= width) {
            add_block(&block, order, sums);
            block.n = 0;
        }
    }
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
        else
            add_row(work->map, y, work->order, &sums);
    }
    work->items[item] = sums;
}

int gn_sh_project_map(const struct gn_radiance_map *map, int order, struct gn_pool *pool,
                      double out_sh[static GN_SH_MAX][3])
{
    int n_items = (map->radiance.height + ROWS_PER_ITEM - 1) / ROWS_PER_ITEM, rc = -ENOMEM;
    bool is_latlong = map->projection.type == GN_PROJECTION_LATLONG;
    struct projection_work work = {.map = map, .order = order};
    work.items = malloc((size_t)n_items * sizeof(*work.items));
    if (is_latlong)
        work.columns = gn_sh_make_columns(map->radiance.width, order);
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
    free(work.columns);
    free(work.items);
    return rc;
}
