/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's partition of the environment into regions, each with one light or several by how far
 * its mean luminance (MLR) lies above the whole's (MLEM); in the paper's literal reading, the
 * energy-keeping one, and those between. Readings: docs/lighting.md.
 * Source: Scheer, Abert, Mueller, "Towards Using Realistic Ray Tracing in Augmented Reality
 * Applications with Natural Lighting", section 5.1.
 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/partition_internal.h"

static void sum_region(void *context, int r, int worker)
{
    (void)worker;
    struct gn_partition *p = context;
    struct gn_region *region = &p->regions[r];
    uint32_t start = p->plan->start[r];
    gn_run_sums_fill(&p->sums, p->map, p->plan->run, start, p->plan->start[r + 1] - start,
                     &region->patch);
    region->patch.solid_angle = p->plan->solid_angle[r];
    double w = region->patch.solid_angle;
    region->mean = w > 0 ? region->patch.energy / w : 0;
    region->n_items = region->patch.n_lit;
    region->n_runs = p->plan->start[r + 1] - start;
}

/* The samples as items, sorted by region, in their own order within. */
static int sort_samples(struct gn_partition *p)
{
    int n = p->samples.n, n_regions = p->plan->n_regions;
    struct gn_scratch *scratch = p->input->scratch;
    int *of = gn_scratch_take(scratch, (size_t)n, sizeof(*of));
    p->items = gn_scratch_take(scratch, (size_t)n, sizeof(*p->items));
    p->sample_start =
        gn_scratch_take_zeroed(scratch, (size_t)n_regions + 2, sizeof(*p->sample_start));
    if (!of || !p->items || !p->sample_start)
        return -ENOMEM;
    uint32_t *next = p->sample_start + 1; // shifted by one, it ends up as the starts
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < n; i++) {
            double polar[2];
            uint32_t texel = p->samples.texel[i];
            gn_partition_plan_get_polar(p->plan, texel, polar);
            if (pass == 0) {
                of[i] = gn_partition_plan_find_region(p->plan, polar);
                next[of[i] + 1]++;
                continue;
            }
            p->items[next[of[i]]++] = (struct gn_split_item){
                {(float)polar[0], (float)polar[1]},
                (float)(gn_partition_get_luminance(p, texel) / p->map->figures.max_luminance),
                texel,
                1,
                GN_NO_RUN};
        }
        for (int r = 0; pass == 0 && r < n_regions; r++)
            next[r + 1] += next[r];
    }
    return 0;
}

static int draw_samples(struct gn_partition *p, struct gn_light_figures *figures)
{
    const struct gn_map_sampling sampling = {.n_wanted = p->settings->n_samples,
                                             .is_plain =
                                                 gn_partition_is_literal(p, GN_READ_PLAIN_SAMPLING),
                                             .is_relaxed = p->settings->relaxed};
    int rc = gn_map_samples_draw(p->map, &sampling, p->input->scratch, &p->samples);
    if (rc == 0)
        rc = sort_samples(p);
    figures->n_samples = p->samples.n;
    return rc;
}

/* MLEM, maxLumiEM and the regions' means over the samples, where they are read so. */
static void take_sample_figures(struct gn_partition *p)
{
    double sum = 0, max = 0;
    for (int r = 0; r < p->plan->n_regions; r++) {
        struct gn_region *region = &p->regions[r];
        int start = (int)p->sample_start[r], end = (int)p->sample_start[r + 1];
        double region_sum = 0;
        for (int i = start; i < end; i++) {
            double y = gn_partition_get_luminance(p, p->items[i].texel);
            region_sum += y;
            max = fmax(max, y);
        }
        if (gn_partition_is_literal(p, GN_READ_SAMPLE_MEAN))
            region->mean = end > start ? region_sum / (end - start) : 0;
        if (gn_partition_is_literal(p, GN_READ_BRIGHTEST))
            region->n_items = end - start;
        sum += region_sum;
    }
    if (gn_partition_is_literal(p, GN_READ_SAMPLE_MEAN))
        p->mean = p->samples.n > 0 ? sum / p->samples.n : 0;
    if (gn_partition_is_literal(p, GN_READ_SAMPLE_MAX))
        p->max = max;
}

