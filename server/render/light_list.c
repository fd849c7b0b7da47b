/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int gn_render_lights_reserve(struct light_list *list, int64_t capacity)
{
    list->n = list->n_lit = list->n_groups = 0;
    memset(list->ends, 0, sizeof(list->ends));
    memset(list->total, 0, sizeof(list->total));
    if (capacity <= list->capacity)
        return 0;
    gn_render_lights_finish(list);
    size_t size = ((size_t)capacity + GROUP - 1) / GROUP * GROUP;
    size_t n_groups = size / GROUP;
    float *block = aligned_alloc(64, 6 * size * sizeof(*block));
    list->cdf = malloc(size * sizeof(*list->cdf));
    list->groups = aligned_alloc(64, n_groups * sizeof(*list->groups));
    list->group_boxes =
        aligned_alloc(64, (n_groups + LANES - 1) / LANES * sizeof(*list->group_boxes));
    list->dir[0] = block;
    if (!block || !list->cdf || !list->groups || !list->group_boxes) {
        gn_render_lights_finish(list);
        return -ENOMEM;
    }
    for (size_t k = 0; k < 3; k++) {
        list->dir[k] = block + k * size;
        list->irradiance[k] = block + (3 + k) * size;
    }
    list->capacity = (int)size;
    return 0;
}

void gn_render_lights_finish(struct light_list *list)
{
    free(list->dir[0]); // one block for all six
    free(list->cdf);
    free(list->groups);
    free(list->group_boxes);
    memset(list, 0, sizeof(*list));
}

void gn_render_lights_add(struct light_list *list, const double dir[static 3],
                          const double irradiance[static 3])
{
    if (!(irradiance[0] > 0 || irradiance[1] > 0 || irradiance[2] > 0))
        return;
    for (int k = 0; k < 3; k++) {
        list->dir[k][list->n] = (float)dir[k];
        list->irradiance[k][list->n] = (float)irradiance[k];
        list->total[k] += (float)irradiance[k];
    }
    list->n++;
    list->n_lit++;
}

void gn_render_lights_pad(struct light_list *list, int multiple)
{
    for (; list->n % multiple != 0; list->n++) {
        for (int k = 0; k < 3; k++) {
            list->dir[k][list->n] = k == 2;
            list->irradiance[k][list->n] = 0;
        }
    }
}

/** Adds the state's first n lights; where those are not all, scaled to the sum of all. */
static void add_lights(const struct gn_lighting_state *state, int n, struct light_list *list)
{
    double all[3] = {0};
    double some[3] = {0};
    for (int i = 0; i < state->n_lights && n < state->n_lights; i++) {
        for (int k = 0; k < 3; k++) {
            all[k] += state->lights[i].irradiance[k];
            some[k] += i < n ? state->lights[i].irradiance[k] : 0;
        }
    }
    for (int i = 0; i < n; i++) {
        const struct gn_light *light = &state->lights[i];
        const double dir[3] = {light->dir_world[0], light->dir_world[1], light->dir_world[2]};
        double irradiance[3];
        for (int k = 0; k < 3; k++)
            irradiance[k] = light->irradiance[k] * (some[k] > 0 ? all[k] / some[k] : 1);
        gn_render_lights_add(list, dir, irradiance);
    }
}

int gn_render_lights_from_blend(const struct gn_blend *blend, struct light_list *list)
{
    int64_t n_all = 0;
    int ret = gn_render_lights_reserve(list, GN_LIGHTS_MAX);
    if (ret < 0)
        return ret;
    for (int i = 0; i < blend->n; i++)
        n_all += blend->state[i]->n_lights;
    for (int i = 0; i < blend->n; i++) {
        int n = blend->state[i]->n_lights;
        int share = GN_LIGHTS_MAX / blend->n;
        add_lights(blend->state[i], n_all > GN_LIGHTS_MAX && n > share ? share : n, list);
        list->ends[i] = list->n;
    }
    return 0;
}

void gn_render_weigh_probes(const struct frame *frame, struct sample *samples, int n)
{
    for (int i = 0; i < n && frame->blend.n > 1; i++) {
        struct sample *s = &samples[i];
        double weights[GN_PROBES_MAX];
        if (s->kind == SAMPLE_NOTHING)
            continue;
        gn_blend_get_weights(&frame->blend, s->surface.point, weights);
        for (int p = 0; p < frame->blend.n; p++)
            s->weights[p] = (float)weights[p];
    }
}
