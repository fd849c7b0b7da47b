/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The least squares inside a curve's fit, weights given: for curve_fit.c alone.
 */
#ifndef GN_CLIENT_CALIBRATE_CURVE_SEARCH_H
#define GN_CLIENT_CALIBRATE_CURVE_SEARCH_H

#include <stdbool.h>

#include "client/calibrate/curve_fit.h"

/**
 * One fit. Its units: the log curve goes through the mean code at c + x = 1, the linear one has
 * b = 1; the groups' factors take up the rest, so that light has no free scale.
 */
struct gn_curve_work {
    enum gn_curve_model model;
    struct gn_curve_sample *samples;
    int n, n_groups;
    int *order;     // [n], samples by group
    int *first;     // [n_groups + 1], where each begins in order
    double *weight; // [n], with the robust part
    double *u;      // [n_groups]
    double *trial_u, *step_u;
    double *rows;     // [n][2], columns of theta after elimination
    double *kept;     // [n][2], the same before
    double *residual; // [n]
    double *slope;    // [n], d code / d u, weighted
    double anchor;    // the mean code
    double theta[2];  // LOG: b, c; LINEAR: a
};

/** The code of light x, in the fit's units. */
double gn_curve_predict(const struct gn_curve_work *f, const double theta[2], double x);

/** The light of a sample whose groups have the logarithms u. */
double gn_curve_get_light(const struct gn_curve_sample *s, const double *u);

/**
 * Linearises at theta and u: rows[n][2] and residual[n] with the groups eliminated (each has one
 * column of its own and no sample has two, so this is exact). step_u gets the step of each group
 * for theta standing still, kept the columns before.
 */
void gn_curve_linearise(struct gn_curve_work *f);

/** Begins with a line through ln of the light, c = 0: b, then u. False: it does not rise. */
bool gn_curve_start(struct gn_curve_work *f);

/** Variable projection, c searched; sets *out_is_c_seen. Returns the cost; infinity: no memory. */
double gn_curve_search(struct gn_curve_work *f, int n_free, bool *out_is_c_seen);

#endif
