/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures in memory: linear float images, 8-bit and 16-bit code images.
 * Rows from the top, pixels from the left, channels interleaved: [height][width][channels].
 */
#ifndef GN_COMMON_IMAGE_H
#define GN_COMMON_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "proto/attr.h"

/** Largest width or height any door of the program takes. */
#define GN_IMAGE_MAX_SIDE 16384
/** Largest number of pixels any door of the program takes: an 8192 x 4096 lat-long map and more. */
#define GN_IMAGE_MAX_PIXELS (1 << 26)

/** A float picture. Caller's memory, our pixels. Thread-safety: unsafe. */
struct gn_image {
    int width;
    int height;
    int channels; // [1, 4]
    float *data;  // [height][width][channels], owned; 64-byte aligned
};

/** An 8-bit picture. Encoded by some response (common/response.h), sRGB unless said otherwise. */
struct gn_image8 {
    int width;
    int height;
    int channels;  // 1, 3 or 4
    uint8_t *data; // [height][width][channels], owned
};

/** A 16-bit picture: sensor codes as they are (12-bit codes use [0, 4095]). */
struct gn_image16 {
    int width;
    int height;
    int channels;   // 1 or 3
    uint16_t *data; // [height][width][channels], owned
};

/**
 * Allocates zeroed pixels. Returns 0, -EINVAL (a side < 1 or > GN_IMAGE_MAX_SIDE, too many pixels,
 * channels outside [1, 4]), -ENOMEM; *image is zeroed on failure.
 */
GN_MUST_USE int gn_image_init(struct gn_image *image, int width, int height, int channels);
/** Frees the pixels and zeroes *image. A zeroed image is fine. */
void gn_image_finish(struct gn_image *image);

/** As gn_image_init, for 8-bit pictures. */
GN_MUST_USE int gn_image8_init(struct gn_image8 *image, int width, int height, int channels);
/** As gn_image_finish. */
void gn_image8_finish(struct gn_image8 *image);

/** As gn_image_init, for 16-bit pictures. */
GN_MUST_USE int gn_image16_init(struct gn_image16 *image, int width, int height, int channels);
/** As gn_image_finish. */
void gn_image16_finish(struct gn_image16 *image);

/** The pixel at column x of row y, [channels]. */
static inline float *gn_image_at(const struct gn_image *image, int x, int y)
{
    return image->data + ((size_t)y * (size_t)image->width + (size_t)x) * (size_t)image->channels;
}

/** The pixel at column x of row y, [channels]. */
static inline uint8_t *gn_image8_at(const struct gn_image8 *image, int x, int y)
{
    return image->data + ((size_t)y * (size_t)image->width + (size_t)x) * (size_t)image->channels;
}

#endif
