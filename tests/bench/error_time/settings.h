/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The settings that the error benchmark tries: every method over its parameter.
 */
#ifndef GN_TESTS_BENCH_ERROR_TIME_SETTINGS_H
#define GN_TESTS_BENCH_ERROR_TIME_SETTINGS_H

#include "server/render/render.h"

/** One way to light a frame. */
struct gn_bench_setting {
    char method[32]; // its name in the tables
    char params[64];
    int asked; // lights asked for; 0: the settings decide
    struct gn_light_options light;
    enum gn_quality quality;
};

/** Which of them. */
enum gn_bench_extent {
    GN_BENCH_QUICK,   // few numbers of lights, one division of the seed
    GN_BENCH_DEFAULT, // 4 to 1024 lights; the seed's divisions, maxLS, metrics and means
    GN_BENCH_STREAM,  // each method once, at about 64 lights
};

#define GN_BENCH_SETTINGS_MAX 512

/** Fills out; returns their number. Methods are taken from gn_light_maker_get(). */
int gn_bench_list_settings(enum gn_bench_extent extent,
                           struct gn_bench_setting out[static GN_BENCH_SETTINGS_MAX]);

#endif
