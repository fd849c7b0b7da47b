/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Harmonics of a lat-long row: its texels are boxes in theta and phi, so the integrals are products
 * of one over theta, the row's, and one over phi, a Fourier sum over the row. Exact.
 */
#include <math.h>
#include <stdbool.h>

#include "server/light/sh_internal.h"

typedef gn_vec4 vec;

enum { LANES = GN_SH_LANES, TRIPLE = 3 * GN_SH_LANES, CHUNK = GN_SH_BLOCK * TRIPLE };

static const double pi = 3.14159265358979323846;

/* Of a row: sums of L times 1, cos phi, sin phi, cos 2 phi, ... sin 4 phi. */
struct waves {
    double w[9][3];
};

/* A quarter of a row further phi is pi / 2 less, and its waves are those of the first quarter,
 * exchanged: one column then serves four texels. Whole vectors are needed. */
static bool is_folded(int width)
{
    return width % 16 == 0;
}

float *gn_sh_make_columns(int width, int order, struct gn_scratch *scratch)
{
    bool is_short = is_folded(width);
    int n = is_short ? width / 4 : width, repeat = is_short ? 3 : 1;
    size_t stride = (size_t)repeat * (size_t)n;
    float *columns = gn_scratch_take(scratch, (size_t)(2 * order) * stride, sizeof(*columns));
    for (int x = 0; columns && x < n; x++) {
        double phi = pi - 2 * pi * (x + 0.5) / width, c1 = cos(phi), s1 = sin(phi), c = c1, s = s1;
        for (int m = 1; m <= order; m++) {
            for (int i = 0; i < repeat; i++) {
                columns[(size_t)(2 * m - 2) * stride + (size_t)(repeat * x + i)] = (float)c;
                columns[(size_t)(2 * m - 1) * stride + (size_t)(repeat * x + i)] = (float)s;
            }
            double next = c * c1 - s * s1;
            s = s * c1 + c * s1;
            c = next;
        }
    }
    return columns;
}

static void add_to_wave(const vec a[static 3], double wave[static 3])
{
    for (int i = 0; i < TRIPLE; i++)
        wave[i % 3] += (double)a[i / LANES][i % LANES];
}

/* cos and sin of an even multiple, which the quarters share. */
static void add_even(const vec *light, const float *cosine, const float *sine, int n,
                     double (*wave)[3])
{
    vec a[3] = {{0}}, b[3] = {{0}};
    for (int i = 0; i < n; i += 3)
        for (int j = 0; j < 3; j++) {
            vec l = light[i + j];
            a[j] += l * gn_vec4_load(cosine + LANES * (i + j));
            b[j] += l * gn_vec4_load(sine + LANES * (i + j));
        }
    add_to_wave(a, wave[0]);
    add_to_wave(b, wave[1]);
}

/* Of an odd multiple: p is light of quarter 0 less quarter 2, q of 1 less 3 (for 3 phi negated). */
static void add_odd(const vec *p, const vec *q, const float *cosine, const float *sine, int n,
                    double (*wave)[3])
{
    vec a[3] = {{0}}, b[3] = {{0}};
    for (int i = 0; i < n; i += 3)
        for (int j = 0; j < 3; j++) {
            vec c = gn_vec4_load(cosine + LANES * (i + j)),
                s = gn_vec4_load(sine + LANES * (i + j));
            a[j] += p[i + j] * c + q[i + j] * s;
            b[j] += p[i + j] * s - q[i + j] * c;
        }
    add_to_wave(a, wave[0]);
    add_to_wave(b, wave[1]);
}

/* Twelve floats are four texels. */
static void sum_folded_row(const float *row, int width, int order, const float *columns,
                           struct waves *out)
{
    int quarter = 3 * (width / 4);
    for (int start = 0; start < quarter; start += CHUNK) {
        int n = (quarter - start < CHUNK ? quarter - start : CHUNK) / LANES;
        vec p[CHUNK / LANES], q[CHUNK / LANES], minus_q[CHUNK / LANES];
        vec all[CHUNK / LANES], cross[CHUNK / LANES], sum[3] = {{0}};
        for (int i = 0; i < n; i += 3)
            for (int j = i; j < i + 3; j++) {
                const float *at = row + start + LANES * j;
                vec l0 = gn_vec4_load(at), l1 = gn_vec4_load(at + quarter);
                vec l2 = gn_vec4_load(at + 2 * quarter), l3 = gn_vec4_load(at + 3 * quarter);
                p[j] = l0 - l2;
                q[j] = l1 - l3;
                minus_q[j] = l3 - l1;
                all[j] = (l0 + l2) + (l1 + l3);
                cross[j] = (l0 + l2) - (l1 + l3);
                sum[j - i] += all[j];
            }
        const float *column = columns + start;
        size_t stride = (size_t)quarter;
        add_to_wave(sum, out->w[0]);
        add_odd(p, q, column, column + stride, n, &out->w[1]);
        add_even(cross, column + 2 * stride, column + 3 * stride, n, &out->w[3]);
        if (order > 2) {
            add_odd(p, minus_q, column + 4 * stride, column + 5 * stride, n, &out->w[5]);
            add_even(all, column + 6 * stride, column + 7 * stride, n, &out->w[7]);
        }
    }
}

