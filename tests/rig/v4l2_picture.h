/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures as a webcam gives them, written apart from the client's decoders.
 */
#ifndef GN_TESTS_RIG_V4L2_PICTURE_H
#define GN_TESTS_RIG_V4L2_PICTURE_H

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

struct v4l2_pix_format;

/**
 * Encodes an 8-bit picture of 3 or more channels and an even width as fourcc: YUYV (BT.601, limited
 * range; two pixels share their mean chroma) or MJPG (4:2:0, quality 90). *out_data: owned by the
 * caller, freed by free(). *out_pix: the format, sizeimage its bytes. Returns 0 or a negative errno
 * and a sentence.
 */
GN_MUST_USE int gn_rig_encode_v4l2(const struct gn_image8 *picture, const char *fourcc,
                                   struct v4l2_pix_format *out_pix, uint8_t **out_data,
                                   struct gn_error *out_error);

#endif
