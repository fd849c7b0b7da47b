/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where pictures come from: one interface, one file per kind of source (file.c; cameras follow).
 * A source gives camera frames or environment frames; which of the two its pictures are is its
 * user's business.
 */
#ifndef GN_CLIENT_CAPTURE_SOURCE_H
#define GN_CLIENT_CAPTURE_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/pose.h"
#include "proto/attr.h"

/** How the pixels of a capture lie in memory: rows from the top, no padding, little-endian. */
enum gn_capture_format {
    GN_CAPTURE_RGB_F32 = 0, // linear R, G, B float32; all others are codes of some response
    GN_CAPTURE_MONO12,      // codes [0, 4095] in 16 bits
    GN_CAPTURE_RGB12,
    GN_CAPTURE_MONO16, // codes [0, 65535]
    GN_CAPTURE_RGB16,
    GN_CAPTURE_RGB8,
    GN_CAPTURE_JPEG, // a JPEG file as it is
};

/** One picture. */
struct gn_capture {
    const char *name; // what files written about it are called; borrowed until the next read
    double time_s;    // since the source's first picture
    int width;        // px
    int height;       // px
    enum gn_capture_format format;
    const uint8_t *data; // borrowed until the next read
    size_t data_bytes;
    bool has_pose; // the source knows where the camera was
    struct gn_pose world_from_camera;
};

struct gn_source;

/** What a kind of source does; see the functions below. */
struct gn_source_ops {
    int (*read)(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error);
    void (*close)(struct gn_source *source);
};

/** Head of every kind's own struct. Thread-safety: unsafe. */
struct gn_source {
    const struct gn_source_ops *ops;
};

/**
 * The next picture. Returns 1, 0 at the end, or a negative errno and a sentence. May block until a
 * camera has one.
 */
GN_MUST_USE int gn_source_read(struct gn_source *source, struct gn_capture *out,
                               struct gn_error *out_error);

/** NULL-safe; nulls *source. */
void gn_source_close(struct gn_source **source);

#endif
