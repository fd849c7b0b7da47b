/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Times of a benchmark: repeats, their median and spread.
 */
#ifndef GN_TESTS_BENCH_TIMING_H
#define GN_TESTS_BENCH_TIMING_H

#include "common/clock.h"

#define GN_BENCH_REPEATS_MAX 101

/** Wall times, ms. A value; zero it before use. */
struct gn_bench_times {
    int n;
    double ms[GN_BENCH_REPEATS_MAX];
    int64_t start_ns;
};

/** What is said of them, ms. */
struct gn_bench_timing {
    double median, iqr;
};

void gn_bench_start(struct gn_bench_times *times);
/** Keeps the time since start; after GN_BENCH_REPEATS_MAX of them no more. */
void gn_bench_stop(struct gn_bench_times *times);
/** Median and interquartile range; sorts. At least one time. */
struct gn_bench_timing gn_bench_sum_up(struct gn_bench_times *times);

/** Exits with a sentence where result is negative. */
void gn_bench_check(int result, const char *what);

#endif
