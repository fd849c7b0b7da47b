/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"

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

/** So many directions that a disc's are as strong as a light in 64, and no step of its shadow's
 * edge is coarser than an eighth. An even number; `spare`: how many more there may be. */
static int count_directions(const struct gn_light *light, double share, int spare)
{
    if (!light->is_disc || !(light->angular_radius > 0))
        return 1;
    int n = 2 * (int)fmin(fmax(ceil(32 * share), 4), 16);
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

/** Adds the state's first n lights; where those are not all, scaled to the sum of all. spare: how
 * many more directions discs may take. Those at a distance go to `placed` while it has room. */
static void add_lights(const struct gn_lighting_state *state, int n, int spare,
                       struct light_list *list, struct placed_lights *placed)
{
    double all[3] = {0};
    double some[3] = {0};
    for (int i = 0; i < state->n_lights; i++) {
        for (int k = 0; k < 3; k++) {
            all[k] += state->lights[i].irradiance[k];
            some[k] += i < n ? state->lights[i].irradiance[k] : 0;
        }
    }
    double energy = gn_luminance_of_sum(all);
    for (int i = 0; i < n; i++) {
        const struct gn_light *light = &state->lights[i];
        double irradiance[3];
        for (int k = 0; k < 3; k++)
            irradiance[k] =
                light->irradiance[k] * (n < state->n_lights && some[k] > 0 ? all[k] / some[k] : 1);
        if (gn_placed_add(placed, state, light, irradiance)) {
            for (int k = 0; k < 3; k++)
                list->total[k] += irradiance[k];
            continue;
        }
        double share = energy > 0 ? gn_luminance_of_sum(irradiance) / energy : 0;
        int n_directions = count_directions(light, share, spare);
        spare -= n_directions - 1;
        add_light(light, irradiance, n_directions, list);
    }
}

int gn_render_lights_from_blend(const struct gn_blend *blend, struct light_list *list,
                                struct placed_lights *placed)
{
    int64_t n_all = 0;
    int ret = gn_render_lights_reserve(list, GN_LIGHTS_MAX);
    if (ret == 0)
        ret = gn_placed_reserve(placed, blend);
    if (ret < 0)
        return ret;
    for (int i = 0; i < blend->n; i++)
        n_all += blend->state[i]->n_lights;
    int spare = n_all < GN_LIGHTS_MAX ? (int)(GN_LIGHTS_MAX - n_all) : 0;
    for (int i = 0; i < blend->n; i++) {
        int n = blend->state[i]->n_lights;
        int share = GN_LIGHTS_MAX / blend->n;
        n = n_all > GN_LIGHTS_MAX && n > share ? share : n;
        add_lights(blend->state[i], n, spare / blend->n, list, placed);
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
