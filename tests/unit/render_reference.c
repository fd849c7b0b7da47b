/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The reference against itself: grids of rays, bounces, partial maps; and the interactive quality
 * against it. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "common/thread.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static const float white[3] = {1, 1, 1};
static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint_one(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 1;
}

static void paint_lamps(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    static const double lamps[2][3] = {{0.6, 0, 0.8}, {-0.48, 0.36, 0.8}};
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0.5f;
    for (int i = 0; i < 2; i++) {
        double c = dir[0] * lamps[i][0] + dir[1] * lamps[i][1] + dir[2] * lamps[i][2];
        if (c > 0.995)
            out_rgb[0] = out_rgb[1] = out_rgb[2] = 60;
    }
}

static void init_ball(struct gn_test_stage *stage, const float albedo[static 3], float floor_size)
{
    const double eye[3] = {0.6, -3, 1.6};
    const double target[3] = {0, 0, 0.3};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(floor_size, 4), 0, 0, 0,
                      GN_MATERIAL_DIFFUSE, albedo);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.4f, 32), 0, 0, 0.6,
                      GN_MATERIAL_DIFFUSE, albedo);
    gn_test_stage_commit(stage, 2);
    gn_test_stage_aim(stage, 32, 24, 27, eye, target);
}

static void test_adaptive_grid_is_as_good_as_a_full_one(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_ball(&stage, grey, 6);
    gn_test_stage_set_map(&stage, 96, 48, paint_lamps, NULL);
    struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE, .supersample_all = true};
    gn_test_stage_render(&stage, &options);
    size_t n = (size_t)stage.layers.width * (size_t)stage.layers.height;
    assert_int_equal(stage.report.n_refined_pixels, n);
    struct gn_layers full = stage.layers;
    memset(&stage.layers, 0, sizeof(stage.layers));
    options.supersample_all = false;
    gn_test_stage_render(&stage, &options);
    assert_true(stage.report.n_refined_pixels > 50);
    assert_true((size_t)stage.report.n_refined_pixels < n / 2);
    double sum = 0;
    double largest = 0;
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < 3; k++) {
            double d = fabs(full.shadow.data[3 * i + k] - stage.layers.shadow.data[3 * i + k]);
            d = fmax(d, fabs(full.virtual_rgba.data[4 * i + k] -
                             stage.layers.virtual_rgba.data[4 * i + k]));
            sum += d;
            largest = fmax(largest, d);
        }
        assert_float_equal(full.virtual_rgba.data[4 * i + 3],
                           stage.layers.virtual_rgba.data[4 * i + 3], 0);
    }
    print_message("# %lld of %zu pixels refined: off by %.2g on average, %.2g at most\n",
                  (long long)stage.report.n_refined_pixels, n, sum / (3.0 * (double)n), largest);
    assert_true(sum / (3.0 * (double)n) < 1e-3);
    gn_layers_finish(&full);
    gn_test_stage_finish(&stage);
}

static void test_single_ray_is_a_pixels_centre(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_ball(&stage, grey, 6);
    gn_test_stage_set_map(&stage, 96, 48, paint_lamps, NULL);
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality += GN_QUALITY_REFERENCE) {
        struct gn_render_options options = {.quality = (enum gn_quality)quality,
                                            .single_ray = true};
        gn_test_stage_set_lights_from_map(&stage, 8);
        gn_test_stage_render(&stage, &options);
        size_t n = (size_t)stage.layers.width * (size_t)stage.layers.height;
        assert_int_equal(stage.report.n_refined_pixels, 0);
        assert_int_equal(stage.report.rays_primary, n);
        for (size_t i = 0; i < n; i++) {
            float a = stage.layers.virtual_rgba.data[4 * i + 3];
            assert_true(a == 0 || a == 1);
        }
    }
    gn_test_stage_finish(&stage);
}

