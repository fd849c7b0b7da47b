/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/solve.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <string.h>

double gn_solve_get_length(const double *column, int n, int stride)
{
    double length = 0;
    for (int i = 0; i < n; i++)
        length = hypot(length, column[i * stride]);
    return length;
}

/* Reflects column k onto its diagonal, and the columns right of it and b along, row by row as they
 * lie in memory. Returns the length that the column has left below the rows done. */
static double reflect(double *a, double *b, int m, int n, int k)
{
    double norm = gn_solve_get_length(a + k * n + k, m - k, n);
    double dot[GN_SOLVE_MAX_COLUMNS + 1] = {0};
    if (!(norm > 0))
        return norm;
    double alpha = a[k * n + k] > 0 ? -norm : norm;
    double scale = -1 / (alpha * (a[k * n + k] - alpha)); // 2 / |v|^2
    a[k * n + k] -= alpha;                                // the column is v now
    for (int i = k; i < m; i++) {
        const double *row = a + i * n;
        double v = scale * row[k];
        for (int j = k + 1; j < n && v != 0; j++)
            dot[j] += v * row[j];
        dot[n] += v * b[i];
    }
    for (int i = k; i < m; i++) {
        double *row = a + i * n, v = row[k];
        for (int j = k + 1; j < n && v != 0; j++)
            row[j] -= v * dot[j];
        b[i] -= v * dot[n];
    }
    a[k * n + k] = alpha;
    return norm;
}

int gn_solve_least_squares(double *a, double *b, int m, int n, double *out_x)
{
    if (m < n || n < 1 || n > GN_SOLVE_MAX_COLUMNS)
        return -EDOM;
    for (int k = 0; k < n; k++) {
        double whole = gn_solve_get_length(a + k, m, n);
        // The part above the diagonal is R's; what is left must be more than its rounding.
        double left = reflect(a, b, m, n, k);
        if (!(left > 4 * DBL_EPSILON * n * whole) || !isfinite(left))
            return -EDOM;
    }
    for (int k = n - 1; k >= 0; k--) {
        double sum = b[k];
        for (int j = k + 1; j < n; j++)
            sum -= a[k * n + j] * b[j];
        b[k] = sum / a[k * n + k];
        if (!isfinite(b[k]))
            return -EDOM;
    }
    memcpy(out_x, b, (size_t)n * sizeof(*out_x));
    return 0;
}

int gn_solve_damped_squares(double *a, double *b, int m, int n, double damping, double *out_x)
{
    for (int j = 0; j < n; j++) {
        double norm = gn_solve_get_length(a + j, m, n);
        for (int i = 0; i < n; i++)
            a[(m + j) * n + i] = i == j ? sqrt(damping) * norm : 0;
        b[m + j] = 0;
    }
    return gn_solve_least_squares(a, b, m + n, n, out_x);
}

/* Turns columns p and q of the matrix by cosine c and sine s. */
static void turn(double *matrix, int m, int n, int p, int q, double c, double s)
{
    for (int i = 0; i < m; i++) {
        double x = matrix[i * n + p], y = matrix[i * n + q];
        matrix[i * n + p] = c * x - s * y;
        matrix[i * n + q] = s * x + c * y;
    }
}

/* Makes columns p and q orthogonal. Returns whether they were not. */
static int orthogonalise(double *a, int m, int n, int p, int q, double *v)
{
    double pp = 0, qq = 0, pq = 0;
    for (int i = 0; i < m; i++) {
        pp += a[i * n + p] * a[i * n + p];
        qq += a[i * n + q] * a[i * n + q];
        pq += a[i * n + p] * a[i * n + q];
    }
    if (fabs(pq) <= 4 * DBL_EPSILON * sqrt(pp * qq) || pq == 0)
        return 0;
    double zeta = (qq - pp) / (2 * pq);
    double t = (zeta >= 0 ? 1 : -1) / (fabs(zeta) + hypot(1, zeta));
    double c = 1 / hypot(1, t);
    turn(a, m, n, p, q, c, c * t);
    turn(v, n, n, p, q, c, c * t);
    return 1;
}

static void swap_columns(double *matrix, int m, int n, int p, int q)
{
    for (int i = 0; i < m; i++) {
        double held = matrix[i * n + p];
        matrix[i * n + p] = matrix[i * n + q];
        matrix[i * n + q] = held;
    }
}

