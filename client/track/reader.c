/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/reader.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_CELLS = GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS };

/** Least correlation of the cells' light with a pattern, before and after that is laid onto it. */
static const double min_guess = 0.5, min_correlation = 0.8;
/** Least difference of linear light between black and white, of full scale. */
static const double min_contrast = 0.02;
/** How probable it may be that a square with random cells is read as one of the ids. */
static const double max_chance = 1e-5;

struct entry {
    int id;
    struct gn_pattern pattern;
    uint8_t white[MAX_CELLS];
};

struct gn_reader {
    int cells, max_wrong;
    int n_entries;
    struct entry *entries;
};

/** How many inner cells may be wrong. */
static int get_max_wrong(int cells, int n_ids)
{
    int n = (cells - 2) * (cells - 2), n_wrong = 0;
    double ways = 1, all = 1;
    while (n_wrong < n) {
        ways *= (double)(n - n_wrong) / (n_wrong + 1);
        all += ways;
        if (4.0 * n_ids * all / pow(2, n) > max_chance)
            break;
        n_wrong++;
    }
    return n_wrong;
}

int gn_reader_create(int dictionary, const int *ids, int n_ids, struct gn_reader **out_reader)
{
    *out_reader = NULL;
    struct gn_reader *r = calloc(1, sizeof(*r));
    if (r)
        r->entries = calloc((size_t)n_ids + 1, sizeof(*r->entries));
    if (!r || !r->entries) {
        gn_reader_destroy(&r);
        return -ENOMEM;
    }
    for (int i = 0; i < n_ids; i++) {
        struct entry *e = &r->entries[r->n_entries];
        int cells = gn_marker_get_cells(dictionary, ids[i], e->white);
        if (cells == 0)
            continue;
        e->id = ids[i];
        e->pattern = (struct gn_pattern){cells, e->white};
        r->cells = cells;
        r->n_entries++;
    }
    r->max_wrong = get_max_wrong(r->cells, r->n_entries);
    *out_reader = r;
    return 0;
}

void gn_reader_destroy(struct gn_reader **reader)
{
    if (*reader)
        free((*reader)->entries);
    free(*reader);
    *reader = NULL;
}

const struct gn_pattern *gn_reader_get_pattern(const struct gn_reader *r, int id)
{
    for (int i = 0; i < r->n_entries; i++)
        if (r->entries[i].id == id)
            return &r->entries[i].pattern;
    return NULL;
}

/** Correlation of the cells with a pattern. */
static double correlate(const double *light, const uint8_t *white, int n)
{
    double l = 0, l2 = 0, w = 0, both = 0;
    for (int i = 0; i < n * n; i++) {
        l += light[i];
        l2 += light[i] * light[i];
        w += white[i];
        both += white[i] ? light[i] : 0;
    }
    double count = n * n, light2 = l2 - l * l / count, white2 = w - w * w / count;
    return light2 > 0 && white2 > 0 ? (both - l * w / count) / sqrt(light2 * white2) : 0;
}

/** How many cells are on the wrong side of the middle between white and black ones. */
static int count_wrong(const double *light, const uint8_t *white, int n)
{
    double sum[2] = {0};
    int count[2] = {0}, n_wrong = 0;
    for (int i = 0; i < n * n; i++) {
        sum[white[i]] += light[i];
        count[white[i]]++;
    }
    double black = sum[0] / count[0], most = sum[1] / count[1];
    if (!(most - black >= min_contrast))
        return n * n;
    for (int i = 0; i < n * n; i++)
        n_wrong += (light[i] > (black + most) / 2) != white[i];
    return n_wrong;
}

/** The entry and turn whose cells are most like these. */
static const struct entry *guess(const struct gn_reader *r, const double *seen, int *out_turn)
{
    const struct entry *found = NULL;
    double best = min_guess, light[MAX_CELLS], turned[MAX_CELLS];
    int n = r->cells;
    memcpy(light, seen, sizeof(light));
    for (int turn = 0; turn < 4; turn++) {
        for (int i = 0; i < r->n_entries; i++) {
            double correlation = correlate(light, r->entries[i].white, n);
            if (correlation > best) {
                best = correlation;
                found = &r->entries[i];
                *out_turn = turn;
            }
        }
        // Its own top left one corner on: x runs down, y to the left.
        for (int i = 0; i < n * n; i++)
            turned[i] = light[i % n * n + (n - 1 - i / n)];
        memcpy(light, turned, sizeof(light));
    }
    return found;
}

bool gn_reader_read(const struct gn_reader *r, const struct gn_grey *grey, double corners_px[4][2],
                    struct gn_marker_sighting *out)
{
    double light[MAX_CELLS] = {0}, found[4][2];
    int turn = 0;
    if (r->n_entries == 0 || !gn_quad_sample_cells(grey, r->cells, corners_px, light))
        return false;
    const struct entry *e = guess(r, light, &turn);
    if (!e)
        return false;
    for (int k = 0; k < 4; k++)
        memcpy(found[k], corners_px[(k + turn) % 4], sizeof(found[k]));
    double correlation = gn_pattern_fit(grey, &e->pattern, found);
    if (!(correlation >= min_correlation) || !gn_quad_sample_cells(grey, r->cells, found, light) ||
        count_wrong(light, e->white, r->cells) > r->max_wrong)
        return false;
    out->id = e->id;
    memcpy(out->corners, found, sizeof(found));
    return true;
}
