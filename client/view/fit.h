/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where a picture lies in a window: whole, in its own shape, as large as fits, in the middle.
 */
#ifndef GN_CLIENT_VIEW_FIT_H
#define GN_CLIENT_VIEW_FIT_H

/** px, from the upper left corner. */
struct gn_fit {
    int x, y, width, height;
};

/** All sizes px, in [1, 65536]. Sides are rounded to whole pixels, at least 1. Thread-safety: safe.
 */
struct gn_fit gn_fit_picture(int picture_width, int picture_height, int window_width,
                             int window_height);

/** The window that a picture opens in: its size times the largest whole number by which it is
 * within 640 x 480; at most max, in the picture's shape. On screens whose pixels are half or a
 * third as wide as usual (96 dpi; 0: not known), and which have the room, twice or three times
 * that. Only width and height are set. */
struct gn_fit gn_fit_window(int picture_width, int picture_height, int max_width, int max_height,
                            double dpi);

#endif
