/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures as machine-vision cameras send them, packed by an encoder written apart from the
 * client's decoder.
 */
#ifndef GN_TESTS_RIG_GIGE_PICTURE_H
#define GN_TESTS_RIG_GIGE_PICTURE_H

#include <stddef.h>
#include <stdint.h>

#include "client/capture/pixels.h"
#include "common/image.h"

/** A code in [0, 4095] of channel c [0, 2] at a pixel: every picture, pixel and channel differs. */
unsigned gn_gige_pattern(int x, int y, int c, uint64_t id);

/**
 * Packs one picture. picture: 12-bit codes (16-bit picture) that are served, 1 or 3 channels; NULL:
 * the pattern of that id. Codes are shifted to the format's bits; a mosaic takes each pixel's one
 * channel, mono the green. out: gn_pixels_get_bytes, zeroed.
 */
void gn_gige_pack(const struct gn_pixels_format *format, const struct gn_image16 *picture,
                  uint64_t id, int width, int height, uint8_t *out);

#endif
