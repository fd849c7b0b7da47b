/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_rows.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "common/half.h"
#include "server/light/luminance.h"

int gn_pixel_layout_get_bytes(enum gn_pixel_layout layout)
{
    static const int bytes[GN_PIXELS_COUNT] = {
        [GN_PIXELS_RGB_F32] = 12, [GN_PIXELS_RGB_F16] = 6, [GN_PIXELS_MONO_U16] = 2,
        [GN_PIXELS_RGB_U16] = 6,  [GN_PIXELS_RGB_U8] = 3,
    };
    return bytes[layout];
}

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

static uint16_t get_u16(const uint8_t *p)
{
    return (uint16_t)(p[0] | p[1] << 8);
}

static uint32_t get_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static const uint8_t *get_raw(const struct gn_map_reader *r, int x, int y)
{
    size_t i = (size_t)y * (size_t)r->table->projection.width + (size_t)x;
    return r->frame->raw + i * (size_t)gn_pixel_layout_get_bytes(r->frame->layout);
}

/* Not a finite number >= 0, or -0: the sign bit, or exponents of infinity and NaN carried there. */
static uint32_t get_fault_bit(uint32_t bits)
{
    return (bits | (bits + 0x00800000u)) & 0x80000000u;
}

/* n floats as they are. Whether any of them has to be mended. */
static bool fetch_f32(const uint8_t *raw, int n, float *restrict out)
{
    uint32_t faults = 0;
    for (int i = 0; i < n; i++) {
        uint32_t bits = get_u32(raw + 4 * (size_t)i);
        faults |= get_fault_bit(bits);
        memcpy(out + i, &bits, sizeof(bits));
    }
    return faults != 0;
}

static bool fetch_f16(const uint8_t *raw, int n, float *restrict out)
{
    uint32_t faults = 0;
    for (int i = 0; i < n; i++) {
        uint32_t bits;
        out[i] = gn_half_to_float(get_u16(raw + 2 * (size_t)i));
        memcpy(&bits, out + i, sizeof(bits));
        faults |= get_fault_bit(bits);
    }
    return faults != 0;
}

/* The largest of n codes. */
static int get_largest_u16(const uint8_t *raw, int n)
{
    int largest = 0;
    for (int i = 0; i < n; i++) {
        int code = get_u16(raw + 2 * (size_t)i);
        largest = code > largest ? code : largest;
    }
    return largest;
}

/* Counts pixels with a code at the rail or above. */
static int count_clipped_u16(const uint8_t *raw, int n, int n_codes, int code_max)
{
    int n_clipped = 0;
    for (int i = 0; i < n; i++, raw += 2 * n_codes) {
        bool is_clipped = false;
        for (int c = 0; c < n_codes; c++)
            is_clipped = is_clipped || get_u16(raw + 2 * c) >= code_max;
        n_clipped += is_clipped;
    }
    return n_clipped;
}

/* n pixels of 16-bit codes, 1 or 3 of them each. A row with codes that are none stays black: the
 * frame is refused. */
static void fetch_u16(const struct gn_code_table *codes, const uint8_t *raw, int n, int n_codes,
                      float *restrict out, struct gn_map_row *row)
{
    const float *linear = codes->linear;
    row->largest_code = get_largest_u16(raw, n * n_codes);
    if (row->largest_code >= codes->code_max)
        row->n_clipped = count_clipped_u16(raw, n, n_codes, codes->code_max);
    if (row->largest_code > codes->code_max) {
        memset(out, 0, 3 * (size_t)n * sizeof(*out));
    } else if (n_codes == 1) {
        for (int i = 0; i < n; i++)
            out[3 * i] = out[3 * i + 1] = out[3 * i + 2] = linear[get_u16(raw + 2 * (size_t)i)];
    } else {
        for (int i = 0; i < 3 * n; i++)
            out[i] = linear[get_u16(raw + 2 * (size_t)i)];
    }
}

static void fetch_u8(const struct gn_code_table *codes, const uint8_t *raw, int n, float *out,
                     struct gn_map_row *row)
{
    for (int i = 0; i < n; i++, raw += 3, out += 3) {
        bool is_clipped = false;
        for (int c = 0; c < 3; c++) {
            out[c] = codes->linear[raw[c]];
            is_clipped = is_clipped || raw[c] == 255;
        }
        row->n_clipped += is_clipped;
    }
}

/* Of a float image, whose codes may be those of an integer format as shares of full scale. */
static bool fetch_image(const struct gn_map_reader *r, int x, int y, int n, float *out,
                        struct gn_map_row *row)
{
    const struct gn_image *image = r->frame->codes;
    bool is_mono = image->channels < 3, is_faulty = false;
    for (int i = 0; i < n; i++) {
        const float *code = gn_image_at(image, x + i, y);
        bool is_clipped = false;
        for (int c = 0; c < 3; c++) {
            float v = code[is_mono ? 0 : c];
            is_faulty = is_faulty || !(v >= 0 && v < INFINITY);
            is_clipped = is_clipped || (r->frame->code_max > 0 && v >= 1);
            if (r->codes && v >= 0)
                v = r->codes->linear[lrintf(fminf(v, 1) * (float)r->codes->code_max)];
            out[3 * i + c] = v;
        }
        row->n_clipped += is_clipped;
    }
    return is_faulty;
}

