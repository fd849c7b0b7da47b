/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Looks for the chart by what it is whatever light it stands in: bright parallelograms, alike in
 * size, on a grid of 6 x 4, in the order of brightness of the published reflectances. Regions above
 * each of many levels are taken whose area is that of the parallelogram with their moments; a grid
 * is grown from each of them and two neighbours.
 */
#include "client/calibrate/chart_find.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/chart.h"
#include "client/calibrate/solve.h"
#include "common/compare.h"

enum {
    MAX_SIDE = 900, // px of the picture that is looked in
    LEVELS = 48,    // that regions are above
    MAX_REGIONS = 400,
    MIN_AREA = 30, // px of a region
    REACH = 11,    // nodes of a grid from the first one, each way: two charts
    SPAN = 2 * REACH + 1,
    MIN_PATCHES = 12, // seen of the chart's 24
    ENOUGH = 20,      // no better grid is looked for
};

/* Area of a region over that of the parallelogram with its moments, which is 12 sqrt(det). */
#define LEAST_FILL 0.88
#define MOST_FILL 1.05
/* Distance of a node from where the grid expects it, in steps of the grid. */
#define NEAR 0.2
/* Rank correlation of a chart, and by so much any other place must be worse. */
#define LEAST_LIKENESS 0.85
#define LEAST_MARGIN 0.1

struct region {
    double x, y, area;
};

struct regions {
    struct region list[MAX_REGIONS];
    int n;
};

/* Positions in the picture of nodes that were seen: [row][column], first one in the middle. */
struct grid {
    int node[SPAN][SPAN]; // index of the region, -1: none
    int n;
    double h[9]; // picture from grid
};

struct plane {
    int width, height;
    float *values;
};

/* Gray, made smaller by a whole factor: the mean of its squares. */
static int make_plane(const struct gn_image *image, int factor, struct plane *out)
{
    struct plane p = {.width = image->width / factor, .height = image->height / factor};
    if (p.width < 1 || p.height < 1)
        return -EDOM;
    p.values = calloc((size_t)p.width * (size_t)p.height, sizeof(*p.values));
    if (!p.values)
        return -ENOMEM;
    for (int y = 0; y < p.height * factor; y++)
        for (int x = 0; x < p.width * factor; x++) {
            const float *from = gn_image_at(image, x, y);
            float sum = from[0];
            for (int c = 1; c < image->channels; c++)
                sum += from[c];
            p.values[(size_t)(y / factor) * (size_t)p.width + (size_t)(x / factor)] +=
                isfinite(sum) ? sum : 0;
        }
    *out = p;
    return 0;
}

/* Levels that part the pixels into equal shares. */
static int find_levels(const struct plane *p, float levels[LEVELS])
{
    size_t n = (size_t)p->width * (size_t)p->height;
    float *sorted = malloc(n * sizeof(*sorted));
    if (!sorted)
        return -ENOMEM;
    memcpy(sorted, p->values, n * sizeof(*sorted));
    qsort(sorted, n, sizeof(*sorted), gn_compare_floats);
    for (size_t i = 0; i < LEVELS; i++)
        levels[i] = sorted[(n - 1) * (i + 1) / (LEVELS + 1)];
    free(sorted);
    return 0;
}

static double get_square(double x, double y)
{
    return x * x + y * y;
}

/* Takes a region if it is one of the sought kind; of several about one place the largest stays. */
static void add_region(struct regions *r, const double sum[6])
{
    double n = sum[0], x = sum[1] / n, y = sum[2] / n;
    // A pixel is a square of its own: 1/12 more.
    double xx = sum[3] / n - x * x + 1.0 / 12, yy = sum[4] / n - y * y + 1.0 / 12;
    double xy = sum[5] / n - x * y, root = sqrt(fmax(xx * yy - xy * xy, 1e-12));
    double fill = n / (12 * root), trace = xx + yy;
    if (fill < LEAST_FILL || fill > MOST_FILL || trace * trace > 12 * root * root) // 1 : 3
        return;
    for (int i = 0; i < r->n; i++) {
        struct region *old = &r->list[i];
        if (get_square(old->x - x, old->y - y) < 0.3 * 0.3 * fmin(n, old->area)) {
            if (n > old->area)
                *old = (struct region){x, y, n};
            return;
        }
    }
    if (r->n < MAX_REGIONS)
        r->list[r->n++] = (struct region){x, y, n};
}

