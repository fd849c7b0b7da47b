/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What virtual objects look like: light, mirrors, what hides them, where the camera sees them. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "tests/meshes.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const float green[3] = {0.25f, 0.75f, 0.5f};
static const double origin[3] = {0, 0, 0};

static void paint_sky(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = 1;
    out_rgb[1] = 2;
    out_rgb[2] = 3;
}

static void check_pixel(const struct gn_test_stage *stage, int x, int y, double r, double g,
                        double b, double tolerance)
{
    const float *p = gn_image_at(&stage->layers.virtual_rgba, x, y);
    assert_float_equal(p[0], r, tolerance * r);
    assert_float_equal(p[1], g, tolerance * g);
    assert_float_equal(p[2], b, tolerance * b);
    assert_float_equal(p[3], 1, 0);
}

static void test_constant_map_gives_albedo_times_radiance(void **state)
{
    (void)state;
    // E = pi L on a plane that sees the whole hemisphere, so its radiance is albedo L; tilted by
    // the camera's side only, the plane is flat.
    struct gn_test_stage stage = {0};
    const double eye[3] = {1, 2, 3};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(4, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      green);
    gn_test_stage_commit(&stage, 2);
    gn_test_stage_set_map(&stage, 256, 128, paint_sky, NULL);
    gn_test_stage_set_lights_from_map(&stage, 4);
    gn_test_stage_aim(&stage, 9, 9, 90, eye, origin);
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
        const struct gn_render_options options = {.quality = (enum gn_quality)quality};
        gn_test_stage_render(&stage, &options);
        check_pixel(&stage, 4, 4, 0.25, 1.5, 1.5, quality == GN_QUALITY_REFERENCE ? 1e-3 : 0.02);
        // Nothing is above the plane.
        assert_int_equal(stage.report.rays_shade, 0);
    }
    const struct gn_render_options irradiance = {.shading = GN_SHADING_IRRADIANCE};
    gn_test_stage_render(&stage, &irradiance);
    check_pixel(&stage, 4, 4, 0.25, 1.5, 1.5, 1e-3);
    assert_int_equal(stage.report.rays_shade, 0);
    stage.state.has_sh = false;
    struct gn_error error = {0};
    assert_int_equal(gn_renderer_render(stage.renderer, &stage.camera, &stage.state, &irradiance,
                                        &stage.layers, &stage.report, &error),
                     -EINVAL);
    assert_non_null(strstr(error.text, "SH"));
    gn_test_stage_finish(&stage);
}

static void test_real_and_virtual_objects_shade_virtual_ones(void **state)
{
    (void)state;
    // One light from above; a real and a virtual square each keep it from half of a virtual floor.
    static const struct gn_light light = {.dir_world = {0, 0, 1}, .irradiance = {1, 1, 1}};
    struct gn_test_stage stage = {0};
    const double eye[3] = {0, -8, 2};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(6, 1), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(0.5f, 1), -1, 0, 2.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(0.5f, 1), 1, 0, 2.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_sky, NULL);
    gn_test_stage_set_lights(&stage, &light, 1);
    for (int i = -1; i <= 1; i++) {
        const double target[3] = {i, 0, 0};
        gn_test_stage_aim(&stage, 5, 5, 2000, eye, target);
        gn_test_stage_render(&stage, NULL);
        double expected = i == 0 ? 0.5 / M_PI : 0;
        assert_float_equal(gn_image_at(&stage.layers.virtual_rgba, 2, 2)[0], expected, 1e-6);
        assert_float_equal(gn_image_at(&stage.layers.virtual_rgba, 2, 2)[3], 1, 0);
    }
    gn_test_stage_finish(&stage);
}

