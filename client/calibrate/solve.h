/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Small dense linear algebra for calibration, in double: least squares by Householder QR and
 * singular values by one-sided Jacobi rotations. Never the normal equations, which square the
 * condition number. Thread-safety of all functions: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_SOLVE_H
#define GN_CLIENT_CALIBRATE_SOLVE_H

#include "proto/attr.h"

/** Columns of a least squares problem. */
#define GN_SOLVE_MAX_COLUMNS 320
/** Columns of a matrix whose singular values are asked for. */
#define GN_SOLVE_MAX_SVD 32

/** The length of n numbers that are stride apart, such as a matrix' column; it neither overflows
 * nor vanishes before they do. */
double gn_solve_get_length(const double *column, int n, int stride);

/**
 * Minimises |a x - b|. a[m][n] row-major and b[m] are overwritten; m >= n,
 * n in [1, GN_SOLVE_MAX_COLUMNS].
 * Source: Golub and Van Loan, Matrix Computations, 5.3.2. Returns 0, or -EDOM where a column
 * depends on the others to rounding, or something is not finite; out_x[n] is untouched then.
 */
GN_MUST_USE int gn_solve_least_squares(double *a, double *b, int m, int n, double *out_x);

/**
 * The same with damping (Levenberg 1944) in each column's own unit: rows sqrt(damping) |column| are
 * appended. a[m + n][n] and b[m + n] have room for them.
 */
GN_MUST_USE int gn_solve_damped_squares(double *a, double *b, int m, int n, double damping,
                                        double *out_x);

/**
 * a = u diag(s) v^T by one-sided Jacobi (Golub and Van Loan, 8.6.3): a[m][n] row-major becomes u,
 * s[n] falls, v[n][n] row-major has the right vectors in its columns. m >= n,
 * n <= GN_SOLVE_MAX_SVD. Columns of u that belong to a singular value of 0 are 0. Returns 0, or
 * -EDOM where something is not finite.
 */
GN_MUST_USE int gn_solve_svd(double *a, int m, int n, double *out_s, double *out_v);

/**
 * The condition number of a[m][n] with its columns scaled to length 1 (within sqrt(n) of the best
 * scaling: van der Sluis 1969): largest over smallest singular value, INFINITY where columns depend
 * on each other, one is 0 or not finite. a is overwritten. n <= GN_SOLVE_MAX_SVD.
 */
double gn_solve_get_condition(double *a, int m, int n);

/**
 * The rotation r[9] (row-major, det 1) that maximises trace(r^T b), b[9] row-major: with
 * b = sum w y x^T it minimises sum w |y - r x|^2. Source: Wahba 1965, solved by SVD (Markley
 * 1988). out_s[3]: the singular values, falling, the last with the sign of det b; where
 * out_s[1] + out_s[2] is 0 the rotation is not determined. Returns 0 or -EDOM.
 */
GN_MUST_USE int gn_solve_wahba(const double b[static 9], double out_r[static 9],
                               double out_s[static 3]);

/** out_h[9] maps (x, y, 1) of four points to multiples of (x, y, 1) of four others; h[8] = 1.
 * Returns 0, or -EDOM where three of a set lie on a line. */
GN_MUST_USE int gn_solve_homography(const double from[static 8], const double to[static 8],
                                    double out_h[static 9]);

#endif
