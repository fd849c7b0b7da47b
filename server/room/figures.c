/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/figures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/compare.h"

const double gn_figures_bounds_ms[GN_FIGURES_BUCKETS] = {2,   5,   10,  16.7, 33.3, 50,
                                                         100, 200, 500, 1000, 5000, 20000};

void gn_time_histogram_add(struct gn_time_histogram *histogram, double ms)
{
    int i = 0;
    while (i < GN_FIGURES_BUCKETS && ms > gn_figures_bounds_ms[i])
        i++;
    histogram->counts[i]++;
    histogram->n++;
    histogram->sum_ms += ms;
}

void gn_time_window_add(struct gn_time_window *window, double ms)
{
    window->ms[window->next] = ms;
    window->next = (window->next + 1) % GN_WINDOW;
    if (window->n < GN_WINDOW)
        window->n++;
}

double gn_time_window_get(const struct gn_time_window *window, double share)
{
    if (window->n == 0)
        return 0;
    double sorted[GN_WINDOW];
    memcpy(sorted, window->ms, (size_t)window->n * sizeof(sorted[0]));
    qsort(sorted, (size_t)window->n, sizeof(sorted[0]), gn_compare_doubles);
    int rank = (int)ceil(share * window->n);
    return sorted[(rank < 1 ? 1 : rank) - 1];
}

void gn_snapshot_unref(struct gn_snapshot **snapshot)
{
    struct gn_snapshot *s = *snapshot;
    *snapshot = NULL;
    if (!s || atomic_fetch_sub_explicit(&s->references, 1, memory_order_acq_rel) != 1)
        return;
    gn_image8_finish(&s->image);
    free(s);
}
