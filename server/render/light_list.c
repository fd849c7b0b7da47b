/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int gn_render_lights_reserve(struct light_list *list, int64_t capacity)
{
    list->n = list->n_lit = list->n_groups = 0;
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

int gn_render_lights_from_state(const struct gn_lighting_state *state, struct light_list *list)
{
    int ret = gn_render_lights_reserve(list, GN_LIGHTS_MAX);
    if (ret < 0)
        return ret;
    for (int i = 0; i < state->n_lights; i++) {
        const struct gn_light *light = &state->lights[i];
        const double dir[3] = {light->dir_world[0], light->dir_world[1], light->dir_world[2]};
        const double irradiance[3] = {light->irradiance[0], light->irradiance[1],
                                      light->irradiance[2]};
        gn_render_lights_add(list, dir, irradiance);
    }
    return 0;
}
