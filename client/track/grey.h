/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Captures as 8-bit grey pictures, for finding markers.
 */
#ifndef GN_CLIENT_TRACK_GREY_H
#define GN_CLIENT_TRACK_GREY_H

#include "client/capture/source.h"
#include "common/error.h"
#include "common/image.h"
#include "common/jpeg.h"
#include "proto/attr.h"

/**
 * Writes the capture's luma into grey, an initialised picture of one channel and the capture's
 * size. Codes keep their response; wider ones lose their lowest bits. Returns 0, or -EINVAL (linear
 * floats, another size) or -EBADMSG (a damaged JPEG) and a sentence. Thread-safety: as jpeg's.
 */
GN_MUST_USE int gn_grey_from_capture(const struct gn_capture *capture, struct gn_jpeg *jpeg,
                                     struct gn_image8 *grey, struct gn_error *out_error);

#endif
