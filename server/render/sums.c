/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/sums.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/draw.h"
#include "server/render/internal.h"

/** Side of a cell, pixels: at least so many pixels are watched, of small pictures all. */
#define WATCHED_MIN 16384
#define CELL_MAX 4

/** Radiances above so many times the mean count as that: a lamp in a mirror is not the picture. */
#define BRIGHT 4

static int get_cell(int width, int height)
{
    int cell = CELL_MAX;
    while (cell > 1 && (int64_t)width * height < (int64_t)WATCHED_MIN * cell * cell)
        cell /= 2;
    return cell;
}

void gn_sums_finish(struct sums *sums)
{
    free(sums->total);
    free(sums->watched);
    free(sums->rows);
    *sums = (struct sums){0};
}

int gn_sums_begin(struct sums *sums, int width, int height)
{
    size_t cell = (size_t)get_cell(width, height);
    size_t cells_x = ((size_t)width + cell - 1) / cell;
    size_t cells_y = ((size_t)height + cell - 1) / cell;
    size_t n = (size_t)width * (size_t)height, n_watched = cells_x * cells_y * REPLICATES;
    sums->n_passes = 0;
    if (sums->width == width && sums->height == height) {
        memset(sums->total, 0, n * sizeof(*sums->total));
        memset(sums->watched, 0, n_watched * sizeof(*sums->watched));
        return 0;
    }
    gn_sums_finish(sums);
    sums->total = calloc(n, sizeof(*sums->total));
    sums->watched = calloc(n_watched, sizeof(*sums->watched));
    sums->rows = calloc(cells_y, sizeof(*sums->rows));
    if (!sums->total || !sums->watched || !sums->rows) {
        gn_sums_finish(sums);
        return -ENOMEM;
    }
    sums->width = width;
    sums->height = height;
    sums->cell = (int)cell;
    sums->cells_x = (int)cells_x;
    sums->cells_y = (int)cells_y;
    return 0;
}

/** The pixel of a cell that is watched; at the picture's border it may be none of the picture. */
static void get_watched(const struct sums *sums, int cell_x, int cell_y, int out[static 2])
{
    int cell = sums->cell;
    int i = (int)(gn_draw_hash((uint64_t)cell_x, (uint64_t)cell_y) * cell * cell);
    out[0] = cell_x * cell + i % cell;
    out[1] = cell_y * cell + i / cell;
}

static struct pixel_sum *get_replicates(const struct sums *sums, int cell_x, int cell_y)
{
    return &sums->watched[((size_t)cell_y * (size_t)sums->cells_x + (size_t)cell_x) * REPLICATES];
}

static void add(struct pixel_sum *sum, const struct sample *s)
{
    if (s->kind == SAMPLE_VIRTUAL) {
        sum->n_virtual++;
        for (int k = 0; k < 3; k++)
            sum->radiance[k] += (float)s->radiance[k];
        return;
    }
    for (int k = 0; k < 3; k++) {
        sum->base[k] += (float)s->base[k];
        sum->lost[k] += (float)s->lost[k];
        sum->gain[k] += (float)s->gain[k];
    }
}

void gn_sums_add(struct sums *sums, int x, int y, const struct sample *s)
{
    int at[2];
    add(&sums->total[(size_t)y * (size_t)sums->width + (size_t)x], s);
    int cell_x = x / sums->cell, cell_y = y / sums->cell;
    get_watched(sums, cell_x, cell_y, at);
    if (at[0] == x && at[1] == y)
        add(&get_replicates(sums, cell_x, cell_y)[sums->n_passes % REPLICATES], s);
}

/** As layers.c. */
static double get_factor(const struct pixel_sum *sum, int k)
{
    double base = sum->base[k], lost = sum->lost[k];
    return lost > 0 && base > 0 ? fmin(fmax(1 - lost / base, 0), 1) : 1;
}

