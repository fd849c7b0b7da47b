/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * JPEG of camera frames and results, by libjpeg-turbo, to and from the caller's buffers. A handle
 * is reused from frame to frame, so that ours allocates nothing (the library keeps its own pools).
 */
#ifndef GN_COMMON_JPEG_H
#define GN_COMMON_JPEG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** True where data starts as a JPEG does. */
bool gn_jpeg_is_jpeg(const void *data, size_t size);

/** A reusable pair of encoder and decoder. Thread-safety: unsafe. */
struct gn_jpeg;

/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_jpeg_create(struct gn_jpeg **out_jpeg);
/** NULL-safe; nulls *jpeg. */
void gn_jpeg_destroy(struct gn_jpeg **jpeg);

/**
 * Size from the header; channels 1 or 3. Returns 0, or -EINVAL and a sentence: no JPEG, sides or
 * pixels beyond GN_IMAGE_MAX_*, CMYK.
 */
GN_MUST_USE int gn_jpeg_get_size(struct gn_jpeg *jpeg, const void *data, size_t size,
                                 int *out_width, int *out_height, int *out_channels,
                                 struct gn_error *out_error);

/**
 * Decodes to image, which has the picture's size and 1 or 3 channels (gray becomes RGB and the
 * other way round as asked for). Returns 0, or -EINVAL and a sentence: another size, damaged, cut,
 * more than 500 progressive scans. The pixels are then undefined.
 */
GN_MUST_USE int gn_jpeg_decode(struct gn_jpeg *jpeg, const void *data, size_t size,
                               struct gn_image8 *image, struct gn_error *out_error);

/** Bytes that an encoded picture of that size never exceeds. */
size_t gn_jpeg_get_bound(int width, int height);

/** All-zero is the default. */
struct gn_jpeg_options {
    int quality;         // [1, 100], default 90
    bool is_full_chroma; // 4:4:4, default 4:2:0
};

/**
 * Encodes 1 or 3 channels to out[capacity], capacity >= gn_jpeg_get_bound. options may be NULL.
 * Returns 0, or -EINVAL and a sentence.
 */
GN_MUST_USE int gn_jpeg_encode(struct gn_jpeg *jpeg, const struct gn_image8 *image,
                               const struct gn_jpeg_options *options, uint8_t *out, size_t capacity,
                               size_t *out_size, struct gn_error *out_error);

#endif
