/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/point_spread.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "common/vec4.h"

/* Of V and A, L, G. */
static const int channels[GN_SPREAD_PARTS] = {4, 3, 3};

/* Four floats are worked on at a time; every array ends in this many spare ones. */
#define SPARE 4

/*
 * e^-t I_n(t), t = deviation^2, is a Fourier coefficient of e^(t (cos a - 1)): a sum over equal
 * steps of a, which is exact but for coefficients beyond the number of steps.
 */
static double get_weight(int n, double t)
{
    enum { STEPS = 512 };
    double sum = 0, step = 2 * acos(-1.0) / STEPS;
    for (int i = 0; i < STEPS; i++)
        sum += exp(t * (cos(i * step) - 1)) * cos(n * i * step);
    return sum / STEPS;
}

void gn_spread_make_kernel(double deviation, struct gn_spread_kernel *out_kernel)
{
    double weights[GN_SPREAD_MAX_RADIUS + 1], t = deviation * deviation;
    double sum = weights[0] = get_weight(0, t);
    int radius = 0;
    while (sum < 1 - 1e-4 && radius < GN_SPREAD_MAX_RADIUS) {
        radius++;
        weights[radius] = get_weight(radius, t);
        sum += 2 * weights[radius];
    }
    *out_kernel = (struct gn_spread_kernel){.radius = radius};
    for (int i = 0; i <= radius; i++)
        out_kernel->weights[i] = (float)(weights[i] / sum);
}

int gn_spread_reserve(struct gn_spread *spread, int width, int n_rows, int radius)
{
    if (width <= spread->width && n_rows <= spread->n_rows && radius <= spread->radius)
        return 0;
    width = width > spread->width ? width : spread->width;
    n_rows = n_rows > spread->n_rows ? n_rows : spread->n_rows;
    radius = radius > spread->radius ? radius : spread->radius;
    gn_spread_finish(spread);
    size_t w = (size_t)width, rows = (size_t)n_rows + 2 * (size_t)radius;
    size_t n = 4 * (w + 2 * (size_t)radius) + SPARE;
    for (int p = 0; p < GN_SPREAD_PARTS; p++)
        n += (rows + 1) * (w * (size_t)channels[p] + SPARE);
    spread->memory = malloc(n * sizeof(*spread->memory));
    spread->spans = malloc(rows * sizeof(*spread->spans));
    if (!spread->memory || !spread->spans) {
        gn_spread_finish(spread);
        return -ENOMEM;
    }
    float *next = spread->memory;
    spread->packed = next;
    next += 4 * (w + 2 * (size_t)radius) + SPARE;
    for (int p = 0; p < GN_SPREAD_PARTS; p++) {
        size_t stride = w * (size_t)channels[p] + SPARE;
        spread->wide[p] = next;
        spread->row[p] = next + rows * stride;
        next += (rows + 1) * stride;
    }
    spread->width = width;
    spread->n_rows = n_rows;
    spread->radius = radius;
    return 0;
}

void gn_spread_finish(struct gn_spread *spread)
{
    free(spread->memory);
    free(spread->spans);
    memset(spread, 0, sizeof(*spread));
}

static float *get_wide(const struct gn_spread *spread, int part, int row)
{
    return spread->wide[part] +
           (size_t)row * ((size_t)spread->width * (size_t)channels[part] + SPARE);
}

/* One row's layers. shadow and added may be NULL. */
struct source {
    const float *rgba, *shadow, *added;
};

/* First of n values that is not the value; n: all are. */
static int find_other(const float *values, int n, float value)
{
    int i = 0;
    for (; i + 16 <= n; i += 16) {
        gn_mask4 is_other =
            (gn_vec4_load(values + i) != value) | (gn_vec4_load(values + i + 4) != value) |
            (gn_vec4_load(values + i + 8) != value) | (gn_vec4_load(values + i + 12) != value);
        if (gn_mask4_has_any(is_other))
            break;
    }
    while (i < n && values[i] == value)
        i++;
    return i;
}

/* Finds the pixels [out[0], out[1]) that hold all values that are not the value; out[0] = out[1]:
 * none. */
static void find_span(const float *values, int n_channels, int width, float value,
                      int out[static 2])
{
    int end = n_channels * width, begin = find_other(values, end, value);
    while (end > begin && values[end - 1] == value)
        end--;
    out[0] = begin / n_channels;
    out[1] = (end + n_channels - 1) / n_channels;
    if (begin == end)
        out[0] = out[1] = 0;
}

