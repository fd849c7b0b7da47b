/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Inversion: a fixed set of well spread points of the square goes through the inverse of the
 * energy's cumulative distribution, rows first, then along the row, as Havran et al. do it for
 * video ("Interactive System for Dynamic Scene Lighting Using Captured Video Environment Maps",
 * 2005). Point i is the same in each frame, and light i with it. A light gets what lies nearest to
 * its point, and shines from that energy's centroid; a point that nothing is nearest to, as where
 * several fall on one texel, gives no light.
 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "common/octahedral.h"
#include "server/light/grid.h"

/* Points near a block of so many cells on a side are looked for together. */
enum { BLOCK = 8 };

/* Memory is of the scratch. */
struct points {
    const struct gn_grid *grid;
    struct gn_scratch *scratch;
    int n;
    double *rows;             // [side + 1] energy of the rows above
    double *columns;          // [side][side + 1] energy to the left in the row
    float (*dir)[3];          // [n]
    struct gn_grid_cell *sum; // [n] of what is nearest to a point
    uint8_t *n_in_cell;       // [side * side] points in a cell, 2 for more
    int n_near;
    int *near; // [n] candidates of the block at hand
    int items_capacity;
    struct gn_grid_cell *items;
};

static int reserve(struct points *p, int n)
{
    size_t side = (size_t)p->grid->side, n_points = (size_t)n;
    struct gn_scratch *s = p->scratch;
    p->n = n;
    p->rows = gn_scratch_take(s, side + 1, sizeof(*p->rows));
    p->columns = gn_scratch_take(s, side * (side + 1), sizeof(*p->columns));
    p->dir = gn_scratch_take(s, n_points, sizeof(*p->dir));
    p->sum = gn_scratch_take_zeroed(s, n_points, sizeof(*p->sum));
    p->n_in_cell = gn_scratch_take_zeroed(s, side * side, sizeof(*p->n_in_cell));
    p->near = gn_scratch_take(s, n_points, sizeof(*p->near));
    return p->rows && p->columns && p->dir && p->sum && p->n_in_cell && p->near ? 0 : -ENOMEM;
}

static void add_energies(struct points *p)
{
    int side = p->grid->side;
    p->rows[0] = 0;
    for (int y = 0; y < side; y++) {
        double *columns = p->columns + y * (side + 1);
        columns[0] = 0;
        for (int x = 0; x < side; x++)
            columns[x + 1] = columns[x] + p->grid->cell[y * side + x].energy;
        p->rows[y + 1] = p->rows[y] + columns[side];
    }
}

/* The i < n with sums[i] <= at < sums[i + 1], always one that has energy; where in it, [0, 1]. */
static int invert(const double *sums, int n, double at, double *out_fraction)
{
    int low = 0, high = n;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (sums[middle] <= at)
            low = middle;
        else
            high = middle;
    }
    while (low > 0 && !(sums[low + 1] > sums[low])) // rounded up to the end of all
        low--;
    *out_fraction = fmin(fmax((at - sums[low]) / (sums[low + 1] - sums[low]), 0), 1);
    return low;
}

/* Point i of the R2 sequence: multiples of 1 / g and 1 / g^2 with g^3 = g + 1. Source: Roberts,
 * "The Unreasonable Effectiveness of Quasirandom Sequences", 2018. */
static void get_point(int i, double out[static 2])
{
    const double g = 1.32471795724474602596;
    out[0] = fmod(0.5 + (i + 1) / g, 1);
    out[1] = fmod(0.5 + (i + 1) / (g * g), 1);
}

static void place_points(struct points *p)
{
    int side = p->grid->side;
    for (int i = 0; i < p->n; i++) {
        double at[2], fx, fy, dir[3];
        get_point(i, at);
        int y = invert(p->rows, side, at[1] * p->rows[side], &fy);
        const double *columns = p->columns + y * (side + 1);
        int x = invert(columns, side, at[0] * columns[side], &fx);
        gn_octahedral_to_direction((x + fx) / side, (y + fy) / side, dir);
        for (int c = 0; c < 3; c++)
            p->dir[i][c] = (float)dir[c];
        p->n_in_cell[y * side + x] += p->n_in_cell[y * side + x] < 2;
    }
}

