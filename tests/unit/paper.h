/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One picture of markers that lie upright on white paper, seen from right above, in linear codes.
 */
#ifndef GN_TESTS_UNIT_PAPER_H
#define GN_TESTS_UNIT_PAPER_H

#include "client/track/quad.h"
#include "client/vision/markers.h"
#include "common/camera.h"

enum {
    GN_PAPER_WIDTH = 240,
    GN_PAPER_HEIGHT = 160,
    GN_PAPER_MAX_CELLS = GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS,
};

/** A camera 0.4 m above the paper, whose pixels are millimetres there. */
extern const struct gn_camera gn_paper_camera;

/** Makes all of it white. */
void gn_paper_clear(void);
/** Cells of `cell` px, side by side, the top left at (x, y); a pixel is the mean of 16 points. */
void gn_paper_put_cells(const uint8_t *white, int side, double x, double y, double cell, int black);
/** A marker of 4x4_50, six cells wide. */
void gn_paper_put(int id, double x, double y, double cell);
/** What is drawn, and what its codes mean. */
struct gn_grey gn_paper_get_grey(void);

#endif
