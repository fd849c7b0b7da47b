/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The buffers of an open camera of V4L2: mapped, given to the driver, taken back filled. The newest
 * whole picture wins; nothing that a driver says of a buffer is believed unchecked.
 */
#ifndef GN_CLIENT_CAPTURE_V4L2_STREAM_H
#define GN_CLIENT_CAPTURE_V4L2_STREAM_H

#include "client/capture/v4l2_device.h"
#include "common/jpeg.h"

/** One buffer of the driver's memory. */
struct gn_v4l2_buffer {
    uint8_t *start; // mapped; NULL: not
    size_t n_bytes;
};

/** A running stream. Caller's memory; zeroed: none. Thread-safety: unsafe. */
struct gn_v4l2_stream {
    const struct gn_v4l2_device *device; // borrowed
    const struct gn_v4l2_layout *layout; // borrowed
    struct gn_jpeg *jpeg;                // borrowed
    struct gn_source_counts *counts;     // borrowed
    struct gn_v4l2_buffer buffers[VIDEO_MAX_FRAME];
    uint32_t n_buffers;
    bool has_held;
    uint32_t held;          // buffer that was taken and not given back
    bool has_sequence;      // the next field is known
    uint32_t last_sequence; // the driver's number of the last buffer
    const char *fault;      // what was wrong with the last buffer beyond an error of transport
};

/** A taken picture; in the stream's memory until the next gn_v4l2_stream_release. */
struct gn_v4l2_picture {
    const uint8_t *data;
    size_t n_bytes;
    struct v4l2_buffer info;
};

/**
 * Maps buffers and starts streaming; the four that are borrowed must be set. Returns 0, or a
 * negative errno and a sentence; the stream must be stopped then, too.
 */
GN_MUST_USE int gn_v4l2_stream_start(struct gn_v4l2_stream *stream, struct gn_error *out_error);

/** Ends streaming, unmaps, and zeroes all but what is borrowed; the device may be gone. */
void gn_v4l2_stream_stop(struct gn_v4l2_stream *stream);

/** Whether a picture may be read where it lies for long: the driver has buffers enough besides, and
 * leaves this one alone. */
bool gn_v4l2_stream_may_lend(const struct gn_v4l2_stream *stream);
/** Bytes of the largest buffer. */
size_t gn_v4l2_stream_get_room(const struct gn_v4l2_stream *stream);

/** Gives the picture that was taken back to the driver, if there is one. 0 or a negative errno. */
GN_MUST_USE int gn_v4l2_stream_release(struct gn_v4l2_stream *stream);

/**
 * Takes all filled buffers, keeps the newest whole picture, gives the others back and counts them.
 * Returns 1, 0 (none), -EPROTO (a buffer that the driver does not have: nothing it says can be
 * trusted), or what the driver returned: it is lost.
 */
GN_MUST_USE int gn_v4l2_stream_take(struct gn_v4l2_stream *stream, struct gn_v4l2_picture *out);

#endif
