/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/fit.h"

#include <stdint.h>

/** value times by over to, to the nearest, at least 1. */
static int scale(int value, int by, int to)
{
    int64_t scaled = (2 * (int64_t)value * by + to) / (2 * (int64_t)to);
    return scaled < 1 ? 1 : (int)scaled;
}

struct gn_fit gn_fit_picture(int picture_width, int picture_height, int window_width,
                             int window_height)
{
    struct gn_fit fit = {.width = window_width, .height = window_height};
    if ((int64_t)picture_width * window_height > (int64_t)picture_height * window_width)
        fit.height = scale(picture_height, window_width, picture_width);
    else
        fit.width = scale(picture_width, window_height, picture_height);
    fit.x = (window_width - fit.width) / 2;
    fit.y = (window_height - fit.height) / 2;
    return fit;
}

struct gn_fit gn_fit_window(int picture_width, int picture_height, int max_width, int max_height,
                            double dpi)
{
    int across = 640 / picture_width, down = 480 / picture_height;
    int times = across < down ? across : down;
    times = times < 1 ? 1 : times;
    for (int finer = dpi < 168 ? 1 : dpi < 264 ? 2 : 3; finer > 1; finer--) {
        if ((int64_t)finer * times * picture_width <= max_width &&
            (int64_t)finer * times * picture_height <= max_height) {
            times *= finer;
            break;
        }
    }
    struct gn_fit fit = {.width = times * picture_width, .height = times * picture_height};
    if (fit.width > max_width || fit.height > max_height)
        fit = gn_fit_picture(picture_width, picture_height, max_width, max_height);
    fit.x = fit.y = 0;
    return fit;
}
