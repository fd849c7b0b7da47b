/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Outlines of dark parts: all borders followed, those of squares kept, clutter let go. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "client/vision/outlines.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

enum { MAX_WIDTH = 200, MAX_HEIGHT = 150 };

static uint8_t grey[MAX_WIDTH * MAX_HEIGHT];

static long find(struct gn_outlines *o, int width, int height, int window, int min_points)
{
    const struct gn_outlines_options options = {.grey = grey,
                                                .width = width,
                                                .height = height,
                                                .stride = MAX_WIDTH,
                                                .window = window,
                                                .min_points = min_points,
                                                .max_points = 4 * MAX_WIDTH,
                                                .tolerance = 0.03};
    return gn_outlines_find(o, &options);
}

static bool is_dark(int width, int height, int window, int x, int y)
{
    int sum = 0, area = window * window;
    for (int v = y - window / 2; v <= y + window / 2; v++)
        for (int u = x - window / 2; u <= x + window / 2; u++)
            sum += grey[(v < 0         ? 0
                         : v >= height ? height - 1
                                       : v) *
                            MAX_WIDTH +
                        (u < 0        ? 0
                         : u >= width ? width - 1
                                      : u)];
    return grey[y * MAX_WIDTH + x] + 7 <= (2 * sum + area) / (2 * area);
}

/** How often borders pass through all pixels: through a dark one once for each stretch of others
 * around it, between two dark neighbours, that has one above, below, left or right. */
static long count_points(int width, int height, int window)
{
    static const int dx[8] = {1, 1, 0, -1, -1, -1, 0, 1}, dy[8] = {0, -1, -1, -1, 0, 1, 1, 1};
    static bool dark[MAX_HEIGHT + 2][MAX_WIDTH + 2];
    long n = 0;
    memset(dark, 0, sizeof(dark));
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            dark[y + 1][x + 1] = is_dark(width, height, window, x, y);
    for (int i = 0; i < width * height; i++) {
        int x = i % width + 1, y = i / width + 1, first = 0;
        while (first < 8 && !dark[y + dy[first]][x + dx[first]])
            first++;
        if (!dark[y][x])
            continue;
        n += first == 8;
        bool has_side = false;
        for (int k = first + 1; first < 8 && k <= first + 8; k++) {
            bool is_next = dark[y + dy[k % 8]][x + dx[k % 8]];
            n += is_next && has_side;
            has_side = !is_next && (has_side || k % 2 == 0);
        }
    }
    return n;
}

static void all_borders_are_followed_once(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1, 1}, {2, 9}, {7, 3}, {8, 8}, {15, 5}, {16, 33}, {95, 64}};
    static const int windows[] = {3, 7, 13, 23, 63};
    struct gn_outlines *o = NULL;
    uint64_t seed = 5;
    assert_int_equal(gn_outlines_create(&o), 0);
    for (int i = 0; i < 140; i++) {
        const int *size = sizes[i % 7];
        for (int k = 0; k < MAX_WIDTH * MAX_HEIGHT; k++) // few dark ones to few light ones
            grey[k] = gn_test_random_unit(&seed) < 0.05 * (i / 7) ? 20 : 60;
        for (int k = 0; k < 5; k++)
            assert_int_equal(find(o, size[0], size[1], windows[k], 4),
                             count_points(size[0], size[1], windows[k]));
    }
    gn_outlines_destroy(&o);
}

/** A rectangle. */
static void fill(int left, int top, int width, int height, uint8_t code)
{
    for (int y = top; y < top + height; y++)
        memset(grey + y * MAX_WIDTH + left, code, (size_t)width);
}

