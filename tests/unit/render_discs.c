/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Small suns: the edge of their shadows against the texel-exact reference. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "server/light/discs.h"
#include "server/light/map_table.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const double sun_dir[3] = {0.6, 0.01, 0.7999375};

/* 0.53 degrees across, as ours. */
static void paint_sun(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    double x = dir[0] - sun_dir[0], y = dir[1] - sun_dir[1], z = dir[2] - sun_dir[2];
    double radius = 0.265 * M_PI / 180;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = x * x + y * y + z * z < radius * radius ? 1e5f : 0;
}

/* The shadow's edge of a plate two metres above the floor, 3 mm a pixel. */
static void init_stage(struct gn_test_stage *stage)
{
    const double eye[3] = {-1, -0.02, 1};
    const double target[3] = {-1, 0, 0};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(6, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_box(1, 1, 0.02f), 0, 0, 2,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(stage, 2);
    gn_test_stage_aim(stage, 48, 16, 320, eye, target);
    gn_test_stage_set_map(stage, 2048, 1024, paint_sun, NULL);
}

/* RMS difference from the reference's factor over the pixels of its edge. */
static double compare(const struct gn_test_stage *stage, const struct gn_layers *reference)
{
    double sum = 0;
    int n = 0;
    for (int i = 0; i < stage->layers.width * stage->layers.height; i++) {
        double exact = reference->shadow.data[3 * i], d = stage->layers.shadow.data[3 * i] - exact;
        if (exact > 0.005 && exact < 0.995) {
            sum += d * d;
            n++;
        }
    }
    assert_true(n > 50);
    return sqrt(sum / n);
}

static void test_a_disc_has_the_suns_penumbra(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    struct gn_light_list list = {0};
    struct gn_radiance_map *rest = NULL;
    init_stage(&stage);
    list.scratch = gn_scratch_borrow(&stage.map->table->scratch);
    assert_non_null(list.scratch);
    assert_int_equal(gn_discs_take(stage.map, NULL, NULL, &list, &rest), 0);
    assert_int_equal(list.n, 1);
    assert_true(list.lights[0].is_disc);
    assert_float_equal(list.lights[0].angular_radius, 0.265 * M_PI / 180, 4e-4); // in texels
    assert_float_equal(rest->figures.max_luminance, 0, 0);

    struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE};
    gn_test_stage_set_lights(&stage, list.lights, 1);
    gn_test_stage_render(&stage, &options);
    struct gn_layers reference = stage.layers;
    memset(&stage.layers, 0, sizeof(stage.layers));

    options.quality = GN_QUALITY_INTERACTIVE;
    gn_test_stage_render(&stage, &options);
    double disc = compare(&stage, &reference);
    int n_directions = stage.report.n_lights;
    list.lights[0].is_disc = false;
    gn_test_stage_set_lights(&stage, list.lights, 1);
    gn_test_stage_render(&stage, &options);
    double point = compare(&stage, &reference);
    print_message("# edge of a 0.53 degree sun's shadow, RMSE: disc %.4f (%d rays), point %.4f\n",
                  disc, n_directions, point);
    assert_true(disc < 0.04 && point > 5 * disc);
    gn_layers_finish(&reference);
    gn_scratch_give_back(&stage.map->table->scratch, &list.scratch);
    gn_radiance_map_unref(&rest);
    gn_test_stage_finish(&stage);
}

/* On a floor in the open, a disc gives what its middle gives with all its power. */
static void test_a_disc_keeps_its_power(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    struct gn_light light = {
        .dir_world = {0.6f, 0, 0.8f}, .angular_radius = 0.0175f, .irradiance = {3, 2, 1}, .id = 1};
    const double eye[3] = {0, -0.5, 3};
    const double target[3] = {0, 0, 0};
    double sums[3] = {0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(6, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_aim(&stage, 16, 16, 16, eye, target);
    gn_test_stage_set_map(&stage, 16, 8, paint_sun, NULL);
    for (int i = 0; i < 3; i++) {
        light.is_disc = i == 2;
        light.angular_radius = i == 0 ? 0 : 0.0175f;
        gn_test_stage_set_lights(&stage, &light, 1);
        gn_test_stage_render(&stage, NULL);
        sums[i] = stage.layers.virtual_rgba.data[4 * 100];
    }
    assert_int_equal(stage.report.n_lights, 32);
    assert_true(sums[0] > 0.3 && sums[1] == sums[0]); // without a disc nothing is spread
    // The mean of the directions' cosines is a little shorter: 1 - r^2 / 4.
    assert_float_equal(sums[2] / sums[0], 1 - 0.0175 * 0.0175 / 4, 2e-5);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_disc_has_the_suns_penumbra),
        cmocka_unit_test(test_a_disc_keeps_its_power),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
