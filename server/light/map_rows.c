/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_rows.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_pixels.h"

void gn_map_reader_init(struct gn_map_reader *reader)
{
    const struct gn_response *response = &reader->frame->response;
    double inverse[9];
    gn_response_get_matrices(response, reader->matrix, inverse);
    reader->scale = response->scale == 0 ? 1 : response->scale;
    reader->has_matrix = false;
    for (int i = 0; i < 9; i++)
        reader->has_matrix = reader->has_matrix || response->to_rec709[i] != 0;
    reader->has_curve = !reader->codes && response->type != GN_RESPONSE_LINEAR;
}

/* What cannot be light is dark, for now where it is infinite. */
static void mend(float *rgb, int n, struct gn_map_row *row)
{
    for (int i = 0; i < n; i++, rgb += 3) {
        bool is_nan = false, is_inf = false, is_negative = false;
        for (int c = 0; c < 3; c++) {
            is_nan = is_nan || isnan(rgb[c]);
            is_inf = is_inf || rgb[c] == INFINITY;
            is_negative = is_negative || rgb[c] < 0;
            rgb[c] = rgb[c] > 0 && rgb[c] < INFINITY ? rgb[c] : 0;
        }
        row->n_nan += is_nan;
        row->n_inf += is_inf;
        row->n_negative += is_negative;
    }
}

/* Of a channel below 0: it is clamped, and the others are lowered so that the luminance stays. */
static void clamp_to_gamut(double v[static 3])
{
    static const double y[3] = {GN_LUMINANCE_R, GN_LUMINANCE_G, GN_LUMINANCE_B};
    double before = 0, after = 0;
    for (int c = 0; c < 3; c++) {
        before += y[c] * v[c];
        after += y[c] * fmax(v[c], 0);
    }
    for (int c = 0; c < 3; c++)
        v[c] = before > 0 ? fmax(v[c], 0) * (before / after) : 0;
}

/* Matrix and scale, then the lens's fall-off: a few texels at a time, so that only those have to be
 * looked at again among which a channel falls below 0. */
static void multiply(const double m[static 9], const float *gain, float *rgb, int n,
                     struct gn_map_row *row)
{
    enum { N_FEW = 32 };
    double v[N_FEW][3];
    for (; n > 0; n -= N_FEW, rgb += 3 * N_FEW) {
        int n_few = n < N_FEW ? n : N_FEW;
        double lowest = 0;
        for (int i = 0; i < n_few; i++) {
            double r = (double)rgb[3 * i], g = (double)rgb[3 * i + 1], b = (double)rgb[3 * i + 2];
            for (int c = 0; c < 3; c++) {
                v[i][c] = m[3 * c] * r + m[3 * c + 1] * g + m[3 * c + 2] * b;
                lowest = v[i][c] < lowest ? v[i][c] : lowest;
            }
        }
        for (int i = 0; i < n_few && lowest < 0; i++) {
            if (v[i][0] < 0 || v[i][1] < 0 || v[i][2] < 0) {
                clamp_to_gamut(v[i]);
                row->n_out_of_gamut++;
            }
        }
        for (int i = 0; i < n_few; i++)
            for (int c = 0; c < 3; c++)
                rgb[3 * i + c] = v[i][c] > 0 ? (float)(v[i][c] * (gain ? (double)gain[i] : 1)) : 0;
        gain = gain ? gain + N_FEW : NULL;
    }
}

/* Device values, >= 0, to radiance: curve, matrix and scale, the lens's fall-off. What lies beyond
 * float's range is infinite then, and capped. */
static void calibrate(const struct gn_map_reader *r, const float *gain, float *rgb, int n,
                      struct gn_map_row *row)
{
    for (int i = 0; i < 3 * n && r->has_curve; i++) // a curve may leave float's range
        rgb[i] = fminf(gn_response_decode(&r->frame->response, rgb[i]), FLT_MAX);
    if (r->has_matrix) {
        multiply(r->matrix, gain, rgb, n, row);
    } else if (gain) {
        for (int i = 0; i < n; i++)
            for (int c = 0; c < 3; c++)
                rgb[3 * i + c] = (float)((double)rgb[3 * i + c] * ((double)gain[i] * r->scale));
    } else if (r->scale != 1) {
        for (int i = 0; i < 3 * n; i++)
            rgb[i] = (float)((double)rgb[i] * r->scale);
    }
}

static void cap(float *rgb, int n, struct gn_map_row *row)
{
    for (int i = 0; i < n; i++, rgb += 3) {
        bool is_capped = false;
        for (int c = 0; c < 3; c++) {
            is_capped = is_capped || rgb[c] > GN_RADIANCE_MAX;
            rgb[c] = rgb[c] < GN_RADIANCE_MAX ? rgb[c] : GN_RADIANCE_MAX;
        }
        row->n_capped += is_capped;
    }
}

/* The largest of n floats >= 0: they are ordered as their bits are. */
static float get_max(const float *v, int n)
{
    int32_t max_bits = 0;
    for (int i = 0; i < n; i++) {
        int32_t bits;
        memcpy(&bits, v + i, sizeof(bits));
        max_bits = bits > max_bits ? bits : max_bits;
    }
    float max;
    memcpy(&max, &max_bits, sizeof(max));
    return max;
}

/* Texels that are summed side by side: their values are a whole number of vectors. */
enum { N_ABREAST = 4, N_LANES = 3 * N_ABREAST };

