/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The shadow factor against closed forms and plain geometry. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "tests/meshes.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const struct gn_render_options reference = {.quality = GN_QUALITY_REFERENCE};
static const struct gn_render_options interactive = {.quality = GN_QUALITY_INTERACTIVE};

static void paint_white(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 2;
}

static void add_floor(struct gn_test_stage *stage)
{
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(20, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
}

/** n lights of one sky, spread evenly: a Fibonacci lattice. */
static void set_even_lights(struct gn_test_stage *stage, int n)
{
    struct gn_light lights[GN_LIGHTS_MAX] = {0};
    for (int i = 0; i < n; i++) {
        double z = 1 - (2 * i + 1.0) / n;
        double phi = i * M_PI * (3 - sqrt(5));
        lights[i].dir_world[0] = (float)(sqrt(1 - z * z) * cos(phi));
        lights[i].dir_world[1] = (float)(sqrt(1 - z * z) * sin(phi));
        lights[i].dir_world[2] = (float)z;
        for (int k = 0; k < 3; k++)
            lights[i].irradiance[k] = (float)(2 * 4 * M_PI / n);
    }
    gn_test_stage_set_lights(stage, lights, n);
}

/** The factor at the pixel in the middle of a 9 x 9 picture that looks at the origin. */
static float render_foot(struct gn_test_stage *stage, const struct gn_render_options *options)
{
    const double eye[3] = {4, 0.3, 0.5};
    const double foot[3] = {0, 0, 0};
    gn_test_stage_aim(stage, 9, 9, 4000, eye, foot);
    gn_test_stage_render(stage, options);
    return gn_image_at(&stage->layers.shadow, 4, 4)[1];
}

/** Reference and interactive at the foot of an object at height h under a constant sky. */
static void check_foot(struct gn_mesh mesh, double h, double expected)
{
    // The map's axis is not the object's: rings of texels would be hidden or not as one.
    struct gn_test_stage stage = {.world_from_probe = {0.8, 0.48, 0.36, 0}};
    add_floor(&stage);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, mesh, 0, 0, h, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 2);
    gn_test_stage_set_map(&stage, 512, 256, paint_white, NULL);
    set_even_lights(&stage, 1024); // half of them above the floor
    double value = render_foot(&stage, &reference);
    print_message("# foot: reference %.5f, expected %.5f\n", value, expected);
    assert_float_equal(value, expected, 1e-3);
    value = render_foot(&stage, &interactive);
    print_message("# foot: interactive %.5f\n", value);
    assert_float_equal(value, expected, 0.02);
    gn_test_stage_finish(&stage);
}

static void test_sphere_over_plane(void **state)
{
    (void)state;
    // 1 - (a / h)^2: a cosine-weighted sphere wholly above the plane, 25280 triangles.
    check_foot(gn_test_make_sphere(0.5f, 80), 1.2, 1 - 0.25 / 1.44);
}

static void test_disc_over_plane(void **state)
{
    (void)state;
    // Blocked share a^2 / (a^2 + h^2): the form factor of a parallel disc on its axis.
    check_foot(gn_test_make_disc(0.6f, 720), 0.9, 1 - 0.36 / (0.36 + 0.81));
}

/** One bright texel around a direction at 45 degrees. */
static void paint_lamp(void *context, const double dir[static 3], float out_rgb[static 3])
{
    const double *lamp = context;
    double c = dir[0] * lamp[0] + dir[1] * lamp[1] + dir[2] * lamp[2];
    for (int k = 0; k < 3; k++)
        out_rgb[k] = c > 0.99999 ? (float)(1000 * (k + 1)) : 0;
}

static void init_lamp(struct gn_test_stage *stage, const double texel[static 2])
{
    struct gn_projection projection = {.type = GN_PROJECTION_LATLONG, .width = 512, .height = 256};
    double lamp[3];
    assert_int_equal(gn_projection_init(&projection, NULL), 0);
    assert_true(gn_projection_get_direction(&projection, texel[0], texel[1], lamp));
    gn_test_stage_set_map(stage, 512, 256, paint_lamp, lamp);
    gn_test_stage_set_lights_from_map(stage, 1);
    assert_int_equal(stage->state.n_lights, 1);
}

static void check_hard_shadow(struct gn_test_stage *stage, const struct gn_render_options *options)
{
    const float *d = stage->lights[0].dir_world;
    int n[2] = {0};
    gn_test_stage_render(stage, options);
    for (int y = 0; y < stage->camera.height; y++) {
        for (int x = 0; x < stage->camera.width; x++) {
            double p[3];
            if (gn_image_at(&stage->layers.virtual_rgba, x, y)[3] > 0)
                continue;
            gn_test_stage_get_point(stage, x + 0.5, y + 0.5, 0, p);
            // Where the ray to the lamp passes the square's height of 1 m; 4 cm of doubt for the
            // texel's size and the pixel's.
            double u = fmax(fabs(p[0] + d[0] / d[2]), fabs(p[1] + d[1] / d[2]));
            const float *shadow = gn_image_at(&stage->layers.shadow, x, y);
            for (int k = 0; k < 3 && fabs(u - 0.4) > 0.04; k++)
                assert_float_equal(shadow[k], u < 0.4 ? 0 : 1, 0);
            n[u < 0.4]++;
        }
    }
    assert_true(n[0] > 1000 && n[1] > 500);
}

