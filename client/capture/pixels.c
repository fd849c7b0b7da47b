/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/pixels.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define MAX_SIDE_PX 16384

static int count_channels(const struct gn_pixels_format *f)
{
    return f->kind == GN_PIXELS_RGB || f->kind == GN_PIXELS_BGR ? 3 : 1;
}

/** Bits that a sample takes in the camera's picture. */
static int get_stored_bits(const struct gn_pixels_format *f)
{
    if (f->packing == GN_PIXELS_LSB || f->bits == 8)
        return f->bits;
    return f->packing == GN_PIXELS_GIGE ? 12 : 16;
}

size_t gn_pixels_get_bytes(const struct gn_pixels_format *format, int width, int height)
{
    if (width < 1 || width > MAX_SIDE_PX || height < 1 || height > MAX_SIDE_PX)
        return 0;
    size_t n_samples = (size_t)width * (size_t)height * (size_t)count_channels(format);
    return (n_samples * (size_t)get_stored_bits(format) + 7) / 8;
}

enum gn_capture_format gn_pixels_get_capture_format(const struct gn_pixels_format *format,
                                                    bool is_8_bit)
{
    bool is_mono = format->kind == GN_PIXELS_MONO;
    if (is_8_bit || (format->bits == 8 && !is_mono))
        return GN_CAPTURE_RGB8;
    if (format->bits == 12)
        return is_mono ? GN_CAPTURE_MONO12 : GN_CAPTURE_RGB12;
    return is_mono ? GN_CAPTURE_MONO16 : GN_CAPTURE_RGB16;
}

size_t gn_pixels_get_capture_bytes(enum gn_capture_format format, int width, int height)
{
    size_t n = (size_t)width * (size_t)height;
    if (format == GN_CAPTURE_RGB8)
        return 3 * n;
    return format == GN_CAPTURE_MONO12 || format == GN_CAPTURE_MONO16 ? 2 * n : 6 * n;
}

bool gn_pixels_is_same(const struct gn_pixels_format *format, bool is_8_bit)
{
    enum gn_capture_format capture = gn_pixels_get_capture_format(format, is_8_bit);
    if (format->packing != GN_PIXELS_UNPACKED)
        return false;
    if (format->kind == GN_PIXELS_RGB)
        return format->bits == 8 || (!is_8_bit && (format->bits == 12 || format->bits == 16));
    return format->kind == GN_PIXELS_MONO &&
           ((capture == GN_CAPTURE_MONO12 && format->bits == 12) ||
            (capture == GN_CAPTURE_MONO16 && format->bits == 16));
}

/** Samples [first, first + n) of the picture. Returns the bits that any of them has. */
static unsigned unpack(const struct gn_pixels_format *f, const uint8_t *source, size_t first,
                       size_t n, uint16_t *out)
{
    unsigned all = 0;
    if (f->bits == 8) {
        for (size_t i = 0; i < n; i++)
            all |= out[i] = source[first + i];
        return all;
    }
    if (f->packing == GN_PIXELS_UNPACKED) {
        for (size_t i = 0; i < n; i++) {
            const uint8_t *p = source + 2 * (first + i);
            all |= out[i] = (uint16_t)(p[0] | p[1] << 8);
        }
        return all;
    }
    if (f->packing == GN_PIXELS_GIGE) {
        // Bytes: the high 8 bits of a; the low bits of a, those of b four bits up; the high 8 of b.
        int n_low = f->bits - 8;
        unsigned low = (1u << n_low) - 1;
        for (size_t i = 0; i < n; i++) {
            const uint8_t *p = source + (first + i) / 2 * 3;
            bool is_second = (first + i) & 1;
            unsigned high = p[is_second ? 2 : 0];
            all |= out[i] = (uint16_t)(high << n_low | (p[1] >> (is_second ? 4 : 0) & low));
        }
        return all;
    }
    unsigned mask = (1u << f->bits) - 1;
    for (size_t i = 0; i < n; i++) {
        size_t bit = (first + i) * (size_t)f->bits;
        const uint8_t *p = source + bit / 8; // 10 or 12 bits from an even one: never over 2 bytes
        all |= out[i] = (uint16_t)((unsigned)(p[0] | p[1] << 8) >> bit % 8 & mask);
    }
    return all;
}

/** Writes codes of bits bits as 8 or as 12 or 16, each n_copies times. */
struct writer {
    unsigned from; // largest code that comes
    unsigned to;   // that goes
    bool is_8_bit;
};

static unsigned scale_code(const struct writer *w, unsigned code)
{
    return w->from == w->to ? code : (code * w->to + w->from / 2) / w->from; // below 2^32
}

static void write_code(const struct writer *w, void *out, size_t i, unsigned code)
{
    unsigned scaled = scale_code(w, code);
    if (w->is_8_bit)
        ((uint8_t *)out)[i] = (uint8_t)scaled;
    else
        ((uint16_t *)out)[i] = (uint16_t)scaled;
}

/** Mirrored at the ends without repeating them: a mosaic keeps its order. */
static int mirror(int i, int n)
{
    return i < 0 ? -i : i >= n ? 2 * n - 2 - i : i;
}

