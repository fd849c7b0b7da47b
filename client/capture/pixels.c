/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/pixels.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "proto/attr.h"

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

/** How codes are written: scaled, as 8 or 16 bits. */
struct writer {
    unsigned from; // largest code that comes
    unsigned to;   // that goes
    bool is_8_bit;
};

/**
 * Writes n codes, the first as number at. Rounding in double is exact: code * to / from is never
 * half-way between two numbers, since from is odd, and never nearer to it than 1 / (2 from).
 */
static void write_codes(const struct writer *w, const uint16_t *codes, size_t n, void *out,
                        size_t at)
{
    double factor = (double)w->to / w->from;
    uint8_t *out8 = (uint8_t *)out + at;
    uint16_t *out16 = (uint16_t *)out + at;
    if (w->from == w->to && w->is_8_bit) {
        for (size_t i = 0; i < n; i++)
            out8[i] = (uint8_t)codes[i];
    } else if (w->from == w->to) {
        memcpy(out16, codes, n * sizeof(*out16));
    } else if (w->is_8_bit) {
        for (size_t i = 0; i < n; i++)
            out8[i] = (uint8_t)(int)(codes[i] * factor + 0.5);
    } else {
        for (size_t i = 0; i < n; i++)
            out16[i] = (uint16_t)(int)(codes[i] * factor + 0.5);
    }
}

/** Rows of a mosaic around the one that is worked on; each has one mirrored sample more at both
 * ends. own, other: places in R, G, B of that row's colour besides green, and of the other's. */
struct mosaic {
    const uint16_t *above, *row, *below;
    int own, other;
};

/** The pixel at x, which has the row's colour. */
static inline void put_coloured(struct mosaic m, int x, uint16_t *rgb)
{
    unsigned sides = (unsigned)m.row[x - 1] + m.row[x + 1] + m.above[x] + m.below[x];
    unsigned corners = (unsigned)m.above[x - 1] + m.above[x + 1] + m.below[x - 1] + m.below[x + 1];
    rgb[m.own] = m.row[x];
    rgb[1] = (uint16_t)((sides + 2) / 4);
    rgb[m.other] = (uint16_t)((corners + 2) / 4);
}

/** The pixel at x, which is green. */
static inline void put_green(struct mosaic m, int x, uint16_t *rgb)
{
    rgb[m.own] = (uint16_t)(((unsigned)m.row[x - 1] + m.row[x + 1] + 1) / 2);
    rgb[1] = m.row[x];
    rgb[m.other] = (uint16_t)(((unsigned)m.above[x] + m.below[x] + 1) / 2);
}

/** One row, in pairs of a coloured pixel and a green one. is_first_green: it begins with half. */
static inline void interpolate_row(struct mosaic m, bool is_first_green, int width, uint16_t *rgb)
{
    int x = 0;
    if (is_first_green)
        put_green(m, x++, rgb);
    for (; x + 1 < width; x += 2) {
        put_coloured(m, x, rgb + 3 * x);
        put_green(m, x + 1, rgb + 3 * x + 3);
    }
    if (x < width)
        put_coloured(m, x, rgb + 3 * x);
}

/** Unpacks row y and mirrors its ends: without repeating them, so that colours keep their order. */
static unsigned unpack_mosaic_row(const struct gn_pixels_format *f, const uint8_t *source, int y,
                                  int width, uint16_t *row)
{
    unsigned all = unpack(f, source, (size_t)y * (size_t)width, (size_t)width, row);
    row[-1] = row[1];
    row[width] = row[width - 2];
    return all;
}

/** Mosaics row by row: three rows of samples are at hand. Returns the bits that any has. */
static unsigned convert_mosaic(const struct gn_pixels_format *f, const struct writer *w, int width,
                               int height, const uint8_t *source, uint16_t *scratch, void *out)
{
    size_t n = (size_t)width;
    uint16_t *row[3] = {scratch + 1, scratch + n + 3, scratch + 2 * n + 5};
    uint16_t *rgb = scratch + 3 * n + 6;
    unsigned all = unpack_mosaic_row(f, source, 0, width, row[0]);
    all |= unpack_mosaic_row(f, source, 1, width, row[1]);
    for (int y = 0; y < height; y++) {
        if (y > 0 && y + 1 < height)
            all |= unpack_mosaic_row(f, source, y + 1, width, row[(y + 1) % 3]);
        int above = y > 0 ? y - 1 : 1, below = y + 1 < height ? y + 1 : height - 2;
        bool is_red_row = (y & 1) == f->red_y, is_first_green = (f->red_x == 0) != is_red_row;
        // Told apart so that the compiler knows the places.
        if (is_red_row)
            interpolate_row((struct mosaic){row[above % 3], row[y % 3], row[below % 3], 0, 2},
                            is_first_green, width, rgb);
        else
            interpolate_row((struct mosaic){row[above % 3], row[y % 3], row[below % 3], 2, 0},
                            is_first_green, width, rgb);
        write_codes(w, rgb, 3 * n, out, 3 * n * (size_t)y);
    }
    return all;
}

/** n gray codes, at least one, to R, G, B: four bytes at once, the last of which is the next
 * pixel's to write again. */
static void widen(const uint8_t *codes, size_t n, uint8_t *rgb)
{
    for (size_t i = 0; i + 1 < n; i++) {
        uint32_t four = codes[i] * 0x01010101u;
        memcpy(rgb + 3 * i, &four, sizeof(four));
    }
    memset(rgb + 3 * (n - 1), codes[n - 1], 3);
}

/** Rows of samples that need no neighbours. Returns the bits that any has. */
static unsigned convert_rows(const struct gn_pixels_format *f, const struct writer *w, int width,
                             int height, const uint8_t *source, uint16_t *samples, void *out)
{
    unsigned all = 0;
    size_t n = (size_t)width * (size_t)count_channels(f);
    bool is_widened = f->kind == GN_PIXELS_MONO && w->is_8_bit; // gray to R, G, B
    uint8_t *gray = (uint8_t *)(samples + n);
    for (size_t y = 0; y < (size_t)height; y++) {
        all |= unpack(f, source, y * n, n, samples);
        for (size_t i = 0; i < n && f->kind == GN_PIXELS_BGR; i += 3) {
            uint16_t blue = samples[i];
            samples[i] = samples[i + 2];
            samples[i + 2] = blue;
        }
        if (is_widened) {
            write_codes(w, samples, n, gray, 0);
            widen(gray, n, (uint8_t *)out + 3 * n * y);
        } else {
            write_codes(w, samples, n, out, n * y);
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
    // Three rows of a mosaic, with ends, and one of R, G, B.
    size_t n_scratch = 6 * (size_t)width + 6;
    uint16_t rows[8 * 1024], *samples = rows;
    if (n_scratch > GN_ARRAY_LEN(rows))
        samples = malloc(n_scratch * sizeof(*samples));
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