/* Moves the lights of these regions into the list; returns their number or -ENOMEM. */
static int add_lights(const struct gn_partition *p, int first, int end, struct gn_light_list *list)
{
    int n = list->n;
    for (int r = first; r < end; r++) {
        const struct gn_region *region = &p->regions[r];
        for (int i = region->first_slot; i < region->first_slot + region->n_slots; i++) {
            int rc = p->is_lit[i] ? gn_light_list_add(list, &p->slots[i]) : 0;
            if (rc < 0)
                return rc;
        }
    }
    return list->n - n;
}

/* The brightest sample's radiance has no solid angle; one factor for all lights makes their
 * luminance that of what they stand for. Ratios stay the paper's. */
static void scale_to_map(const struct gn_partition *p, struct gn_light_list *list)
{
    double sum = 0;
    for (int i = 0; i < list->n; i++)
        sum += gn_luminance(list->lights[i].irradiance);
    bool discards =
        gn_partition_is_literal(p, GN_READ_DISCARD_DARK); // else dark regions have their own lights
    double total = 0;
    for (int r = 0; r < p->plan->n_regions; r++)
        total += discards || p->regions[r].is_bright ? p->regions[r].patch.energy : 0;
    for (int i = 0; i < list->n && sum > 0; i++)
        for (int c = 0; c < 3; c++)
            list->lights[i].irradiance[c] *= (float)(total / sum);
}

static int make_lights(struct gn_partition *p, struct gn_light_list *list,
                       struct gn_light_figures *figures)
{
    gn_pool_run(p->input->pool, p->plan->n_regions, sum_region, p);
    p->mean = p->map->figures.mean_luminance;
    int rc = p->needs_samples ? draw_samples(p, figures) : 0, n_base = p->plan->n_regions;
    if (rc == 0 && p->needs_samples)
        take_sample_figures(p);
    if (rc == 0 && p->settings->metric != GN_METRIC_LOG2 &&
        !gn_partition_is_literal(p, GN_READ_SAMPLE_MAX))
        rc = gn_partition_get_smoothed_max(p->map, p->input->scratch, &p->max);
    if (rc < 0)
        return rc;
    gn_partition_count_lights(p, figures);
    rc = gn_partition_split_regions(p);
    if (rc == 0)
        rc = add_lights(p, 0, n_base, list);
    if (rc >= 0 && gn_partition_is_literal(p, GN_READ_BRIGHTEST))
        scale_to_map(p, list);
    if (rc >= 0 && !gn_partition_is_literal(p, GN_READ_DISCARD_DARK)) {
        rc = add_lights(p, n_base, p->n_regions, list);
        figures->n_dark_lights = rc < 0 ? 0 : rc;
        if (rc >= 0)
            rc = gn_light_list_add_fill(list, p->map, p->plan, &figures->n_fill_lights);
    }
    return rc < 0 ? rc : gn_partition_remember(p, p->input->memory);
}

static int take_memory(struct gn_partition *p)
{
    struct gn_scratch *scratch = p->input->scratch;
    size_t n_runs = p->plan->start[p->plan->n_regions];
    p->regions = gn_scratch_take_zeroed(scratch, (size_t)p->n_regions, sizeof(*p->regions));
    p->sums.unit = gn_run_get_unit(p->map);
    p->sums.sum = gn_scratch_take(scratch, n_runs, sizeof(*p->sums.sum));
    if (p->map->geometry)
        p->sums.place = gn_scratch_take(scratch, n_runs, sizeof(*p->sums.place));
    bool is_ok = p->regions && p->sums.sum && (p->sums.place || !p->map->geometry);
    return is_ok ? 0 : -ENOMEM;
}

int gn_partition_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                             struct gn_light_figures *figures)
{
    const struct gn_partition_plan *plan = input->plan;
    struct gn_partition p = {.input = input,
                             .map = input->map,
                             .settings = input->settings,
                             .plan = plan,
                             .n_regions = plan->n_regions + plan->n_dark_cells,
                             .needs_samples = (input->settings->literal & GN_READ_SAMPLED) != 0};
    figures->rings = plan->n_rings;
    figures->sectors = plan->division.sectors;
    figures->split_gain = 1;
    if (!(p.map->figures.mean_luminance > 0))
        return 0; // all black: no lights
    int rc = take_memory(&p);
    return rc < 0 ? rc : make_lights(&p, list, figures);
}
