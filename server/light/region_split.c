/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/region_split.h"

#include <math.h>

/* A histogram finds the median; where all weight falls in one bin, it is made again over that bin:
 * 128^3 bins of a whole circle are finer than any texel. */
enum { N_BINS = 128, N_ZOOMS = 3 };

static const double side_min = 1e-6; // rad: nothing shorter is cut in the middle

struct splitter {
    bool is_midpoint;
    gn_split_part_fn part;
    void *context;
};

static int get_longer_axis(const struct gn_polar_box *box)
{
    double theta = box->high[0] - box->low[0], phi = box->high[1] - box->low[1];
    return phi * sin(0.5 * (box->low[0] + box->high[0])) > theta ? 1 : 0;
}

static void fill_histogram(const struct gn_split_item *items, int n, int axis, double low,
                           double high, double out_bins[static N_BINS + 2])
{
    double scale = N_BINS / (high - low);
    for (int b = 0; b < N_BINS + 2; b++)
        out_bins[b] = 0;
    for (int i = 0; i < n; i++) { // bin 0: below low; bin N_BINS + 1: at or above high
        double x = ((double)items[i].polar[axis] - low) * scale;
        int b = x < 0 ? 0 : x >= N_BINS ? N_BINS + 1 : 1 + (int)x;
        out_bins[b] += (double)items[i].weight;
    }
}

/* Where the share of the weight below comes nearest to the wanted one, with weight on both sides.
 * False where the items cannot be told apart along the axis. */
static bool find_cut(const struct gn_split_item *items, int n, int axis,
                     const struct gn_polar_box *box, double share, double *out_cut)
{
    double low = box->low[axis], high = box->high[axis], bins[N_BINS + 2];
    for (int zoom = 0; zoom < N_ZOOMS && high > low; zoom++) {
        fill_histogram(items, n, axis, low, high, bins);
        double total = 0, below = 0, best = INFINITY;
        for (int b = 0; b < N_BINS + 2; b++)
            total += bins[b];
        int at = -1, heaviest = 1;
        for (int b = 0; b < N_BINS + 1; b++) {
            below += bins[b];
            double miss = fabs(below - share * total);
            if (below > 0 && below < total && miss < best) {
                best = miss;
                at = b;
            }
            if (b > 0 && bins[b] > bins[heaviest])
                heaviest = b;
        }
        double width = (high - low) / N_BINS;
        bool is_coarse = bins[heaviest] > 0.5 * total && zoom + 1 < N_ZOOMS;
        if (at >= 0 && !(is_coarse && best > 0.1 * total)) {
            *out_cut = low + at * width;
            return true;
        }
        double middle = low + (heaviest - 0.5) * width;
        low = middle - 0.51 * width;
        high = middle + 0.51 * width;
    }
    return false;
}

/* Moves what lies below the cut to the front; returns how many. */
static int partition(struct gn_split_item *items, int n, int axis, double cut)
{
    int n_below = 0;
    for (int i = 0; i < n; i++) {
        if ((double)items[i].polar[axis] < cut) {
            struct gn_split_item item = items[i];
            items[i] = items[n_below];
            items[n_below++] = item;
        }
    }
    return n_below;
}

/* axis -1: the longer side. */
static void split(const struct splitter *s, struct gn_split_item *items, int n,
                  const struct gn_polar_box *box, int64_t n_parts, int axis, uint64_t path)
{
    if (n == 0)
        return;
    int along = axis >= 0 ? axis : get_longer_axis(box);
    int64_t n_first = n_parts / 2;
    double share = (double)n_first / (double)n_parts, cut = 0;
    double side = box->high[along] - box->low[along];
    bool is_cut = n_parts > 1 && n > 1;
    if (is_cut && s->is_midpoint) {
        cut = box->low[along] + share * side;
        is_cut = side > side_min;
    } else if (is_cut && !find_cut(items, n, along, box, share, &cut)) {
        along = 1 - along;
        is_cut = find_cut(items, n, along, box, share, &cut);
    }
    if (!is_cut) {
        s->part(s->context, items, n, path);
        return;
    }
    int n_below = partition(items, n, along, cut);
    struct gn_polar_box below = *box, above = *box;
    below.high[along] = above.low[along] = cut;
    if (!s->is_midpoint) { // parts that one side has no points for are the other's
        n_first = n_first > n_below ? n_below : n_first;
        n_first = n_parts - n_first > n - n_below ? n_parts - (n - n_below) : n_first;
    }
    split(s, items, n_below, &below, n_first, axis, 2 * path);
    split(s, items + n_below, n - n_below, &above, n_parts - n_first, axis, 2 * path + 1);
}

void gn_region_split(struct gn_split_item *items, int n, const struct gn_polar_box *box,
                     const struct gn_split_options *options, gn_split_part_fn part, void *context)
{
    struct splitter s = {options->is_midpoint, part, context};
    if (!options->is_two_strips || options->n_parts < 4) {
        split(&s, items, n, box, options->n_parts, -1, 1);
        return;
    }
    int axis = get_longer_axis(box);
    double cut = 0.5 * (box->low[axis] + box->high[axis]);
    if (!options->is_midpoint && !find_cut(items, n, axis, box, 0.5, &cut)) {
        split(&s, items, n, box, options->n_parts, -1, 1);
        return;
    }
    int n_below = partition(items, n, axis, cut);
    struct gn_polar_box half[2] = {*box, *box};
    half[0].high[axis] = half[1].low[axis] = cut;
    int64_t n_first = options->n_parts / 2;
    split(&s, items, n_below, &half[0], n_first, get_longer_axis(&half[0]), 2);
    split(&s, items + n_below, n - n_below, &half[1], options->n_parts - n_first,
          get_longer_axis(&half[1]), 3);
}
