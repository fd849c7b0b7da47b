/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/method.h"

#include <math.h>

#include "server/light/luminance.h"
#include "server/light/map_samples.h"

/* The mean light of the texel and its neighbours: one texel's colour is noise. */
static void get_mean_light(const struct gn_radiance_map *map, uint32_t texel,
                           double out_mean[static 3])
{
    int width = map->radiance.width, height = map->radiance.height;
    int x = (int)(texel % (uint32_t)width), y = (int)(texel / (uint32_t)width);
    out_mean[0] = out_mean[1] = out_mean[2] = 0;
    for (int i = 0; i < 9; i++) {
        int nx = x + i % 3 - 1, ny = y + i / 3 - 1;
        if (nx < 0 || nx >= width || ny < 0 || ny >= height)
            continue;
        for (int c = 0; c < 3; c++)
            out_mean[c] += (double)gn_image_at(&map->radiance, nx, ny)[c];
    }
}

/* Makes the lights add up to the map, channel by channel. A channel that no light has, though the
 * map does, is shared out evenly. */
static void balance(struct gn_light_list *list, const double total[static 3])
{
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int i = 0; i < list->n; i++)
            sum += (double)list->lights[i].irradiance[c];
        for (int i = 0; i < list->n; i++) {
            float *v = &list->lights[i].irradiance[c];
            *v = sum > 0 ? (float)((double)*v * (total[c] / sum)) : (float)(total[c] / list->n);
        }
    }
}

static int add_samples(const struct gn_radiance_map *map, const struct gn_map_samples *samples,
                       struct gn_light_list *list)
{
    for (int i = 0; i < samples->n; i++) {
        const float *d = map->direction_world + 3 * (size_t)samples->texel[i];
        double mean[3];
        get_mean_light(map, samples->texel[i], mean);
        double y = 0.2126 * mean[0] + 0.7152 * mean[1] + 0.0722 * mean[2];
        struct gn_light light = {.dir_world = {d[0], d[1], d[2]}};
        for (int c = 0; c < 3; c++)
            light.irradiance[c] = (float)(mean[c] / y);
        int rc = gn_light_list_add(list, &light);
        if (rc < 0)
            return rc;
    }
    return 0;
}

int gn_penrose_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                           struct gn_light_figures *figures)
{
    const struct gn_radiance_map *map = input->map;
    const struct gn_light_settings *settings = input->settings;
    const struct gn_partition_plan *plan = input->plan;
    struct gn_map_samples samples = {0};
    int n_fill = gn_luminance(map->fill) > 0 ? plan->n_fill_cells : 0;
    int n_wanted = settings->n_aim > n_fill ? settings->n_aim - n_fill : 1;
    bool is_plain = (settings->literal & GN_READ_PLAIN_SAMPLING) != 0;
    int rc = gn_map_samples_draw(map, n_wanted, is_plain, &samples);
    if (rc == 0)
        rc = add_samples(map, &samples, list);
    if (rc == 0 && samples.n == 0 && map->figures.mean_luminance > 0) {
        struct gn_patch patch = {0};
        struct gn_light light;
        for (uint32_t i = 0; i < plan->start[plan->n_regions]; i++)
            gn_patch_add_texel(&patch, map, plan->texel[i]);
        if (gn_patch_get_light(&patch, &light))
            rc = gn_light_list_add(list, &light);
    }
    if (rc == 0 && list->n > 0)
        balance(list, map->figures.shown_irradiance);
    figures->n_samples = samples.n;
    gn_map_samples_finish(&samples);
    if (rc == 0 && !(settings->literal & GN_READ_DISCARD_DARK))
        rc = gn_light_list_add_fill(list, map, plan, &figures->n_fill_lights);
    return rc;
}