static void test_edges_are_covered_by_their_area(void **state)
{
    (void)state;
    // A pentagon seen from above at 20 px per m: the sum of coverage is its area.
    const double expected = 400 * 2.5 * 0.49 * sin(2 * M_PI / 5);
    struct gn_test_stage stage = {0};
    const double eye[3] = {0.01, 0.02, 4};
    const double target[3] = {0.01, 0.02, 0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_disc(0.7f, 5), 0, 0, 0,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_one, NULL);
    gn_test_stage_set_lights_from_map(&stage, 1);
    gn_test_stage_aim(&stage, 64, 64, 80, eye, target);
    // No edge along the pixels' rows or columns.
    const struct gn_pose roll = {.rotation = {cos(0.15), 0, 0, sin(0.15)}};
    gn_pose_multiply(&stage.camera.world_from_camera, &roll, &stage.camera.world_from_camera);
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality += GN_QUALITY_REFERENCE) {
        const struct gn_render_options options = {.quality = (enum gn_quality)quality};
        double area = 0;
        int n_partial = 0;
        gn_test_stage_render(&stage, &options);
        for (int i = 0; i < 64 * 64; i++) {
            double a = stage.layers.virtual_rgba.data[4 * i + 3];
            area += a;
            n_partial += a > 0 && a < 1;
        }
        print_message("# quality %d: %.2f px covered, %d in part\n", quality, area, n_partial);
        assert_float_equal(area, expected, 1.5);
        assert_true(n_partial > 60);
    }
    gn_test_stage_finish(&stage);
}

static void test_white_furnace(void **state)
{
    (void)state;
    // All albedos 1 under a constant map of radiance 1: whatever is seen has radiance 1. So
    // virtual = 1, and shadow * B + added = 1 with B = 1 of the floor alone.
    struct gn_test_stage stage = {0};
    init_ball(&stage, white, 2);
    gn_test_stage_set_map(&stage, 32, 16, paint_one, NULL);
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .bounces = 16, .paths_per_pixel = 128, .seed = 3};
    gn_test_stage_render(&stage, &options);
    double virtual_sum = 0;
    double real_sum = 0;
    double n_virtual = 0;
    double n_real = 0;
    float darkest = 1;
    for (int y = 0; y < stage.layers.height; y++) {
        for (int x = 0; x < stage.layers.width; x++) {
            const float *rgba = gn_image_at(&stage.layers.virtual_rgba, x, y);
            if (rgba[3] == 1) {
                virtual_sum += rgba[1];
                n_virtual++;
            } else if (rgba[3] == 0 && isfinite(*gn_image_at(&stage.layers.depth, x, y))) {
                const float *shadow = gn_image_at(&stage.layers.shadow, x, y);
                real_sum += shadow[1] + gn_image_at(&stage.layers.added, x, y)[1];
                darkest = fminf(darkest, shadow[1]);
                n_real++;
            }
        }
    }
    print_message("# furnace: virtual %.4f over %.0f px, real %.4f over %.0f px, darkest %.3f\n",
                  virtual_sum / n_virtual, n_virtual, real_sum / n_real, n_real, darkest);
    assert_true(n_virtual > 20 && n_real > 100);
    // One path has a variance of order 1, so the means have 1 / sqrt(128 n) = 0.02 and less.
    assert_float_equal(virtual_sum / n_virtual, 1, 0.02);
    assert_float_equal(real_sum / n_real, 1, 0.02);
    assert_true(darkest < 0.8f); // what is added makes up for a shadow
    gn_test_stage_finish(&stage);
}

/** What frames say together that ask a part of the pixels each: all of them once. */
static double estimate_in_parts(struct gn_test_stage *stage)
{
    struct gn_error_sums sums[GN_ERROR_PARTS];
    int n = 0, n_whole = stage->report.error.n;
    for (int i = 0; i < GN_ERROR_PARTS; i++) {
        gn_test_stage_render(stage, &(struct gn_render_options){.single_ray = true,
                                                                .estimate_error = true,
                                                                .estimate_parts = GN_ERROR_PARTS,
                                                                .estimate_part = i});
        sums[i] = stage->report.error;
        n += sums[i].n;
    }
    // Which pixels are affected is found by directions of each part's own.
    assert_in_range(n, n_whole - n_whole / 10, n_whole + n_whole / 10);
    return gn_error_sums_get(sums, GN_ERROR_PARTS);
}

