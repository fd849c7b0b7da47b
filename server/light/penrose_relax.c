/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/penrose_relax.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Places are the centres of a raster over [0, 1]^2; the margin's are nobody's, so that no cell is
 * cut: what lies in it only bounds the cells inside. */
enum { SIDE = 384, N_BINS = 32, LEVEL = 10 };
static const double margin = 0.12;
static const double over_relaxation = 1.3;

/* Points by square bins, for the nearest one. Points outside [0, 1]^2 fall into the outer bins. */
struct bins {
    int start[N_BINS * N_BINS + 1];
    int *point; // [n], owned
};

static int get_bin(double x)
{
    return x > 0 ? (int)fmin(x * N_BINS, N_BINS - 1) : 0;
}

static int init_bins(struct bins *bins, const double (*points)[2], int n)
{
    memset(bins, 0, sizeof(*bins));
    bins->point = malloc((size_t)n * sizeof(*bins->point) + 1);
    if (!bins->point)
        return -ENOMEM;
    for (int i = 0; i < n; i++)
        bins->start[N_BINS * get_bin(points[i][1]) + get_bin(points[i][0]) + 1]++;
    for (int b = 0; b < N_BINS * N_BINS; b++)
        bins->start[b + 1] += bins->start[b];
    for (int i = n - 1; i >= 0; i--) { // filled from the back, shifted to the starts by it
        int b = N_BINS * get_bin(points[i][1]) + get_bin(points[i][0]);
        bins->point[--bins->start[b + 1]] = i;
    }
    memmove(bins->start, bins->start + 1, (N_BINS * N_BINS) * sizeof(bins->start[0]));
    bins->start[N_BINS * N_BINS] = n;
    return 0;
}

/* The nearest point: rings of bins about the place, until none nearer can follow. */
static int find_nearest(const struct bins *bins, const double (*points)[2],
                        const double place[static 2], double *out_squared)
{
    int at[2] = {get_bin(place[0]), get_bin(place[1])}, nearest = -1;
    double best = INFINITY;
    for (int ring = 0; ring < N_BINS; ring++) {
        double safe = (ring - 1.0) / N_BINS; // nothing in this ring is nearer
        if (safe > 0 && safe * safe > best)
            break;
        for (int y = at[1] - ring; y <= at[1] + ring; y++) {
            bool is_whole = y == at[1] - ring || y == at[1] + ring;
            for (int x = at[0] - ring; x <= at[0] + ring;
                 x += is_whole || ring == 0 ? 1 : 2 * ring) {
                if (x < 0 || y < 0 || x >= N_BINS || y >= N_BINS)
                    continue;
                for (int i = bins->start[N_BINS * y + x]; i < bins->start[N_BINS * y + x + 1];
                     i++) {
                    int p = bins->point[i];
                    double dx = points[p][0] - place[0], dy = points[p][1] - place[1];
                    if (dx * dx + dy * dy < best) {
                        best = dx * dx + dy * dy;
                        nearest = p;
                    }
                }
            }
        }
    }
    *out_squared = best;
    return nearest;
}

static void get_place(int x, int y, double out[static 2])
{
    out[0] = (x + 0.5) / SIDE;
    out[1] = (y + 0.5) / SIDE;
}

static bool is_inner(const double at[static 2])
{
    return at[0] >= margin && at[0] < 1 - margin && at[1] >= margin && at[1] < 1 - margin;
}

int gn_penrose_relax_measure(const double (*points)[2], int n, double density, double *out_moment)
{
    struct bins bins;
    double sum = 0, place[2], squared;
    long n_places = 0;
    int rc = init_bins(&bins, points, n);
    for (int i = 0; rc == 0 && i < SIDE * SIDE; i++) {
        get_place(i % SIDE, i / SIDE, place);
        if (!is_inner(place))
            continue;
        find_nearest(&bins, points, place, &squared);
        sum += squared;
        n_places++;
    }
    free(bins.point);
    if (rc == 0)
        *out_moment = sum / (double)n_places * density;
    return rc;
}

double gn_penrose_relax_get_importance(int phase, int level)
{
    double golden = 0.5 * (1 + sqrt(5));
    return (pow(golden, 2 * (level + (phase + 0.5) / GN_PENROSE_INDICES)) - 1) / sqrt(5);
}

/* Samples of an even importance. */
struct even {
    double importance;
    int n, capacity;
    struct gn_penrose_sample *samples; // owned
};

static double get_even(void *context, double x, double y)
{
    (void)x;
    (void)y;
    return ((const struct even *)context)->importance;
}

