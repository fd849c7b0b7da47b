/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Lines and dots on pictures, to look at what was found. Thread-safety: safe.
 */
#ifndef GN_COMMON_DRAW_H
#define GN_COMMON_DRAW_H

#include <stdint.h>

#include "common/image.h"

/** A colour, sRGB. */
struct gn_ink {
    uint8_t r, g, b;
};

/** What lies outside the picture is not drawn. image: 8 bits, 3 channels. Positions in px. */
void gn_draw_dot(struct gn_image8 *image, double x, double y, double radius, struct gn_ink ink);
void gn_draw_line(struct gn_image8 *image, const double from[static 2], const double to[static 2],
                  struct gn_ink ink);
void gn_draw_circle(struct gn_image8 *image, double x, double y, double radius, struct gn_ink ink);
/** Fills columns [x0, x1) of rows [y0, y1). */
void gn_draw_box(struct gn_image8 *image, int x0, int y0, int x1, int y1, struct gn_ink ink);

#endif
