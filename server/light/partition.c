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
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/partition_internal.h"

static double get_luminance(const struct gn_partition *p, uint32_t texel)
{
    return gn_luminance(p->map->radiance.data + 3 * (size_t)texel);
}

static void sum_region(void *context, int r, int worker)
{
    (void)worker;
    struct gn_partition *p = context;
    struct gn_region *region = &p->regions[r];
    uint32_t start = p->plan->start[r];
    gn_patch_add_texels(&region->patch, p->map, p->plan->texel + start,
                        p->plan->start[r + 1] - start);
    double w = region->patch.solid_angle;
    region->mean = w > 0 ? region->patch.energy / w : 0;
    region->n_items = region->patch.n_lit;
}

/* The samples as items, sorted by region, in their own order within. */
static int sort_samples(struct gn_partition *p)
{
    int n = p->samples.n, n_regions = p->plan->n_regions;
    int *of = malloc((size_t)n * sizeof(*of) + 1);
    p->items = malloc((size_t)n * sizeof(*p->items) + 1);
    p->sample_start = calloc((size_t)n_regions + 2, sizeof(*p->sample_start));
    if (!of || !p->items || !p->sample_start) {
        free(of);
        return -ENOMEM;
    }
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
                (float)(get_luminance(p, texel) / p->map->figures.max_luminance),
                texel,
                1};
        }
        for (int r = 0; pass == 0 && r < n_regions; r++)
            next[r + 1] += next[r];
    }
    free(of);
    return 0;
}

static int draw_samples(struct gn_partition *p, struct gn_light_figures *figures)
{
    const struct gn_map_sampling sampling = {.n_wanted = p->settings->n_samples,
                                             .is_plain =
                                                 gn_partition_is_literal(p, GN_READ_PLAIN_SAMPLING),
                                             .is_relaxed = p->settings->relaxed};
    int rc = gn_map_samples_draw(p->map, &sampling, &p->samples);
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
            double y = get_luminance(p, p->items[i].texel);
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

/* The largest luminance after a 5 x 5 mean over texels that show something: one hot texel does not
 * decide for all. */
static double get_smoothed_max(const struct gn_radiance_map *map)
{
    double max = 0;
    int width = map->radiance.width, height = map->radiance.height;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double sum = 0, weight = 0;
            for (int i = 0; i < 25; i++) {
                int nx = x + i % 5 - 2, ny = y + i / 5 - 2;
                if (nx < 0 || nx >= width || ny < 0 || ny >= height)
                    continue;
                double w = (double)map->solid_angle[(size_t)ny * (size_t)width + (size_t)nx];
                sum += w * gn_luminance(gn_image_at(&map->radiance, nx, ny));
                weight += w;
            }
            max = weight > 0 ? fmax(max, sum / weight) : max;
        }
    }
    return max;
}

/* Where the parts of one region go, in order. */
struct part_sink {
    struct gn_partition *partition;
    struct gn_region *region;
    int n;
};

static uint32_t find_brightest(const struct gn_partition *p, const struct gn_split_item *items,
                               int n)
{
    uint32_t best = items[0].texel;
    for (int i = 0; i < n; i++) {
        for (uint32_t t = items[i].texel; t < items[i].texel + items[i].n; t++) {
            double y = get_luminance(p, t), y_best = get_luminance(p, best);
            if (y > y_best || (y == y_best && t < best))
                best = t;
        }
    }
    return best;
}

static uint64_t get_region_id(const struct gn_partition *p, const struct gn_region *region,
                              uint64_t path)
{
    int r = (int)(region - p->regions), n_base = p->plan->n_regions;
    return r < n_base ? GN_LIGHT_ID_REGION | (uint64_t)r << 44 | path
                      : GN_LIGHT_ID_DARK | (uint64_t)(r - n_base) << 44 | path;
}

