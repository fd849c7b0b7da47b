/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/partition_internal.h"

/* Of the mean: means nearer than this are equal, whatever the order of their sums. */
static const double equal_slack = 1e-6;

/* Sub-regions of a region are halved at most this often: below any texel of any map. */
enum { HALVINGS_MAX = 40 };

/* A decision of the last frame stays down to 0.95 and up to 1.05 of where it would turn. */
static const double stay_low = 0.95, stay_high = 1.05;

/* Of the memory's figures; its marks are 0 for a dark region, 1 + halvings for a bright one. */
enum { MEAN, LOG_UNIT };

/* What regions are measured against. */
struct measure {
    double mean;           // MLEM: brighter regions are bright
    double log_unit;       // log2 of the luminance that gives one light, two at twice of it, ...
    const uint64_t *marks; // of the last frame, or NULL
};

static bool is_bright(const struct gn_partition *p, const struct measure *m, int r)
{
    const struct gn_region *region = &p->regions[r];
    double limit = m->mean * (m->marks ? (m->marks[r] ? stay_low : stay_high) : 1);
    bool is_above = gn_partition_is_literal(p, GN_READ_STRICT)
                        ? region->mean > limit * (1 + 1e-12)
                        : region->mean >= limit * (1 - equal_slack);
    return is_above && region->mean > 0 && region->n_items > 0;
}

/* How often the luminance is twice the unit. */
static int count_halvings(const struct gn_region *region, const struct measure *m, uint64_t mark)
{
    double ratio = region->log_mean - m->log_unit;
    double k = floor(ratio + 1e-9);
    if (mark > 0 && ratio >= (double)mark - 1 + log2(stay_low) &&
        ratio < (double)mark + log2(stay_high))
        k = (double)mark - 1;
    return (int)fmin(fmax(k, 0), HALVINGS_MAX);
}

static int64_t clamp_parts(const struct gn_partition *p, const struct gn_region *region,
                           int64_t parts)
{
    if (!gn_partition_is_literal(p, GN_READ_UNCLAMPED) && parts > p->settings->max_ls)
        parts = p->settings->max_ls;
    return parts > region->n_items ? region->n_items : parts;
}

/* The paper's loop in closed form: the largest k < maxLS with MLR - MLEM > k range / maxLS. */
static int64_t get_linear_parts(const struct gn_partition *p, const struct gn_region *region)
{
    double range = p->max - p->mean, n = p->settings->max_ls;
    int64_t parts = 1;
    if (range > equal_slack * p->mean) {
        double k = fmin(n - 1, ceil(n * (region->mean - p->mean) / range) - 1);
        bool is_pow2 = p->settings->metric == GN_METRIC_POW2;
        if (k >= 1)
            parts = is_pow2 ? INT64_C(1) << (int)fmin(k, HALVINGS_MAX) : 2 * (int64_t)k;
    }
    return clamp_parts(p, region, parts);
}

/* The lights of bright regions. */
static int64_t choose_parts(struct gn_partition *p, const struct measure *m)
{
    int64_t total = 0;
    for (int r = 0; r < p->n_regions; r++) {
        struct gn_region *region = &p->regions[r];
        region->n_parts = 0;
        if (!region->is_bright)
            continue;
        uint64_t mark = m->marks ? m->marks[r] : 0;
        if (p->settings->metric == GN_METRIC_LOG2)
            region->n_parts = clamp_parts(p, region, INT64_C(1) << count_halvings(region, m, mark));
        else
            region->n_parts = r < p->plan->n_regions ? get_linear_parts(p, region) : 1;
        total += region->n_parts;
    }
    return total;
}

/* Tells bright regions; the rest is merged into cells, which are bright where they hold light. */
static void classify(struct gn_partition *p, const struct measure *m)
{
    int n_base = p->plan->n_regions;
    struct gn_region *cells = p->regions + n_base;
    memset(cells, 0, (size_t)p->plan->n_dark_cells * sizeof(*cells));
    for (int r = 0; r < n_base; r++) {
        struct gn_region *region = &p->regions[r];
        region->is_bright = is_bright(p, m, r);
        if (region->is_bright)
            continue;
        struct gn_region *cell = &cells[gn_partition_plan_get_dark_cell(p->plan, r)];
        gn_patch_add(&cell->patch, &region->patch);
        cell->n_runs += region->n_runs;
    }
    double solid_angle = p->map->figures.shown_solid_angle / n_base;
    for (int i = 0; i < p->plan->n_dark_cells; i++) {
        double mean = cells[i].patch.energy / solid_angle; // as if in one region
        cells[i].is_bright = mean > 0 && !gn_partition_is_literal(p, GN_READ_DISCARD_DARK);
        cells[i].log_mean = mean > 0 ? log2(mean) : 0;
        cells[i].n_items = cells[i].patch.n_lit;
        if (gn_partition_is_literal(p, GN_READ_BRIGHTEST))
            cells[i].n_items = 1; // samples are of regions
    }
}