/* The region above a level that has the pixel at `seed`: its pixels are marked, its moments. */
static void flood(const struct plane *p, float level, int seed, uint8_t *is_seen, int *stack,
                  double sum[6], bool *out_is_cut)
{
    int n = 1;
    stack[0] = seed;
    is_seen[seed] = 1;
    *out_is_cut = false;
    while (n > 0) {
        int at = stack[--n], x = at % p->width, y = at / p->width;
        double px = x + 0.5, py = y + 0.5;
        const double add[6] = {1, px, py, px * px, py * py, px * py};
        for (int i = 0; i < 6; i++)
            sum[i] += add[i];
        *out_is_cut |= x == 0 || y == 0 || x == p->width - 1 || y == p->height - 1;
        const int next[4] = {x > 0 ? at - 1 : -1, x < p->width - 1 ? at + 1 : -1,
                             y > 0 ? at - p->width : -1, y < p->height - 1 ? at + p->width : -1};
        for (int i = 0; i < 4; i++)
            if (next[i] >= 0 && !is_seen[next[i]] && p->values[next[i]] > level) {
                is_seen[next[i]] = 1;
                stack[n++] = next[i];
            }
    }
}

static int find_regions(const struct plane *p, struct regions *out)
{
    int n = p->width * p->height;
    float levels[LEVELS];
    uint8_t *is_seen = malloc((size_t)n);
    int *stack = malloc((size_t)n * sizeof(*stack));
    int err = is_seen && stack ? find_levels(p, levels) : -ENOMEM;
    // From the brightest down: where regions are too many the bright ones are there.
    for (int l = LEVELS - 1; !err && l >= 0; l--) {
        memset(is_seen, 0, (size_t)n);
        for (int i = 0; i < n; i++) {
            double sum[6] = {0};
            bool is_cut;
            if (is_seen[i] || !(p->values[i] > levels[l]))
                continue;
            flood(p, levels[l], i, is_seen, stack, sum, &is_cut);
            if (!is_cut && sum[0] >= MIN_AREA && sum[0] < n / 24.0)
                add_region(out, sum);
        }
    }
    free(is_seen);
    free(stack);
    return err;
}

static void map_point(const double h[static 9], double x, double y, double out[2])
{
    double w = h[6] * x + h[7] * y + h[8];
    out[0] = (h[0] * x + h[1] * y + h[2]) / w;
    out[1] = (h[3] * x + h[4] * y + h[5]) / w;
}

/* Least squares of the nodes seen; affine while they are few, h33 = 1. */
static int fit_grid(const struct regions *r, struct grid *g)
{
    double a[2 * SPAN * SPAN * 8], b[2 * SPAN * SPAN], x[8] = {0};
    int m = 0, n = g->n >= 9 ? 8 : 6;
    for (int v = 0; v < SPAN; v++)
        for (int u = 0; u < SPAN; u++) {
            if (g->node[v][u] < 0)
                continue;
            const struct region *at = &r->list[g->node[v][u]];
            double gu = u - REACH, gv = v - REACH, to[2] = {at->x, at->y};
            for (int i = 0; i < 2; i++, m++) {
                double row[8] = {0, 0, 0, 0, 0, 0, -to[i] * gu, -to[i] * gv};
                row[3 * i] = gu;
                row[3 * i + 1] = gv;
                row[3 * i + 2] = 1;
                memcpy(a + m * n, row, (size_t)n * sizeof(double));
                b[m] = to[i];
            }
        }
    if (gn_solve_least_squares(a, b, m, n, x) < 0)
        return -EDOM;
    memcpy(g->h, x, sizeof(x));
    g->h[8] = 1;
    return 0;
}

