/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A window with one picture, scaled to fit, and a canvas over it. The only file that names SDL is
 * window.c; a build without SDL has window_stub.c.
 */
#ifndef GN_CLIENT_VIEW_WINDOW_H
#define GN_CLIENT_VIEW_WINDOW_H

#include <stdbool.h>

#include "client/view/canvas.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** Keys beside the letters, which come as themselves, small. */
enum { GN_WINDOW_KEY_NONE = 0, GN_WINDOW_KEY_CLOSE = 1 };

/** Thread-safety: owner thread (who opened it), the process's main thread. */
struct gn_window;

/** Whether a window can be opened here. Returns 0, or -ENODEV or -ENOSYS and a sentence. */
GN_MUST_USE int gn_window_find_display(struct gn_error *out_error);

/**
 * Opens it for pictures of that size in px; it is shown by the first gn_window_present. Returns 0,
 * or a negative errno and a sentence: -ENODEV (no display), -ENOSYS (built without), -ENOMEM.
 */
GN_MUST_USE int gn_window_open(int width, int height, struct gn_window **out_window,
                               struct gn_error *out_error);
/** NULL-safe; nulls *window. */
void gn_window_close(struct gn_window **window);

void gn_window_set_title(struct gn_window *window, const char *title);
/** The whole screen that it is on; again: as it was. */
void gn_window_toggle_full_screen(struct gn_window *window);

/** The next key that was pressed, a letter or one of the above. Never waits. *out_is_stale is set
 * where the window has to be drawn again, and left as it is else. */
int gn_window_poll(struct gn_window *window, bool *out_is_stale);

/** Of what is drawn into, px. */
void gn_window_get_size(const struct gn_window *window, int *out_width, int *out_height);

/** Whether nobody can see it: minimised, or unmapped. */
bool gn_window_is_hidden(const struct gn_window *window);

/** Shows the picture (RGB; NULL: black) and over it the canvas, which has the window's size; NULL:
 * none. Does not wait for the screen. Returns 0, or -EIO and a sentence. */
GN_MUST_USE int gn_window_present(struct gn_window *window, const struct gn_image8 *picture,
                                  const struct gn_canvas *canvas, struct gn_error *out_error);

#endif