static void test_real_objects_hide_virtual_ones(void **state)
{
    (void)state;
    // A real box before the left half of a virtual wall; the floor far behind gives the depth.
    struct gn_test_stage stage = {0};
    const double eye[3] = {0, 0, 10};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(4, 1), 0, 0, 2, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_box(2, 4, 1), -1, 0, 3.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_sky, NULL);
    gn_test_stage_set_lights_from_map(&stage, 1);
    gn_test_stage_aim(&stage, 40, 40, 60, eye, origin);
    gn_test_stage_render(&stage, NULL);
    int n[2] = {0};
    for (int y = 10; y < 30; y++) {
        for (int x = 10; x < 30; x++) {
            double p[3];
            gn_test_stage_get_point(&stage, x + 0.5, y + 0.5, 4, p);
            if (fabs(p[0]) < 0.15)
                continue; // the edge
            float a = gn_image_at(&stage.layers.virtual_rgba, x, y)[3];
            float depth = *gn_image_at(&stage.layers.depth, x, y);
            assert_float_equal(a, p[0] > 0, 0);
            assert_float_equal(depth, p[0] > 0 ? 8 : 6, 1e-5);
            n[p[0] > 0]++;
        }
    }
    assert_true(n[0] > 100 && n[1] > 100);
    assert_true(isinf(*gn_image_at(&stage.layers.depth, 0, 0)));
    gn_test_stage_finish(&stage);
}

/** A patch of 7 x 7 degrees about the direction is bright. */
static void paint_patch(void *context, const double dir[static 3], float out_rgb[static 3])
{
    const double *middle = context;
    double c = dir[0] * middle[0] + dir[1] * middle[1] + dir[2] * middle[2];
    for (int k = 0; k < 3; k++)
        out_rgb[k] = c > cos(3.5 * M_PI / 180) ? (float)(k + 1) : 0;
}

static void test_mirror_reflects_the_map_and_the_scene(void **state)
{
    (void)state;
    // The camera looks down on a mirror in z = 0 along (-3, 1, -2): it sees (-3, 1, 2).
    double middle[3] = {-3 / sqrt(14), 1 / sqrt(14), 2 / sqrt(14)};
    static const struct gn_light light = {.dir_world = {0, 0, 1}, .irradiance = {M_PI, M_PI, M_PI}};
    const double eye[3] = {3, -1, 2};
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality += GN_QUALITY_REFERENCE) {
        const struct gn_render_options options = {.quality = (enum gn_quality)quality};
        struct gn_test_stage stage = {0};
        gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(8, 1), 0, 0, 0,
                          GN_MATERIAL_MIRROR, green);
        gn_test_stage_commit(&stage, 0);
        gn_test_stage_set_map(&stage, 720, 360, paint_patch, middle);
        gn_test_stage_set_lights(&stage, &light, 1);
        gn_test_stage_aim(&stage, 41, 41, 100, eye, origin);
        gn_test_stage_render(&stage, &options);
        check_pixel(&stage, 20, 20, 0.25, 1.5, 1.5, 1e-5);
        check_pixel(&stage, 15, 20, 0.25, 1.5, 1.5, 1e-5); // 2.9 degrees beside it
        check_pixel(&stage, 11, 20, 0, 0, 0, 1e-5);        // 5.1 degrees
        check_pixel(&stage, 20, 29, 0, 0, 0, 1e-5);
        assert_true(stage.report.rays_mirror > 0);
        gn_test_stage_finish(&stage);
    }
    // Through a second mirror at x = -3 the ray comes back to a real diffuse floor square.
    struct gn_test_stage stage = {0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(2, 1), 0, 0, 0, GN_MATERIAL_MIRROR,
                      green);
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(2, 1), -3, 1, 2, GN_MATERIAL_DIFFUSE,
                      green);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 720, 360, paint_patch, middle);
    static const struct gn_light below = {.dir_world = {0, 0.6f, -0.8f},
                                          .irradiance = {M_PI, M_PI, M_PI}};
    gn_test_stage_set_lights(&stage, &below, 1);
    gn_test_stage_aim(&stage, 5, 5, 100, eye, origin);
    gn_test_stage_render(&stage, NULL);
    // albedo of the mirror x albedo of the square's lower side x cosine
    check_pixel(&stage, 2, 2, 0.0625 * 0.8, 0.5625 * 0.8, 0.25 * 0.8, 1e-5);
    gn_test_stage_finish(&stage);
}

