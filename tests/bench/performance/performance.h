/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The parts of the performance benchmark; performance.c puts them together. Each writes the table
 * of its name into a folder. What fails ends the benchmark.
 */
#ifndef GN_TESTS_BENCH_PERFORMANCE_PERFORMANCE_H
#define GN_TESTS_BENCH_PERFORMANCE_PERFORMANCE_H

#include <stdio.h>

#include "tests/bench/rig_frame.h"

/** What a run is about. */
struct gn_performance {
    const char *folder; // of the tables
    const char *cache;  // of references; NULL: they are made anew
    int n_threads;
    int n_repeats; // [3, GN_BENCH_REPEATS_MAX]
};

/** Opens folder/name.csv for writing, with its head. */
FILE *gn_performance_open(const struct gn_performance *run, const char *name, const char *head);
void gn_performance_close(FILE *file);

/** How far two shadow layers are from each other. */
struct gn_shadow_difference {
    double largest;      // of the factor
    double largest_code; // of what a white background then shows, in sRGB codes [0, 1]
    int64_t n_off;       // pixels of which either is over 1/255
};
struct gn_shadow_difference gn_performance_compare(const struct gn_image *a,
                                                   const struct gn_image *b);

/** The paper's hardest frame beside the naive loop's. */
void gn_performance_measure_hardest(const struct gn_performance *run);
/** The frame's shadow rays beside the tracer's own loop over them. */
void gn_performance_measure_rate(const struct gn_performance *run);
/** Error of the shadow and time over the number of lights. */
void gn_performance_measure_error(const struct gn_performance *run);
/** Time over pixels, lights, triangles, threads. */
void gn_performance_measure_scaling(const struct gn_performance *run);

#endif
