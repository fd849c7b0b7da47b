/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The views of a board that gnomon calibrate intrinsics fits a camera to: of pictures given, or
 * picked from a camera's as they come.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_COLLECT_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_COLLECT_H

#include "client/calibrate/views.h"
#include "client/cmd_calibrate/calibrate_live.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** Fewer corners are no view. */
#define GN_CALIBRATE_MIN_CORNERS 8

/** Views of one camera. All-zero but the board is empty; end it with _finish. */
struct gn_calibrate_views {
    struct gn_board board;
    struct gn_board_view views[GN_BOARD_MAX_VIEWS];
    struct gn_board_corner *corners[GN_BOARD_MAX_VIEWS]; // [n_views], owned
    double *residuals[GN_BOARD_MAX_VIEWS];               // [n_views], owned
    char *names[GN_BOARD_MAX_VIEWS];                     // [n_views], owned
    int n_views;
    int width, height; // of all pictures
    int n_searched;    // pictures without the board in which another was looked for
    char hint[128];    // what they show instead; "": nothing that is known
};

void gn_calibrate_views_finish(struct gn_calibrate_views *set);

/**
 * The board's corners in a picture, which is finished; out_corners as of gn_board_find. Returns 0,
 * or a negative errno and a sentence: -EINVAL where it is not as large as those before.
 */
GN_MUST_USE int gn_calibrate_views_look(struct gn_calibrate_views *set, const char *name,
                                        struct gn_image *picture,
                                        struct gn_board_corner *out_corners, int *out_n,
                                        struct gn_error *out_error);

/** Adds a copy; there must be room. Returns 0 or -ENOMEM and a sentence. */
GN_MUST_USE int gn_calibrate_views_add(struct gn_calibrate_views *set, const char *name,
                                       const struct gn_board_corner *corners, int n,
                                       struct gn_error *out_error);

/**
 * Adds views of the board at rest that are unlike all before, from the video or camera that the
 * options name, until there are n_wanted and gn_views_check takes them, the video ends, or Ctrl-C.
 * folder: where their pictures are written; NULL: nowhere. Says on stdout how far it is and what
 * is wrong with what it sees. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_calibrate_views_collect(struct gn_calibrate_views *set,
                                           const struct gn_program *program,
                                           const struct gn_options *options, int n_wanted,
                                           const char *folder, struct gn_error *out_error);

#endif
