/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The response of a log or linear sensor, fitted to codes of surfaces whose light is known up to
 * a factor each:
 *   log:    code = a + b ln(c + x)   (ALGORITHMS of HDRC-like sensors: a offset, b gain, c dark)
 *   linear: code = a + b x
 * x = exp(offset + u[group]) is the light of a sample: offset is what is known of its logarithm
 * (that of the exposure time, or of a grey patch's reflectance) and u what is not, one number for
 * all samples of a group (a patch in a channel, or a picture in a channel).
 */
#ifndef GN_CLIENT_CALIBRATE_CURVE_FIT_H
#define GN_CLIENT_CALIBRATE_CURVE_FIT_H

#include <stdbool.h>

#include "common/error.h"
#include "proto/attr.h"

/** One code seen. */
struct gn_curve_sample {
    double code;     // share of full scale
    double offset;   // ln of the light up to the group's factor; finite
    int group;       // [0, n_groups)
    double weight;   // 1 / standard deviation, relative to other samples; 0: not used
    bool is_outlier; // out: further from the curve than robust statistics allow; not used
};

enum gn_curve_model { GN_CURVE_LOG = 0, GN_CURVE_LINEAR };

/** A curve that was fitted, its light in units of which only the curve itself is sure. */
struct gn_curve {
    enum gn_curve_model model;
    double a, b, c;   // c 0 for LINEAR
    double b_error;   // standard error of b, relative
    double c_error;   // standard error of c, absolute
    bool is_c_seen;   // false: c is too small to be seen in these samples and was taken as 0
    double condition; // of the scaled problem, the groups' factors eliminated
    double rms;       // of the residuals of what was used, codes as a share of full scale
    int n_used, n_outliers;
};

/** Largest condition number that a fit may have: by so much it blows up relative errors of the
 * exposures, and 0.1 % is good for a camera's. */
#define GN_CURVE_MAX_CONDITION 100.0

/**
 * Fits by variable projection: the one number that enters non-linearly is searched for along ln c,
 * for each c the rest is solved by QR, the groups' factors eliminated group by group. Robust:
 * Tukey's biweight (Beaton and Tukey 1974) about the median deviation. out_u[n_groups]: ln of the
 * factors; groups without samples get NaN. Returns 0, or -EDOM (the samples do not determine a
 * curve: too few, one exposure, nearly the same exposures, falling codes, a log sensor that is
 * linear), -EINVAL, -ENOMEM and a sentence. Thread-safety: safe.
 */
GN_MUST_USE int gn_curve_fit(enum gn_curve_model model, struct gn_curve_sample *samples, int n,
                             int n_groups, double *out_u, struct gn_curve *out_curve,
                             struct gn_error *out_error);

/** The light that gives a code; 0 at and below the dark. */
double gn_curve_decode(const struct gn_curve *curve, double code);
/** The same curve for light in units that are `factor` times as large: x_new = x / factor. */
void gn_curve_rescale(struct gn_curve *curve, double factor);

#endif
