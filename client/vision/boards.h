/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What calibration takes from OpenCV: the corners of chessboards and ChArUco boards, the place of a
 * colour chart, and the least squares of a camera's intrinsics. Picture positions are ours (pixel
 * centres at half-integers). Points in C and in C++. Without OpenCV in the build every function
 * returns -ENOSYS and a sentence. Thread-safety: safe; looking for a chart leaves OpenCV with one
 * thread.
 */
#ifndef GN_CLIENT_VISION_BOARDS_H
#define GN_CLIENT_VISION_BOARDS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "common/error.h"
#include "proto/attr.h"

/** Most inner corners of a board, and most views of one. */
#define GN_BOARD_MAX_CORNERS 1024
#define GN_BOARD_MAX_VIEWS 256

/** A board as it is printed. */
struct gn_board {
    bool is_charuco;   // chessboard with a marker in each white square, as OpenCV 4.6 draws it
    int columns, rows; // squares, [3, 33]; the inner corners are one less
    double square_m;   // side of a square
    double marker_m;   // ChArUco: side of a marker, below square_m
    int dictionary;    // ChArUco: index into GN_MARKER_DICTIONARIES
};

/** An inner corner that was seen: its column and row on the board, where in the picture. */
struct gn_board_corner {
    int column, row; // [0, columns - 2], [0, rows - 2]
    double xy[2];    // px
};

/**
 * Finds the board in grey[height][width], corners below a pixel. A chessboard is found whole or not
 * at all. out_corners has GN_BOARD_MAX_CORNERS. Returns 0 (*out_n 0: not seen), -EINVAL, -ENOMEM,
 * -EIO or -ENOSYS and a sentence.
 */
GN_MUST_USE int gn_board_find(const struct gn_board *board, const uint8_t *grey, int width,
                              int height, struct gn_board_corner *out_corners, int *out_n,
                              struct gn_error *out_error);

/** One picture's corners for the solver. */
struct gn_board_view {
    const struct gn_board_corner *corners; // [n], borrowed
    int n;
    double board_normal[3]; // out: of the board in the camera frame, unit
    double rms_px;          // out
    double *residuals;      // out: [n][2] px, seen minus predicted; borrowed
};

struct gn_intrinsics {
    double fx, fy, cx, cy; // px
    double distortion[5];  // k1, k2, p1, p2, k3
    double deviation[9];   // standard deviations of the nine above
    double rms_px;
};

/**
 * Minimises the reprojection error of all views (cv::calibrateCamera: Zhang 2000, Levenberg and
 * Marquardt). has_square_pixels: fx = fy. Returns 0, -EDOM (it does not converge), -ENOMEM, -EIO
 * or -ENOSYS and a sentence.
 */
GN_MUST_USE int gn_intrinsics_solve(const struct gn_board *board, struct gn_board_view *views,
                                    int n_views, int width, int height, bool has_square_pixels,
                                    struct gn_intrinsics *out, struct gn_error *out_error);

/**
 * Finds a 24-patch colour chart in rgb[height][width][3]: the centres of its corner patches, in the
 * order of struct gn_chart_place up to the way it lies. Returns 1, 0 where there is none, -EINVAL,
 * -ENOMEM, -EIO or -ENOSYS and a sentence.
 */
GN_MUST_USE int gn_vision_find_chart(const uint8_t *rgb, int width, int height,
                                     double out_corners[8], struct gn_error *out_error);

#ifdef __cplusplus
}
#endif

#endif
