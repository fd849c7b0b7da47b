/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/partition_plan.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;

/* The fill's cells are summed over this many directions: rows of equal solid angle. */
enum { FILL_ROWS = 256, FILL_COLUMNS = 192 };

/* More than there are: at most 1024 of a hemisphere. */
enum { NO_REGION = 65535 };

static void get_polar(const double dir[static 3], double out_polar[static 2])
{
    out_polar[0] = atan2(hypot(dir[0], dir[1]), dir[2]);
    out_polar[1] = atan2(dir[1], dir[0]);
}

static bool is_about_world_axis(const struct gn_partition_plan *plan)
{
    return gn_projection_is_full_sphere(&plan->table->projection);
}

void gn_partition_plan_get_polar(const struct gn_partition_plan *plan, uint32_t texel,
                                 double out_polar[static 2])
{
    const float *d =
        (is_about_world_axis(plan) ? plan->table->direction_world : plan->table->direction_probe) +
        3 * (size_t)texel;
    get_polar((double[3]){(double)d[0], (double)d[1], (double)d[2]}, out_polar);
}

void gn_partition_plan_get_world_polar(const struct gn_partition_plan *plan,
                                       const double dir_world[static 3], double out_polar[static 2])
{
    double dir[3] = {dir_world[0], dir_world[1], dir_world[2]};
    const double *m = plan->table->world_from_probe;
    if (!is_about_world_axis(plan))
        for (int c = 0; c < 3; c++)
            dir[c] = m[c] * dir_world[0] + m[3 + c] * dir_world[1] + m[6 + c] * dir_world[2];
    get_polar(dir, out_polar);
}

/* Share of the divided part's height, in rings, that lies above theta: [0, 1]. */
static double get_height(const struct gn_partition_plan *plan, double theta)
{
    if (plan->division.is_equal_angle)
        return theta / plan->theta_max;
    double s = sin(0.5 * theta), s_max = sin(0.5 * plan->theta_max);
    return s * s / (s_max * s_max);
}

static double get_theta(const struct gn_partition_plan *plan, double height)
{
    if (plan->division.is_equal_angle)
        return height * plan->theta_max;
    return 2 * asin(fmin(sqrt(height) * sin(0.5 * plan->theta_max), 1));
}

static int clamp_index(double x, int n)
{
    return x > 0 ? (int)fmin(x, n - 1) : 0;
}

int gn_partition_plan_find_region(const struct gn_partition_plan *plan,
                                  const double polar[static 2])
{
    int sectors = plan->division.sectors;
    int ring = clamp_index(get_height(plan, polar[0]) * plan->n_rings, plan->n_rings);
    return ring * sectors + clamp_index((polar[1] + pi) / (2 * pi) * sectors, sectors);
}

void gn_partition_plan_get_box(const struct gn_partition_plan *plan, int region,
                               struct gn_polar_box *out_box)
{
    int ring = region / plan->division.sectors, sector = region % plan->division.sectors;
    for (int i = 0; i < 2; i++) {
        double *side = i == 0 ? out_box->low : out_box->high;
        side[0] = get_theta(plan, (double)(ring + i) / plan->n_rings);
        side[1] = 2 * pi * (sector + i) / plan->division.sectors - pi;
    }
}

static int count_dark_rings(const struct gn_partition_plan *plan)
{
    int n = (int)lround((double)plan->n_rings * plan->division.dark_rings / plan->division.rings);
    return n < 1 ? 1 : n;
}

int gn_partition_plan_get_dark_cell(const struct gn_partition_plan *plan, int region)
{
    const struct gn_division *d = &plan->division;
    int ring = region / d->sectors, sector = region % d->sectors;
    return ring * count_dark_rings(plan) / plan->n_rings * d->dark_sectors +
           sector * d->dark_sectors / d->sectors;
}

/* So long that a region has a thousand runs: cuts need no finer ones. */
static uint32_t choose_run_length(const struct gn_partition_plan *plan, size_t n_shown)
{
    double n = (double)n_shown / (1024.0 * plan->n_regions);
    return n >= GN_REGION_RUN_MAX ? GN_REGION_RUN_MAX : n >= 8 ? 8 : 4;
}

