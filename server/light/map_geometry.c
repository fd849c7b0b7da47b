/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_geometry.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

// A surface so near to the point, as a share of its distance, is the point's own.
#define SAME_SURFACE 1e-4f

void gn_map_geometry_look(const struct gn_map_geometry *geometry, const float dir_world[static 3],
                          float *out_distance, float out_normal[static 3])
{
    const float org[3] = {(float)geometry->position[0], (float)geometry->position[1],
                          (float)geometry->position[2]};
    struct gn_rt_hit hit;
    if (!gn_rt_intersect(geometry->scene->rt, GN_RT_REAL, org, dir_world, 0, INFINITY, &hit) ||
        !(hit.distance > 0)) {
        *out_distance = INFINITY;
        memset(out_normal, 0, 3 * sizeof(*out_normal));
        return;
    }
    float along = 0;
    for (int c = 0; c < 3; c++)
        along += hit.normal[c] * dir_world[c];
    *out_distance = hit.distance;
    for (int c = 0; c < 3; c++)
        out_normal[c] = along > 0 ? -hit.normal[c] : hit.normal[c];
}

bool gn_map_geometry_sees(const struct gn_map_geometry *geometry, const float point[static 3],
                          float out_dir[static 3])
{
    double to[3], length2 = 0;
    for (int c = 0; c < 3; c++) {
        to[c] = (double)point[c] - geometry->position[c];
        length2 += to[c] * to[c];
    }
    if (!(length2 > 0))
        return false;
    double length = sqrt(length2);
    const float org[3] = {(float)geometry->position[0], (float)geometry->position[1],
                          (float)geometry->position[2]};
    for (int c = 0; c < 3; c++)
        out_dir[c] = (float)(to[c] / length);
    return !gn_rt_is_occluded(geometry->scene->rt, GN_RT_REAL, org, out_dir, 0,
                              (float)length * (1 - SAME_SURFACE));
}

static void trace_row(void *context, int y, int worker)
{
    (void)worker;
    struct gn_map_geometry *g = context;
    size_t width = (size_t)g->table->projection.width, start = (size_t)y * width;
    for (size_t i = start; i < start + width; i++) {
        float distance;
        if (!(g->table->solid_angle[i] > 0))
            continue;
        gn_map_geometry_look(g, g->table->direction_world + 3 * i, &distance, g->normal + 3 * i);
        g->nearness[i] = 1 / distance;
    }
}

int gn_map_geometry_create(const struct gn_scene *scene, struct gn_map_table *table,
                           const double position[static 3], struct gn_map_geometry *previous,
                           struct gn_pool *pool, struct gn_map_geometry **out_geometry)
{
    *out_geometry = NULL;
    if (previous && previous->scene == scene && previous->table == table &&
        memcmp(previous->position, position, sizeof(previous->position)) == 0) {
        *out_geometry = gn_map_geometry_ref(previous);
        return 0;
    }
    size_t n = (size_t)table->projection.width * (size_t)table->projection.height;
    struct gn_map_geometry *g = calloc(1, sizeof(*g));
    if (!g)
        return -ENOMEM;
    atomic_init(&g->references, 1);
    g->scene = scene;
    g->table = gn_map_table_ref(table);
    memcpy(g->position, position, sizeof(g->position));
    g->nearness = calloc(n, sizeof(*g->nearness));
    g->normal = calloc(n, 3 * sizeof(*g->normal));
    if (!g->nearness || !g->normal) {
        gn_map_geometry_unref(&g);
        return -ENOMEM;
    }
    gn_pool_run(pool, table->projection.height, trace_row, g);
    for (size_t i = 0; i < n; i++)
        g->n_covered += g->nearness[i] > 0;
    *out_geometry = g;
    return 0;
}

struct gn_map_geometry *gn_map_geometry_ref(struct gn_map_geometry *geometry)
{
    atomic_fetch_add_explicit(&geometry->references, 1, memory_order_relaxed);
    return geometry;
}

void gn_map_geometry_unref(struct gn_map_geometry **geometry)
{
    struct gn_map_geometry *g = *geometry;
    *geometry = NULL;
    if (!g || atomic_fetch_sub_explicit(&g->references, 1, memory_order_acq_rel) != 1)
        return;
    gn_map_table_unref(&g->table);
    free(g->nearness);
    free(g->normal);
    free(g);
}