/** One row of a mosaic; above, row, below: its samples and its neighbours'. */
static void interpolate_row(const struct gn_pixels_format *f, const struct writer *w, int y,
                            int width, const uint16_t *above, const uint16_t *row,
                            const uint16_t *below, void *out)
{
    bool is_red_row = (y & 1) == f->red_y;
    for (int x = 0; x < width; x++) {
        int left = mirror(x - 1, width), right = mirror(x + 1, width);
        unsigned beside = (unsigned)row[left] + row[right];
        unsigned upright = (unsigned)above[x] + below[x];
        unsigned rgb[3];
        bool is_red_column = (x & 1) == f->red_x;
        if (is_red_row == is_red_column) { // on red, or on blue
            unsigned corners = (unsigned)above[left] + above[right] + below[left] + below[right];
            rgb[is_red_row ? 0 : 2] = row[x];
            rgb[1] = (beside + upright + 2) / 4;
            rgb[is_red_row ? 2 : 0] = (corners + 2) / 4;
        } else {
            rgb[is_red_row ? 0 : 2] = (beside + 1) / 2;
            rgb[1] = row[x];
            rgb[is_red_row ? 2 : 0] = (upright + 1) / 2;
        }
        for (size_t c = 0; c < 3; c++)
            write_code(w, out, 3 * ((size_t)y * (size_t)width + (size_t)x) + c, rgb[c]);
    }
}

/** Mosaics row by row: three rows of samples are at hand. Returns the bits that any has. */
static unsigned convert_mosaic(const struct gn_pixels_format *f, const struct writer *w, int width,
                               int height, const uint8_t *source, uint16_t *rows, void *out)
{
    unsigned all = 0;
    size_t n = (size_t)width;
    uint16_t *row[3] = {rows, rows + n, rows + 2 * n};
    all |= unpack(f, source, 0, n, row[0]);
    all |= unpack(f, source, n, n, row[1]);
    for (int y = 0; y < height; y++) {
        if (y > 0 && y + 1 < height)
            all |= unpack(f, source, (size_t)(y + 1) * n, n, row[(y + 1) % 3]);
        const uint16_t *above = row[mirror(y - 1, height) % 3];
        interpolate_row(f, w, y, width, above, row[y % 3], row[mirror(y + 1, height) % 3], out);
    }
    return all;
}

/** Rows of samples that need no neighbours. Returns the bits that any has. */
static unsigned convert_rows(const struct gn_pixels_format *f, const struct writer *w, int width,
                             int height, const uint8_t *source, uint16_t *samples, void *out)
{
    unsigned all = 0;
    int n_channels = count_channels(f);
    size_t n = (size_t)width * (size_t)n_channels;
    bool is_widened = f->kind == GN_PIXELS_MONO && w->is_8_bit; // gray to R, G, B
    for (size_t y = 0; y < (size_t)height; y++) {
        all |= unpack(f, source, y * n, n, samples);
        for (size_t i = 0; i < n && !is_widened; i++) {
            size_t from = f->kind == GN_PIXELS_BGR ? i - i % 3 + (2 - i % 3) : i;
            write_code(w, out, y * n + i, samples[from]);
        }
        for (size_t i = 0; i < n && is_widened; i++) {
            unsigned code = scale_code(w, samples[i]);
            memset((uint8_t *)out + 3 * (y * n + i), (int)code, 3);
        }
    }
    return all;
}

/** Bits that any sample has, where nothing is to be copied. */
static unsigned check_codes(const uint8_t *source, size_t n)
{
    unsigned high = 0;
    for (size_t i = 0; i < n; i++)
        high |= source[2 * i + 1];
    return high << 8;
}

int gn_pixels_convert(const struct gn_pixels_format *format, bool is_8_bit, int width, int height,
                      const uint8_t *source, void *out)
{
    enum gn_capture_format capture = gn_pixels_get_capture_format(format, is_8_bit);
    unsigned max = (1u << format->bits) - 1, all = 0;
    size_t row_samples = (size_t)width * (size_t)count_channels(format);
    if (gn_pixels_is_same(format, is_8_bit)) {
        if (format->bits == 12)
            all = check_codes(source, row_samples * (size_t)height);
        return all > max ? -EDOM : 0;
    }
    const struct writer w = {
        .from = max,
        .to = capture == GN_CAPTURE_RGB8                                    ? 255
              : capture == GN_CAPTURE_MONO12 || capture == GN_CAPTURE_RGB12 ? 4095
                                                                            : 65535,
        .is_8_bit = capture == GN_CAPTURE_RGB8,
    };
    uint16_t rows[3 * 1024], *samples = rows;
    if (3 * row_samples > sizeof(rows) / sizeof(rows[0]))
        samples = malloc(3 * row_samples * sizeof(*samples));
    if (!samples)
        return -ENOMEM;
    if (format->kind == GN_PIXELS_BAYER)
        all = convert_mosaic(format, &w, width, height, source, samples, out);
    else
        all = convert_rows(format, &w, width, height, source, samples, out);
    if (samples != rows)
        free(samples);
    return all > max ? -EDOM : 0;
}
