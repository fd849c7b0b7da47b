/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/unit/paper.h"

#include <string.h>

#include "tests/unit/cmocka_setup.h"

static uint8_t pixels[GN_PAPER_WIDTH * GN_PAPER_HEIGHT];

const struct gn_camera gn_paper_camera = {.width = GN_PAPER_WIDTH,
                                          .height = GN_PAPER_HEIGHT,
                                          .fx = 400,
                                          .fy = 400,
                                          .cx = 120,
                                          .cy = 80,
                                          .world_from_camera = {.rotation = {1, 0, 0, 0}}};

void gn_paper_clear(void)
{
    memset(pixels, 204, sizeof(pixels));
}

void gn_paper_put_cells(const uint8_t *white, int side, double x, double y, double cell, int black)
{
    for (int row = (int)y - 1; row < y + side * cell + 1; row++) {
        for (int column = (int)x - 1; column < x + side * cell + 1; column++) {
            int sum = 0;
            for (int i = 0; i < 16; i++) {
                double u = (column + (i % 4 + 0.5) / 4 - x) / cell;
                double v = (row + (i / 4 + 0.5) / 4 - y) / cell;
                bool is_on = u >= 0 && v >= 0 && u < side && v < side;
                sum += is_on && !white[(int)v * side + (int)u] ? black : 204;
            }
            pixels[row * GN_PAPER_WIDTH + column] = (uint8_t)(sum / 16);
        }
    }
}

void gn_paper_put(int id, double x, double y, double cell)
{
    uint8_t white[GN_PAPER_MAX_CELLS];
    int side = gn_marker_get_cells(0, id, white);
    assert_int_equal(side, 6);
    gn_paper_put_cells(white, side, x, y, cell, 20);
}

struct gn_grey gn_paper_get_grey(void)
{
    struct gn_grey grey = {.pixels = pixels, .width = GN_PAPER_WIDTH, .height = GN_PAPER_HEIGHT};
    for (int i = 0; i < 256; i++)
        grey.linear[i] = (float)i / 255.0F;
    return grey;
}
