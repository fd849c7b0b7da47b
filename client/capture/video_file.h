/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A video file as libavformat and libavcodec give it: decoded pictures, one after another. */
#ifndef GN_CLIENT_CAPTURE_VIDEO_FILE_H
#define GN_CLIENT_CAPTURE_VIDEO_FILE_H

#include <stdbool.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>

#include "common/error.h"
#include "proto/attr.h"

/** Most pixels of a picture: what the longest message holds of the fewest bytes a pixel. */
#define GN_VIDEO_MAX_PIXELS (22 << 20)
/** Longest side, as on the wire. */
#define GN_VIDEO_MAX_SIDE 8192

/** Zero it before opening. Caller's memory. */
struct gn_video_file {
    AVFormatContext *format;
    AVCodecContext *codec;
    AVPacket *packet;
    AVFrame *frame; // the picture read last
    int stream;
    bool is_draining; // the file is read to its end, the decoder is not
    long n_pictures;
};

/** Opens path, a regular file. Returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_video_file_open(struct gn_video_file *file, const char *path,
                                   struct gn_error *out_error);
/** Decodes the next picture into file->frame. Returns 1, 0 at the end, or a negative errno and a
 * sentence. */
GN_MUST_USE int gn_video_file_read(struct gn_video_file *file, const char *path,
                                   struct gn_error *out_error);
/** Gives everything back and zeroes *file. */
void gn_video_file_close(struct gn_video_file *file);

#endif