/* The region next to where the grid expects a node; -1: none near enough, or of another size. */
static int find_node(const struct regions *r, const struct grid *g, double u, double v, double area)
{
    double at[2], right[2], below[2];
    int found = -1;
    map_point(g->h, u, v, at);
    map_point(g->h, u + 1, v, right);
    map_point(g->h, u, v + 1, below);
    double step_square = fmin(get_square(right[0] - at[0], right[1] - at[1]),
                              get_square(below[0] - at[0], below[1] - at[1]));
    double best = NEAR * NEAR * step_square; // squared, as this loop is where the time goes
    for (int i = 0; i < r->n; i++) {
        double d = get_square(r->list[i].x - at[0], r->list[i].y - at[1]);
        double ratio = r->list[i].area / area;
        if (d < best && ratio > 0.4 && ratio < 2.5) {
            best = d;
            found = i;
        }
    }
    return found;
}

/* Whether a node is there in the same row or column, `reach` steps away at most. */
static bool has_neighbour(const struct grid *g, int u, int v, int reach)
{
    for (int i = -reach; i <= reach; i++) {
        if (u + i >= 0 && u + i < SPAN && g->node[v][u + i] >= 0)
            return true;
        if (v + i >= 0 && v + i < SPAN && g->node[v + i][u] >= 0)
            return true;
    }
    return false;
}

/* Grows the grid that three regions begin until it has no more: by neighbours, and
 * over one that is not seen where there are none. */
static void grow(const struct regions *r, int origin, int right, int below, struct grid *g)
{
    memset(g->node, -1, sizeof(g->node));
    g->node[REACH][REACH] = origin;
    g->node[REACH][REACH + 1] = right;
    g->node[REACH + 1][REACH] = below;
    g->n = 3;
    for (int reach = 1; reach <= 2;) {
        int before = g->n;
        if (fit_grid(r, g) < 0)
            return;
        for (int v = 0; v < SPAN; v++)
            for (int u = 0; u < SPAN; u++) {
                if (g->node[v][u] >= 0 || !has_neighbour(g, u, v, reach))
                    continue;
                g->node[v][u] = find_node(r, g, u - REACH, v - REACH, r->list[origin].area);
                g->n += g->node[v][u] >= 0;
            }
        if (g->n < 5) // chance ends here
            return;
        reach = g->n > before ? 1 : reach + 1;
    }
}

/* Nodes seen in a window of the grid. */
static int count_window(const struct grid *g, int u0, int v0, int columns, int rows)
{
    int n = 0;
    for (int v = v0; v < v0 + rows; v++)
        for (int u = u0; u < u0 + columns; u++)
            n += g->node[v][u] >= 0;
    return n;
}

static int count_best(const struct grid *g)
{
    int best = 0;
    for (int turned = 0; turned < 2; turned++) {
        int columns = turned ? 4 : 6, rows = turned ? 6 : 4;
        for (int v = 0; v + rows <= SPAN; v++)
            for (int u = 0; u + columns <= SPAN; u++) {
                int n = count_window(g, u, v, columns, rows);
                best = n > best ? n : best;
            }
    }
    return best;
}

/* The grid in whose best window most of the chart is seen. */
static int find_grid(const struct regions *r, struct grid *out)
{
    int best = 0;
    for (int i = 0; i < r->n; i++) {
        const struct region *o = &r->list[i];
        int near[24], n = 0;
        for (int k = 0; k < r->n && n < 24; k++) {
            double d = hypot(r->list[k].x - o->x, r->list[k].y - o->y) / sqrt(o->area);
            double ratio = r->list[k].area / o->area;
            if (k != i && d > 0.8 && d < 1.8 && ratio > 0.5 && ratio < 2)
                near[n++] = k;
        }
        for (int a = 0; a < n; a++)
            for (int b = 0; b < n && best < ENOUGH; b++) {
                const struct region *p = &r->list[near[a]], *q = &r->list[near[b]];
                double ux = p->x - o->x, uy = p->y - o->y, vx = q->x - o->x, vy = q->y - o->y;
                // Right-handed with y down: a mirrored chart is none. 50 to 130 degrees.
                if (ux * vy - uy * vx < 0.77 * hypot(ux, uy) * hypot(vx, vy))
                    continue;
                struct grid g;
                grow(r, i, near[a], near[b], &g);
                int seen = count_best(&g);
                if (seen > best) {
                    best = seen;
                    *out = g;
                }
            }
    }
    return best;
}