static void test_mirrors_end(void **state)
{
    (void)state;
    // Inside a mirrored box a ray never leaves; after its last reflection it takes the map's light.
    static const float white[3] = {1, 1, 1};
    struct gn_test_stage stage = {0};
    const double eye[3] = {0.1, 0.2, 0.3};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_cube(2), 0, 0, 0, GN_MATERIAL_MIRROR,
                      white);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_sky, NULL);
    gn_test_stage_aim(&stage, 16, 16, 10, eye, origin);
    gn_test_stage_render(&stage, NULL);
    for (int i = 0; i < 16; i++)
        check_pixel(&stage, i, i, 1, 2, 3, 1e-5);
    gn_test_stage_finish(&stage);
}

/** Coverage-weighted middle of the virtual object, px. */
static double get_middle(const struct gn_test_stage *stage, double out_xy[static 2])
{
    double sum = 0;
    out_xy[0] = out_xy[1] = 0;
    for (int y = 0; y < stage->layers.height; y++) {
        for (int x = 0; x < stage->layers.width; x++) {
            double a = gn_image_at(&stage->layers.virtual_rgba, x, y)[3];
            sum += a;
            out_xy[0] += a * (x + 0.5);
            out_xy[1] += a * (y + 0.5);
        }
    }
    out_xy[0] /= sum;
    out_xy[1] /= sum;
    return sum;
}

static void test_distortion_moves_the_object_as_the_lens_does(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    const double eye[3] = {0, 0, 3};
    const double target[3] = {0.8, 0.6, 0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.03f, 32), 1.6, 1.2, 0.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 2);
    gn_test_stage_set_map(&stage, 16, 8, paint_sky, NULL);
    gn_test_stage_set_lights_from_map(&stage, 1);
    gn_test_stage_aim(&stage, 320, 240, 260, eye, target);
    static const double lens[5] = {-0.25, 0.08, 1e-3, -2e-3, 0};
    double ideal[2];
    for (int distorted = 0; distorted < 2; distorted++) {
        double middle[2];
        double expected[2];
        double in_camera[3];
        struct gn_pose camera_from_world;
        const double ball[3] = {1.6, 1.2, 0.5};
        if (distorted)
            memcpy(stage.camera.distortion, lens, sizeof(lens));
        gn_pose_invert(&stage.camera.world_from_camera, &camera_from_world);
        gn_pose_transform(&camera_from_world, ball, in_camera);
        assert_true(gn_camera_project(&stage.camera, in_camera, expected));
        gn_test_stage_render(&stage, NULL);
        assert_true(get_middle(&stage, middle) > 15);
        assert_float_equal(middle[0], expected[0], 0.1);
        assert_float_equal(middle[1], expected[1], 0.1);
        if (!distorted)
            memcpy(ideal, middle, sizeof(ideal));
        else
            assert_true(hypot(middle[0] - ideal[0], middle[1] - ideal[1]) > 1);
    }
    gn_test_stage_finish(&stage);
}

static void test_depth_is_at_the_centre_of_the_pixel(void **state)
{
    (void)state;
    // A floor seen aslant: half a pixel aside its depth differs by some parts in a thousand.
    struct gn_test_stage stage = {0};
    const double eye[3] = {1, 2, 3};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(20, 1), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_commit(&stage, 2);
    gn_test_stage_set_map(&stage, 16, 8, paint_sky, NULL);
    gn_test_stage_aim(&stage, 40, 30, 60, eye, origin);
    gn_test_stage_render(&stage, NULL);
    for (int y = 0; y < 30; y++) {
        for (int x = 0; x < 40; x++) {
            double p[3];
            gn_test_stage_get_point(&stage, x + 0.5, y + 0.5, 0, p);
            double along = 0; // the camera's z is from the eye to the origin
            for (int k = 0; k < 3; k++)
                along -= (p[k] - eye[k]) * eye[k] / sqrt(14);
            assert_float_equal(*gn_image_at(&stage.layers.depth, x, y) / along, 1, 1e-5);
        }
    }
    gn_test_stage_finish(&stage);
}

