/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The map's pyramid: means over cones, directions by luminance. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>

#include "server/light/pyramid.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static void paint_even(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    for (int k = 0; k < 3; k++)
        out_rgb[k] = (float)(k + 1);
}

/* Smooth, and of mean 1: 1 + z, and in green 1 + x y. */
static void paint_slopes(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    out_rgb[0] = (float)(1 + dir[2]);
    out_rgb[1] = (float)(1 + dir[0] * dir[1]);
    out_rgb[2] = 0.1f;
}

/* A lamp on black. */
static void paint_lamp(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    float value = 500 * (float)pow(fmax(0, 0.6 * dir[0] + 0.8 * dir[2]), 80);
    for (int k = 0; k < 3; k++)
        out_rgb[k] = value;
}

static void test_means(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    uint64_t seed = 3;
    gn_test_stage_set_map(&stage, 128, 64, paint_even, NULL);
    for (int i = 0; i < 200; i++) {
        float dir[3], rgb[3];
        gn_test_random_direction(&seed, dir);
        gn_pyramid_get_radiance(stage.state.pyramid, stage.map, dir, 4 * M_PI * pow(4, -i % 11),
                                rgb);
        for (int k = 0; k < 3; k++)
            assert_float_equal(rgb[k], k + 1, 1e-5);
    }
    gn_test_stage_set_map(&stage, 256, 128, paint_slopes, NULL);
    for (int i = 0; i < 2000; i++) {
        float dir[3], rgb[3];
        gn_test_random_direction(&seed, dir);
        // A cone of that solid angle: cos is 1 - omega / 2 pi, the mean of d . n is (1 + cos) / 2.
        // The square has a bend where a quadrant ends: off by r h, the distance from its middle
        // times a cell's side there, 2 / 64 and less.
        double omega = 0.005 * gn_test_random_unit(&seed);
        gn_pyramid_get_radiance(stage.state.pyramid, stage.map, dir, omega, rgb);
        assert_float_equal(rgb[0], 1 + dir[2] * (1 - omega / (4 * M_PI)), 0.03);
        assert_float_equal(rgb[1], 1 + dir[0] * dir[1], 0.03);
    }
    const float up[3] = {0, 0, 1};
    float rgb[3];
    gn_pyramid_get_radiance(stage.state.pyramid, stage.map, up, 4 * M_PI, rgb);
    assert_float_equal(rgb[0], 1, 5e-3);
    assert_float_equal(rgb[1], 1, 5e-3);
    gn_test_stage_finish(&stage);
}

static void test_directions_follow_the_light(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    uint64_t seed = 5;
    double sum = 0, at_lamp = 0;
    enum { N = 20000 };
    gn_test_stage_set_map(&stage, 512, 256, paint_lamp, NULL);
    for (int i = 0; i < N; i++) {
        const double u[2] = {gn_test_random_unit(&seed), gn_test_random_unit(&seed)};
        float dir[3], rgb[3];
        assert_true(gn_pyramid_sample(stage.state.pyramid, u, dir));
        double pdf = gn_pyramid_get_pdf(stage.state.pyramid, dir);
        assert_true(pdf > 0);
        gn_radiance_map_get_radiance(stage.map, dir, rgb);
        sum += (double)rgb[0] / pdf / N;
        at_lamp += rgb[0] > 5;
    }
    assert_true(at_lamp > 0.95 * N); // whose share of the sphere is 3 %
    assert_float_equal(sum / stage.map->figures.shown_irradiance[0], 1, 0.01);
    // The density over the sphere is 1.
    double whole = 0;
    for (int i = 0; i < 400 * 400; i++) {
        double z = 1 - 2 * (i / 400 + 0.5) / 400, phi = 2 * M_PI * (i % 400 + 0.5) / 400;
        double s = sqrt(1 - z * z);
        const float dir[3] = {(float)(s * cos(phi)), (float)(s * sin(phi)), (float)z};
        whole += gn_pyramid_get_pdf(stage.state.pyramid, dir) * 4 * M_PI / (400 * 400);
    }
    assert_float_equal(whole, 1, 0.01);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_means),
        cmocka_unit_test(test_directions_follow_the_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
