/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/pattern.h"

#include <math.h>
#include <string.h>

#include "client/track/normal.h"

enum {
    N = 10, // unknowns: eight coordinates, offset, gain
    MAX_STEPS = 12,
};

/** A step below this ends it, px. */
static const double end_px = 0.01;
/** How far corners may move at once and altogether, of a cell. */
static const double max_step = 0.5, max_way = 1.5;

/** Sums over all samples. */
struct sums {
    double normal[N][N], right[N];
    double n, light, light2, model, model2, both;
};

/** The pattern at a place on it, in cells: between the centres of four; white around it. */
static double get_model(const struct gn_pattern *p, double u, double v)
{
    double fx = floor(u - 0.5), fy = floor(v - 0.5), sum = 0;
    for (int k = 0; k < 4; k++) {
        int x = (int)fx + (k & 1), y = (int)fy + (k >> 1);
        double wx = k & 1 ? u - 0.5 - fx : fx + 1.5 - u;
        double wy = k >> 1 ? v - 0.5 - fy : fy + 1.5 - v;
        bool is_white =
            x < 0 || y < 0 || x >= p->cells || y >= p->cells || p->white[y * p->cells + x];
        sum += wx * wy * is_white;
    }
    return sum;
}

static void add_sample(const struct gn_grey *g, const double px[static 2], double u, double v,
                       double model, struct sums *s)
{
    const double h = 0.5;
    double light = gn_grey_sample(g, px[0], px[1]);
    double slope[2] = {
        gn_grey_sample(g, px[0] + h, px[1]) - gn_grey_sample(g, px[0] - h, px[1]),
        gn_grey_sample(g, px[0], px[1] + h) - gn_grey_sample(g, px[0], px[1] - h),
    };
    // How the place moves with the corners: as in a parallelogram, which is near enough.
    const double share[4] = {(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v};
    double row[N];
    for (int k = 0; k < 8; k++)
        row[k] = slope[k % 2] / (2 * h) * share[k / 2];
    row[8] = -1;
    row[9] = -model;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j <= i; j++)
            s->normal[i][j] += row[i] * row[j];
        s->right[i] -= row[i] * light;
    }
    s->n++;
    s->light += light;
    s->light2 += light * light;
    s->model += model;
    s->model2 += model * model;
    s->both += light * model;
}

/** Two samples along a cell's side, from a quarter of a cell outside the marker. False where
 * less than three quarters of them lie well within the picture. */
static bool sum_up(const struct gn_grey *g, const struct gn_pattern *p, double corners_px[4][2],
                   struct sums *s)
{
    memset(s, 0, sizeof(*s));
    int n = 2 * p->cells + 2;
    for (int i = 0; i < n * n; i++) {
        double u = 0.5 * (i % n) - 0.25, v = 0.5 * (i / n) - 0.25;
        double px[2];
        gn_quad_map(corners_px, u / p->cells, v / p->cells, px);
        if (!(px[0] >= 1.5 && px[1] >= 1.5 && px[0] <= g->width - 1.5 && px[1] <= g->height - 1.5))
            continue;
        add_sample(g, px, u / p->cells, v / p->cells, get_model(p, u, v), s);
    }
    return s->n >= 0.75 * n * n;
}

static double get_correlation(const struct sums *s)
{
    double light2 = s->light2 - s->light * s->light / s->n;
    double model2 = s->model2 - s->model * s->model / s->n;
    double both = s->both - s->light * s->model / s->n;
    return light2 > 0 && model2 > 0 ? both / sqrt(light2 * model2) : 0;
}

double gn_pattern_fit(const struct gn_grey *grey, const struct gn_pattern *pattern,
                      double corners_px[4][2])
{
    double found[4][2], cell = gn_quad_get_side(corners_px) / pattern->cells, best = 0;
    struct sums s = {0};
    memcpy(found, corners_px, sizeof(found));
    bool is_end = false;
    for (int step = 0; step < MAX_STEPS && !is_end; step++) {
        double largest = 0;
        if (!sum_up(grey, pattern, found, &s) || !gn_normal_decompose(s.normal[0], N))
            return 0;
        gn_normal_solve(s.normal[0], N, s.right);
        for (int k = 0; k < 8; k++)
            largest = fmax(largest, fabs(s.right[k]));
        double share = fmin(1, max_step * cell / largest);
        for (int k = 0; k < 8; k++) {
            found[k / 2][k % 2] += share * s.right[k];
            if (!(fabs(found[k / 2][k % 2] - corners_px[k / 2][k % 2]) < max_way * cell))
                return 0;
        }
        is_end = largest < end_px;
    }
    if (!sum_up(grey, pattern, found, &s))
        return 0;
    best = get_correlation(&s);
    if (best > 0)
        memcpy(corners_px, found, sizeof(found));
    return fmax(best, 0);
}