/* Of a texel, or of the middle between two. */
static void get_middle_polar(const struct gn_partition_plan *plan, const struct gn_texel_run *run,
                             float out_polar[static 2])
{
    const struct gn_map_table *t = plan->table;
    const float *d = is_about_world_axis(plan) ? t->direction_world : t->direction_probe;
    const float *a = d + 3 * (size_t)(run->texel + (run->n - 1) / 2);
    const float *b = d + 3 * (size_t)(run->texel + run->n / 2);
    double middle[3], polar[2];
    for (int c = 0; c < 3; c++)
        middle[c] = (double)a[c] + (double)b[c];
    get_polar(middle, polar);
    out_polar[0] = (float)polar[0];
    out_polar[1] = (float)polar[1];
}

/* Counts the runs by region; or puts each where its region's next one belongs. */
static void visit_runs(struct gn_partition_plan *plan, const uint16_t *region, uint32_t longest,
                       uint32_t *next)
{
    uint32_t width = (uint32_t)plan->table->projection.width;
    uint32_t n = width * (uint32_t)plan->table->projection.height;
    for (uint32_t i = 0; i < n;) {
        uint32_t end = i + 1, row_end = i - i % width + width;
        while (end < row_end && end < i + longest && region[end] == region[i])
            end++;
        if (region[i] != NO_REGION) {
            uint32_t slot = next[region[i]]++;
            if (plan->run) {
                plan->run[slot] = (struct gn_texel_run){i, end - i};
                get_middle_polar(plan, &plan->run[slot], plan->polar[slot]);
            }
        }
        i = end;
    }
}

/* Finds the region of each texel that shows something; returns how many do. */
static size_t find_regions(struct gn_partition_plan *plan, uint16_t *region)
{
    const struct gn_map_table *t = plan->table;
    size_t n = (size_t)t->projection.width * (size_t)t->projection.height, n_shown = 0;
    for (size_t i = 0; i < n; i++) {
        double polar[2];
        region[i] = NO_REGION;
        if (!(t->solid_angle[i] > 0))
            continue;
        gn_partition_plan_get_polar(plan, (uint32_t)i, polar);
        region[i] = (uint16_t)gn_partition_plan_find_region(plan, polar);
        plan->solid_angle[region[i]] += (double)t->solid_angle[i];
        n_shown++;
    }
    return n_shown;
}

/* Sorts the texels that show something by region, in the map's order within. */
static int list_runs(struct gn_partition_plan *plan)
{
    const struct gn_projection *p = &plan->table->projection;
    size_t n_regions = (size_t)plan->n_regions;
    uint16_t *region = malloc((size_t)p->width * (size_t)p->height * sizeof(*region));
    uint32_t *next = calloc(n_regions, sizeof(*next));
    int rc = -ENOMEM;
    plan->solid_angle = calloc(n_regions, sizeof(*plan->solid_angle));
    plan->start = calloc(n_regions + 1, sizeof(*plan->start));
    if (!region || !next || !plan->solid_angle || !plan->start)
        goto out;
    uint32_t longest = choose_run_length(plan, find_regions(plan, region));
    visit_runs(plan, region, longest, next);
    for (size_t r = 0; r < n_regions; r++) {
        plan->start[r + 1] = plan->start[r] + next[r];
        next[r] = plan->start[r];
    }
    plan->run = calloc((size_t)plan->start[n_regions] + 1, sizeof(*plan->run));
    plan->polar = calloc((size_t)plan->start[n_regions] + 1, sizeof(*plan->polar));
    if (!plan->run || !plan->polar)
        goto out;
    visit_runs(plan, region, longest, next);
    rc = 0;
out:
    free(next);
    free(region);
    return rc;
}

