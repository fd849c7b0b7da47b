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
#include "server/light/map_samples.h"
#include "server/light/method.h"
#include "server/light/region_split.h"

/* Of the mean: means nearer than this are equal, whatever the order of their sums. */
static const double equal_slack = 1e-6;

/* Sub-regions of a region are halved at most this often: below any texel of any map. */
static const int halvings_max = 40;

/* One base region. */
struct region {
    struct gn_patch patch; // its texels
    double mean;           // MLR
    double log_ratio;      // log2(MLR / MLEM)
    bool is_bright;
    int64_t n_parts; // lights wanted, 0 or more
    int n_items;     // what can be told apart in it: lit texels, or samples
    int first_slot;  // of its lights
    int n_slots;
};

struct partition {
    const struct gn_radiance_map *map;
    const struct gn_light_settings *settings;
    const struct gn_partition_plan *plan;
    struct region *regions; // [n_regions]
    bool needs_samples;
    struct gn_map_samples samples;
    uint32_t *sample_start;      // [n_regions + 1] into sample_items
    struct gn_split_item *items; // texels in the plan's order, or samples by region
    double mean;                 // MLEM
    double max;                  // maxLumiEM
    struct gn_light *slots;
    bool *is_lit; // of slots
};

static bool is_literal(const struct partition *p, unsigned reading)
{
    return (p->settings->literal & reading) != 0;
}

static double get_luminance(const struct partition *p, uint32_t texel)
{
    return gn_luminance(p->map->radiance.data + 3 * (size_t)texel);
}

static void sum_region(void *context, int r, int worker)
{
    (void)worker;
    struct partition *p = context;
    struct region *region = &p->regions[r];
    for (uint32_t i = p->plan->start[r]; i < p->plan->start[r + 1]; i++)
        gn_patch_add_texel(&region->patch, p->map, p->plan->texel[i]);
    double w = region->patch.solid_angle;
    region->mean = w > 0 ? region->patch.energy / w : 0;
    region->n_items = region->patch.n_lit;
}

/* The samples as items, sorted by region, in their own order within. */
static int sort_samples(struct partition *p)
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
                texel};
        }
        for (int r = 0; pass == 0 && r < n_regions; r++)
            next[r + 1] += next[r];
    }
    free(of);
    return 0;
}

static int draw_samples(struct partition *p, struct gn_light_figures *figures)
{
    const struct gn_map_sampling sampling = {.n_wanted = p->settings->n_samples,
                                             .is_plain = is_literal(p, GN_READ_PLAIN_SAMPLING),
                                             .is_relaxed = p->settings->relaxed};
    int rc = gn_map_samples_draw(p->map, &sampling, &p->samples);
    if (rc == 0)
        rc = sort_samples(p);
    figures->n_samples = p->samples.n;
    return rc;
}

