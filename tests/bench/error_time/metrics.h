/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How far a picture is from its reference, and lights from their map.
 */
#ifndef GN_TESTS_BENCH_ERROR_TIME_METRICS_H
#define GN_TESTS_BENCH_ERROR_TIME_METRICS_H

#include "server/light/state.h"
#include "tests/bench/error_time/scenes.h"

/** Errors of one picture. The mask M holds the real pixels where the reference's or the tested
 * shadow factor is below 0.995 in any channel; an error is the test's value less the reference's.
 */
struct gn_bench_errors {
    long n_masked;         // pixels of M
    double rmse, bias;     // of the shadow factor over M and channels; bias: mean signed
    double relmse;         // over M and the virtual pixels, of the composite's linear radiance,
                           // scaled so that the reference's mean there is 1: mean of
                           // (x - r)^2 / (r^2 + 0.01) over pixels and channels
    double relmse_trimmed; // without the largest 0.1 % of its terms
    double flip;           // of the composites, whole picture; < 0: not asked for
};

/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_bench_measure_errors(const struct gn_bench_picture *reference,
                                        const struct gn_layers *test, bool has_flip,
                                        struct gn_bench_errors *out_errors);

/** shadow * background * (1 - A) + virtual; what it shows on a display on which the background's
 * mean luminance is 0.25, clamped to [0, 1], where exposed. Same size; out inited by the caller. */
void gn_bench_compose(const struct gn_bench_picture *reference, const struct gn_image *shadow,
                      const struct gn_image *virtual_rgba, bool is_exposed, struct gn_image *out);

/** Normals at which irradiance is compared, evenly spread over the sphere. */
#define GN_BENCH_NORMALS 200

/** Irradiance at the normals from every texel of the map and its fill, W/m^2: [normal][channel]. */
void gn_bench_sum_texels(const struct gn_radiance_map *map,
                         double out_irradiance[static GN_BENCH_NORMALS][3]);
/** RMS of the lights' error over normals and channels, relative to the exact mean. */
double gn_bench_compare_irradiance(const struct gn_lighting_state *state,
                                   double exact[static GN_BENCH_NORMALS][3]);
/** The same of the state's harmonics. */
double gn_bench_compare_sh(const struct gn_lighting_state *state,
                           double exact[static GN_BENCH_NORMALS][3]);

#endif
