/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Cameras of the Linux kernel (Video for Linux 2): USB webcams, frame grabbers.
 */
#ifndef GN_CLIENT_CAPTURE_V4L2_H
#define GN_CLIENT_CAPTURE_V4L2_H

#include "client/capture/source.h"

/**
 * Opens a camera and starts it; options->id: its device node, such as /dev/video0, or "any": the
 * first that can capture. Returns 0, -ENOSYS (built without V4L2), -ENODEV (no camera there),
 * -EBUSY (another program streams from it), -EINVAL (a size, rate, format or control that it does
 * not have; the sentence names what it has), or another negative errno, and a sentence.
 *
 * Pictures: YUYV and NV12 are converted to RGB8 by the matrix and range that the driver names;
 * MJPEG is given as it is; RGB3, BGR3 as RGB8; GREY, Y10 and Y16 as MONO16, Y12 as MONO12; with
 * is_8_bit the upper eight bits of these as RGB8. Luma alone is given in the camera's codes.
 * Times are the driver's where it has CLOCK_MONOTONIC, moved to the middle of the exposure where
 * that was set. A camera that is unplugged is opened again
 * when it is back, and set as it was.
 */
GN_MUST_USE int gn_v4l2_open(const struct gn_live_options *options, struct gn_source **out_source,
                             struct gn_error *out_error);

/** Told a line about a camera. indent 0: the camera itself; 1: what it offers. */
typedef void (*gn_v4l2_say_fn)(void *context, int indent, const char *line);

/** Tells of every camera there is, its formats and controls. Returns how many, or -ENOSYS. */
int gn_v4l2_describe_all(gn_v4l2_say_fn say, void *context);

#endif