static void add_sum(struct pixel_sum *sum, const struct pixel_sum *part)
{
    for (int k = 0; k < 3; k++) {
        sum->base[k] += part->base[k];
        sum->lost[k] += part->lost[k];
        sum->gain[k] += part->gain[k];
        sum->radiance[k] += part->radiance[k];
    }
    sum->n_virtual += part->n_virtual;
}

/** Square of the standard error of the mean of what the replicates say. */
static double get_variance(const double values[static REPLICATES])
{
    double mean = 0, sum = 0;
    for (int r = 0; r < REPLICATES; r++)
        mean += values[r] / REPLICATES;
    for (int r = 0; r < REPLICATES; r++)
        sum += (values[r] - mean) * (values[r] - mean);
    return sum / (REPLICATES * (REPLICATES - 1));
}

/** What each row of cells is judged with. */
struct judging {
    const struct sums *sums;
    const struct gn_layers *start;
    double bright; // cap of radiances; 0: only their mean is wanted
};

/** What is put over the camera's picture: virtual radiance and added, by their shares. */
static double get_put(const struct pixel_sum *sum, int k, double n)
{
    return ((double)sum->radiance[k] + (double)sum->gain[k]) / n;
}

static void judge_put(const struct judging *j, const struct pixel_sum *all,
                      const struct pixel_sum *replicates, double start, int k, struct sums_row *row)
{
    double put[REPLICATES], n = j->sums->n_passes, cap = j->bright;
    double apart = fmin(start, cap) - fmin(get_put(all, k, n), cap);
    for (int r = 0; r < REPLICATES; r++)
        put[r] = fmin(get_put(&replicates[r], k, n / REPLICATES), cap);
    row->put += get_variance(put);
    row->put_apart += apart * apart;
}

static void judge_shadow(const struct pixel_sum *all, const struct pixel_sum *replicates,
                         double real, double start, int k, struct sums_row *row)
{
    double factor[REPLICATES], f = get_factor(all, k);
    if (!(real > 0) || !(f < 1 || start < 1))
        return;
    for (int r = 0; r < REPLICATES; r++)
        factor[r] = real * get_factor(&replicates[r], k);
    row->shadow += get_variance(factor);
    row->shadow_apart += real * real * (start - f) * (start - f);
    row->n_shadow++;
}

static void judge_pixel(const struct judging *j, const struct pixel_sum *replicates, int x, int y,
                        struct sums_row *row)
{
    struct pixel_sum all = {0};
    const float *rgba = gn_image_at(&j->start->virtual_rgba, x, y);
    const float *shadow = gn_image_at(&j->start->shadow, x, y);
    const float *added = gn_image_at(&j->start->added, x, y);
    for (int r = 0; r < REPLICATES; r++)
        add_sum(&all, &replicates[r]);
    double n = j->sums->n_passes, real = 1 - (double)all.n_virtual / n;
    for (int k = 0; k < 3; k++) {
        double start = (double)rgba[k] + (1 - (double)rgba[3]) * (double)added[k];
        double put = get_put(&all, k, n);
        bool is_put = start > 0 || put > 0;
        row->put_sum += put;
        row->n_put += is_put;
        if (j->bright > 0 && is_put)
            judge_put(j, &all, replicates, start, k, row);
        if (j->bright > 0)
            judge_shadow(&all, replicates, real, (double)shadow[k], k, row);
    }
}

static void judge_row(void *context, int cell_y, int worker)
{
    (void)worker;
    const struct judging *j = context;
    struct sums_row row = {0};
    for (int cell_x = 0; cell_x < j->sums->cells_x; cell_x++) {
        int at[2];
        get_watched(j->sums, cell_x, cell_y, at);
        if (at[0] < j->sums->width && at[1] < j->sums->height)
            judge_pixel(j, get_replicates(j->sums, cell_x, cell_y), at[0], at[1], &row);
    }
    j->sums->rows[cell_y] = row;
}

