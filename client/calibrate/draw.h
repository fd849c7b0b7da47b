/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Reports as pictures: lines and dots on a raster, and plots as SVG text. Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_CALIBRATE_DRAW_H
#define GN_CLIENT_CALIBRATE_DRAW_H

#include <stdint.h>

#include "client/calibrate/chart_response.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

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

/**
 * The fit of a chart as an SVG file: relative error of each patch's light over that light on a
 * logarithmic axis, greys black, the rest in their colour, outliers hollow, pale what its code does
 * not say to 5 %. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_draw_chart_plot(const char *path, const struct gn_chart_response *response,
                                   struct gn_error *out_error);

#endif
