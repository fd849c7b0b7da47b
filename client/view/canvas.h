/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A transparent picture that lies over the window's: filled boxes and letters, nothing more. What
 * lies outside is cut off. Sizes are in units of `scale` pixels, so that text has one size on
 * windows of any. Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_VIEW_CANVAS_H
#define GN_CLIENT_VIEW_CANVAS_H

#include <stdint.h>

#include "common/font.h"
#include "common/image.h"
#include "proto/attr.h"

/** From a line of text to the next, units. */
#define GN_CANVAS_LINE 11

struct gn_canvas {
    struct gn_image8 image; // R, G, B, A, not premultiplied, owned
    int scale;              // pixels of a unit, >= 1
    int width, height;      // units, rounded down
};

/** R, G, B, A. */
struct gn_color {
    uint8_t rgba[4];
};

/**
 * Makes the canvas of that size in pixels, all transparent; a zeroed one at first. Returns 0,
 * -EINVAL or -ENOMEM; *canvas is zeroed on failure.
 */
GN_MUST_USE int gn_canvas_begin(struct gn_canvas *canvas, int width_px, int height_px);
/** A zeroed one is fine. */
void gn_canvas_finish(struct gn_canvas *canvas);

/** Replaces what is there. Units. */
void gn_canvas_fill(struct gn_canvas *canvas, int x, int y, int width, int height,
                    struct gn_color color);

/** One line, its upper left corner at x, y. Units. Anything but printable ASCII is a '?'. */
void gn_canvas_write(struct gn_canvas *canvas, int x, int y, struct gn_color color,
                     const char *text);

#endif
