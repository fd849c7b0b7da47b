/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/grid.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "common/octahedral.h"
#include "server/light/luminance.h"
#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;

/* Cells that the map shows in part are measured by this many positions on a side. */
enum { FILL_STEPS = 8, NO_CELL = 65536 };

struct addressing {
    struct gn_grid_plan *plan;
    uint32_t *cell; // [height][width]
};

static void find_cells_of_row(void *context, int y, int worker)
{
    (void)worker;
    struct addressing *a = context;
    const struct gn_map_table *t = a->plan->table;
    size_t width = (size_t)t->projection.width, start = (size_t)y * width;
    int side = a->plan->side;
    for (size_t i = start; i < start + width; i++) {
        const float *d = t->direction_world + 3 * i;
        double uv[2];
        a->cell[i] = NO_CELL;
        if (!(t->solid_angle[i] > 0))
            continue;
        gn_octahedral_from_direction((double[3]){(double)d[0], (double)d[1], (double)d[2]}, uv);
        int x = (int)fmin(uv[0] * side, side - 1), row = (int)fmin(uv[1] * side, side - 1);
        a->cell[i] = (uint32_t)(row * side + x);
    }
}

static int get_quarter(const struct gn_grid_plan *plan, uint32_t cell)
{
    uint32_t side = (uint32_t)plan->side, half = side / 2;
    return (cell % side >= half) + 2 * (cell / side >= half);
}

/* Where the next run of a cell, and of a quarter, belongs. */
struct next_runs {
    uint32_t *of_cell, of_quarter[GN_GRID_QUARTERS];
};

/* Counts the runs; or lists them, where there is memory. */
static void list_runs(const struct addressing *a, struct next_runs *next)
{
    struct gn_grid_plan *plan = a->plan;
    size_t width = (size_t)plan->table->projection.width;
    size_t n = width * (size_t)plan->table->projection.height;
    for (size_t i = 0; i < n;) {
        uint32_t cell = a->cell[i];
        size_t end = i + 1, row_end = i - i % width + width;
        while (end < row_end && a->cell[end] == cell)
            end++;
        if (cell != NO_CELL) {
            uint32_t *of_cell = &next->of_cell[cell];
            uint32_t *of_quarter = &next->of_quarter[get_quarter(plan, cell)];
            const struct gn_grid_run run = {(uint32_t)i, (uint32_t)(end - i), cell};
            if (plan->run) {
                plan->run[*of_cell] = run;
                plan->in_order[*of_quarter] = run;
            }
            ++*of_cell;
            ++*of_quarter;
        }
        i = end;
    }
}

/* Turns counts into places, and gets memory. */
static int place_runs(struct gn_grid_plan *plan, struct next_runs *next)
{
    uint32_t n = 0;
    for (int c = 0; c < plan->side * plan->side; c++) {
        plan->start[c] = n;
        n += next->of_cell[c];
        next->of_cell[c] = plan->start[c];
    }
    plan->start[plan->side * plan->side] = n;
    for (int q = 0; q < GN_GRID_QUARTERS; q++) {
        plan->quarter_start[q + 1] = plan->quarter_start[q] + next->of_quarter[q];
        next->of_quarter[q] = plan->quarter_start[q];
    }
    plan->run = malloc(n * sizeof(*plan->run) + 1);
    plan->in_order = malloc(n * sizeof(*plan->in_order) + 1);
    return plan->run && plan->in_order ? 0 : -ENOMEM;
}

static int sort_texels(struct gn_grid_plan *plan, struct gn_pool *pool)
{
    const struct gn_projection *p = &plan->table->projection;
    size_t n_cells = (size_t)plan->side * (size_t)plan->side;
    struct addressing a = {plan, malloc((size_t)p->width * (size_t)p->height * sizeof(*a.cell))};
    struct next_runs next = {.of_cell = calloc(n_cells, sizeof(*next.of_cell))};
    plan->start = malloc((n_cells + 1) * sizeof(*plan->start));
    int rc = a.cell && next.of_cell && plan->start ? 0 : -ENOMEM;
    if (rc == 0) {
        gn_pool_run(pool, p->height, find_cells_of_row, &a);
        list_runs(&a, &next);
        rc = place_runs(plan, &next);
    }
    if (rc == 0)
        list_runs(&a, &next);
    free(a.cell);
    free(next.of_cell);
    return rc;
}

/* Adds the position to a cell's fill where the map does not show it. */
static bool add_fill(const struct gn_map_table *t, double u, double v, double weight,
                     double fill[static 4])
{
    double dir[3], probe[3], xy[2];
    gn_octahedral_to_direction(u, v, dir);
    const double *m = t->world_from_probe;
    for (int c = 0; c < 3; c++)
        probe[c] = m[c] * dir[0] + m[3 + c] * dir[1] + m[6 + c] * dir[2];
    if (gn_projection_get_position(&t->projection, probe, xy))
        return false;
    fill[0] += weight;
    for (int c = 0; c < 3; c++)
        fill[1 + c] += weight * dir[c];
    return true;
}