/* What is spread of pixel x. */
static void pack(const struct source *source, int part, int x, float *out)
{
    const float *rgba = source->rgba + 4 * x;
    const float *from = (part == 1 ? source->shadow : source->added) + 3 * x;
    for (int c = 0; c < 3; c++)
        out[c] = (1 - rgba[3]) * (part == 1 ? 1 - from[c] : from[c]);
}

/* Pixels [begin, end) into packed, those outside the picture as its border. */
static void pack_span(const struct gn_spread *spread, const struct source *source, int part,
                      int width, int begin, int end)
{
    float *out = spread->packed;
    for (int x = begin; x < end; x++, out += channels[part]) {
        int inside = x < 0 ? 0 : x < width ? x : width - 1;
        if (part == 0)
            memcpy(out, source->rgba + 4 * inside, 4 * sizeof(*out));
        else
            pack(source, part, inside, out);
    }
}

/* One part of a row into wide. */
static void spread_along(struct gn_spread *spread, const struct gn_spread_kernel *kernel,
                         const struct source *source, int part, int width, int row)
{
    int *span = spread->spans[row][part], r = kernel->radius, n = channels[part];
    const float *values = part == 0 ? source->rgba : part == 1 ? source->shadow : source->added;
    span[0] = span[1] = 0;
    if (values)
        find_span(values, n, width, part == 1 ? 1 : 0, span);
    if (span[0] == span[1])
        return;
    span[0] = span[0] > r ? span[0] - r : 0;
    span[1] = span[1] < width - r ? span[1] + r : width;
    pack_span(spread, source, part, width, span[0] - r, span[1] + r);
    const float *in = spread->packed + n * r;
    float *out = get_wide(spread, part, row) + n * span[0];
    for (int i = 0; i < n * (span[1] - span[0]); i += 4) {
        gn_vec4 sum = kernel->weights[0] * gn_vec4_load(in + i);
        for (int k = 1; k <= r; k++)
            sum +=
                kernel->weights[k] * (gn_vec4_load(in + i - n * k) + gn_vec4_load(in + i + n * k));
        gn_vec4_store(out + i, sum);
    }
}

static const float *get_source_row(const struct gn_image *image, int y)
{
    return image ? gn_image_at(image, 0, y) : NULL;
}

void gn_spread_load(struct gn_spread *spread, const struct gn_spread_kernel *kernel,
                    const struct gn_image *virtual_rgba, const struct gn_image *shadow,
                    const struct gn_image *added, int y, int n_rows)
{
    int last = virtual_rgba->height - 1;
    for (int row = 0; row < n_rows + 2 * kernel->radius; row++) {
        int from = y - kernel->radius + row;
        from = from < 0 ? 0 : from < last ? from : last;
        const struct source source = {get_source_row(virtual_rgba, from),
                                      get_source_row(shadow, from), get_source_row(added, from)};
        for (int part = 0; part < GN_SPREAD_PARTS; part++)
            spread_along(spread, kernel, &source, part, virtual_rgba->width, row);
    }
}

/* The part of wide's rows i to i + 2 radius into row, zeros around it up to [begin, end). */
static void spread_across(struct gn_spread *spread, const struct gn_spread_kernel *kernel, int part,
                          int i, int begin, int end)
{
    int n = channels[part];
    float *out = spread->row[part];
    memset(out + n * begin, 0, (size_t)(n * (end - begin)) * sizeof(*out));
    for (int k = 0; k <= 2 * kernel->radius; k++) {
        const int *span = spread->spans[i + k][part];
        const float *in = get_wide(spread, part, i + k);
        float weight = kernel->weights[abs(k - kernel->radius)];
        int at = n * span[0], stop = n * span[1];
        for (; at + 4 <= stop; at += 4)
            gn_vec4_store(out + at, gn_vec4_load(out + at) + weight * gn_vec4_load(in + at));
        for (; at < stop; at++)
            out[at] += weight * in[at];
    }
}

void gn_spread_get_row(struct gn_spread *spread, const struct gn_spread_kernel *kernel, int i,
                       int *out_begin, int *out_end)
{
    int begin = spread->width, end = 0;
    for (int k = 0; k <= 2 * kernel->radius; k++) {
        for (int part = 0; part < GN_SPREAD_PARTS; part++) {
            const int *span = spread->spans[i + k][part];
            if (span[0] == span[1])
                continue;
            begin = span[0] < begin ? span[0] : begin;
            end = span[1] > end ? span[1] : end;
        }
    }
    *out_begin = begin < end ? begin : 0;
    *out_end = end;
    for (int part = 0; part < GN_SPREAD_PARTS && begin < end; part++)
        spread_across(spread, kernel, part, i, begin, end);
}
