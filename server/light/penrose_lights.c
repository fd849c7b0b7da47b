/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/method.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_samples.h"
#include "server/light/penrose_weights.h"

/* Of the memory's figures. */
enum { POWER };

/* Draws about n_wanted samples. In a stream each stands for the power that the last frame's did as
 * long as that gives about as many: else one lamp would move them all. */
static int draw(const struct gn_light_input *input, int n_wanted, struct gn_map_samples *samples)
{
    const struct gn_radiance_map *map = input->map;
    const struct gn_light_memory *remembered = input->remembered;
    struct gn_map_sampling sampling = {.n_wanted = n_wanted,
                                       .is_plain =
                                           (input->settings->literal & GN_READ_PLAIN_SAMPLING) != 0,
                                       .is_relaxed = input->settings->relaxed};
    if (remembered && remembered->figure[POWER] > 0 && !sampling.is_plain) {
        double fresh = map->figures.mean_luminance * map->figures.shown_solid_angle / n_wanted;
        double kept = remembered->figure[POWER];
        sampling.power = gn_light_follow(input, kept, fresh, fresh / kept);
        sampling.kept = remembered->marks;
        sampling.n_kept = remembered->n_marks;
    }
    return gn_map_samples_draw(map, &sampling, input->scratch, samples);
}

static int compare_ids(const void *a, const void *b)
{
    uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;
    return (p > q) - (p < q);
}

static int remember(struct gn_light_memory *memory, const struct gn_map_samples *samples)
{
    size_t n = (size_t)samples->n;
    if (n == 0)
        return 0;
    memory->marks = malloc(n * sizeof(*memory->marks));
    if (!memory->marks)
        return -ENOMEM;
    memcpy(memory->marks, samples->id, n * sizeof(*memory->marks));
    qsort(memory->marks, n, sizeof(*memory->marks), compare_ids);
    memory->n_marks = samples->n;
    memory->figure[POWER] = samples->power;
    return 0;
}

/* Light too little for one sample is one light. */
static int add_whole(const struct gn_light_input *input, struct gn_light_list *list)
{
    const struct gn_partition_plan *plan = input->plan;
    struct gn_patch patch = {0};
    struct gn_light light;
    for (uint32_t k = 0; k < plan->start[plan->n_regions]; k++)
        gn_patch_add_run(&patch, input->map, plan->run[k].texel, plan->run[k].n);
    if (!gn_patch_get_light(&patch, &light))
        return 0;
    light.id = GN_PENROSE_LIGHT_ID;
    return gn_light_list_add(list, &light);
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
    int rc = draw(input, n_wanted, &samples);
    if (rc == 0)
        rc = gn_penrose_weigh_samples(input, &samples, list);
    if (rc == 0)
        rc = remember(input->memory, &samples);
    if (rc == 0 && samples.n == 0 && map->figures.mean_luminance > 0)
        rc = add_whole(input, list);
    figures->n_samples = samples.n;
    if (rc == 0 && !(settings->literal & GN_READ_DISCARD_DARK))
        rc = gn_light_list_add_fill(list, map, plan, &figures->n_fill_lights);
    return rc;
}
