/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/timing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void gn_bench_start(struct gn_bench_times *times)
{
    times->start_ns = gn_clock_get_monotonic_ns();
}

void gn_bench_stop(struct gn_bench_times *times)
{
    double ms = 1e-6 * (double)(gn_clock_get_monotonic_ns() - times->start_ns);
    if (times->n < GN_BENCH_REPEATS_MAX)
        times->ms[times->n++] = ms;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

struct gn_bench_timing gn_bench_sum_up(struct gn_bench_times *times)
{
    int n = times->n;
    qsort(times->ms, (size_t)n, sizeof(times->ms[0]), compare);
    return (struct gn_bench_timing){times->ms[n / 2], times->ms[3 * n / 4] - times->ms[n / 4]};
}

void gn_bench_check(int result, const char *what)
{
    if (result >= 0)
        return;
    fprintf(stderr, "benchmark: %s: %s\n", what, strerror(-result));
    exit(1);
}
