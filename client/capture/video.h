/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pictures of a video file, one after another, with its times. Needs the feature `libav`. */
#ifndef GN_CLIENT_CAPTURE_VIDEO_H
#define GN_CLIENT_CAPTURE_VIDEO_H

#include <stdbool.h>

#include "client/capture/source.h"

/** All-zero is the default. */
struct gn_video_options {
    bool is_looped;  // begin again at the end, times going on
    bool keeps_bits; // RGB16 for video of more than 8 bits a channel; default RGB8 always
};

/**
 * Opens the first video stream of a regular file. Pictures come as R, G, B codes [0, 255] or
 * [0, 65535] over their full range, by the file's colour matrix and range (docs/capture.md); the
 * file's transfer curve is left as it is: it belongs to the camera's response. A picture that is
 * damaged ends the source with a sentence. Returns 0, -ENOSYS (built without libav), or another
 * negative errno, and a sentence.
 */
GN_MUST_USE int gn_video_source_open(const char *path, const struct gn_video_options *options,
                                     struct gn_source **out_source, struct gn_error *out_error);

#endif