static void paint_lamps(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    for (int k = 0; k < 3; k++)
        out_rgb[k] =
            (float)(0.2 + (dir[2] > 0.6 && dir[0] > 0.3 ? 10 : 0) + (dir[1] < -0.8 ? 3 : 0));
}

/** Coverage of the finer picture's 3 x 3 pixels, and the sum of squares of what the pixel is off
 * from their mean. */
static double compare_pixel(const struct gn_test_stage *coarse, const struct gn_test_stage *fine,
                            int x, int y)
{
    const float *rgba = gn_image_at(&coarse->layers.virtual_rgba, x, y);
    double mean[4] = {0};
    double sum = 0;
    for (int i = 0; i < 9; i++) {
        const float *part = gn_image_at(&fine->layers.virtual_rgba, 3 * x + i % 3, 3 * y + i / 3);
        for (int k = 0; k < 4; k++)
            mean[k] += part[k] / 9.0;
    }
    assert_float_equal(rgba[3], mean[3], 1e-6);
    for (int k = 0; k < 3; k++)
        sum += ((double)rgba[k] - mean[k]) * ((double)rgba[k] - mean[k]);
    return sum;
}

/** The grid's rays are the centres of a picture three times as fine, so that picture is what they
 * show, had each its own light. */
static void test_grids_share_their_light(void **state)
{
    (void)state;
    struct gn_test_stage stages[2] = {{0}};
    const double eye[3] = {1.3, -1.6, 1.2};
    for (int i = 0; i < 2; i++) {
        struct gn_test_stage *stage = &stages[i];
        gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 24), 0, 0, 0.1,
                          GN_MATERIAL_DIFFUSE, green);
        gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_box(0.2f, 0.2f, 0.5f), 0.35, -0.2, 0.1,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_commit(stage, 2);
        gn_test_stage_set_map(stage, 32, 16, paint_lamps, NULL);
        gn_test_stage_set_lights_from_map(stage, 1);
        gn_test_stage_aim(stage, i ? 216 : 72, i ? 216 : 72, i ? 540 : 180, eye, origin);
    }
    const struct gn_render_options grids = {.supersample_all = true};
    const struct gn_render_options centres = {.single_ray = true};
    gn_test_stage_render(&stages[0], &grids);
    gn_test_stage_render(&stages[1], &centres);
    uint64_t rays = stages[0].report.rays_shade;
    uint64_t all = stages[1].report.rays_shade;
    double sum = 0;
    double most = 0;
    double brightest = 0;
    int n = 0;
    for (int i = 0; i < 72 * 72; i++) {
        const float *rgba = gn_image_at(&stages[0].layers.virtual_rgba, i % 72, i / 72);
        double square = compare_pixel(&stages[0], &stages[1], i % 72, i / 72);
        n += rgba[3] > 0;
        sum += square;
        most = fmax(most, sqrt(square / 3));
        brightest = fmax(brightest, rgba[1]);
    }
    double error = sqrt(sum / (3 * n)) / brightest;
    print_message("# %d pixels, %llu of %llu rays, off by %.2g of the brightest, most %.2g\n", n,
                  (unsigned long long)rays, (unsigned long long)all, error, most / brightest);
    assert_true(n > 2000);
    assert_true(4 * rays < 3 * all);
    assert_true(error < 0.002 && most < 0.03 * brightest);
    for (int i = 0; i < 2; i++)
        gn_test_stage_finish(&stages[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_is_at_the_centre_of_the_pixel),
        cmocka_unit_test(test_constant_map_gives_albedo_times_radiance),
        cmocka_unit_test(test_real_and_virtual_objects_shade_virtual_ones),
        cmocka_unit_test(test_real_objects_hide_virtual_ones),
        cmocka_unit_test(test_mirror_reflects_the_map_and_the_scene),
        cmocka_unit_test(test_mirrors_end),
        cmocka_unit_test(test_grids_share_their_light),
        cmocka_unit_test(test_distortion_moves_the_object_as_the_lens_does),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