static void sum_row(const float *row, int width, int order, const float *columns, struct waves *out)
{
    for (int x = 0; x < width; x++)
        for (int c = 0; c < 3; c++) {
            double l = (double)row[3 * x + c];
            out->w[0][c] += l;
            for (int k = 0; k < 2 * order; k++)
                out->w[k + 1][c] += (double)columns[(size_t)k * (size_t)width + (size_t)x] * l;
        }
}

/* The antiderivatives in theta of sin^(m + 1) cos^k: [m][k], those that harmonics need. */
static void integrate_theta(double theta, double (*f)[5])
{
    double s = sin(theta), z = cos(theta), s3 = s * s * s, s5 = s3 * s * s;
    double z2 = z * z, z3 = z2 * z, z4 = z2 * z2, z5 = z4 * z;
    double sin2 = 2 * s * z, sin4 = 2 * sin2 * (z2 - s * s);
    f[0][0] = -z;
    f[0][1] = -z2 / 2;
    f[0][2] = -z3 / 3;
    f[0][3] = -z4 / 4;
    f[0][4] = -z5 / 5;
    f[1][0] = theta / 2 - sin2 / 4;
    f[1][1] = s3 / 3;
    f[1][2] = theta / 8 - sin4 / 32;
    f[1][3] = s3 / 3 - s5 / 5;
    f[2][0] = z3 / 3 - z;
    f[2][1] = z4 / 4 - z2 / 2;
    f[2][2] = z5 / 5 - z3 / 3;
    f[3][0] = 3 * theta / 8 - sin2 / 4 + sin4 / 32;
    f[3][1] = s5 / 5;
    f[4][0] = 2 * z3 / 3 - z - z5 / 5;
}

/* The polynomials' parts in theta, integrated over a row. */
static void get_row_integrals(int y, int height, double out[static GN_SH_MAX])
{
    double i[5][5] = {{0}}, end[5][5] = {{0}};
    integrate_theta(pi * y / height, i);
    integrate_theta(pi * (y + 1) / height, end);
    for (int m = 0; m < 5; m++)
        for (int k = 0; k < 5; k++)
            i[m][k] = end[m][k] - i[m][k];
    const double parts[GN_SH_MAX] = {
        i[0][0],
        i[1][0],
        i[0][1],
        i[1][0],
        0.5 * i[2][0],
        i[1][1],
        3 * i[0][2] - i[0][0],
        i[1][1],
        i[2][0],
        i[3][0],
        0.5 * i[2][1],
        5 * i[1][2] - i[1][0],
        5 * i[0][3] - 3 * i[0][1],
        5 * i[1][2] - i[1][0],
        i[2][1],
        i[3][0],
        0.25 * i[4][0],
        i[3][1],
        0.5 * (7 * i[2][2] - i[2][0]),
        7 * i[1][3] - 3 * i[1][1],
        35 * i[0][4] - 30 * i[0][2] + 3 * i[0][0],
        7 * i[1][3] - 3 * i[1][1],
        7 * i[2][2] - i[2][0],
        i[3][1],
        i[4][0],
    };
    memcpy(out, parts, sizeof(parts));
}

void gn_sh_add_latlong_row(const struct gn_image *image, int y, int order, const float *columns,
                           struct gn_sh_sums *sums)
{
    static const uint8_t wave_of[GN_SH_MAX] = {0, 2, 0, 1, 4, 2, 0, 1, 3, 6, 4, 2, 0,
                                               1, 3, 5, 8, 6, 4, 2, 0, 1, 3, 5, 7};
    struct waves waves = {{{0}}};
    const float *row = gn_image_at(image, 0, y);
    if (is_folded(image->width))
        sum_folded_row(row, image->width, order, columns, &waves);
    else
        sum_row(row, image->width, order, columns, &waves);
    double integral[GN_SH_MAX], step = 2 * pi / image->width;
    get_row_integrals(y, image->height, integral);
    for (int k = 0; k <= 2 * order; k++) { // over each texel's width
        int m = (k + 1) / 2;
        double width = m == 0 ? step : 2.0 / m * sin(0.5 * m * step);
        for (int c = 0; c < 3; c++)
            waves.w[k][c] *= width;
    }
    for (int k = 0; k < gn_sh_get_count(order); k++)
        for (int c = 0; c < 3; c++)
            sums->p[k][c] += integral[k] * waves.w[wave_of[k]][c];
}
