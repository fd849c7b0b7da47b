/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Normal equations of small least squares, by Cholesky. Thread-safety: safe.
 */
#ifndef GN_CLIENT_TRACK_NORMAL_H
#define GN_CLIENT_TRACK_NORMAL_H

#include <stdbool.h>

/** a[n][n], of which the lower half is read, becomes its Cholesky factor in place. False where it
 * is not positive definite. */
bool gn_normal_decompose(double *a, int n);

/** Solves for b[n] in place, by that factor. */
void gn_normal_solve(const double *factor, int n, double *b);

#endif
