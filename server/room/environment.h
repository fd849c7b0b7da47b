/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * ENVIRONMENT_FRAME's payload to pixels: every format of the wire, sizes compared with the header
 * before memory is taken.
 */
#ifndef GN_SERVER_ROOM_ENVIRONMENT_H
#define GN_SERVER_ROOM_ENVIRONMENT_H

#include "common/buf.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"
#include "proto/wire.h"
#include "server/light/radiance_map.h"

/** What decoding keeps from frame to frame; zero it before first use. Thread-safety: unsafe. */
struct gn_environment_decoder {
    struct gn_image codes;   // of EXR
    struct gn_image8 codes8; // of JPEG
    struct gn_jpeg *jpeg;    // made by the first JPEG frame
    float table[GN_LIMIT_TABLE_ENTRIES];
};
void gn_environment_decoder_finish(struct gn_environment_decoder *decoder);

/**
 * Fills *out_frame, which borrows from the payload (rows of numbers are taken as they are) and from
 * the decoder until the next call. Memory is taken only where
 * the size differs from the last frame's. Returns 0, -EINVAL and a sentence, -ENOMEM.
 */
GN_MUST_USE int gn_environment_decode(struct gn_environment_decoder *decoder,
                                      const struct gn_msg_environment_frame *message,
                                      const struct gn_buf *payload,
                                      struct gn_environment_frame *out_frame,
                                      struct gn_error *out_error);

#endif
