/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A camera's response from pictures of the colour chart at several exposures: the curve that all
 * channels share, and the matrix to Rec.709. Light is counted in units in which a perfect white in
 * the chart's place is 1 in the first picture.
 */
#ifndef GN_CLIENT_CALIBRATE_CHART_RESPONSE_H
#define GN_CLIENT_CALIBRATE_CHART_RESPONSE_H

#include <stdbool.h>
#include <stdio.h>

#include "client/calibrate/chart.h"
#include "client/calibrate/curve_fit.h"
#include "common/error.h"
#include "proto/attr.h"

#define GN_CHART_MAX_SHOTS 64
/** Codes whose light is known better than this, relative, tell how good a fit is. */
#define GN_CHART_SURE 0.01
/** RMS error of such codes of a picture above which it is no picture of the same light and camera:
 * good series stay below 0.025. */
#define GN_CHART_MAX_SHOT_ERROR 0.1

/** One picture of the chart. */
struct gn_chart_shot {
    const char *name; // borrowed
    double time;      // exposure time or any multiple of it, > 0; 0: unknown, of all or of none
    struct gn_chart_patch patches[GN_CHART_PATCHES];
};

struct gn_chart_response_options {
    enum gn_curve_model model;
    bool is_mono; // one channel: no matrix
    bool has_no_matrix;
    bool keeps_white; // the matrix maps the greys to grey exactly
    double code_step; // of the codes: 1 / full scale
};

/** A code of a patch, and what the fit made of it. */
struct gn_chart_point {
    int shot, patch, channel;
    double code, spread;
    double light;       // what the fit takes the patch's light to be
    double error;       // light of the code over that, minus 1
    double uncertainty; // of the code's light, relative: its noise and its steps
    bool is_clipped;
    bool is_fitted;  // the curve is fitted to it
    bool is_outlier; // and found it off
};

struct gn_chart_response {
    struct gn_curve curve;
    bool has_matrix;
    struct gn_chart_matrix matrix;
    double time[GN_CHART_MAX_SHOTS]; // relative to the first picture's: given, or found
    double device[72];               // linear device colour of the patches in the first picture
    int n_points;
    struct gn_chart_point *points; // [n_points], owned
    int n_clipped;
    double worst_grey; // largest error of a grey patch's code that is sure to GN_CHART_SURE
};

/**
 * Fits curve and matrix to n shots. Clipped patches (more than 2 % of pixels in the rails) are left
 * out, outlying ones found and marked; times in another order than the codes are refused. *out is
 * zeroed on failure. Returns 0, or -EDOM (not determined), -EINVAL, -ENOMEM and a sentence.
 * Thread-safety: safe.
 */
GN_MUST_USE int gn_chart_response_fit(const struct gn_chart_shot *shots, int n,
                                      const struct gn_chart_response_options *options,
                                      struct gn_chart_response *out, struct gn_error *out_error);
/** RMS error of the codes of a picture that are sure to GN_CHART_SURE, *out_n of them; 0 of none.
 */
double gn_chart_response_get_error(const struct gn_chart_response *response, int shot, int *out_n);
/**
 * Refuses a curve that does not hold for its own pictures: more than half of one left out, or off
 * by more than GN_CHART_MAX_SHOT_ERROR, or more than a third of all left out. Returns 0, or -EDOM
 * and a sentence that names it. Thread-safety: safe.
 */
GN_MUST_USE int gn_chart_response_check(const struct gn_chart_shot *shots, int n,
                                        const struct gn_chart_response *response,
                                        struct gn_error *out_error);
/** NULL-safe; zeroes *response. */
void gn_chart_response_finish(struct gn_chart_response *response);

#endif