/* MLEM, maxLumiEM and the regions' means over the samples, where they are read so. */
static void take_sample_figures(struct partition *p)
{
    double sum = 0, max = 0;
    for (int r = 0; r < p->plan->n_regions; r++) {
        struct region *region = &p->regions[r];
        int start = (int)p->sample_start[r], end = (int)p->sample_start[r + 1];
        double region_sum = 0;
        for (int i = start; i < end; i++) {
            double y = get_luminance(p, p->items[i].texel);
            region_sum += y;
            max = fmax(max, y);
        }
        if (is_literal(p, GN_READ_SAMPLE_MEAN))
            region->mean = end > start ? region_sum / (end - start) : 0;
        if (is_literal(p, GN_READ_BRIGHTEST))
            region->n_items = end - start;
        sum += region_sum;
    }
    if (is_literal(p, GN_READ_SAMPLE_MEAN))
        p->mean = p->samples.n > 0 ? sum / p->samples.n : 0;
    if (is_literal(p, GN_READ_SAMPLE_MAX))
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

static double get_log_parts(const struct partition *p, const struct region *region, double log_gain)
{
    double k = floor(region->log_ratio + log_gain + 1e-9);
    double parts = exp2(fmin(fmax(k, 0), halvings_max));
    if (!is_literal(p, GN_READ_UNCLAMPED))
        parts = fmin(parts, p->settings->max_ls);
    return fmin(parts, region->n_items);
}

/* The paper's loop in closed form: the largest k < maxLS with MLR - MLEM > k range / maxLS. */
static double get_linear_parts(const struct partition *p, const struct region *region)
{
    double range = p->max - p->mean, n = p->settings->max_ls, parts = 1;
    if (range > equal_slack * p->mean) {
        double k = fmin(n - 1, ceil(n * (region->mean - p->mean) / range) - 1);
        bool is_pow2 = p->settings->metric == GN_METRIC_POW2;
        if (k >= 1)
            parts = is_pow2 ? exp2(fmin(k, halvings_max)) : 2 * k;
    }
    if (!is_literal(p, GN_READ_UNCLAMPED))
        parts = fmin(parts, n);
    return fmin(parts, region->n_items);
}

static int64_t choose_parts(struct partition *p, double log_gain)
{
    int64_t total = 0;
    for (int r = 0; r < p->plan->n_regions; r++) {
        struct region *region = &p->regions[r];
        region->n_parts = 0;
        if (!region->is_bright)
            continue;
        region->n_parts = p->settings->metric == GN_METRIC_LOG2
                              ? (int64_t)get_log_parts(p, region, log_gain)
                              : (int64_t)get_linear_parts(p, region);
        total += region->n_parts;
    }
    return total;
}

static void classify_regions(struct partition *p, struct gn_light_figures *figures)
{
    for (int r = 0; r < p->plan->n_regions; r++) {
        struct region *region = &p->regions[r];
        bool is_bright = is_literal(p, GN_READ_STRICT)
                             ? region->mean > p->mean * (1 + 1e-12)
                             : region->mean >= p->mean * (1 - equal_slack);
        region->is_bright = is_bright && region->mean > 0 && region->n_items > 0;
        region->log_ratio = region->is_bright ? log2(region->mean / p->mean) : 0;
        figures->n_bright += region->is_bright;
    }
}

/* The factor on MLR/MLEM, as a power of two, that brings the number nearest to the wanted one. */
static double find_log_gain(struct partition *p, int64_t n_others)
{
    int64_t wanted = p->settings->n_aim;
    double low = -64, high = 64;
    if (wanted == 0) {
        if (choose_parts(p, 0) + n_others <= GN_LIGHTS_MAX)
            return 0;
        wanted = GN_LIGHTS_MAX;
    }
    if (choose_parts(p, high) + n_others <= wanted)
        return high;
    if (choose_parts(p, low) + n_others >= wanted)
        return low;
    for (int i = 0; i < 50; i++) {
        double middle = 0.5 * (low + high);
        if (choose_parts(p, middle) + n_others <= wanted)
            low = middle;
        else
            high = middle;
    }
    int64_t below = wanted - (choose_parts(p, low) + n_others);
    int64_t above = choose_parts(p, high) + n_others - wanted;
    return above < below && wanted + above <= GN_LIGHTS_MAX ? high : low;
}

/* Where the parts of one region go, in order. */
struct part_sink {
    struct partition *partition;
    struct region *region;
    int n;
};

static void take_part(void *context, const struct gn_split_item *items, int n)
{
    struct part_sink *sink = context;
    struct partition *p = sink->partition;
    if (sink->n >= sink->region->n_slots)
        return;
    int slot = sink->region->first_slot + sink->n++;
    if (!is_literal(p, GN_READ_BRIGHTEST)) {
        struct gn_patch patch = {0};
        for (int i = 0; i < n; i++)
            gn_patch_add_texel(&patch, p->map, items[i].texel);
        p->is_lit[slot] = gn_patch_get_light(&patch, &p->slots[slot]);
        return;
    }
    uint32_t best = items[0].texel;
    for (int i = 1; i < n; i++) {
        double y = get_luminance(p, items[i].texel), y_best = get_luminance(p, best);
        if (y > y_best || (y == y_best && items[i].texel < best))
            best = items[i].texel;
    }
    const float *d = p->map->direction_world + 3 * (size_t)best;
    const float *l = p->map->radiance.data + 3 * (size_t)best;
    p->slots[slot] =
        (struct gn_light){.dir_world = {d[0], d[1], d[2]}, .irradiance = {l[0], l[1], l[2]}};
    p->is_lit[slot] = true;
}

/* The region's lit texels as items; weights as shares, so that no scale of light is too large. */
static int list_texels(struct partition *p, int r)
{
    const struct gn_partition_plan *plan = p->plan;
    double scale = 1 / p->regions[r].patch.energy;
    int n = 0;
    for (uint32_t i = plan->start[r]; i < plan->start[r + 1]; i++) {
        uint32_t texel = plan->texel[i];
        double energy = get_luminance(p, texel) * (double)p->map->solid_angle[texel];
        if (energy > 0)
            p->items[plan->start[r] + (uint32_t)n++] =
                (struct gn_split_item){{plan->polar[2 * (size_t)i], plan->polar[2 * (size_t)i + 1]},
                                       (float)(energy * scale),
                                       texel};
    }
    return n;
}

static void split_region(void *context, int r, int worker)
{
    (void)worker;
    struct partition *p = context;
    struct region *region = &p->regions[r];
    if (region->n_parts == 0)
        return;
    if (region->n_parts == 1 && !is_literal(p, GN_READ_BRIGHTEST)) {
        p->is_lit[region->first_slot] =
            gn_patch_get_light(&region->patch, &p->slots[region->first_slot]);
        return;
    }
    struct gn_polar_box box;
    gn_partition_plan_get_box(p->plan, r, &box);
    struct gn_split_options options = {.n_parts = region->n_parts,
                                       .is_midpoint = is_literal(p, GN_READ_MIDPOINT),
                                       .is_two_strips = p->settings->metric == GN_METRIC_TWICE};
    struct part_sink sink = {p, region, 0};
    bool is_samples = is_literal(p, GN_READ_BRIGHTEST);
    int n = is_samples ? region->n_items : list_texels(p, r);
    gn_region_split(p->items + (is_samples ? p->sample_start[r] : p->plan->start[r]), n, &box,
                    &options, take_part, &sink);
}

static int split_regions(struct partition *p, struct gn_pool *pool, struct gn_light_list *list)
{
    int n_slots = 0, n_regions = p->plan->n_regions;
    for (int r = 0; r < n_regions; r++) {
        struct region *region = &p->regions[r];
        region->first_slot = n_slots;
        region->n_slots = (int)region->n_parts;
        n_slots += region->n_slots;
    }
    p->slots = calloc((size_t)n_slots + 1, sizeof(*p->slots));
    p->is_lit = calloc((size_t)n_slots + 1, sizeof(*p->is_lit));
    if (!is_literal(p, GN_READ_BRIGHTEST)) {
        free(p->items);
        p->items = malloc((size_t)p->plan->start[n_regions] * sizeof(*p->items) + 1);
    }
    if (!p->slots || !p->is_lit || !p->items)
        return -ENOMEM;
    gn_pool_run(pool, n_regions, split_region, p);
    for (int i = 0; i < n_slots; i++) {
        int rc = p->is_lit[i] ? gn_light_list_add(list, &p->slots[i]) : 0;
        if (rc < 0)
            return rc;
    }
    return 0;
}

/* What bright regions leave, merged into coarser cells: sums, without lights yet. */
static int merge_dark_regions(const struct partition *p, struct gn_patch *cells)
{
    int n_lit = 0;
    memset(cells, 0, (size_t)p->plan->n_dark_cells * sizeof(*cells));
    for (int r = 0; r < p->plan->n_regions; r++)
        if (!p->regions[r].is_bright)
            gn_patch_add(&cells[gn_partition_plan_get_dark_cell(p->plan, r)], &p->regions[r].patch);
    for (int i = 0; i < p->plan->n_dark_cells; i++)
        n_lit += cells[i].energy > 0;
    return n_lit;
}

/* The brightest sample's radiance has no solid angle; one factor for all lights makes their
 * luminance that of what they stand for. Ratios stay the paper's. */
static void scale_to_map(const struct partition *p, struct gn_light_list *list)
{
    double sum = 0;
    for (int i = 0; i < list->n; i++)
        sum += gn_luminance(list->lights[i].irradiance);
    bool discards = is_literal(p, GN_READ_DISCARD_DARK); // else dark regions have their own lights
    double total = 0;
    for (int r = 0; r < p->plan->n_regions; r++)
        total += discards || p->regions[r].is_bright ? p->regions[r].patch.energy : 0;
    for (int i = 0; i < list->n && sum > 0; i++)
        for (int c = 0; c < 3; c++)
            list->lights[i].irradiance[c] *= (float)(total / sum);
}

static int add_dark_lights(const struct partition *p, const struct gn_patch *cells,
                           struct gn_light_list *list, struct gn_light_figures *figures)
{
    for (int i = 0; i < p->plan->n_dark_cells; i++) {
        struct gn_light light;
        if (!gn_patch_get_light(&cells[i], &light))
            continue;
        int rc = gn_light_list_add(list, &light);
        if (rc < 0)
            return rc;
        figures->n_dark_lights++;
    }
    return gn_light_list_add_fill(list, p->map, p->plan, &figures->n_fill_lights);
}

static int make_lights(struct partition *p, struct gn_patch *cells, struct gn_pool *pool,
                       struct gn_light_list *list, struct gn_light_figures *figures)
{
    bool discards = is_literal(p, GN_READ_DISCARD_DARK);
    gn_pool_run(pool, p->plan->n_regions, sum_region, p);
    p->mean = p->map->figures.mean_luminance;
    if (p->needs_samples) {
        int rc = draw_samples(p, figures);
        if (rc < 0)
            return rc;
        take_sample_figures(p);
    }
    bool is_linear = p->settings->metric != GN_METRIC_LOG2;
    if (is_linear && !is_literal(p, GN_READ_SAMPLE_MAX))
        p->max = get_smoothed_max(p->map);
    classify_regions(p, figures);

    int64_t n_others = merge_dark_regions(p, cells);
    n_others =
        discards ? 0 : n_others + (gn_luminance(p->map->fill) > 0 ? p->plan->n_fill_cells : 0);
    double log_gain = is_linear ? 0 : find_log_gain(p, n_others);
    figures->split_gain = exp2(log_gain);
    choose_parts(p, log_gain);
    int rc = split_regions(p, pool, list);
    if (rc == 0 && is_literal(p, GN_READ_BRIGHTEST))
        scale_to_map(p, list);
    if (rc == 0 && !discards)
        rc = add_dark_lights(p, cells, list, figures);
    return rc;
}

int gn_partition_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                             struct gn_light_figures *figures)
{
    const struct gn_radiance_map *map = input->map;
    const struct gn_light_settings *settings = input->settings;
    const struct gn_partition_plan *plan = input->plan;
    unsigned sampled = GN_READ_SAMPLE_MEAN | GN_READ_SAMPLE_MAX | GN_READ_BRIGHTEST;
    struct partition p = {.map = map,
                          .settings = settings,
                          .plan = plan,
                          .needs_samples = (settings->literal & sampled) != 0};
    figures->rings = plan->n_rings;
    figures->sectors = plan->division.sectors;
    figures->split_gain = 1;
    if (!(map->figures.mean_luminance > 0))
        return 0; // all black: no lights
    p.regions = calloc((size_t)plan->n_regions, sizeof(*p.regions));
    struct gn_patch *cells = calloc((size_t)plan->n_dark_cells, sizeof(*cells));
    int rc = p.regions && cells ? make_lights(&p, cells, input->pool, list, figures) : -ENOMEM;
    free(cells);
    free(p.is_lit);
    free(p.slots);
    free(p.items);
    free(p.sample_start);
    gn_map_samples_finish(&p.samples);
    free(p.regions);
    return rc;
}
