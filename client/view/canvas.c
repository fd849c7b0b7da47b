/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/canvas.h"

#include <string.h>

/** Pixels of a window for which a unit is one: a 320 x 240 picture must still hold the figures. */
enum { UNIT_WIDTH = 480, UNIT_HEIGHT = 360 };

int gn_canvas_begin(struct gn_canvas *canvas, int width_px, int height_px)
{
    struct gn_image8 *image = &canvas->image;
    if (image->width != width_px || image->height != height_px) {
        gn_canvas_finish(canvas);
        int err = gn_image8_init(image, width_px, height_px, 4);
        if (err)
            return err;
    } else {
        memset(image->data, 0, (size_t)width_px * (size_t)height_px * 4);
    }
    int across = width_px / UNIT_WIDTH, down = height_px / UNIT_HEIGHT;
    canvas->scale = across < down ? across : down;
    canvas->scale = canvas->scale < 1 ? 1 : canvas->scale;
    canvas->width = width_px / canvas->scale;
    canvas->height = height_px / canvas->scale;
    return 0;
}

void gn_canvas_finish(struct gn_canvas *canvas)
{
    gn_image8_finish(&canvas->image);
    *canvas = (struct gn_canvas){0};
}

static int cut(int value, int max)
{
    return value < 0 ? 0 : value > max ? max : value;
}

void gn_canvas_fill(struct gn_canvas *canvas, int x, int y, int width, int height,
                    struct gn_color color)
{
    int x0 = cut(x, canvas->width) * canvas->scale, y0 = cut(y, canvas->height) * canvas->scale;
    int x1 = cut(x + width, canvas->width) * canvas->scale;
    int y1 = cut(y + height, canvas->height) * canvas->scale;
    for (int row = y0; row < y1; row++) {
        for (int column = x0; column < x1; column++)
            memcpy(gn_image8_at(&canvas->image, column, row), color.rgba, 4);
    }
}

void gn_canvas_write(struct gn_canvas *canvas, int x, int y, struct gn_color color,
                     const char *text)
{
    for (; *text && x < canvas->width; text++, x += GN_FONT_ADVANCE) {
        int c = *text < ' ' || *text > '~' ? '?' : *text;
        for (int row = 0; row < GN_FONT_ROWS; row++) {
            for (int column = 0; column < GN_FONT_WIDTH; column++) {
                if (gn_font_rows[c][row] >> (GN_FONT_WIDTH - 1 - column) & 1)
                    gn_canvas_fill(canvas, x + column, y + row, 1, 1, color);
            }
        }
    }
}
