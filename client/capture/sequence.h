/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A recorded sequence on disk: camera frames with poses, environment frames, and what is known
 * about both devices. The format of sequence.json is documented in docs/frames.md.
 */
#ifndef GN_CLIENT_CAPTURE_SEQUENCE_H
#define GN_CLIENT_CAPTURE_SEQUENCE_H

#include "client/capture/file.h"
#include "common/camera.h"
#include "common/device_json.h"
#include "common/error.h"
#include "proto/attr.h"

/** A sequence. Caller's memory, our lists. pictures and environments have as many entries. */
struct gn_sequence {
    struct gn_camera camera; // intrinsics and response; poses are those of pictures
    struct gn_probe_setup probe;
    struct gn_file_list pictures;
    struct gn_file_list environments;
};

/** Reads DIR/sequence.json. Returns 0, or a negative errno and a sentence; *out is zeroed then. */
GN_MUST_USE int gn_sequence_read(const char *dir, struct gn_sequence *out,
                                 struct gn_error *out_error);
/** Frees the lists and zeroes *sequence. */
void gn_sequence_finish(struct gn_sequence *sequence);

#endif