static double get_even_max(void *context, const double low[static 2], const double high[static 2])
{
    (void)low;
    (void)high;
    return ((const struct even *)context)->importance;
}

static int keep_sample(void *context, const struct gn_penrose_sample *sample)
{
    struct even *even = context;
    if (even->n == even->capacity) {
        int capacity = even->capacity ? 2 * even->capacity : 2048;
        struct gn_penrose_sample *samples =
            realloc(even->samples, (size_t)capacity * sizeof(*samples));
        if (!samples)
            return -ENOMEM;
        even->samples = samples;
        even->capacity = capacity;
    }
    even->samples[even->n++] = *sample;
    return 0;
}

int gn_penrose_relax_sample(double even_importance, struct gn_penrose_sample **out_samples,
                            int *out_n)
{
    struct even even = {.importance = even_importance};
    const struct gn_penrose_importance importance = {
        .size = 1, .context = &even, .get_at = get_even, .get_max = get_even_max};
    int rc = gn_penrose_sample_domain(&importance, keep_sample, &even);
    if (rc < 0) {
        free(even.samples);
        return rc;
    }
    *out_samples = even.samples;
    *out_n = even.n;
    return 0;
}

/* Working memory of one phase, [n] each. */
struct work {
    int n;
    struct gn_penrose_sample *samples;
    struct bins bins;
    double (*points)[2], (*centroid)[2];
    long *n_places;
};

/* Sums what is nearest to each point, then moves each index's vector by the mean way from point to
 * centroid, in the frame of the tile. */
static int relax_once(struct work *work, float row[static GN_PENROSE_INDICES][2])
{
    int count[GN_PENROSE_INDICES] = {0};
    double step[GN_PENROSE_INDICES][2] = {{0}}, place[2], squared;
    for (int i = 0; i < work->n; i++)
        gn_penrose_get_corrected(&work->samples[i], (const float(*)[2])row, work->points[i]);
    int rc = init_bins(&work->bins, (const double(*)[2])work->points, work->n);
    if (rc < 0)
        return rc;
    memset(work->centroid, 0, (size_t)work->n * sizeof(*work->centroid));
    memset(work->n_places, 0, (size_t)work->n * sizeof(*work->n_places));
    for (int i = 0; i < SIDE * SIDE; i++) {
        get_place(i % SIDE, i / SIDE, place);
        int p = find_nearest(&work->bins, (const double(*)[2])work->points, place, &squared);
        work->centroid[p][0] += place[0];
        work->centroid[p][1] += place[1];
        work->n_places[p]++;
    }
    free(work->bins.point);
    for (int i = 0; i < work->n; i++) {
        const struct gn_penrose_sample *s = &work->samples[i];
        if (!is_inner(work->points[i]) || work->n_places[i] == 0)
            continue;
        double angle = s->tile.direction * acos(-1) / 10, c = cos(angle), d = sin(angle);
        double n = (double)work->n_places[i] * s->tile.scale;
        double dx = (work->centroid[i][0] - (double)work->n_places[i] * work->points[i][0]) / n;
        double dy = (work->centroid[i][1] - (double)work->n_places[i] * work->points[i][1]) / n;
        int k = gn_penrose_get_structure(&s->tile);
        step[k][0] += -d * dx + c * dy; // u(d) = (-sin, cos), u(d + 5) = (-cos, -sin)
        step[k][1] += -c * dx - d * dy;
        count[k]++;
    }
    for (int k = 0; k < GN_PENROSE_INDICES; k++)
        for (int c = 0; c < 2 && count[k] > 0; c++)
            row[k][c] += (float)(over_relaxation * step[k][c] / count[k]);
    return 0;
}

int gn_penrose_relax_phase(int phase, int n_iterations, float out_row[static GN_PENROSE_INDICES][2])
{
    struct work work = {0};
    float row[GN_PENROSE_INDICES][2] = {{0}};
    int rc = gn_penrose_relax_sample(gn_penrose_relax_get_importance(phase, LEVEL), &work.samples,
                                     &work.n);
    size_t n = (size_t)work.n + 1;
    work.points = malloc(n * sizeof(*work.points));
    work.centroid = malloc(n * sizeof(*work.centroid));
    work.n_places = malloc(n * sizeof(*work.n_places));
    if (rc == 0 && (!work.points || !work.centroid || !work.n_places))
        rc = -ENOMEM;
    for (int i = 0; rc == 0 && i < n_iterations; i++)
        rc = relax_once(&work, row);
    free(work.n_places);
    free(work.centroid);
    free(work.points);
    free(work.samples);
    if (rc == 0)
        memcpy(out_row, row, sizeof(row));
    return rc;
}
