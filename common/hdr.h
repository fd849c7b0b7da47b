/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Radiance RGBE pictures (.hdr, .pic) to linear float RGB and back. Source of the format:
 * Radiance's file format notes, "Picture File Format (.hdr)", and Ward, Real Pixels, Graphics Gems
 * II, 1991. Thread-safety of all functions: safe.
 */
#ifndef GN_COMMON_HDR_H
#define GN_COMMON_HDR_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** True where data starts as a Radiance picture does. */
bool gn_hdr_is_hdr(const void *data, size_t size);

/**
 * Decodes a picture in memory to [height][width][3]: flat, old and new run lengths, all eight
 * orientations, upright in the end. A missing FORMAT line is RGBE; XYZE is refused. Values are
 * mantissa * 2^(e - 136) over the product of the EXPOSURE lines (and per channel of COLORCORR),
 * which is the radiance that the format means. Returns 0, -EINVAL or -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_hdr_read_memory(const void *data, size_t size, struct gn_image *out_image,
                                   struct gn_error *out_error);

/**
 * Writes [height][width][3], new run lengths, all or nothing; rounded to the nearest shared
 * exponent, negatives and NaN as 0. Returns 0, -EINVAL (not 3 channels) or a negative errno.
 */
GN_MUST_USE int gn_hdr_write_file(const char *path, const struct gn_image *image,
                                  struct gn_error *out_error);

#endif
