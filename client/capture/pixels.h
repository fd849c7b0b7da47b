/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * From the pixels that machine-vision cameras send to those of a capture, in one pass: unpacking,
 * widening or narrowing of codes, interpolation of Bayer mosaics. Formats carry the names and codes
 * of the GenICam Pixel Format Naming Convention 2.4 (PFNC, EMVA).
 */
#ifndef GN_CLIENT_CAPTURE_PIXELS_H
#define GN_CLIENT_CAPTURE_PIXELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "proto/attr.h"

enum gn_pixels_kind {
    GN_PIXELS_MONO = 0,
    GN_PIXELS_BAYER,
    GN_PIXELS_RGB,
    GN_PIXELS_BGR,
};

enum gn_pixels_packing {
    GN_PIXELS_UNPACKED = 0, // 8 bits in a byte, more in the low bits of two, little-endian
    GN_PIXELS_LSB,          // "p": bits one after another from the low end, rows not padded
    GN_PIXELS_GIGE,         // "Packed": two samples in three bytes, GigE Vision's own
};

/** A camera's pixel format. Static. */
struct gn_pixels_format {
    const char *name; // as the camera's PixelFormat has it
    uint32_t code;    // PFNC
    enum gn_pixels_kind kind;
    enum gn_pixels_packing packing;
    int bits;         // of a sample, [8, 16]
    int red_x, red_y; // BAYER: where in each 2x2 red is, 0 or 1; blue is opposite
};

/** The format of that code; NULL: we cannot read it. */
const struct gn_pixels_format *gn_pixels_find(uint32_t code);

/** "Mono8, Mono10, ...": all names, static. */
const char *gn_pixels_get_names(void);

/** Bytes of a picture; 0 where a side is not in [1, 16384]. */
size_t gn_pixels_get_bytes(const struct gn_pixels_format *format, int width, int height);

/**
 * What such pictures become: MONO12 and RGB12 from 12 bits, 16 from 8 (mono), 10, 14 and 16, RGB8
 * from 8 (colour); is_8_bit: always RGB8.
 */
enum gn_capture_format gn_pixels_get_capture_format(const struct gn_pixels_format *format,
                                                    bool is_8_bit);
/** Bytes of a picture of a capture format of codes. */
size_t gn_pixels_get_capture_bytes(enum gn_capture_format format, int width, int height);

/** Whether the camera's bytes are the capture's already: nothing need be copied. */
bool gn_pixels_is_same(const struct gn_pixels_format *format, bool is_8_bit);

/**
 * Converts one picture. A code c of n bits becomes the nearest to the same share of full scale,
 * round(c max / (2^n - 1)); where max is not the same. Missing colours of a mosaic are the means of
 * the nearest samples of that colour (bilinear, mirrored at the border), rounded half up; a side of
 * a mosaic is at least 2. source: gn_pixels_get_bytes; out: gn_pixels_get_capture_bytes, aligned
 * for uint16_t; NULL where gn_pixels_is_same, which only checks. Returns 0; -EDOM: a sample has
 * bits above those of its format. Thread-safety: safe.
 */
GN_MUST_USE int gn_pixels_convert(const struct gn_pixels_format *format, bool is_8_bit, int width,
                                  int height, const uint8_t *source, void *out);

#endif
