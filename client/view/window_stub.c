/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/window.h"

#include "client/feature.h"

int gn_window_open(int width, int height, struct gn_window **out_window, struct gn_error *out_error)
{
    (void)width;
    (void)height;
    *out_window = NULL;
    return gn_feature_refuse(GN_FEATURE_WINDOW, out_error);
}

int gn_window_find_display(struct gn_error *out_error)
{
    return gn_feature_refuse(GN_FEATURE_WINDOW, out_error);
}

/* No window was ever opened: nothing of the following has one. */

void gn_window_close(struct gn_window **window)
{
    *window = NULL;
}

void gn_window_set_title(struct gn_window *window, const char *title)
{
    (void)window;
    (void)title;
}

void gn_window_toggle_full_screen(struct gn_window *window)
{
    (void)window;
}

int gn_window_poll(struct gn_window *window, bool *out_is_stale)
{
    (void)window;
    (void)out_is_stale;
    return GN_WINDOW_KEY_CLOSE;
}

void gn_window_get_size(const struct gn_window *window, int *out_width, int *out_height)
{
    (void)window;
    *out_width = *out_height = 1;
}

bool gn_window_is_hidden(const struct gn_window *window)
{
    (void)window;
    return true;
}

int gn_window_present(struct gn_window *window, const struct gn_image8 *picture,
                      const struct gn_canvas *canvas, struct gn_error *out_error)
{
    (void)window;
    (void)picture;
    (void)canvas;
    return gn_feature_refuse(GN_FEATURE_WINDOW, out_error);
}