static void test_many_lights_tend_to_the_reference(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_ball(&stage, grey, 6);
    gn_test_stage_set_map(&stage, 96, 48, paint_lamps, NULL);
    const struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE, .single_ray = true};
    gn_test_stage_render(&stage, &options);
    struct gn_layers reference = stage.layers;
    double rms[2];
    memset(&stage.layers, 0, sizeof(stage.layers));
    static const int sides[2] = {12, 2};
    for (int i = 0; i < 2; i++) {
        gn_test_stage_set_lights_from_map(&stage, sides[i]);
        gn_test_stage_render(
            &stage, &(struct gn_render_options){.single_ray = true, .estimate_error = true});
        double sum = 0;
        int n = 0;
        for (int p = 0; p < 32 * 24; p++) {
            double a = reference.shadow.data[3 * p];
            double b = stage.layers.shadow.data[3 * p];
            if (a > 0.995 && b > 0.995)
                continue;
            sum += (a - b) * (a - b);
            n++;
        }
        rms[i] = sqrt(sum / n);
        print_message("# %d lights: shadow off by %.4f RMS over %d px, estimated %.4f\n",
                      stage.report.n_lights, rms[i], n, stage.report.estimated_error);
        assert_true(stage.report.estimated_error > rms[i] / 1.5);
        assert_true(stage.report.estimated_error < rms[i] * 1.5);
        double in_parts = estimate_in_parts(&stage);
        print_message("# in %d parts %.4f\n", GN_ERROR_PARTS, in_parts);
        assert_true(in_parts > rms[i] / 1.5 && in_parts < rms[i] * 1.5);
    }
    assert_true(rms[1] < 0.02 && 2 * rms[1] < rms[0]);
    gn_layers_finish(&reference);
    gn_test_stage_finish(&stage);
}

static void test_a_coarse_constant_map_is_exact(void **state)
{
    (void)state;
    // The horizon of z = 0 runs along the texels' edges: their moments add up to pi, however few.
    struct gn_test_stage stage = {0};
    const double eye[3] = {1, 2, 3};
    const double target[3] = {0, 0, 0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(4, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_aim(&stage, 9, 9, 90, eye, target);
    const struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE};
    static const int widths[3] = {8, 32, 512};
    for (int i = 0; i < 3; i++) {
        gn_test_stage_set_map(&stage, widths[i], widths[i] / 2, paint_one, NULL);
        gn_test_stage_render(&stage, &options);
        assert_float_equal(gn_image_at(&stage.layers.virtual_rgba, 4, 4)[1], 0.5, 1e-5);
    }
    gn_test_stage_finish(&stage);
}

/** A frame of hours. */
static void render_for_hours(void *context)
{
    struct gn_test_stage *stage = context;
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .bounces = 16, .paths_per_pixel = 4096};
    int ret = gn_renderer_render(stage->renderer, &stage->camera, &stage->state, &options,
                                 &stage->layers, &stage->report, NULL);
    stage->report.n_lights = -ret;
}

static void test_a_cancelled_frame_ends(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    struct gn_thread thread = {0};
    init_ball(&stage, grey, 6);
    gn_test_stage_set_map(&stage, 96, 48, paint_lamps, NULL);
    gn_test_stage_aim(&stage, 640, 480, 540, (const double[]){0.6, -3, 1.6},
                      (const double[]){0, 0, 0.3});
    assert_int_equal(gn_thread_start(&thread, "render", render_for_hours, &stage), 0);
    nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
    gn_renderer_cancel(stage.renderer);
    gn_thread_join(&thread); // or this test's time is over
    assert_int_equal(stage.report.n_lights, ECANCELED);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_adaptive_grid_is_as_good_as_a_full_one),
        cmocka_unit_test(test_single_ray_is_a_pixels_centre),
        cmocka_unit_test(test_edges_are_covered_by_their_area),
        cmocka_unit_test(test_a_coarse_constant_map_is_exact),
        cmocka_unit_test(test_white_furnace),
        cmocka_unit_test(test_many_lights_tend_to_the_reference),
        cmocka_unit_test(test_a_cancelled_frame_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
