/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The corners of a marker below a pixel: where lines meet that are laid along its four edges, in
 * linear light. On encoded values the blur of lens and pixels would move every edge towards the
 * dark side (sRGB: by a tenth of a pixel and more), the marker would look smaller and be put too
 * far away.
 */
#ifndef GN_CLIENT_TRACK_EDGES_H
#define GN_CLIENT_TRACK_EDGES_H

#include <stdbool.h>

#include "client/track/quad.h"
#include "common/camera.h"

/** Narrowest cell across whose edge a profile sees both sides, px. */
#define GN_EDGES_MIN_CELL_PX 1.8

/**
 * Moves corners_px[4][2] (clockwise around a dark square on a light ground, each within about
 * 2 px) onto the edges of the square. cells: of its side, its border included; the border is one
 * cell wide. Each edge is measured across, by how much light is on either side, at many places
 * along what the lens makes of a straight line, and a straight line fitted to that. Returns false,
 * and leaves them, where cells are under GN_EDGES_MIN_CELL_PX wide or an edge is not seen well
 * enough.
 */
bool gn_edges_refine(const struct gn_grey *grey, const struct gn_camera *camera, int cells,
                     double corners_px[4][2]);

/**
 * Moves the edges of a square outwards: whole-pixel corners are the centres of its outermost dark
 * pixels, half a pixel within it. Corners whose edges hardly differ in direction stay.
 */
void gn_edges_widen(double corners_px[4][2], double by_px);

#endif
