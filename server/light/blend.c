/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/blend.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "server/light/state_copy.h"

int gn_lighting_state_join(struct gn_lighting_state *const *states, int n, int newest,
                           struct gn_lighting_state **out_state)
{
    *out_state = NULL;
    if (n == 1) {
        *out_state = gn_lighting_state_ref(states[0]);
        return 0;
    }
    const struct gn_lighting_state *times = states[newest];
    struct gn_lighting_state *s = gn_lighting_state_copy(states[0]);
    if (!s)
        return -ENOMEM;
    s->figures = times->figures;
    s->in_time = times->in_time;
    s->sequence = times->sequence;
    s->capture_time_ns = times->capture_time_ns;
    s->published_time_ns = times->published_time_ns;
    s->ms_map = times->ms_map;
    s->ms_sh = times->ms_sh;
    s->ms_lights = times->ms_lights;
    s->ms_temporal = times->ms_temporal;
    for (int i = 1; i < n; i++)
        s->others[s->n_others++] = gn_lighting_state_ref(states[i]);
    *out_state = s;
    return 0;
}

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

bool gn_blend_get_radiance_at(const struct gn_blend *blend, const float point[static 3],
                              float out_radiance[static 3])
{
    double weights[GN_PROBES_MAX], sum[3] = {0}, seen = 0;
    bool is_seen = false;
    gn_blend_get_weights(blend, point, weights);
    for (int i = 0; i < blend->n; i++) {
        float radiance[3];
        if (!gn_radiance_map_get_radiance_at(blend->state[i]->map, point, radiance))
            continue;
        double weight = fmax(weights[i], 1e-12); // a lone one's light whatever it weighs
        is_seen = true;
        seen += weight;
        for (int c = 0; c < 3; c++)
            sum[c] += weight * (double)radiance[c];
    }
    for (int c = 0; c < 3 && is_seen; c++)
        out_radiance[c] = (float)(sum[c] / seen);
    return is_seen;
}
