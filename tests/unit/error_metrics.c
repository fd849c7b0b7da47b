/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The error benchmark's figures, by hand. */
#include "tests/unit/cmocka_setup.h"

#include "tests/bench/error_time/metrics.h"
#include "tests/light_fixture.h"

enum { SIDE = 4, N = SIDE * SIDE };

static struct gn_image make(int channels, float value)
{
    struct gn_image image;
    assert_int_equal(gn_image_init(&image, SIDE, SIDE, channels), 0);
    for (int i = 0; i < N * channels; i++)
        image.data[i] = value;
    return image;
}

static void set(struct gn_image *image, int pixel, float value)
{
    for (int c = 0; c < 3; c++)
        image->data[image->channels * pixel + c] = value;
}

static void test_shadow_and_radiance(void **state)
{
    (void)state;
    struct gn_bench_picture reference = {make(3, 1), make(4, 0), make(3, 2)};
    struct gn_layers test = {
        .width = SIDE, .height = SIDE, .shadow = make(3, 1), .virtual_rgba = make(4, 0)};
    struct gn_bench_errors e;
    set(&reference.shadow, 0, 0.5f); // 0.1 too dark
    set(&test.shadow, 0, 0.4f);
    set(&reference.shadow, 1, 0.5f); // right
    set(&test.shadow, 1, 0.5f);
    set(&test.shadow, 2, 0.8f);   // where there is no shadow
    set(&test.shadow, 3, 0.997f); // under the mask's threshold: not counted
    set(&test.shadow, 5, 0.1f);   // on the object: no receiver
    for (int i = 0; i < 2; i++) {
        struct gn_image *rgba = i ? &test.virtual_rgba : &reference.virtual_rgba;
        set(rgba, 5, i ? 3.0f : 2.0f);
        rgba->data[4 * 5 + 3] = 1;
    }
    assert_int_equal(gn_bench_measure_errors(&reference, &test, true, &e), 0);
    assert_int_equal(e.n_masked, 3);
    assert_near(e.rmse, sqrt((0.1 * 0.1 + 0.2 * 0.2) / 3), 1e-6);
    assert_near(e.bias, -0.3 / 3, 1e-6);
    // Radiances 1, 1, 2, 2 (mean 1.5) against 0.8, 1, 1.6, 3.
    double a = 2 / 3.0, b = 4 / 3.0;
    double sum = 0.2 * 0.2 / 2.25 / (a * a + 0.01) + 0.4 * 0.4 / 2.25 / (b * b + 0.01) +
                 1 / 2.25 / (b * b + 0.01);
    assert_near(e.relmse, sum / 4, 1e-6);
    assert_near(e.relmse_trimmed, sum / 4, 1e-6); // a thousandth of twelve terms is none
    assert_true(e.flip > 0 && e.flip < 1);
    assert_int_equal(gn_bench_measure_errors(&reference, &test, false, &e), 0);
    assert_true(e.flip < 0);
    gn_bench_picture_finish(&reference);
    gn_image_finish(&test.shadow);
    gn_image_finish(&test.virtual_rgba);
}

static void test_irradiance(void **state)
{
    (void)state;
    static double exact[GN_BENCH_NORMALS][3];
    struct light_fixture f;
    struct gn_lighting_state *light;
    const struct gn_light_options options = {.n_lights = 256};
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 128, 128), 0);
    light_fixture_fill(&f, light_fixture_constant);
    assert_int_equal(gn_lighting_state_create(&f.frame, NULL, &options, NULL, &light, NULL), 0);
    gn_bench_sum_texels(light->map, exact);
    // The first normal is all but +z: E = pi (1 + cos a) / 2 of the sky, at an angle of a, and of
    // the fill, albedo 0.2, the rest.
    double cosine = 1 - 1.0 / GN_BENCH_NORMALS, sky = (1 + cosine) / 2;
    assert_near(exact[0][1], M_PI * (sky + 0.2 * (1 - sky)), 2e-3);
    // The last: the reverse.
    assert_near(exact[GN_BENCH_NORMALS - 1][1], M_PI * (1 - sky + 0.2 * sky), 2e-3);
    double by_lights = gn_bench_compare_irradiance(light, exact);
    double by_harmonics = gn_bench_compare_sh(light, exact);
    print_message("# lights off by %.4f, harmonics by %.4f\n", by_lights, by_harmonics);
    assert_true(by_lights > 1e-5 && by_lights < 0.01);
    assert_true(by_harmonics < 1e-3); // two even halves: bands 0 and 1 say all that counts
    light->n_lights = 0;
    double sum = 0, squares = 0;
    for (int i = 0; i < GN_BENCH_NORMALS; i++) {
        sum += exact[i][0] / GN_BENCH_NORMALS;
        squares += exact[i][0] * exact[i][0] / GN_BENCH_NORMALS;
    }
    assert_near(gn_bench_compare_irradiance(light, exact), sqrt(squares) / sum, 1e-5);
    gn_lighting_state_unref(&light);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_shadow_and_radiance),
                                       cmocka_unit_test(test_irradiance)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
