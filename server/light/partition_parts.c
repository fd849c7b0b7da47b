/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Cuts the regions into parts of about equal energy, a light each. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "server/light/partition_internal.h"

/* A part is cut of items no larger than this share of it, one over it; but for single texels. */
enum { FINENESS = 8 };

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
            double y = gn_partition_get_luminance(p, t),
                   y_best = gn_partition_get_luminance(p, best);
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

static void sum_items(const struct gn_partition *p, const struct gn_split_item *items, int n,
                      struct gn_patch *patch)
{
    struct gn_run_total total = {0};
    for (int i = 0; i < n; i++) {
        if (items[i].run == GN_NO_RUN)
            gn_patch_add_texel(patch, p->map, items[i].texel);
        else
            gn_run_total_add(&total, &p->sums, items[i].run);
    }
    gn_run_total_get(&total, &p->sums, patch);
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
        sum_items(p, items, n, &patch);
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

/* Adds the lit texels of a run one by one. */
static int list_texels(const struct gn_partition *p, const struct gn_texel_run *run, double whole,
                       struct gn_split_item *items)
{
    int n = 0;
    for (uint32_t i = run->texel; i < run->texel + run->n; i++) {
        double polar[2], weight = (double)p->map->solid_angle[i];
        double energy = gn_partition_get_luminance(p, i) * weight;
        if (!(energy > 0))
            continue;
        gn_partition_plan_get_polar(p->plan, i, polar);
        items[n++] = (struct gn_split_item){.polar = {(float)polar[0], (float)polar[1]},
                                            .weight = (float)(energy / whole),
                                            .texel = i,
                                            .n = 1,
                                            .run = GN_NO_RUN};
    }
    return n;
}

/* Adds a base region's lit runs to the items; weights as shares of the energy, so that no scale of
 * light is too large. A run that holds an eighth of a part is listed texel by texel. */
static int list_runs(const struct gn_partition *p, int r, const struct gn_region *whole,
                     struct gn_split_item *items)
{
    const struct gn_partition_plan *plan = p->plan;
    double most = whole->patch.energy / (FINENESS * (double)whole->n_parts);
    int n = 0;
    for (uint32_t k = plan->start[r]; k < plan->start[r + 1]; k++) {
        const struct gn_texel_run *run = &plan->run[k];
        double energy = gn_run_sums_get_energy(&p->sums, k);
        if (energy > most && run->n > 1) {
            n += list_texels(p, run, whole->patch.energy, items + n);
        } else if (energy > 0) {
            items[n] = (struct gn_split_item){.weight = (float)(energy / whole->patch.energy),
                                              .texel = run->texel,
                                              .n = run->n,
                                              .run = k};
            memcpy(items[n++].polar, plan->polar[k], sizeof(plan->polar[k]));
        }
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
        n += list_runs(p, k, region, items + n);
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

/* Most items of a region: its runs, and the texels of those that are too large for one. Not the
 * texels with light: what vanishes in the run sums' floats is an item all the same. */
static size_t count_items(const struct gn_region *region)
{
    uint64_t n = FINENESS * (uint64_t)region->n_parts; // so many hold so much
    n = n < region->n_runs ? n : region->n_runs;
    return (size_t)(region->n_runs + (GN_REGION_RUN_MAX - 1) * n);
}

int gn_partition_split_regions(struct gn_partition *p)
{
    struct gn_scratch *scratch = p->input->scratch;
    size_t n_slots = 0, n_items = 0;
    for (int r = 0; r < p->n_regions; r++) {
        struct gn_region *region = &p->regions[r];
        region->first_slot = (int)n_slots;
        region->n_slots = (int)region->n_parts;
        region->first_item = n_items;
        n_slots += (size_t)region->n_slots;
        if (region->n_parts > 0 && !is_whole(p, r))
            n_items += count_items(region);
    }
    p->slots = gn_scratch_take_zeroed(scratch, n_slots, sizeof(*p->slots));
    p->is_lit = gn_scratch_take_zeroed(scratch, n_slots, sizeof(*p->is_lit));
    if (!gn_partition_is_literal(p, GN_READ_BRIGHTEST))
        p->items = gn_scratch_take(scratch, n_items, sizeof(*p->items));
    if (!p->slots || !p->is_lit || !p->items)
        return -ENOMEM;
    gn_pool_run(p->input->pool, p->n_regions, split_region, p);
    return 0;
}
