/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The few calls by which V4L2 cameras are reached, as a table, so that the tests can put a driver
 * of their own, honest or hostile, in the kernel's place.
 */
#ifndef GN_CLIENT_CAPTURE_V4L2_IO_H
#define GN_CLIENT_CAPTURE_V4L2_IO_H

#include <stddef.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "client/capture/v4l2.h"
#include "proto/attr.h"

/** Nodes that are looked at for cameras: /dev/video0 and on. */
#define GN_V4L2_MAX_NODES 64

/** Calls of the kernel. All return 0 (or what is said), or a negative errno. */
struct gn_v4l2_io {
    void *context;
    int (*open)(void *context, const char *path); // a descriptor
    void (*close)(void *context, int fd);
    int (*control)(void *context, int fd, unsigned long request, void *argument); // ioctl()
    int (*map)(void *context, int fd, size_t n_bytes, int64_t offset, uint8_t **out_start);
    void (*unmap)(void *context, uint8_t *start, size_t n_bytes);
    /** poll() for pictures and events: its revents, 0 after timeout_ms. fd -1: waits it out. */
    int (*wait)(void *context, int fd, int timeout_ms);
    int64_t (*now_ns)(void *context); // CLOCK_MONOTONIC
};

/** The kernel itself. Thread-safety: safe. */
extern const struct gn_v4l2_io gn_v4l2_kernel;

/** As gn_v4l2_open, through io, which is borrowed until the source is closed. */
GN_MUST_USE int gn_v4l2_open_through(const struct gn_v4l2_io *io,
                                     const struct gn_live_options *options,
                                     struct gn_source **out_source, struct gn_error *out_error);

/** Tells of one camera, its formats and controls. Returns 0, or a negative errno and a sentence:
 * it is none. */
GN_MUST_USE int gn_v4l2_describe(const struct gn_v4l2_io *io, const char *path, gn_v4l2_say_fn say,
                                 void *context, struct gn_error *out_error);

#endif