static void measure_fill(const struct gn_grid_plan *plan, int x, int y, double out[static 4])
{
    const struct gn_map_table *t = plan->table;
    int n_hidden = 0;
    memset(out, 0, 4 * sizeof(*out));
    for (int k = 0; k < 4; k++) {
        double corner[4];
        n_hidden += add_fill(t, (x + k % 2) / (double)plan->side, (y + k / 2) / (double)plan->side,
                             1, corner);
    }
    int steps = n_hidden == 0 || n_hidden == 4 ? 1 : FILL_STEPS;
    double weight = 4 * pi / plan->side / plan->side / steps / steps;
    for (int k = 0; k < steps * steps; k++)
        add_fill(t, (x + (k % steps + 0.5) / steps) / plan->side,
                 (y + (k / steps + 0.5) / steps) / plan->side, weight, out);
}

static int list_fill(struct gn_grid_plan *plan)
{
    int n = plan->side * plan->side;
    double sum = 0;
    if (!(plan->table->fill_solid_angle > 0))
        return 0;
    plan->fill = calloc((size_t)n, sizeof(*plan->fill));
    if (!plan->fill)
        return -ENOMEM;
    for (int i = 0; i < n; i++) {
        double fill[4];
        measure_fill(plan, i % plan->side, i / plan->side, fill);
        for (int k = 0; k < 4; k++)
            plan->fill[i][k] = (float)fill[k];
        sum += (double)plan->fill[i][0];
    }
    // Texels cut by the circle count only in part: their cells' share is the whole's remainder.
    for (int i = 0; i < n && sum > 0; i++)
        for (int k = 0; k < 4; k++)
            plan->fill[i][k] *= (float)(plan->table->fill_solid_angle / sum);
    return 0;
}

/* A quarter as many cells as a map of this resolution needs texels for the whole sphere; the
 * finest, whose cells cost as much as their texels, for eight texels a cell. */
static int choose_side(const struct gn_map_table *t)
{
    double n = (double)t->projection.width * (double)t->projection.height;
    double whole = t->shown_solid_angle > 0 ? n * 4 * pi / t->shown_solid_angle : n;
    int side = 8;
    while (side < GN_GRID_SIDE_MAX / 2 && 4.0 * side * side < whole)
        side *= 2;
    return whole >= 8.0 * GN_GRID_SIDE_MAX * GN_GRID_SIDE_MAX ? GN_GRID_SIDE_MAX : side;
}

static int fill_plan(struct gn_grid_plan *plan, struct gn_pool *pool)
{
    plan->side = choose_side(plan->table);
    int n = plan->side * plan->side;
    plan->dir_world = malloc((size_t)n * sizeof(*plan->dir_world));
    if (!plan->dir_world)
        return -ENOMEM;
    for (int i = 0; i < n; i++) {
        double dir[3];
        gn_octahedral_to_direction((i % plan->side + 0.5) / plan->side,
                                   (i / plan->side + 0.5) / plan->side, dir);
        for (int c = 0; c < 3; c++)
            plan->dir_world[i][c] = (float)dir[c];
    }
    int rc = sort_texels(plan, pool);
    return rc < 0 ? rc : list_fill(plan);
}

static int create_plan(const struct gn_light_input *input, struct gn_grid_plan **out_plan)
{
    const struct gn_lighting_state *last = input->previous;
    struct gn_grid_plan *previous = last && last->memory ? last->memory->grid : NULL;
    *out_plan = previous;
    if (previous && previous->table == input->map->table) {
        atomic_fetch_add_explicit(&previous->references, 1, memory_order_relaxed);
        return 0;
    }
    struct gn_grid_plan *plan = calloc(1, sizeof(*plan));
    *out_plan = NULL;
    if (!plan)
        return -ENOMEM;
    atomic_init(&plan->references, 1);
    plan->table = gn_map_table_ref(input->map->table);
    int rc = fill_plan(plan, input->pool);
    if (rc < 0)
        gn_grid_plan_unref(&plan);
    *out_plan = plan;
    return rc;
}

void gn_grid_plan_unref(struct gn_grid_plan **plan)
{
    struct gn_grid_plan *p = *plan;
    *plan = NULL;
    if (!p || atomic_fetch_sub_explicit(&p->references, 1, memory_order_acq_rel) != 1)
        return;
    free(p->fill);
    free(p->dir_world);
    free(p->in_order);
    free(p->run);
    free(p->start);
    gn_map_table_unref(&p->table);
    free(p);
}

/* Adds n texels that follow each other. They are few: in float, their sums are good to 1e-6, and
 * there is no faster way to read a map. */
static void add_texels(const struct gn_radiance_map *map, size_t first, size_t n,
                       struct gn_grid_cell *cell)
{
    const float *l = map->radiance.data + 3 * first, *d = map->direction_world + 3 * first;
    const float *weight = map->solid_angle + first;
    float r = 0, g = 0, b = 0, x = 0, y = 0, z = 0, spread = 0;
    for (size_t i = 0; i < n; i++, l += 3, d += 3) {
        float w = weight[i], tr = l[0] * w, tg = l[1] * w, tb = l[2] * w;
        float energy =
            (float)GN_LUMINANCE_R * tr + (float)GN_LUMINANCE_G * tg + (float)GN_LUMINANCE_B * tb;
        r += tr;
        g += tg;
        b += tb;
        x += energy * d[0];
        y += energy * d[1];
        z += energy * d[2];
        spread += energy * w;
    }
    cell->irradiance[0] += (double)r;
    cell->irradiance[1] += (double)g;
    cell->irradiance[2] += (double)b;
    cell->toward[0] += (double)x;
    cell->toward[1] += (double)y;
    cell->toward[2] += (double)z;
    cell->own_spread += (double)spread;
}

