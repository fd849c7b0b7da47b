/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/blend.h"

#include <math.h>
#include <string.h>

void gn_blend_init(struct gn_blend *blend, const struct gn_lighting_state *state)
{
    blend->n = 1 + state->n_others;
    for (int i = 0; i < blend->n; i++) {
        blend->state[i] = i == 0 ? state : state->others[i - 1];
        memcpy(blend->position[i], blend->state[i]->map->world_from_probe.translation,
               sizeof(blend->position[i]));
    }
}

void gn_blend_get_weights(const struct gn_blend *blend, const float point[static 3],
                          double out_weights[static GN_PROBES_MAX])
{
    double squared[GN_PROBES_MAX], smallest = INFINITY, sum = 0;
    for (int i = 0; i < blend->n; i++) {
        squared[i] = 0;
        for (int c = 0; c < 3; c++) {
            double d = (double)point[c] - blend->position[i][c];
            squared[i] += d * d;
        }
        smallest = fmin(smallest, squared[i]);
    }
    // Each over the largest, so that none overflows; the nearest has 1.
    for (int i = 0; i < blend->n; i++) {
        out_weights[i] = squared[i] > smallest ? smallest / squared[i] : 1;
        sum += out_weights[i];
    }
    for (int i = 0; i < blend->n; i++)
        out_weights[i] /= sum;
}

void gn_blend_get_radiance(const struct gn_blend *blend, const float point[static 3],
                           const float dir_world[static 3], float out_radiance[static 3])
{
    double weights[GN_PROBES_MAX], sum[3] = {0};
    if (blend->n == 1) {
        gn_radiance_map_get_radiance(blend->state[0]->map, dir_world, out_radiance);
        return;
    }
    gn_blend_get_weights(blend, point, weights);
    for (int i = 0; i < blend->n; i++) {
        float radiance[3];
        gn_radiance_map_get_radiance(blend->state[i]->map, dir_world, radiance);
        for (int c = 0; c < 3; c++)
            sum[c] += weights[i] * (double)radiance[c];
    }
    for (int c = 0; c < 3; c++)
        out_radiance[c] = (float)sum[c];
}
