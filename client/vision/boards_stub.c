/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What stands for OpenCV's part of calibration where the build has none. */
#include <errno.h>

#include "client/vision/boards.h"

static int refuse(struct gn_error *out_error)
{
    return gn_error_set(out_error, -ENOSYS,
                        "this build cannot find boards and charts: it was made without OpenCV "
                        "(install libopencv-dev and libopencv-contrib-dev, meson setup "
                        "-Dopencv=enabled)");
}

int gn_board_find(const struct gn_board *board, const uint8_t *grey, int width, int height,
                  struct gn_board_corner *out_corners, int *out_n, struct gn_error *out_error)
{
    (void)board, (void)grey, (void)width, (void)height, (void)out_corners;
    *out_n = 0;
    return refuse(out_error);
}

int gn_intrinsics_solve(const struct gn_board *board, struct gn_board_view *views, int n_views,
                        int width, int height, bool has_square_pixels, struct gn_intrinsics *out,
                        struct gn_error *out_error)
{
    (void)board, (void)views, (void)n_views, (void)width, (void)height;
    (void)has_square_pixels, (void)out;
    return refuse(out_error);
}

int gn_vision_find_chart(const uint8_t *rgb, int width, int height, double out_corners[8],
                         struct gn_error *out_error)
{
    (void)rgb, (void)width, (void)height, (void)out_corners;
    return refuse(out_error);
}
