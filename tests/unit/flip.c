/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* FLIP's known properties: its paper's closed forms, symmetry, order. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>

#include "tests/bench/error_time/flip.h"

enum { WIDTH = 64, HEIGHT = 48 };

static struct gn_image make(void)
{
    struct gn_image image;
    assert_int_equal(gn_image_init(&image, WIDTH, HEIGHT, 3), 0);
    return image;
}

static struct gn_image make_even(float r, float g, float b)
{
    struct gn_image image = make();
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        image.data[3 * i] = r;
        image.data[3 * i + 1] = g;
        image.data[3 * i + 2] = b;
    }
    return image;
}

/** Waves, and a grey square of that contrast whose left edge is at x. */
static struct gn_image make_scene(int x, float contrast)
{
    struct gn_image image = make();
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        bool is_in = i % WIDTH >= x && i % WIDTH < x + 20 && i / WIDTH > 12 && i / WIDTH < 32;
        for (int c = 0; c < 3; c++)
            image.data[3 * i + c] =
                0.4f + 0.1f * sinf(0.3f * (float)(i % WIDTH) + (float)c) + (is_in ? contrast : 0);
    }
    return image;
}

static double last_peak; // of the last compare()'s map

static double compare(struct gn_image a, struct gn_image b)
{
    last_peak = 0;
    double mean = -1, back = -1;
    struct gn_image map;
    assert_int_equal(gn_flip_compare(&a, &b, GN_FLIP_PIXELS_PER_DEGREE, &map, &mean), 0);
    assert_int_equal(gn_flip_compare(&b, &a, GN_FLIP_PIXELS_PER_DEGREE, NULL, &back), 0);
    assert_true(fabs(mean - back) < 1e-12);
    double sum = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        assert_true(map.data[i] >= 0 && map.data[i] <= 1.000001f);
        sum += map.data[i];
        last_peak = fmax(last_peak, map.data[i]);
    }
    assert_true(fabs(sum / (WIDTH * HEIGHT) - mean) < 1e-6);
    gn_image_finish(&map);
    gn_image_finish(&a);
    gn_image_finish(&b);
    return mean;
}

static void test_even_pictures(void **state)
{
    (void)state;
    assert_true(compare(make_even(0.2f, 0.5f, 0.9f), make_even(0.2f, 0.5f, 0.9f)) == 0);
    // By hand: HyAB of black and white is 100, of green and blue in Hunt's L*a*b* 203.0 (the
    // largest); 0.95 + (100^0.7 - 0.4 m) / (0.6 m) 0.05 with m = 203.0^0.7.
    double largest = pow(203.0, 0.7);
    double expected = 0.95 + (pow(100, 0.7) - 0.4 * largest) / (0.6 * largest) * 0.05;
    double black_white = compare(make_even(0, 0, 0), make_even(1, 1, 1));
    print_message("# black and white: %.5f, by hand %.5f\n", black_white, expected);
    assert_true(fabs(black_white - expected) < 1e-3);
    assert_true(fabs(compare(make_even(0, 1, 0), make_even(0, 0, 1)) - 1) < 1e-6);
    // Of a small difference of lightness the rule is linear in the power: L* 100 and 90.
    float y = (float)pow((90.0 + 16) / 116, 3);
    double by_hand = 0.95 / (0.4 * largest) * pow(10, 0.7);
    assert_true(fabs(compare(make_even(1, 1, 1), make_even(y, y, y)) - by_hand) < 1e-3);
}

static void test_order(void **state)
{
    (void)state;
    double same = compare(make_scene(20, 0.1f), make_scene(20, 0.1f));
    double faint = compare(make_scene(20, 0.1f), make_scene(20, 0.12f));
    double strong = compare(make_scene(20, 0.1f), make_scene(20, 0.3f));
    double moved = compare(make_scene(20, 0.3f), make_scene(21, 0.3f));
    double moved_far = compare(make_scene(20, 0.3f), make_scene(28, 0.3f));
    print_message("# faint %.4f strong %.4f moved %.4f far %.4f\n", faint, strong, moved,
                  moved_far);
    assert_true(same == 0);
    assert_true(faint > 0 && strong > 3 * faint);
    assert_true(moved > 0 && moved_far > 2 * moved);
}

static void test_features_raise_it(void **state)
{
    (void)state;
    // A line a pixel wide: its colour difference is blurred, its edge is not forgotten.
    struct gn_image plain = make_even(0.5f, 0.5f, 0.5f), lined = make_even(0.5f, 0.5f, 0.5f);
    struct gn_image spread = make_even(0.5f, 0.5f, 0.5f), plain_again = make_even(0.5f, 0.5f, 0.5f);
    for (int y = 0; y < HEIGHT; y++) {
        for (int c = 0; c < 3; c++) {
            gn_image_at(&lined, 32, y)[c] = 0.9f;
            for (int x = 12; x < 52; x++)
                gn_image_at(&spread, x, y)[c] = 0.51f; // as much light more
        }
    }
    (void)compare(plain, lined);
    double line = last_peak;
    (void)compare(plain_again, spread);
    print_message("# peaks: line %.4f haze %.4f\n", line, last_peak);
    assert_true(line > 0.3 && line > 4 * last_peak); // by colour alone: 0.26
}

static void test_refusals(void **state)
{
    (void)state;
    struct gn_image a = make(), grey;
    double mean = -2;
    assert_int_equal(gn_image_init(&grey, WIDTH, HEIGHT, 1), 0);
    assert_int_equal(gn_flip_compare(&a, &grey, 67, NULL, &mean), -EINVAL);
    assert_int_equal(gn_flip_compare(&a, &a, 0, NULL, &mean), -EINVAL);
    a.width--;
    grey.channels = 3;
    assert_int_equal(gn_flip_compare(&a, &grey, 67, NULL, &mean), -EINVAL);
    assert_true(mean == -2);
    gn_image_finish(&a);
    gn_image_finish(&grey);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_even_pictures), cmocka_unit_test(test_order),
        cmocka_unit_test(test_features_raise_it), cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
