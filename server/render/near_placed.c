/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "server/render/internal.h"

// A piece seen more nearly edge-on than that is taken for one so seen.
#define LEAST_COSINE 0.1
// Widest spread that widens a piece, rad.
#define WIDEST 1.2
// Share of its distance by which a piece stands off its surface: it is the mean of many points.
#define STAND_OFF 1e-3

int gn_placed_reserve(struct placed_lights *placed, const struct gn_blend *blend)
{
    bool is_global = false;
    for (int i = 0; i < blend->n; i++)
        is_global |= blend->state[i]->map && blend->state[i]->map->geometry;
    placed->n = 0;
    placed->limit = 0;
    if (!is_global)
        return 0;
    if (!placed->lights)
        placed->lights = malloc(GN_NEAR_LIGHTS_MAX * sizeof(*placed->lights));
    if (!placed->lights)
        return -ENOMEM;
    placed->limit = GN_NEAR_LIGHTS_MAX - blend->state[0]->n_near;
    return 0;
}

bool gn_placed_add(struct placed_lights *placed, const struct gn_lighting_state *state,
                   const struct gn_light *light, const double irradiance[static 3])
{
    if (placed->n >= placed->limit || !(light->distance > 0) || !(light->distance < INFINITY))
        return false;
    const double *probe = state->map->world_from_probe.translation;
    double r0 = (double)light->distance;
    double s = r0 * tan(fmin((double)light->angular_radius, WIDEST));
    double c0 = 0;
    struct gn_near_light near = {
        .role = GN_RT_REAL, .object = GN_NEAR_NO_OBJECT, .radius = (float)s, .id = light->id};
    bool has_normal = light->normal[0] != 0 || light->normal[1] != 0 || light->normal[2] != 0;
    for (int k = 0; k < 3; k++) {
        near.normal_world[k] = has_normal ? light->normal[k] : -light->dir_world[k];
        c0 -= (double)near.normal_world[k] * (double)light->dir_world[k];
    }
    c0 = fmax(c0, LEAST_COSINE);
    for (int k = 0; k < 3; k++) {
        near.position_world[k] = (float)(probe[k] + r0 * (double)light->dir_world[k] +
                                         STAND_OFF * r0 * (double)near.normal_world[k]);
        near.intensity[k] = (float)(irradiance[k] * (r0 * r0 + s * s) / c0);
    }
    placed->lights[placed->n++] = near;
    return true;
}

double gn_placed_get_weight(const struct frame *frame, const struct sample *s, int l)
{
    int probe = 0;
    if (frame->blend.n == 1 || l >= frame->near.n_placed)
        return 1;
    while (l >= frame->near.ends[probe])
        probe++;
    return (double)s->weights[probe];
}