static void take_part(void *context, const struct gn_split_item *items, int n, uint64_t path)
{
    struct part_sink *sink = context;
    struct gn_partition *p = sink->partition;
    if (sink->n >= sink->region->n_slots)
        return;
    int slot = sink->region->first_slot + sink->n++;
    struct gn_light *light = &p->slots[slot];
    struct gn_patch patch = {0};
    bool is_brightest = gn_partition_is_literal(p, GN_READ_BRIGHTEST);
    if (is_brightest) {
        gn_patch_add_texel(&patch, p->map, find_brightest(p, items, n));
    } else {
        for (int i = 0; i < n; i++)
            gn_patch_add_run(&patch, p->map, items[i].texel, items[i].n);
    }
    p->is_lit[slot] = gn_patch_get_light(&patch, light);
    light->id = get_region_id(p, sink->region, path);
    if (!is_brightest && !gn_partition_is_literal(p, GN_READ_BRIGHTEST_DIR))
        return;
    uint32_t best = find_brightest(p, items, n);
    memcpy(light->dir_world, p->map->direction_world + 3 * (size_t)best, sizeof(light->dir_world));
    if (is_brightest) { // its radiance, without a solid angle
        light->angular_radius = 0;
        memcpy(light->irradiance, p->map->radiance.data + 3 * (size_t)best,
               sizeof(light->irradiance));
    }
}

/* Adds a base region's lit texels to the items; weights as shares of the energy, so that no scale
 * of light is too large. Of many texels those side by side are one item, while it holds less than
 * an eighth of a part: cuts need no finer ones. */
static int list_texels(const struct gn_partition *p, int r, const struct gn_region *whole,
                       struct gn_split_item *items)
{
    const struct gn_partition_plan *plan = p->plan;
    uint32_t n_joined = (plan->start[r + 1] - plan->start[r]) / 1024;
    double most = whole->patch.energy / (8.0 * (double)whole->n_parts), sum = 0;
    int n = 0;
    n_joined = n_joined < 1 ? 1 : n_joined > 16 ? 16 : n_joined;
    for (uint32_t i = plan->start[r]; i < plan->start[r + 1]; i++) {
        uint32_t texel = plan->texel[i];
        double energy = get_luminance(p, texel) * (double)p->map->solid_angle[texel];
        struct gn_split_item *last = items + n - 1;
        if (!(energy > 0))
            continue;
        if (n > 0 && last->n < n_joined && last->texel + last->n == texel && sum + energy < most) {
            sum += energy;
            last->n++;
        } else {
            sum = energy;
            last = items + n++;
            *last = (struct gn_split_item){.texel = texel, .n = 1};
        }
        memcpy(last->polar, plan->polar + 2 * (size_t)(i - last->n / 2), sizeof(last->polar));
        last->weight = (float)(sum / whole->patch.energy);
    }
    return n;
}

/* The box, and the texels as items, of a region or of the dark regions of a cell. */
static int list_items(const struct gn_partition *p, int r, struct gn_polar_box *out_box)
{
    const struct gn_region *region = &p->regions[r];
    struct gn_split_item *items = p->items + region->first_item;
    int n = 0, n_base = p->plan->n_regions;
    *out_box = (struct gn_polar_box){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int k = r < n_base ? r : 0; k < (r < n_base ? r + 1 : n_base); k++) {
        struct gn_polar_box box;
        if (r >= n_base &&
            (p->regions[k].is_bright || gn_partition_plan_get_dark_cell(p->plan, k) != r - n_base))
            continue;
        gn_partition_plan_get_box(p->plan, k, &box);
        for (int c = 0; c < 2; c++) {
            out_box->low[c] = fmin(out_box->low[c], box.low[c]);
            out_box->high[c] = fmax(out_box->high[c], box.high[c]);
        }
        n += list_texels(p, k, region, items + n);
    }
    return n;
}

static bool is_cut_by_texels(const struct gn_partition *p, int r)
{
    return r >= p->plan->n_regions || !gn_partition_is_literal(p, GN_READ_BRIGHTEST);
}