int gn_solve_svd(double *a, int m, int n, double *out_s, double *out_v)
{
    double largest = 0;
    for (int i = 0; i < m * n; i++) {
        if (!isfinite(a[i]))
            return -EDOM;
        largest = fmax(largest, fabs(a[i]));
    }
    double scale = largest > 0 ? largest : 1; // squares neither overflow nor vanish
    for (int i = 0; i < m * n; i++)
        a[i] /= scale;
    for (int i = 0; i < n * n; i++)
        out_v[i] = i % (n + 1) == 0;
    int turned = 1;
    for (int sweep = 0; sweep < 60 && turned; sweep++) {
        turned = 0;
        for (int p = 0; p < n - 1; p++)
            for (int q = p + 1; q < n; q++)
                turned += orthogonalise(a, m, n, p, q, out_v);
    }
    for (int j = 0; j < n; j++) {
        double norm = gn_solve_get_length(a + j, m, n);
        out_s[j] = norm * scale;
        for (int i = 0; i < m && norm > 0; i++)
            a[i * n + j] /= norm;
    }
    for (int p = 0; p < n - 1; p++) { // falling
        int best = p;
        for (int q = p + 1; q < n; q++)
            best = out_s[q] > out_s[best] ? q : best;
        double held = out_s[p];
        out_s[p] = out_s[best];
        out_s[best] = held;
        swap_columns(a, m, n, p, best);
        swap_columns(out_v, n, n, p, best);
    }
    return 0;
}

double gn_solve_get_condition(double *a, int m, int n)
{
    double s[GN_SOLVE_MAX_SVD], v[GN_SOLVE_MAX_SVD * GN_SOLVE_MAX_SVD];
    for (int j = 0; j < n; j++) {
        double norm = gn_solve_get_length(a + j, m, n);
        if (!(norm > 0) || !isfinite(norm))
            return INFINITY;
        for (int i = 0; i < m; i++)
            a[i * n + j] /= norm;
    }
    if (m < n || gn_solve_svd(a, m, n, s, v) < 0)
        return INFINITY;
    return s[n - 1] > 0 ? s[0] / s[n - 1] : INFINITY;
}

static double get_determinant(const double m[static 9])
{
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}

/* The third column of a matrix as the cross product of the other two, or of what fits them. */
static void complete(double u[static 9], const double s[static 3])
{
    if (s[1] <= 4 * DBL_EPSILON * s[0]) { // any direction across the first
        int i = fabs(u[0]) < 0.6 ? 0 : 3; // an axis that it does not lie along
        double dot = u[i];
        for (int k = 0; k < 9; k += 3)
            u[k + 1] = (k == i) - dot * u[k];
        double norm = gn_solve_get_length(u + 1, 3, 3);
        for (int k = 0; k < 9; k += 3)
            u[k + 1] /= norm;
    }
    u[2] = u[3] * u[7] - u[6] * u[4];
    u[5] = u[6] * u[1] - u[0] * u[7];
    u[8] = u[0] * u[4] - u[3] * u[1];
}

int gn_solve_wahba(const double b[static 9], double out_r[static 9], double out_s[static 3])
{
    double u[9], s[3], v[9];
    memcpy(u, b, sizeof(u));
    if (gn_solve_svd(u, 3, 3, s, v) < 0 || !(s[0] > 0))
        return -EDOM;
    s[2] = get_determinant(b) < 0 ? -s[2] : s[2];
    complete(u, s); // both right-handed: the sign of the last pair is Wahba's det
    complete(v, (double[3]){1, 1, 1});
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out_r[3 * i + j] =
                u[3 * i] * v[3 * j] + u[3 * i + 1] * v[3 * j + 1] + u[3 * i + 2] * v[3 * j + 2];
    memcpy(out_s, s, sizeof(s));
    return 0;
}

int gn_solve_homography(const double from[static 8], const double to[static 8],
                        double out_h[static 9])
{
    double a[64] = {0}, b[8], h[8];
    for (int i = 0; i < 4; i++) {
        double x = from[2 * i], y = from[2 * i + 1];
        for (int k = 0; k < 2; k++) {
            double *row = a + 8 * (2 * i + k), t = to[2 * i + k];
            row[3 * k] = x;
            row[3 * k + 1] = y;
            row[3 * k + 2] = 1;
            row[6] = -x * t;
            row[7] = -y * t;
            b[2 * i + k] = t;
        }
    }
    if (gn_solve_least_squares(a, b, 8, 8, h) < 0)
        return -EDOM;
    memcpy(out_h, h, sizeof(h));
    out_h[8] = 1;
    return fabs(get_determinant(out_h)) > 1e-12 ? 0 : -EDOM;
}
