/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A marker followed without searching: only where it is, and only if it is the one it was. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/follow.h"
#include "tests/unit/cmocka_setup.h"

enum { WIDTH = 200, HEIGHT = 160, CELLS = 6 };

static const uint8_t white[CELLS * CELLS] = {0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 0, 1, 0,
                                             0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0};

/** A marker whose top left is at (x, y), 60 px wide, each pixel the mean over its square. */
static void draw(uint8_t *pixels, const uint8_t *cells, double x, double y)
{
    for (int row = 0; row < HEIGHT; row++) {
        for (int column = 0; column < WIDTH; column++) {
            double sum = 0;
            for (int i = 0; i < 64; i++) {
                double u = (column + (i % 8 + 0.5) / 8 - x) / 10;
                double v = (row + (i / 8 + 0.5) / 8 - y) / 10;
                bool is_on = u >= 0 && v >= 0 && u < CELLS && v < CELLS;
                sum += is_on && !cells[(int)v * CELLS + (int)u] ? 0.05 : 0.8;
            }
            pixels[row * WIDTH + column] = (uint8_t)lround(255 * sum / 64);
        }
    }
}

static struct gn_grey get_grey(const uint8_t *pixels)
{
    struct gn_grey grey = {.pixels = pixels, .width = WIDTH, .height = HEIGHT};
    for (int i = 0; i < 256; i++)
        grey.linear[i] = (float)i / 255.0F;
    return grey;
}

static struct gn_camera get_camera(void)
{
    return (struct gn_camera){.width = WIDTH,
                              .height = HEIGHT,
                              .fx = 200,
                              .fy = 200,
                              .cx = 100,
                              .cy = 80,
                              .world_from_camera = {.rotation = {1, 0, 0, 0}}};
}

static void set_corners(double corners[4][2], double x, double y)
{
    for (int k = 0; k < 4; k++) {
        corners[k][0] = x + (k == 1 || k == 2 ? 60 : 0);
        corners[k][1] = y + (k >= 2 ? 60 : 0);
    }
}

static void follows_what_is_there(void **state)
{
    (void)state;
    uint8_t *pixels = malloc(WIDTH * HEIGHT);
    const struct gn_pattern pattern = {CELLS, white};
    struct gn_camera camera = get_camera();
    for (int i = 0; i < 20; i++) {
        double x = 70.3 + 0.1 * i, y = 50.9 - 0.07 * i, corners[4][2];
        draw(pixels, white, x, y);
        const struct gn_grey grey = get_grey(pixels);
        set_corners(corners, x + 1.9 - 0.2 * i, y - 1.9 + 0.2 * i);
        assert_true(gn_follow_marker(&grey, &camera, &pattern, corners));
        // 8 x 8 points draw an edge to a sixteenth of a pixel.
        for (int k = 0; k < 4; k++) {
            assert_true(fabs(corners[k][0] - x - (k == 1 || k == 2 ? 60 : 0)) < 0.08);
            assert_true(fabs(corners[k][1] - y - (k >= 2 ? 60 : 0)) < 0.08);
        }
    }
    free(pixels);
}

/** A light speck on one edge: the rest of it says where it is. */
static void follows_edges_that_have_a_speck(void **state)
{
    (void)state;
    uint8_t *pixels = malloc(WIDTH * HEIGHT);
    const struct gn_pattern pattern = {CELLS, white};
    struct gn_camera camera = get_camera();
    double corners[4][2];
    draw(pixels, white, 70.3, 50.9);
    for (int row = 46; row < 53; row++) // white, down to two pixels into the black
        memset(pixels + row * WIDTH + 92, lround(0.8 * 255), 3);
    const struct gn_grey grey = get_grey(pixels);
    set_corners(corners, 71, 50);
    assert_true(gn_follow_marker(&grey, &camera, &pattern, corners));
    for (int k = 0; k < 4; k++) {
        assert_true(fabs(corners[k][0] - 70.3 - (k == 1 || k == 2 ? 60 : 0)) < 0.08);
        assert_true(fabs(corners[k][1] - 50.9 - (k >= 2 ? 60 : 0)) < 0.08);
    }
    free(pixels);
}

static void edges_are_not_guessed_far_off_or_where_light_is_even(void **state)
{
    (void)state;
    uint8_t *pixels = malloc(WIDTH * HEIGHT);
    struct gn_camera camera = get_camera();
    for (int off = 2; off <= 6; off += 4) { // px
        double corners[4][2];
        draw(pixels, white, 70, 50);
        const struct gn_grey grey = get_grey(pixels);
        set_corners(corners, 70 + off, 50);
        assert_int_equal(gn_edges_refine(&grey, &camera, CELLS, corners), off == 2);
    }
    for (int contrast = 2; contrast <= 16; contrast += 14) { // of 255
        double corners[4][2];
        draw(pixels, white, 70, 50);
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            pixels[i] = (uint8_t)(100 + pixels[i] * contrast / 255);
        const struct gn_grey grey = get_grey(pixels);
        set_corners(corners, 70, 50);
        assert_int_equal(gn_edges_refine(&grey, &camera, CELLS, corners), contrast == 16);
    }
    free(pixels);
}

static void refuses_another_marker_and_none(void **state)
{
    (void)state;
    uint8_t *pixels = malloc(WIDTH * HEIGHT), other[CELLS * CELLS];
    const struct gn_pattern pattern = {CELLS, white};
    struct gn_camera camera = get_camera();
    double corners[4][2], before[4][2];
    // The same one a quarter turned.
    for (int i = 0; i < CELLS * CELLS; i++)
        other[i] = white[(CELLS - 1 - i % CELLS) * CELLS + i / CELLS];
    draw(pixels, other, 70, 50);
    struct gn_grey grey = get_grey(pixels);
    set_corners(corners, 70, 50);
    memcpy(before, corners, sizeof(before));
    assert_false(gn_follow_marker(&grey, &camera, &pattern, corners));
    assert_memory_equal(before, corners, sizeof(before));
    // Too far, out of the picture, and nothing at all.
    draw(pixels, white, 70, 50);
    set_corners(corners, 80, 50);
    assert_false(gn_follow_marker(&grey, &camera, &pattern, corners));
    set_corners(corners, -30, 50);
    assert_false(gn_follow_marker(&grey, &camera, &pattern, corners));
    set_corners(corners, 1e9, NAN);
    assert_false(gn_follow_marker(&grey, &camera, &pattern, corners));
    memset(pixels, 90, WIDTH * HEIGHT);
    set_corners(corners, 70, 50);
    assert_false(gn_follow_marker(&grey, &camera, &pattern, corners));
    free(pixels);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(follows_what_is_there),
        cmocka_unit_test(follows_edges_that_have_a_speck),
        cmocka_unit_test(edges_are_not_guessed_far_off_or_where_light_is_even),
        cmocka_unit_test(refuses_another_marker_and_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