/* One light of the whole. */
static bool is_whole(const struct gn_partition *p, int r)
{
    bool is_from_brightest = gn_partition_is_literal(p, GN_READ_BRIGHTEST | GN_READ_BRIGHTEST_DIR);
    return p->regions[r].n_parts == 1 && (r >= p->plan->n_regions || !is_from_brightest);
}

static void split_region(void *context, int r, int worker)
{
    (void)worker;
    struct gn_partition *p = context;
    struct gn_region *region = &p->regions[r];
    if (region->n_parts == 0)
        return;
    if (is_whole(p, r)) {
        struct gn_light *light = &p->slots[region->first_slot];
        p->is_lit[region->first_slot] = gn_patch_get_light(&region->patch, light);
        light->id = get_region_id(p, region, 1);
        return;
    }
    struct gn_polar_box box;
    struct gn_split_options options = {.n_parts = region->n_parts,
                                       .is_midpoint = gn_partition_is_literal(p, GN_READ_MIDPOINT),
                                       .is_two_strips = p->settings->metric == GN_METRIC_TWICE};
    struct part_sink sink = {p, region, 0};
    if (is_cut_by_texels(p, r)) {
        int n = list_items(p, r, &box);
        gn_region_split(p->items + region->first_item, n, &box, &options, take_part, &sink);
        return;
    }
    gn_partition_plan_get_box(p->plan, r, &box);
    gn_region_split(p->items + p->sample_start[r], region->n_items, &box, &options, take_part,
                    &sink);
}

static int split_regions(struct gn_partition *p, struct gn_pool *pool)
{
    int n_slots = 0;
    size_t n_items = 0;
    for (int r = 0; r < p->n_regions; r++) {
        struct gn_region *region = &p->regions[r];
        region->first_slot = n_slots;
        region->n_slots = (int)region->n_parts;
        region->first_item = n_items;
        n_slots += region->n_slots;
        if (region->n_parts > 0 && !is_whole(p, r))
            n_items += (size_t)region->patch.n_lit;
    }
    p->slots = calloc((size_t)n_slots + 1, sizeof(*p->slots));
    p->is_lit = calloc((size_t)n_slots + 1, sizeof(*p->is_lit));
    if (!gn_partition_is_literal(p, GN_READ_BRIGHTEST)) {
        free(p->items);
        p->items = malloc(n_items * sizeof(*p->items) + 1);
    }
    if (!p->slots || !p->is_lit || !p->items)
        return -ENOMEM;
    gn_pool_run(pool, p->n_regions, split_region, p);
    return 0;
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
    if (p->needs_samples) {
        int rc = draw_samples(p, figures);
        if (rc < 0)
            return rc;
        take_sample_figures(p);
    }
    if (p->settings->metric != GN_METRIC_LOG2 && !gn_partition_is_literal(p, GN_READ_SAMPLE_MAX))
        p->max = get_smoothed_max(p->map);
    gn_partition_count_lights(p, figures);
    int rc = split_regions(p, p->input->pool), n_base = p->plan->n_regions;
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

int gn_partition_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                             struct gn_light_figures *figures)
{
    const struct gn_partition_plan *plan = input->plan;
    unsigned sampled = GN_READ_SAMPLE_MEAN | GN_READ_SAMPLE_MAX | GN_READ_BRIGHTEST;
    struct gn_partition p = {.input = input,
                             .map = input->map,
                             .settings = input->settings,
                             .plan = plan,
                             .n_regions = plan->n_regions + plan->n_dark_cells,
                             .needs_samples = (input->settings->literal & sampled) != 0};
    figures->rings = plan->n_rings;
    figures->sectors = plan->division.sectors;
    figures->split_gain = 1;
    if (!(p.map->figures.mean_luminance > 0))
        return 0; // all black: no lights
    p.regions = calloc((size_t)p.n_regions, sizeof(*p.regions));
    int rc = p.regions ? make_lights(&p, list, figures) : -ENOMEM;
    free(p.is_lit);
    free(p.slots);
    free(p.items);
    free(p.sample_start);
    gn_map_samples_finish(&p.samples);
    free(p.regions);
    return rc;
}
