/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_table.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

static void bound_block(const struct gn_map_table *t, int x0, int y0, float out_bound[static 4])
{
    int width = t->projection.width, height = t->projection.height, n = 0;
    int x1 = x0 + GN_MAP_BLOCK < width ? x0 + GN_MAP_BLOCK : width;
    int y1 = y0 + GN_MAP_BLOCK < height ? y0 + GN_MAP_BLOCK : height;
    float centre[3] = {0}, radius = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int y = y0; y < y1; y++) {
            for (int x = x0; x < x1; x++) {
                size_t i = (size_t)y * (size_t)width + (size_t)x;
                const float *d = t->direction_world + 3 * i;
                float chord = 0;
                if (!(t->solid_angle[i] > 0))
                    continue;
                n += pass == 0;
                for (int c = 0; c < 3; c++) {
                    centre[c] += pass == 0 ? d[c] : 0;
                    chord += (d[c] - centre[c]) * (d[c] - centre[c]);
                }
                radius = pass == 1 && chord > radius ? chord : radius;
            }
        }
        for (int c = 0; c < 3 && pass == 0 && n > 0; c++)
            centre[c] /= (float)n;
    }
    for (int c = 0; c < 3; c++)
        out_bound[c] = centre[c];
    out_bound[3] = n > 0 ? sqrtf(radius) : -1;
}

static void bound_row(void *context, int row, int worker)
{
    (void)worker;
    struct gn_map_table *t = context;
    int n = gn_map_table_get_blocks(t->projection.width);
    for (int x = 0; x < n; x++)
        bound_block(t, x * GN_MAP_BLOCK, row * GN_MAP_BLOCK,
                    t->block[(size_t)row * (size_t)n + (size_t)x]);
}

int gn_map_table_bound_blocks(struct gn_map_table *table, struct gn_pool *pool)
{
    int n_rows = gn_map_table_get_blocks(table->projection.height);
    size_t n = (size_t)n_rows * (size_t)gn_map_table_get_blocks(table->projection.width);
    table->block = malloc(n * sizeof(*table->block));
    if (!table->block)
        return -ENOMEM;
    gn_pool_run(pool, n_rows, bound_row, table);
    return 0;
}