/* A place of the chart on the grid, and how like it is. */
struct place {
    struct gn_chart_place at;
    double likeness;
};

/* Corners of a window as the chart's, beginning at its corner `way` of four. */
static void set_place(const struct grid *g, double factor, int u0, int v0, int columns, int rows,
                      int way, struct gn_chart_place *out)
{
    const double corners[4][2] = {
        {u0, v0}, {u0 + columns - 1, v0}, {u0 + columns - 1, v0 + rows - 1}, {u0, v0 + rows - 1}};
    for (int i = 0; i < 4; i++) {
        double xy[2];
        const double *from = corners[(i + way) % 4];
        map_point(g->h, from[0] - REACH, from[1] - REACH, xy);
        out->corners[2 * i] = factor * xy[0];
        out->corners[2 * i + 1] = factor * xy[1];
    }
}

/* All windows that show nearly as much as the best, the two ways the chart may lie in each. */
static int choose(const struct gn_image *image, const struct grid *g, double factor, int seen,
                  struct gn_chart_place *out, struct gn_error *out_error)
{
    struct place best = {.likeness = -1};
    double second = -1;
    for (int i = 0; i < 4; i++) {
        int columns = i % 2 ? 4 : 6, rows = i % 2 ? 6 : 4;
        for (int v = 0; v + rows <= SPAN; v++)
            for (int u = 0; u + columns <= SPAN; u++) {
                struct place tried;
                if (count_window(g, u, v, columns, rows) < seen - 2)
                    continue;
                set_place(g, factor, u, v, columns, rows, i, &tried.at);
                tried.likeness = gn_chart_get_likeness(image, &tried.at);
                if (tried.likeness > best.likeness) {
                    second = best.likeness;
                    best = tried;
                } else {
                    second = fmax(second, tried.likeness);
                }
            }
    }
    if (best.likeness < LEAST_LIKENESS)
        return 0;
    if (best.likeness - second < LEAST_MARGIN)
        return gn_error_set(out_error, -EDOM,
                            "a chart may lie in two ways (%.2f and %.2f of 1 like its greys and "
                            "colours): say where it is with --corners",
                            best.likeness, second);
    *out = best.at;
    return 1;
}

static int find_at(const struct gn_image *image, int factor, struct gn_chart_place *out,
                   struct gn_error *out_error)
{
    struct plane plane = {0};
    struct regions *regions = calloc(1, sizeof(*regions));
    struct grid grid;
    int ret = regions ? make_plane(image, factor, &plane) : -ENOMEM;
    if (!ret)
        ret = find_regions(&plane, regions);
    if (!ret) {
        int seen = find_grid(regions, &grid);
        if (seen >= MIN_PATCHES)
            ret = choose(image, &grid, factor, seen, out, out_error);
    }
    free(plane.values);
    free(regions);
    if (ret == -ENOMEM)
        return gn_error_set(out_error, ret, "out of memory");
    return ret;
}

int gn_chart_find(const struct gn_image *image, struct gn_chart_place *out_place,
                  struct gn_error *out_error)
{
    int side = image->width > image->height ? image->width : image->height;
    int first = 1 + (side - 1) / MAX_SIDE, ret = 0;
    // Noise that tears the patches apart is gone at half the size.
    for (int i = 0; i < 3 && ret == 0 && side / (first << i) >= 32; i++)
        ret = find_at(image, first << i, out_place, out_error);
    return ret;
}