/* Sums n texels. */
static inline void sum_alike(const float *l, int n, double sum[static 3])
{
    double lane[N_LANES] = {0};
    int i = 0;
    for (; i + N_ABREAST <= n; i += N_ABREAST)
        for (int j = 0; j < N_LANES; j++)
            lane[j] += (double)l[3 * i + j];
    for (; i < n; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += (double)l[3 * i + c];
    for (int j = 0; j < N_LANES; j++)
        sum[j % 3] += lane[j];
}

/* Sums n texels, each of its own weight. */
static inline void sum_weighted(const float *l, const float *weight, int n, double sum[static 3])
{
    double s[3] = {0};
    for (int i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            s[c] += (double)l[3 * i + c] * (double)weight[i];
    memcpy(sum, s, sizeof(s));
}

/* Patch by patch, whose sums make the row's. */
static void sum_row(const struct gn_map_reader *r, int y, struct gn_map_row *row)
{
    const struct gn_map_table *t = r->table;
    size_t start = (size_t)y * (size_t)t->projection.width;
    const float *l = r->radiance + 3 * start, *weight = t->weight + start;
    int begin = t->span[2 * y], end = t->span[2 * y + 1], side = t->patch_side;
    memset(row->irradiance, 0, sizeof(row->irradiance));
    memset(row->upward, 0, sizeof(row->upward));
    memset(row->luminance, 0, sizeof(row->luminance));
    row->max_channel = get_max(l + 3 * begin, 3 * (end - begin));
    for (int x = begin; x < end;) {
        int patch = x / side, n = (patch + 1) * side < end ? (patch + 1) * side - x : end - x;
        double sum[3] = {0};
        if (t->has_row_weights)
            sum_alike(l + 3 * x, n, sum);
        else
            sum_weighted(l + 3 * x, weight + x, n, sum);
        row->luminance[patch] = gn_luminance_of_sum(sum);
        for (int c = 0; c < 3; c++)
            row->irradiance[c] += sum[c];
        x += n;
    }
    if (t->has_row_weights && begin < end) {
        for (int c = 0; c < 3; c++)
            row->irradiance[c] *= (double)weight[begin];
        for (int k = 0; k < GN_MAP_PATCHES; k++)
            row->luminance[k] *= (double)weight[begin];
    }
    if (t->up_weight)
        sum_weighted(l + 3 * begin, t->up_weight + start + begin, end - begin, row->upward);
}

double gn_map_row_get_max_luminance(const struct gn_map_reader *reader, int y)
{
    const struct gn_map_table *t = reader->table;
    const float *row = reader->radiance + 3 * (size_t)y * (size_t)t->projection.width;
    double max = 0;
    for (int x = t->span[2 * y]; x < t->span[2 * y + 1]; x++) {
        double luminance = gn_luminance(row + 3 * x);
        max = luminance > max ? luminance : max;
    }
    return max;
}

void gn_map_row_read(const struct gn_map_reader *reader, int y, struct gn_map_row *out_row)
{
    const struct gn_map_table *t = reader->table;
    int width = t->projection.width, begin = t->span[2 * y], n = t->span[2 * y + 1] - begin;
    float *row = reader->radiance + 3 * (size_t)y * (size_t)width, *shown = row + 3 * begin;
    *out_row = (struct gn_map_row){0};
    memset(row, 0, 3 * (size_t)begin * sizeof(*row));
    memset(shown + 3 * n, 0, 3 * (size_t)(width - begin - n) * sizeof(*row));
    if (gn_map_pixels_fetch(reader, begin, y, n, shown, out_row))
        mend(shown, n, out_row);
    if (reader->has_curve || reader->has_matrix || reader->scale != 1 || t->gain)
        calibrate(reader, t->gain ? t->gain + (size_t)y * (size_t)width + begin : NULL, shown, n,
                  out_row);
    sum_row(reader, y, out_row);
    if (out_row->max_channel > GN_RADIANCE_MAX) {
        cap(shown, n, out_row);
        sum_row(reader, y, out_row);
    }
}

static float get_median(float *v, int n)
{
    for (int i = 1; i < n; i++) {
        float key = v[i];
        int j = i;
        for (; j > 0 && v[j - 1] > key; j--)
            v[j] = v[j - 1];
        v[j] = key;
    }
    return n == 0 ? 0 : n % 2 ? v[n / 2] : 0.5f * (v[n / 2 - 1] + v[n / 2]);
}

static void mend_infinite_texel(const struct gn_map_reader *r, int x, int y)
{
    const struct gn_map_table *t = r->table;
    size_t width = (size_t)t->projection.width;
    float values[3][8];
    int n = 0;
    for (int i = 0; i < 9; i++) {
        int at[2] = {x, y};
        if (i == 4 || !gn_projection_step(&t->projection, i % 3 - 1, i / 3 - 1, at))
            continue;
        size_t texel = (size_t)at[1] * width + (size_t)at[0];
        if (!(t->solid_angle[texel] > 0) || gn_map_pixels_is_infinite(r, at[0], at[1]))
            continue;
        for (int c = 0; c < 3; c++)
            values[c][n] = r->radiance[3 * texel + (size_t)c];
        n++;
    }
    for (int c = 0; c < 3; c++)
        r->radiance[3 * ((size_t)y * width + (size_t)x) + (size_t)c] = get_median(values[c], n);
}

void gn_map_row_mend(const struct gn_map_reader *reader, int y, struct gn_map_row *row)
{
    const struct gn_map_table *t = reader->table;
    if (row->n_inf == 0)
        return;
    for (int x = t->span[2 * y]; x < t->span[2 * y + 1]; x++)
        if (gn_map_pixels_is_infinite(reader, x, y))
            mend_infinite_texel(reader, x, y);
    sum_row(reader, y, row);
}