static void test_one_texel_throws_a_hard_shadow(void **state)
{
    (void)state;
    static const double texels[2][2] = {{100.5, 64.5}, {400.5, 50.5}};
    static const struct gn_render_options seed = {.quality = GN_QUALITY_SEED};
    for (int i = 0; i < 2; i++) {
        struct gn_test_stage stage = {0};
        const double eye[3] = {0.3, 0.2, 6};
        const double target[3] = {0.3, 0.2, 0};
        add_floor(&stage);
        gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(0.8f, 1), 0, 0, 1,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_commit(&stage, 2);
        init_lamp(&stage, texels[i]);
        gn_test_stage_aim(&stage, 160, 120, 240, eye, target);
        check_hard_shadow(&stage, &reference);
        check_hard_shadow(&stage, &interactive);
        check_hard_shadow(&stage, &seed);
        gn_test_stage_finish(&stage);
    }
}

/** A floor, a real wall at x = 1 and a virtual cube between it and the middle. */
static void init_wall(struct gn_test_stage *stage)
{
    const double eye[3] = {-2, -3, 4};
    const double target[3] = {0, 0, 0};
    add_floor(stage);
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.1f, 8, 6), 1, 0, 3, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_cube(0.4f), 0.3, 0, 0.25,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(stage, 2);
    gn_test_stage_set_map(stage, 16, 8, paint_white, NULL);
    gn_test_stage_aim(stage, 64, 48, 60, eye, target);
}

static float get_smallest_factor(const struct gn_test_stage *stage, int channel)
{
    float smallest = 1;
    for (int i = 0; i < stage->layers.width * stage->layers.height; i++)
        smallest = fminf(smallest, stage->layers.shadow.data[3 * i + channel]);
    return smallest;
}

static void test_real_shadow_is_not_darkened_twice(void **state)
{
    (void)state;
    // From +x at 30 degrees: the wall keeps it from all the floor before it.
    static const struct gn_light lights[2] = {
        {.dir_world = {0.8660254f, 0, 0.5f}, .irradiance = {1, 1, 1}},
        {.dir_world = {0, 0, 1}, .irradiance = {1, 1, 1}},
    };
    struct gn_render_options options = {0};
    struct gn_test_stage stage = {0};
    init_wall(&stage);
    gn_test_stage_set_lights(&stage, lights, 1);
    gn_test_stage_render(&stage, &options);
    assert_float_equal(get_smallest_factor(&stage, 0), 1, 0);
    assert_int_equal(stage.report.n_shadow_pixels, 0);
    options.shadow_ignore_real = true; // the paper's reading darkens it all the same
    gn_test_stage_render(&stage, &options);
    assert_float_equal(get_smallest_factor(&stage, 0), 0, 0);
    options.shadow_ignore_real = false; // and the light that is there is still cut
    gn_test_stage_set_lights(&stage, lights, 2);
    gn_test_stage_render(&stage, &options);
    assert_float_equal(get_smallest_factor(&stage, 0), 0, 0);
    gn_test_stage_finish(&stage);
}

static void test_channels_without_light_stay(void **state)
{
    (void)state;
    static const struct gn_light lights[2] = {
        {.dir_world = {0, 0.6f, 0.8f}, .irradiance = {3, 0, 0}},
        {.dir_world = {0, 0.6f, -0.8f}, .irradiance = {0, 5, 0}}, // from below the floor
    };
    for (int quality = GN_QUALITY_INTERACTIVE; quality <= GN_QUALITY_SEED; quality++) {
        struct gn_render_options options = {.quality = (enum gn_quality)quality};
        struct gn_test_stage stage = {0};
        init_wall(&stage);
        gn_test_stage_set_lights(&stage, lights, 2);
        gn_test_stage_render(&stage, &options);
        assert_float_equal(get_smallest_factor(&stage, 0), 0, 0);
        assert_float_equal(get_smallest_factor(&stage, 1), 1, 0);
        assert_float_equal(get_smallest_factor(&stage, 2), 1, 0);
        gn_test_stage_set_lights(&stage, lights, 0); // an all-black map gives none
        gn_test_stage_render(&stage, &options);
        assert_float_equal(get_smallest_factor(&stage, 0), 1, 0);
        gn_test_stage_finish(&stage);
    }
}

static void test_weights(void **state)
{
    (void)state;
    // Under the cube's middle: the light from above is cut, the one from -x at 30 degrees is not.
    static const struct gn_light lights[2] = {
        {.dir_world = {0, 0, 1}, .irradiance = {2, 2, 2}},
        {.dir_world = {-0.8660254f, 0, 0.5f}, .irradiance = {1, 1, 1}},
    };
    struct gn_test_stage stage = {0};
    add_floor(&stage);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(0.4f, 1), 0, 0, 1,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_white, NULL);
    gn_test_stage_set_lights(&stage, lights, 2);
    assert_float_equal(render_foot(&stage, &interactive), 1 - 2.0 / 2.5, 1e-6);
    const struct gn_render_options unweighted = {.shadow_unweighted = true};
    assert_float_equal(render_foot(&stage, &unweighted), 1 - 2.0 / 3.0, 1e-6);
    const struct gn_render_options seed = {.quality = GN_QUALITY_SEED};
    assert_float_equal(render_foot(&stage, &seed), 1 - 2.0 / 3.0, 1e-6);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere_over_plane),
        cmocka_unit_test(test_disc_over_plane),
        cmocka_unit_test(test_one_texel_throws_a_hard_shadow),
        cmocka_unit_test(test_real_shadow_is_not_darkened_twice),
        cmocka_unit_test(test_channels_without_light_stay),
        cmocka_unit_test(test_weights),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
