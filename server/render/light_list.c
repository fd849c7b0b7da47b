/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"

/** Lights from which on discs are spread over no more directions. */
#define MANY 64

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

/** So many directions that a disc's are as strong as a light in `limit`, and no step of its
 * shadow's edge is coarser than an eighth (with few lights: half a light's share). An even number;
 * `spare`: how many more there may be. */
static int count_directions(const struct gn_light *light, double share, int limit, int spare)
{
    if (!light->is_disc || !(light->angular_radius > 0))
        return 1;
    double half = 0.5 * fmin(limit, MANY);
    int n = 2 * (int)fmin(fmax(ceil(half * share), ceil(half / 8)), 16);
    return n - 1 <= spare ? n : 1;
}

/** The light; of a disc, n directions of equal power spread over it: a spiral of equal areas, each
 * point with its opposite, so that the mean direction is the disc's. */
static void add_light(const struct gn_light *light, const double irradiance[static 3], int n,
                      struct light_list *list)
{
    const double d[3] = {light->dir_world[0], light->dir_world[1], light->dir_world[2]};
    if (n == 1) {
        gn_render_lights_add(list, d, irradiance);
        return;
    }
    // Two axes across d. Source: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
    double sign = d[2] < 0 ? -1 : 1, a = -1 / (sign + d[2]), b = d[0] * d[1] * a;
    const double across[2][3] = {{1 + sign * d[0] * d[0] * a, sign * b, -sign * d[0]},
                                 {b, sign + d[1] * d[1] * a, -d[1]}};
    double part[3] = {irradiance[0] / n, irradiance[1] / n, irradiance[2] / n};
    double reach = sin(light->angular_radius);
    for (int i = 0; i < n; i++) {
        double r = reach * sqrt((2 * (i / 2) + 1.0) / n);
        double phi = i / 2 * (M_PI * (3 - sqrt(5))) + i % 2 * M_PI, dir[3];
        for (int k = 0; k < 3; k++)
            dir[k] =
                sqrt(1 - r * r) * d[k] + r * (cos(phi) * across[0][k] + sin(phi) * across[1][k]);
        gn_render_lights_add(list, dir, part);
    }
}

/** Adds n lights of the state. limit: how many a frame has; spare: how many more directions discs
 * may take. Those at a distance go to `placed` while it has room. */
static void add_lights(const struct gn_lighting_state *state, const struct gn_light *lights, int n,
                       int limit, int spare, struct light_list *list, struct placed_lights *placed)
{
    double all[3] = {0};
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            all[k] += lights[i].irradiance[k];
    }
    double energy = gn_luminance_of_sum(all);
    for (int i = 0; i < n; i++) {
        const struct gn_light *light = &lights[i];
        const double irradiance[3] = {light->irradiance[0], light->irradiance[1],
                                      light->irradiance[2]};
        if (gn_placed_add(placed, state, light, irradiance)) {
            for (int k = 0; k < 3; k++)
                list->total[k] += irradiance[k];
            continue;
        }
        double share = energy > 0 ? gn_luminance_of_sum(irradiance) / energy : 0;
        int n_directions = count_directions(light, share, limit, spare);
        spare -= n_directions - 1;
        add_light(light, irradiance, n_directions, list);
    }
}

int gn_render_lights_from_blend(const struct gn_blend *blend, int limit, struct light_merge *merge,
                                struct light_list *list, struct placed_lights *placed)
{
    int64_t n_all = 0;
    int ret = gn_render_lights_reserve(list, GN_LIGHTS_MAX);
    if (ret == 0)
        ret = gn_placed_reserve(placed, blend);
    if (ret < 0)
        return ret;
    for (int i = 0; i < blend->n; i++)
        n_all += blend->state[i]->n_lights;
    limit = limit > 0 ? limit : GN_LIGHTS_MAX;
    int spare = n_all < GN_LIGHTS_MAX ? (int)(GN_LIGHTS_MAX - n_all) : 0;
    for (int i = 0; i < blend->n; i++) {
        const struct gn_lighting_state *state = blend->state[i];
        const struct gn_light *lights = state->lights;
        int n = state->n_lights, share = limit > blend->n ? limit / blend->n : 1;
        if (n_all > limit && n > share) {
            n = gn_light_merge_make(merge, lights, n, share);
            if (n < 0)
                return n;
            lights = merge->lights;
        }
        add_lights(state, lights, n, limit, spare / blend->n, list, placed);
        list->ends[i] = list->n;
        placed->ends[i] = placed->n;
    }
    return 0;
}

int gn_render_lights_choose(const struct light_list *list, double u)
{
    int lo = 0;
    int hi = list->n - 1;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (list->cdf[mid] > u)
            hi = mid;
        else
            lo = mid + 1;
    }
    return lo;
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