/* Divides the sphere about the pole as dark regions are, and keeps what the map does not show. */
static int list_fill_cells(struct gn_partition_plan *plan)
{
    const struct gn_map_table *t = plan->table;
    const struct gn_division *d = &plan->division;
    if (!(t->fill_solid_angle > 0))
        return 0;
    int rings = 2 * d->dark_rings, n = rings * d->dark_sectors;
    plan->fill_cell = calloc((size_t)n, sizeof(*plan->fill_cell));
    if (!plan->fill_cell)
        return -ENOMEM;
    double step = 4 * pi / (FILL_ROWS * FILL_COLUMNS), sum = 0;
    for (int i = 0; i < FILL_ROWS * FILL_COLUMNS; i++) {
        int row = i / FILL_COLUMNS, column = i % FILL_COLUMNS;
        double z = 1 - 2 * (row + 0.5) / FILL_ROWS, s = sqrt(1 - z * z);
        double phi = 2 * pi * (column + 0.5) / FILL_COLUMNS - pi, xy[2];
        double dir[3] = {s * cos(phi), s * sin(phi), z};
        if (gn_projection_get_position(&t->projection, dir, xy))
            continue;
        struct gn_fill_cell *cell = &plan->fill_cell[row * rings / FILL_ROWS * d->dark_sectors +
                                                     column * d->dark_sectors / FILL_COLUMNS];
        cell->solid_angle += step;
        sum += step;
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                cell->toward[c] += step * t->world_from_probe[3 * c + k] * dir[k];
    }
    for (int i = 0; i < n; i++) {
        struct gn_fill_cell cell = plan->fill_cell[i];
        if (!(cell.solid_angle > 0))
            continue;
        cell.solid_angle *= t->fill_solid_angle / sum;
        for (int c = 0; c < 3; c++)
            cell.toward[c] *= t->fill_solid_angle / sum;
        plan->fill_cell[plan->n_fill_cells++] = cell;
    }
    return 0;
}

static int fill_plan(struct gn_partition_plan *plan)
{
    const struct gn_projection *p = &plan->table->projection;
    const struct gn_division *d = &plan->division;
    plan->theta_max = is_about_world_axis(plan) ? pi : p->theta_max;
    double hemispheres = d->is_equal_angle ? 2 * plan->theta_max / pi : 1 - cos(plan->theta_max);
    plan->n_rings = (int)fmax(lround(d->rings * hemispheres), 1);
    plan->n_regions = plan->n_rings * d->sectors;
    plan->n_dark_cells = count_dark_rings(plan) * d->dark_sectors;
    int rc = list_runs(plan);
    return rc < 0 ? rc : list_fill_cells(plan);
}

int gn_partition_plan_create(const struct gn_radiance_map *map, const struct gn_division *division,
                             struct gn_partition_plan *previous,
                             struct gn_partition_plan **out_plan)
{
    *out_plan = NULL;
    if (previous && previous->table == map->table &&
        memcmp(&previous->division, division, sizeof(*division)) == 0) {
        *out_plan = gn_partition_plan_ref(previous);
        return 0;
    }
    struct gn_partition_plan *plan = calloc(1, sizeof(*plan));
    if (!plan)
        return -ENOMEM;
    atomic_init(&plan->references, 1);
    plan->table = gn_map_table_ref(map->table);
    plan->division = *division;
    int rc = fill_plan(plan);
    if (rc < 0)
        gn_partition_plan_unref(&plan);
    *out_plan = plan;
    return rc;
}

struct gn_partition_plan *gn_partition_plan_ref(struct gn_partition_plan *plan)
{
    atomic_fetch_add_explicit(&plan->references, 1, memory_order_relaxed);
    return plan;
}

void gn_partition_plan_unref(struct gn_partition_plan **plan)
{
    struct gn_partition_plan *p = *plan;
    *plan = NULL;
    if (!p || atomic_fetch_sub_explicit(&p->references, 1, memory_order_acq_rel) != 1)
        return;
    free(p->fill_cell);
    free(p->polar);
    free(p->run);
    free(p->start);
    free(p->solid_angle);
    gn_map_table_unref(&p->table);
    free(p);
}
