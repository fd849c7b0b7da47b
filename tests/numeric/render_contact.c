/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Shadows where a virtual object touches what it stands on: a long box or wall on a floor, seen so
 * near that a pixel is a ten-thousandth of the box's height, at scales of 1e-3 to 1e4 m, far from
 * the origin, resting, and sunk a little into the floor as tracked poses have it.
 *
 * Under one distant light no pixel between box and shadow is lit, and none on the other side is
 * dark. Under an even sky a wall of height h hides from the floor at distance d the share
 *   1/2 (1 - d / sqrt(d^2 + h^2))
 * of its irradiance (a strip that goes on for ever, as seen from a surface across it): one half at
 * the line of contact.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>

#include "tests/stage.h"

enum { WIDTH = 48, HEIGHT = 16 };

static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint_even(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 1;
}

/** A box of the height, `thick` heights thick and 40 long along y, whose side x = 0 goes up from
 * the floor at z = 0; all `far` from the origin. */
static void init_box(struct gn_test_stage *stage, double height, double thick, double far,
                     double sunk)
{
    float h = (float)height;
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(60 * h, 60 * h, h), far, far,
                      far - 0.5 * height, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_box((float)thick * h, 40 * h, h),
                      far - 0.5 * thick * height, far, far + 0.5 * height - sunk,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(stage, 0);
    gn_test_stage_set_map(stage, 64, 32, paint_even, NULL);
    gn_test_stage_set_lights_from_map(stage, 1);
}

/** Looks down at the line of contact so that a pixel is `pixel` heights wide. */
static void aim(struct gn_test_stage *stage, double height, double far, double pixel)
{
    const double eye[3] = {far + 0.4 * height, far, far + height};
    const double target[3] = {far, far, far};
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 1.08 / pixel, eye, target);
    // The camera's up is z, so its rows run along the wall's foot: turn the picture's x across it.
    double *q = stage->camera.world_from_camera.rotation;
    const double half = sqrt(0.5);
    const double turned[4] = {half * (q[0] - q[3]), half * (q[1] + q[2]), half * (q[2] - q[1]),
                              half * (q[3] + q[0])};
    for (int i = 0; i < 4; i++)
        q[i] = turned[i];
}

struct counts {
    int n_virtual, n_dark, n_lit;
};

static struct counts count(const struct gn_test_stage *stage)
{
    struct counts counts = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        float factor = gn_image_at(&stage->layers.shadow, i % WIDTH, i / WIDTH)[0];
        float alpha = gn_image_at(&stage->layers.virtual_rgba, i % WIDTH, i / WIDTH)[3];
        assert_true(alpha == 0 || alpha == 1);
        counts.n_virtual += alpha == 1;
        counts.n_dark += alpha == 0 && factor == 0;
        counts.n_lit += alpha == 0 && factor == 1;
    }
    return counts;
}

static void test_no_light_leaks_in_at_the_contact(void **state)
{
    (void)state;
    static const double heights[] = {1e-3, 1, 1e4};
    static const double sunks[] = {0, 1e-6, 0.01};
    static const double fars[] = {0, 100};
    for (int i = 0; i < 3 * 3 * 2 * 2; i++) {
        double height = heights[i % 3];
        double far = fars[i / 18] * height;
        struct gn_test_stage stage = {0};
        const struct gn_render_options options = {
            .single_ray = true, .quality = i / 9 % 2 ? GN_QUALITY_SEED : GN_QUALITY_INTERACTIVE};
        struct gn_light light = {.dir_world = {-0.8f, 0, 0.6f}, .irradiance = {1, 1, 1}};
        init_box(&stage, height, i % 2 ? 1 : 0.01, far, sunks[i / 3 % 3] * height);
        aim(&stage, height, far, far > 0 ? 2e-3 : 1e-4);
        gn_test_stage_set_lights(&stage, &light, 1);
        gn_test_stage_render(&stage, &options);
        struct counts behind = count(&stage);
        assert_true(behind.n_virtual > 100);
        assert_true(behind.n_dark > 100);
        assert_int_equal(behind.n_virtual + behind.n_dark, WIDTH * HEIGHT);
        light.dir_world[0] = 0.8f;
        gn_test_stage_set_lights(&stage, &light, 1);
        gn_test_stage_render(&stage, &options);
        struct counts before = count(&stage);
        assert_int_equal(before.n_virtual, behind.n_virtual);
        assert_int_equal(before.n_virtual + before.n_lit, WIDTH * HEIGHT);
        gn_test_stage_finish(&stage);
    }
}

/** Of the mean of each column and of single pixels. */
static double get_worst(const struct gn_test_stage *stage, double height)
{
    double worst = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double p[3];
        int x = i % WIDTH;
        int y = i / WIDTH;
        if (gn_image_at(&stage->layers.virtual_rgba, x, y)[3] > 0)
            continue;
        gn_test_stage_get_point(stage, x + 0.5, y + 0.5, 0, p);
        double expected = 1 - 0.5 * (1 - p[0] / hypot(p[0], height));
        worst = fmax(worst, fabs((double)gn_image_at(&stage->layers.shadow, x, y)[0] - expected));
    }
    return worst;
}

static void test_an_even_sky_is_half_hidden_at_the_contact(void **state)
{
    (void)state;
    static const double heights[] = {1e-3, 1, 1e4};
    static const double pixels[] = {1e-4, 1e-2};
    for (int i = 0; i < 6; i++) {
        double height = heights[i % 3];
        double worst[2];
        struct gn_test_stage stage = {0};
        init_box(&stage, height, i % 2 ? 1 : 0.01, 0, 0);
        for (int q = 0; q < 2; q++) {
            const struct gn_render_options options = {
                .quality = q ? GN_QUALITY_REFERENCE : GN_QUALITY_INTERACTIVE, .single_ray = true};
            aim(&stage, height, 0, pixels[i / 3]);
            gn_test_stage_render(&stage, &options);
            worst[q] = get_worst(&stage, height);
        }
        print_message("# height %g m, pixel %g: off by %.4f, reference %.4f\n", height,
                      pixels[i / 3] * height, worst[0], worst[1]);
        assert_true(worst[0] < 0.02);
        assert_true(worst[1] < 0.02);
        gn_test_stage_finish(&stage);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_light_leaks_in_at_the_contact),
        cmocka_unit_test(test_an_even_sky_is_half_hidden_at_the_contact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