static int64_t count_fill(const struct gn_partition *p)
{
    bool has_fill =
        gn_luminance(p->map->fill) > 0 && !gn_partition_is_literal(p, GN_READ_DISCARD_DARK);
    return has_fill ? p->plan->n_fill_cells : 0;
}

/* The unit that brings the number nearest to the wanted one; without one, the mean. */
static double find_log_unit(struct gn_partition *p, double log_mean)
{
    int64_t wanted = p->settings->n_aim, n_others = count_fill(p);
    struct measure m = {.log_unit = log_mean};
    double low = log_mean - 64, high = log_mean + 64;
    if (wanted == 0) {
        if (choose_parts(p, &m) + n_others <= GN_LIGHTS_MAX)
            return log_mean;
        wanted = GN_LIGHTS_MAX;
    }
    for (int i = 0; i < 50; i++) { // more at low than at high
        m.log_unit = 0.5 * (low + high);
        if (choose_parts(p, &m) + n_others <= wanted)
            high = m.log_unit;
        else
            low = m.log_unit;
    }
    int64_t above = choose_parts(p, &(struct measure){.log_unit = low}) + n_others - wanted;
    int64_t below = wanted - choose_parts(p, &(struct measure){.log_unit = high}) - n_others;
    return above >= 0 && above < below && wanted + above <= GN_LIGHTS_MAX ? low : high;
}

/* As if there were no frame before. */
static void measure_anew(struct gn_partition *p, struct measure *m)
{
    *m = (struct measure){.mean = p->mean};
    classify(p, m);
    m->log_unit = find_log_unit(p, log2(p->mean));
}

/* What the last frame was measured against, or on the way from there to this one's own. */
static void measure_by_last(struct gn_partition *p, const struct gn_light_memory *last,
                            struct measure *out)
{
    struct measure fresh = {0}, kept = {.mean = last->figure[MEAN],
                                        .log_unit = last->figure[LOG_UNIT],
                                        .marks = last->marks};
    classify(p, &kept);
    int64_t n = choose_parts(p, &kept) + count_fill(p);
    double ratio = p->mean / kept.mean;
    if (p->settings->n_aim > 0)
        ratio = (double)n / p->settings->n_aim;
    *out = kept;
    bool is_near = p->mean < 4 * kept.mean && kept.mean < 4 * p->mean;
    if (is_near && n <= GN_LIGHTS_MAX && gn_light_is_count_kept(ratio))
        return;
    measure_anew(p, &fresh);
    double share = gn_light_get_share(p->input);
    double gap = fresh.log_unit - kept.log_unit;
    if (!is_near || n > GN_LIGHTS_MAX || fabs(gap) > 2) {
        *out = fresh;
        return;
    }
    out->mean *= pow(fresh.mean / kept.mean, share);
    out->log_unit += share * gap;
}

void gn_partition_count_lights(struct gn_partition *p, struct gn_light_figures *figures)
{
    const struct gn_light_memory *last = p->input->remembered;
    struct measure m = {.mean = p->mean, .log_unit = log2(p->mean)};
    for (int r = 0; r < p->plan->n_regions; r++)
        p->regions[r].log_mean = p->regions[r].mean > 0 ? log2(p->regions[r].mean) : 0;
    if (p->settings->metric == GN_METRIC_LOG2) {
        if (last && last->n_marks == p->n_regions)
            measure_by_last(p, last, &m);
        else
            measure_anew(p, &m);
    }
    classify(p, &m);
    choose_parts(p, &m);
    for (int r = 0; r < p->plan->n_regions; r++)
        figures->n_bright += p->regions[r].is_bright;
    figures->split_gain = exp2(log2(m.mean) - m.log_unit);
    p->mean = m.mean;
    p->log_unit = m.log_unit;
    p->marks = m.marks;
}

int gn_partition_remember(const struct gn_partition *p, struct gn_light_memory *memory)
{
    if (p->settings->metric != GN_METRIC_LOG2)
        return 0;
    memory->marks = malloc((size_t)p->n_regions * sizeof(*memory->marks));
    if (!memory->marks)
        return -ENOMEM;
    memory->n_marks = p->n_regions;
    memory->figure[MEAN] = p->mean;
    memory->figure[LOG_UNIT] = p->log_unit;
    const struct measure m = {.log_unit = p->log_unit, .marks = p->marks};
    for (int r = 0; r < p->n_regions; r++) {
        const struct gn_region *region = &p->regions[r];
        uint64_t mark = m.marks ? m.marks[r] : 0;
        memory->marks[r] = region->is_bright ? 1 + (uint64_t)count_halvings(region, &m, mark) : 0;
    }
    return 0;
}