static void squares_are_kept_with_all_their_points(void **state)
{
    (void)state;
    struct gn_outlines *o = NULL;
    int n;
    assert_int_equal(gn_outlines_create(&o), 0);
    memset(grey, 200, sizeof(grey));
    fill(40, 30, 24, 20, 30);
    fill(44, 34, 16, 12, 200);
    // Its outside, and the hole's, whose border is of the dark pixels around it, less their
    // corners.
    long n_points = find(o, MAX_WIDTH, MAX_HEIGHT, 63, 20);
    assert_int_equal(n_points, (2 * (24 + 20) - 4) + 2 * (16 + 12));
    assert_int_equal(gn_outlines_count(o), 2);
    for (int i = 0; i < 2; i++) {
        const int32_t(*p)[2] = gn_outlines_get(o, i, &n);
        int low = i == 0 ? 0 : 3, dark = 0;
        assert_int_equal(n, i == 0 ? 84 : 56);
        for (int k = 0; k < n; k++) {
            int u = p[k][0] - 40, v = p[k][1] - 30, next = (k + 1) % n;
            dark += u == low || v == low || u == 23 - low || v == 19 - low;
            assert_in_range(abs(p[next][0] - p[k][0]) + abs(p[next][1] - p[k][1]), 1, 2);
        }
        assert_int_equal(dark, n);
    }
    // Too short, too long or nothing.
    assert_int_equal(find(o, MAX_WIDTH, MAX_HEIGHT, 63, 85), n_points);
    assert_int_equal(gn_outlines_count(o), 0);
    memset(grey, 200, sizeof(grey));
    assert_int_equal(find(o, MAX_WIDTH, MAX_HEIGHT, 63, 20), 0);
    gn_outlines_destroy(&o);
}

static void discs_triangles_and_lines_are_let_go(void **state)
{
    (void)state;
    struct gn_outlines *o = NULL;
    assert_int_equal(gn_outlines_create(&o), 0);
    memset(grey, 200, sizeof(grey));
    fill(20, 20, 120, 2, 30);
    for (int y = 0; y < 40; y++) // a triangle
        fill(130, 60 + y, y + 1, 1, 30);
    for (int y = 0; y < 60; y++)
        for (int x = 0; x < 60; x++)
            if ((x - 30) * (x - 30) + (y - 30) * (y - 30) < 29 * 29)
                grey[(y + 60) * MAX_WIDTH + x + 60] = 30;
    assert_true(find(o, MAX_WIDTH, MAX_HEIGHT, 63, 20) > 400);
    assert_int_equal(gn_outlines_count(o), 0);
    gn_outlines_destroy(&o);
}

/** What makes clutter cheap: nearly nothing of it is looked at more closely. */
static void clutter_is_let_go(void **state)
{
    (void)state;
    struct gn_outlines *o = NULL;
    uint64_t seed = 11;
    assert_int_equal(gn_outlines_create(&o), 0);
    for (int i = 0; i < MAX_WIDTH * MAX_HEIGHT; i++)
        grey[i] = 0;
    for (int size = 4; size <= 64; size *= 2) // blotches of many sizes
        for (int y = 0; y < MAX_HEIGHT; y += size)
            for (int x = 0; x < MAX_WIDTH; x += size) {
                uint8_t code = (uint8_t)(51 * gn_test_random_unit(&seed));
                for (int v = y; v < y + size && v < MAX_HEIGHT; v++)
                    for (int u = x; u < x + size && u < MAX_WIDTH; u++)
                        grey[v * MAX_WIDTH + u] = (uint8_t)(grey[v * MAX_WIDTH + u] + code);
            }
    for (int window = 3; window <= 23; window += 10) {
        long n_all = find(o, MAX_WIDTH, MAX_HEIGHT, window, 19), n_kept = 0;
        int n;
        for (int i = 0; i < gn_outlines_count(o); i++, n_kept += n)
            (void)gn_outlines_get(o, i, &n);
        print_message("# windows of %d: %ld points of borders, kept of %d outlines %ld\n", window,
                      n_all, gn_outlines_count(o), n_kept);
        assert_true(n_all > MAX_WIDTH * MAX_HEIGHT / 8);
        assert_true(n_kept < n_all / 8);
    }
    gn_outlines_destroy(&o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_borders_are_followed_once),
        cmocka_unit_test(squares_are_kept_with_all_their_points),
        cmocka_unit_test(discs_triangles_and_lines_are_let_go),
        cmocka_unit_test(clutter_is_let_go),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