/* Device values of n texels, not yet mended. Whether there is something to mend. */
static bool fetch(const struct gn_map_reader *r, int x, int y, int n, float *out,
                  struct gn_map_row *row)
{
    enum gn_pixel_layout layout = r->frame->layout;
    switch (layout) {
    case GN_PIXELS_RGB_F32:
        return fetch_f32(get_raw(r, x, y), 3 * n, out);
    case GN_PIXELS_RGB_F16:
        return fetch_f16(get_raw(r, x, y), 3 * n, out);
    case GN_PIXELS_MONO_U16:
        fetch_u16(r->codes, get_raw(r, x, y), n, 1, out, row);
        return false;
    case GN_PIXELS_RGB_U16:
        fetch_u16(r->codes, get_raw(r, x, y), n, 3, out, row);
        return false;
    case GN_PIXELS_RGB_U8:
        fetch_u8(r->codes, get_raw(r, x, y), n, out, row);
        return false;
    default:
        return fetch_image(r, x, y, n, out, row);
    }
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

/* Matrix and scale of one texel. Where a channel falls below 0 it is clamped, and the others are
 * lowered so that the luminance stays. */
static bool multiply(const double m[static 9], double rgb[static 3])
{
    double v[3], before = 0, after = 0;
    bool is_out = false;
    for (int c = 0; c < 3; c++) {
        v[c] = m[3 * c] * rgb[0] + m[3 * c + 1] * rgb[1] + m[3 * c + 2] * rgb[2];
        is_out = is_out || v[c] < 0;
    }
    memcpy(rgb, v, sizeof(v));
    if (!is_out)
        return false;
    static const double y[3] = {GN_LUMINANCE_R, GN_LUMINANCE_G, GN_LUMINANCE_B};
    for (int c = 0; c < 3; c++) {
        before += y[c] * v[c];
        after += y[c] * fmax(v[c], 0);
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = before > 0 ? fmax(v[c], 0) * (before / after) : 0;
    return true;
}

/* Device values to radiance: curve, matrix and scale, the lens's fall-off. */
static void calibrate(const struct gn_map_reader *r, const float *gain, float *rgb, int n,
                      struct gn_map_row *row)
{
    for (int i = 0; i < n; i++, rgb += 3) {
        double v[3], factor = gain ? (double)gain[i] : 1;
        for (int c = 0; c < 3; c++) // a curve may leave float's range, and a matrix has zeros
            v[c] = r->has_curve ? fmin((double)gn_response_decode(&r->frame->response, rgb[c]),
                                       (double)FLT_MAX)
                                : (double)rgb[c];
        if (r->has_matrix)
            row->n_out_of_gamut += multiply(r->matrix, v);
        else
            factor *= r->scale;
        for (int c = 0; c < 3; c++) // beyond float's range it is infinite, and capped
            rgb[c] = v[c] > 0 ? (float)fmin(v[c] * factor, 2 * (double)GN_RADIANCE_MAX) : 0;
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

/* Sums n texels of one weight for all. */
static void sum_alike(const float *l, double weight, int n, struct gn_map_row *row)
{
    double sum[N_LANES] = {0};
    int i = 0;
    for (; i + N_ABREAST <= n; i += N_ABREAST)
        for (int j = 0; j < N_LANES; j++)
            sum[j] += (double)l[3 * i + j];
    for (int j = 0; j < 3 * (n - i); j++)
        sum[j] += (double)l[3 * i + j];
    for (int j = 0; j < N_LANES; j++)
        row->irradiance[j % 3] += sum[j] * weight;
}

/* Sums n texels, each of its own weight; and upward, where there is something to fill. */
static void sum_weighted(const float *l, const float *weight, const float *up_weight, int n,
                         struct gn_map_row *row)
{
    double sum[3] = {0}, upward[3] = {0};
    for (int i = 0; i < n; i++, l += 3) {
        double w = (double)weight[i], up = up_weight ? (double)up_weight[i] : 0;
        for (int c = 0; c < 3; c++) {
            sum[c] += (double)l[c] * w;
            upward[c] += (double)l[c] * up;
        }
    }
    memcpy(row->irradiance, sum, sizeof(sum));
    memcpy(row->upward, upward, sizeof(upward));
}

static void sum_row(const struct gn_map_reader *r, int y, struct gn_map_row *row)
{
    const struct gn_map_table *t = r->table;
    size_t start = (size_t)y * (size_t)t->projection.width + (size_t)t->span[2 * y];
    int n = t->span[2 * y + 1] - t->span[2 * y];
    const float *l = r->radiance + 3 * start;
    memset(row->irradiance, 0, sizeof(row->irradiance));
    memset(row->upward, 0, sizeof(row->upward));
    row->max_channel = get_max(l, 3 * n);
    if (t->has_row_weights)
        sum_alike(l, (double)t->weight[start], n, row);
    else
        sum_weighted(l, t->weight + start, t->up_weight ? t->up_weight + start : NULL, n, row);
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
    if (fetch(reader, begin, y, n, shown, out_row))
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

static bool is_infinite_texel(const struct gn_map_reader *r, int x, int y)
{
    const struct gn_environment_frame *frame = r->frame;
    bool is_image = frame->layout == GN_PIXELS_IMAGE;
    int n = is_image && frame->codes->channels < 3 ? 1 : 3;
    for (int c = 0; c < n; c++) {
        float v = 0;
        if (is_image) {
            v = gn_image_at(frame->codes, x, y)[c];
        } else if (frame->layout == GN_PIXELS_RGB_F32) {
            uint32_t bits = get_u32(get_raw(r, x, y) + 4 * c);
            memcpy(&v, &bits, sizeof(v));
        } else if (frame->layout == GN_PIXELS_RGB_F16) {
            v = gn_half_to_float(get_u16(get_raw(r, x, y) + 2 * c));
        }
        if (v == INFINITY)
            return true;
    }
    return false;
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
        if (!(t->solid_angle[texel] > 0) || is_infinite_texel(r, at[0], at[1]))
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
        if (is_infinite_texel(reader, x, y))
            mend_infinite_texel(reader, x, y);
    sum_row(reader, y, row);
}