/* After all texels are added. */
static void finish_cell(struct gn_grid_cell *cell)
{
    const double *e = cell->irradiance;
    cell->energy = gn_luminance_of_sum(e);
    cell->own_spread /= 4 * pi;
}

static struct gn_grid_cell get_fill(const struct gn_grid *grid, int cell)
{
    const float *fill = grid->plan->fill[cell];
    double y = gn_luminance(grid->map->fill);
    struct gn_grid_cell sum = {.energy = y * (double)fill[0]};
    sum.own_spread = sum.energy * (double)fill[0] / (4 * pi);
    for (int c = 0; c < 3; c++) {
        sum.irradiance[c] = (double)grid->map->fill[c] * (double)fill[0];
        sum.toward[c] = y * (double)fill[1 + c];
    }
    return sum;
}

static void sum_quarter(void *context, int quarter, int worker)
{
    (void)worker;
    struct gn_grid *grid = context;
    const struct gn_grid_plan *plan = grid->plan;
    bool has_fill = plan->fill && gn_luminance(grid->map->fill) > 0;
    for (uint32_t k = plan->quarter_start[quarter]; k < plan->quarter_start[quarter + 1]; k++) {
        const struct gn_grid_run *run = &plan->in_order[k];
        add_texels(grid->map, run->texel, run->n, &grid->cell[run->cell]);
    }
    for (int y = 0, half = grid->side / 2; y < half; y++) {
        int first = (quarter / 2 * half + y) * grid->side + quarter % 2 * half;
        for (int i = first; i < first + half; i++) {
            finish_cell(&grid->cell[i]);
            if (has_fill && plan->fill[i][0] > 0) {
                struct gn_grid_cell fill = get_fill(grid, i);
                gn_grid_cell_add(&grid->cell[i], &fill);
            }
        }
    }
}

int gn_grid_init(struct gn_grid *grid, const struct gn_light_input *input)
{
    *grid = (struct gn_grid){.map = input->map};
    int rc = create_plan(input, &input->memory->grid);
    if (rc < 0)
        return rc;
    grid->plan = input->memory->grid;
    grid->side = grid->plan->side;
    grid->cell = gn_scratch_take_zeroed(input->scratch, (size_t)grid->side * (size_t)grid->side,
                                        sizeof(*grid->cell));
    if (!grid->cell)
        return -ENOMEM;
    gn_pool_run(input->pool, GN_GRID_QUARTERS, sum_quarter, grid);
    return 0;
}

void gn_grid_cell_add(struct gn_grid_cell *cell, const struct gn_grid_cell *other)
{
    for (int c = 0; c < 3; c++) {
        cell->irradiance[c] += other->irradiance[c];
        cell->toward[c] += other->toward[c];
    }
    cell->energy += other->energy;
    cell->own_spread += other->own_spread;
}

bool gn_grid_cell_get_light(const struct gn_grid_cell *cell, struct gn_light *out_light)
{
    struct gn_patch patch = {.energy = cell->energy, .own_spread = cell->own_spread};
    memcpy(patch.irradiance, cell->irradiance, sizeof(patch.irradiance));
    memcpy(patch.toward, cell->toward, sizeof(patch.toward));
    return gn_patch_get_light(&patch, out_light);
}

struct gn_grid_cell gn_grid_sum(const struct gn_grid *grid, int x0, int y0, int x1, int y1)
{
    struct gn_grid_cell sum = {0};
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            gn_grid_cell_add(&sum, &grid->cell[y * grid->side + x]);
    return sum;
}

int gn_grid_count_items(const struct gn_grid *grid, int cell)
{
    const struct gn_grid_plan *plan = grid->plan;
    int n = plan->fill != NULL;
    for (uint32_t k = plan->start[cell]; k < plan->start[cell + 1]; k++)
        n += (int)plan->run[k].n;
    return n;
}

int gn_grid_list_items(const struct gn_grid *grid, int cell, struct gn_grid_cell *out_items)
{
    const struct gn_grid_plan *plan = grid->plan;
    int n = 0;
    for (uint32_t k = plan->start[cell]; k < plan->start[cell + 1]; k++) {
        for (uint32_t t = 0; t < plan->run[k].n; t++) {
            struct gn_grid_cell item = {0};
            add_texels(grid->map, plan->run[k].texel + t, 1, &item);
            finish_cell(&item);
            if (item.energy > 0)
                out_items[n++] = item;
        }
    }
    if (plan->fill) {
        out_items[n] = get_fill(grid, cell);
        n += out_items[n].energy > 0;
    }
    return n;
}
