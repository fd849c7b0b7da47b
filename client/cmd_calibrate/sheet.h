/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Boards and markers to print: SVG files in millimetres, black on white, with the white margin that
 * they need, a line of text that says what it is, and a ruler that tells whether the printer has
 * scaled it. The path "-" is standard output. Thread-safety: safe.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_SHEET_H
#define GN_CLIENT_CMD_CALIBRATE_SHEET_H

#include "client/track/bodies.h"
#include "client/vision/boards.h"
#include "common/error.h"
#include "proto/attr.h"

/** A sheet as it was written. */
struct gn_sheet_size {
    double width_mm, height_mm;
    int ruler_mm;
};

/**
 * The board as gn_board_find looks for it. Returns 0, -ENOSYS (a ChArUco board, no OpenCV), -EINVAL
 * (the dictionary has too few markers) or another negative errno, and a sentence.
 */
GN_MUST_USE int gn_sheet_write_board(const char *path, const struct gn_board *board,
                                     struct gn_sheet_size *out_size, struct gn_error *out_error);

/**
 * All markers of a body, which must lie in one plane, its z = 0, and face its z. Returns 0,
 * -ENOSYS, -EINVAL (it is not flat) or another negative errno, and a sentence.
 */
GN_MUST_USE int gn_sheet_write_body(const char *path, const struct gn_bodies *bodies, int body,
                                    struct gn_sheet_size *out_size, struct gn_error *out_error);

#endif
