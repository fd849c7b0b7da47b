/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Makes the table of correction vectors: points of an even importance are relaxed until each lies
 * in the middle of what is nearest to it, with one vector for all points of one structural index.
 * Offline: for penrose-table, which prints the table, and for the tests that judge it.
 * Source: Lloyd, "Least squares quantization in PCM", 1982; tying the vectors of a phase after
 * Ostromoukhov, Donohue, Jodoin 2004, section 5.
 */
#ifndef GN_SERVER_LIGHT_PENROSE_RELAX_H
#define GN_SERVER_LIGHT_PENROSE_RELAX_H

#include "proto/attr.h"
#include "server/light/penrose.h"

/** Iterations of the table. */
#define GN_PENROSE_RELAX_ITERATIONS 60

/** The importance in the middle of the phase, at that level. */
double gn_penrose_relax_get_importance(int phase, int level);

/**
 * The samples of an even importance on the unit square, uncorrected. Returns 0, *out_samples to be
 * freed by the caller, or -ENOMEM. Thread-safety: safe.
 */
GN_MUST_USE int gn_penrose_relax_sample(double importance, struct gn_penrose_sample **out_samples,
                                        int *out_n);

/**
 * One phase's row of the table, relaxed n_iterations times. Deterministic. Returns 0 or -ENOMEM.
 * Thread-safety: safe.
 */
GN_MUST_USE int gn_penrose_relax_phase(int phase, int n_iterations,
                                       float out_row[static GN_PENROSE_INDICES][2]);

/**
 * Mean squared distance from a place to the nearest point, times the points' density:
 * 5 sqrt(3) / 54 = 0.1604 for hexagons, 1 / 6 for squares, 1 / pi for random points.
 * points[n][2] cover [0, 1]^2 and its surroundings; the mean is taken over its inner part.
 * Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_penrose_relax_measure(const double (*points)[2], int n, double density,
                                         double *out_moment);

#endif