/** All rows together, in their order. */
static struct sums_row judge_rows(struct judging *j, struct gn_pool *pool)
{
    struct sums_row all = {0};
    gn_pool_run(pool, j->sums->cells_y, judge_row, j);
    for (int y = 0; y < j->sums->cells_y; y++) {
        const struct sums_row *row = &j->sums->rows[y];
        all.shadow += row->shadow;
        all.shadow_apart += row->shadow_apart;
        all.n_shadow += row->n_shadow;
        all.put += row->put;
        all.put_apart += row->put_apart;
        all.put_sum += row->put_sum;
        all.n_put += row->n_put;
    }
    return all;
}

/**
 * The sums' share in a mean with the start that is off least. Their errors are independent, so the
 * square of how far they lie apart is that of the start's error and that of the sums' together, and
 * the best share of the sums is 1 - sums' / apart. Source: Efron and Morris, "Stein's Estimation
 * Rule and Its Competitors", JASA 68, 1973 (the positive part).
 */
static double get_share(double variance, double apart)
{
    return variance > 0 ? fmax(0, apart > 0 ? 1 - variance / apart : 0) : 1;
}

/** Square of the mean's error: variance times share; not trusted below a quarter of the variance,
 * where the start and the sums cannot be told apart. */
static double get_shown(double variance, double share)
{
    return variance * fmax(share, 0.25);
}

void gn_sums_judge(struct sums *sums, const struct gn_layers *start, struct gn_pool *pool,
                   struct sums_error *out_error)
{
    struct judging judging = {.sums = sums, .start = start};
    struct sums_row all = judge_rows(&judging, pool);
    double mean = all.put_sum > 0 ? all.put_sum / all.n_put : 1;
    judging.bright = BRIGHT * mean;
    all = judge_rows(&judging, pool);
    double shadow_share = get_share(all.shadow, all.shadow_apart);
    double put_share = get_share(all.put, all.put_apart);
    *out_error = (struct sums_error){
        .shadow = all.n_shadow > 0 ? sqrt(get_shown(all.shadow, shadow_share) / all.n_shadow) : 0,
        .put = all.n_put > 0 ? sqrt(get_shown(all.put, put_share) / all.n_put) / mean : 0,
        .shadow_share = shadow_share,
        .put_share = put_share,
    };
}

/** What each row of pixels is made with. */
struct resolving {
    const struct sums *sums;
    const struct gn_layers *start;
    const struct sums_error *error;
    struct gn_layers *layers;
};

static float mix(float start, double sums, double share)
{
    return (float)((double)start + share * (sums - (double)start));
}

static void resolve_row(void *context, int y, int worker)
{
    (void)worker;
    const struct resolving *c = context;
    double n = c->sums->n_passes;
    for (int x = 0; x < c->sums->width; x++) {
        const struct pixel_sum *sum =
            &c->sums->total[(size_t)y * (size_t)c->sums->width + (size_t)x];
        const float *old_rgba = gn_image_at(&c->start->virtual_rgba, x, y);
        const float *old_shadow = gn_image_at(&c->start->shadow, x, y);
        const float *old_added = gn_image_at(&c->start->added, x, y);
        float *rgba = gn_image_at(&c->layers->virtual_rgba, x, y);
        float *shadow = gn_image_at(&c->layers->shadow, x, y);
        float *added = gn_image_at(&c->layers->added, x, y);
        double n_real = n - (double)sum->n_virtual;
        for (int k = 0; k < 3; k++) {
            rgba[k] = mix(old_rgba[k], sum->radiance[k] / n, c->error->put_share);
            shadow[k] = mix(old_shadow[k], get_factor(sum, k), c->error->shadow_share);
            added[k] =
                mix(old_added[k], n_real > 0 ? sum->gain[k] / n_real : 0, c->error->put_share);
        }
        rgba[3] = mix(old_rgba[3], sum->n_virtual / n, c->error->put_share);
    }
}

void gn_sums_resolve(const struct sums *sums, const struct gn_layers *start,
                     const struct sums_error *error, struct gn_pool *pool, struct gn_layers *layers)
{
    struct resolving resolving = {sums, start, error, layers};
    gn_pool_run(pool, sums->height, resolve_row, &resolving);
}
