/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * PNG pictures as codes: 8 bits gray, RGB, RGBA and 16 bits gray, RGB, just as they are stored (no
 * gamma, no colour profile), so 12-bit sensor codes survive in 16 bits. Thread-safety of all
 * functions: safe.
 */
#ifndef GN_COMMON_PNG_H
#define GN_COMMON_PNG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** True where data starts as a PNG does. */
bool gn_png_is_png(const void *data, size_t size);

/** A decoded PNG: exactly one of the two has pixels. */
struct gn_png {
    struct gn_image8 codes8;   // palettes as RGB(A), gray with alpha as RGBA, 1 to 4 bits as 8
    struct gn_image16 codes16; // alpha is dropped
};

/**
 * Decodes a PNG in memory. Sizes are checked before memory is taken, against GN_IMAGE_MAX_* and
 * against what so many bytes can hold. Returns 0, -EINVAL (damaged, too large), -ENOMEM and a
 * sentence; *out_png is zeroed then. End it with gn_png_finish.
 */
GN_MUST_USE int gn_png_read_memory(const void *data, size_t size, struct gn_png *out_png,
                                   struct gn_error *out_error);
/** The same as 8 bits whatever the file has: codes of 16 are rounded, their alpha stays. */
GN_MUST_USE int gn_png_read_memory8(const void *data, size_t size, struct gn_image8 *out_image,
                                    struct gn_error *out_error);
/** Frees the pixels. A zeroed one is fine. */
void gn_png_finish(struct gn_png *png);

/**
 * Encodes to memory that the caller frees. level is zlib's, [0, 9]: 1 for live pictures, 6 for
 * files. Returns 0, -EINVAL (channels other than 1, 3, 4), -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_png_write_memory(const struct gn_image8 *image, int level, uint8_t **out_data,
                                    size_t *out_size, struct gn_error *out_error);
/** Writes a file, all or nothing. */
GN_MUST_USE int gn_png_write_file(const char *path, const struct gn_image8 *image,
                                  struct gn_error *out_error);
/** As gn_png_write_file, 16 bits, 1 or 3 channels. */
GN_MUST_USE int gn_png_write_file16(const char *path, const struct gn_image16 *image,
                                    struct gn_error *out_error);

#endif
