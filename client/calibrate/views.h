/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Whether views of a calibration board determine a camera, judged from the corners alone, before
 * anything is fitted; and the picture that shows where they were. Thread-safety: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_VIEWS_H
#define GN_CLIENT_CALIBRATE_VIEWS_H

#include <stdbool.h>
#include <stddef.h>

#include "client/vision/boards.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

#define GN_VIEWS_MIN 5
/** The picture in cells, for coverage. */
#define GN_VIEWS_COLUMNS 8
#define GN_VIEWS_ROWS 6
#define GN_VIEWS_MIN_COVERAGE 0.4
/** Relative change of the board's distance over the board that counts as tilted. */
#define GN_VIEWS_MIN_TILT 0.04
/** Views are alike whose corners lie nearer than this share of the picture's diagonal and whose
 * changes of distance differ by less than so much. */
#define GN_VIEWS_ALIKE_SHIFT 0.06
#define GN_VIEWS_ALIKE_TILT 0.08

/** Refuses a chessboard that looks the same upside down, sizes that are none. 0 or -EINVAL. */
GN_MUST_USE int gn_board_check(const struct gn_board *board, struct gn_error *out_error);

/** What a set of views is like. */
struct gn_views_figures {
    double coverage; // share of cells with a corner
    double tilt;     // the second largest view's change of distance over the board
    int n_tilted;
};

/**
 * Refuses a set that does not determine a camera: too few views, all parallel to the picture, a
 * small part of the picture covered. Returns 0, or -EDOM and a sentence with what would be right.
 */
GN_MUST_USE int gn_views_check(const struct gn_board_view *views, int n, int width, int height,
                               struct gn_views_figures *out_figures, struct gn_error *out_error);

/** How far, in px, the corners that both views have lie apart at most; INFINITY where both have
 * less than 4. */
double gn_views_get_shift(const struct gn_board_view *a, const struct gn_board_view *b);

/** Whether the second view tells hardly more than the first: the board as far away, as tilted. */
bool gn_views_are_alike(const struct gn_board_view *a, const struct gn_board_view *b, int width,
                        int height);

/** Bytes that hold any text of gn_views_describe_bare. */
#define GN_VIEWS_BARE_BYTES 128

/** "top left, bottom": the parts of the picture, of 3 x 3, most of whose cells have no corner; ""
 * where there are none. Returns the share of cells that have one. */
double gn_views_describe_bare(const struct gn_board_view *views, int n, int width, int height,
                              char out_text[static GN_VIEWS_BARE_BYTES]);

/** Refuses a fit whose errors are large: focal length or centre uncertain, corners off by more than
 * max_rms_px. Returns 0, or -EDOM and a sentence. */
GN_MUST_USE int gn_views_judge(const struct gn_intrinsics *intrinsics, int width, double max_rms_px,
                               struct gn_error *out_error);

/** Draws corners, their errors `gain` times as long, empty cells tinted. The caller finishes
 * *out_image. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_views_draw(const struct gn_board_view *views, int n, int width, int height,
                              double gain, struct gn_image8 *out_image);

#endif
