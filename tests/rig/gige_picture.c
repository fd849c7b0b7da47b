/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/gige_picture.h"

unsigned gn_gige_pattern(int x, int y, int c, uint64_t id)
{
    return (unsigned)(7 * x + 131 * y + 1009 * c + (int)(id % 4096) * 29) & 4095;
}

/** The 12-bit code of one sample; 0 outside the picture: a client may ask for more than it has. */
static unsigned get_code(const struct gn_image16 *picture, uint64_t id, int x, int y, int c)
{
    if (!picture)
        return gn_gige_pattern(x, y, c, id);
    if (x >= picture->width || y >= picture->height)
        return 0;
    size_t at = ((size_t)y * (size_t)picture->width + (size_t)x) * (size_t)picture->channels;
    return picture->data[at + (picture->channels == 3 ? (size_t)c : 0)];
}

/** Or-s the low bits of value in at a bit position, low bits first; over two bytes at most. */
static void put_bits(uint8_t *out, size_t at, unsigned value)
{
    unsigned shifted = value << at % 8;
    out[at / 8] |= (uint8_t)shifted;
    if (shifted > 0xff)
        out[at / 8 + 1] |= (uint8_t)(shifted >> 8);
}

static void put_sample(const struct gn_pixels_format *f, size_t i, unsigned code, uint8_t *out)
{
    if (f->packing == GN_PIXELS_LSB) {
        put_bits(out, i * (size_t)f->bits, code);
    } else if (f->packing == GN_PIXELS_GIGE) {
        // High 8 bits in a byte of its own, low bits in a nibble of the byte in the middle.
        int n_low = f->bits - 8;
        size_t pair = i / 2 * 3;
        out[pair + (i % 2 ? 2 : 0)] = (uint8_t)(code >> n_low);
        put_bits(out, (pair + 1) * 8 + (i % 2 ? 4 : 0), code & ((1u << n_low) - 1));
    } else {
        put_bits(out, i * (f->bits == 8 ? 8 : 16), code);
    }
}

void gn_gige_pack(const struct gn_pixels_format *format, const struct gn_image16 *picture,
                  uint64_t id, int width, int height, uint8_t *out)
{
    const struct gn_pixels_format *f = format;
    size_t i = 0;
    int n_channels = f->kind == GN_PIXELS_RGB || f->kind == GN_PIXELS_BGR ? 3 : 1;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            for (int k = 0; k < n_channels; k++) {
                int c = f->kind == GN_PIXELS_MONO  ? 1
                        : f->kind == GN_PIXELS_RGB ? k
                        : f->kind == GN_PIXELS_BGR ? 2 - k
                        : x % 2 == f->red_x        ? (y % 2 == f->red_y ? 0 : 1)
                                                   : (y % 2 == f->red_y ? 1 : 2);
                unsigned code = get_code(picture, id, x, y, c);
                code = f->bits < 12 ? code >> (12 - f->bits) : code << (f->bits - 12);
                put_sample(f, i++, code, out);
            }
        }
    }
}