static float get_distance(const float a[static 3], const float b[static 3])
{
    float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrtf(x * x + y * y + z * z);
}

/* The points that can be nearest to a direction of the block: no farther from its middle than the
 * nearest one by twice the block's radius. */
static void list_near(struct points *p, int x0, int y0)
{
    int side = p->grid->side, last = BLOCK - 1;
    const float(*dir)[3] = (const float(*)[3])p->grid->plan->dir_world;
    const float *middle = dir[(y0 + BLOCK / 2) * side + x0 + BLOCK / 2];
    float radius = 0, nearest = INFINITY;
    for (int k = 0; k < 4; k++) {
        int corner = (y0 + last * (k / 2)) * side + x0 + last * (k % 2);
        radius = fmaxf(radius, get_distance(middle, dir[corner]));
    }
    radius *= 1.3f; // the cells reach beyond their middles
    for (int i = 0; i < p->n; i++)
        nearest = fminf(nearest, get_distance(middle, p->dir[i]));
    p->n_near = 0;
    for (int i = 0; i < p->n; i++)
        if (get_distance(middle, p->dir[i]) <= nearest + 2 * radius)
            p->near[p->n_near++] = i;
}

static void give(struct points *p, const struct gn_grid_cell *cell)
{
    double best = -INFINITY;
    int owner = 0;
    for (int k = 0; k < p->n_near; k++) {
        const float *d = p->dir[p->near[k]];
        double dot = (double)d[0] * cell->toward[0] + (double)d[1] * cell->toward[1] +
                     (double)d[2] * cell->toward[2];
        if (dot > best) {
            best = dot;
            owner = p->near[k];
        }
    }
    gn_grid_cell_add(&p->sum[owner], cell);
}

/* Where a cell has several points, each may have some of its texels. */
static int give_items(struct points *p, int cell)
{
    int n = gn_grid_count_items(p->grid, cell);
    if (n > p->items_capacity) {
        struct gn_grid_cell *items = gn_scratch_take(p->scratch, (size_t)n, sizeof(*items));
        if (!items)
            return -ENOMEM;
        p->items = items;
        p->items_capacity = n;
    }
    n = gn_grid_list_items(p->grid, cell, p->items);
    for (int i = 0; i < n; i++)
        give(p, &p->items[i]);
    return 0;
}

static int share_out(struct points *p)
{
    int side = p->grid->side, blocks = side / BLOCK, rc = 0;
    for (int b = 0; b < blocks * blocks; b++) {
        int x0 = b % blocks * BLOCK, y0 = b / blocks * BLOCK;
        bool has_near = false;
        for (int k = 0; k < BLOCK * BLOCK && rc == 0; k++) {
            int i = (y0 + k / BLOCK) * side + x0 + k % BLOCK;
            if (!(p->grid->cell[i].energy > 0))
                continue;
            if (!has_near)
                list_near(p, x0, y0);
            has_near = true;
            if (p->n_in_cell[i] > 1)
                rc = give_items(p, i);
            else
                give(p, &p->grid->cell[i]);
        }
    }
    return rc;
}

static int make_lights(struct points *p, int n, struct gn_light_list *list)
{
    int rc = reserve(p, n);
    if (rc < 0)
        return rc;
    add_energies(p);
    if (!(p->rows[p->grid->side] > 0)) {
        p->n = 0;
        return 0;
    }
    place_points(p);
    rc = share_out(p);
    for (int i = 0; i < p->n && rc == 0; i++) {
        struct gn_light light;
        if (!gn_grid_cell_get_light(&p->sum[i], &light))
            continue;
        light.id = (uint64_t)i + 1;
        rc = gn_light_list_add(list, &light);
    }
    return rc;
}

int gn_inversion_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                             struct gn_light_figures *figures)
{
    struct gn_grid grid;
    struct points points = {.grid = &grid, .scratch = input->scratch};
    int rc = gn_grid_init(&grid, input);
    if (rc == 0)
        rc = make_lights(&points, input->settings->n_aim, list);
    figures->n_samples = points.n;
    return rc;
}
