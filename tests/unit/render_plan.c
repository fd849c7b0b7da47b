/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What the plan leaves out changes no bit and does no work; the same bits on any number of threads;
 * no memory is taken once warm; what is refused. Under sanitizers fewer of the pictures that need
 * many rays or are drawn by lot. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/allocations.h"
#include "tests/meshes.h"
#include "tests/sanitized.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.4f, 0.3f};

static void paint_room(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    for (int k = 0; k < 3; k++)
        out_rgb[k] = (float)(1 + 0.5 * dir[k] + (dir[2] > 0.7 && dir[k] > 0.3 ? 20 : 0));
}

enum { FLAT_FLOOR = 1, BOX = 2, BALL = 4, MIRROR = 8, ALL_THINGS = 15 };

static void init_stage(struct gn_test_stage *stage, int things, int n_threads)
{
    const double eye[3] = {0.5, -3, 2};
    const double target[3] = {0, 0, 0.3};
    if (things & FLAT_FLOOR)
        gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(6, 3), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                          grey);
    if (things & BOX)
        gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.5f, 0.3f, 1), 0.7, 0.2, 0.5,
                          GN_MATERIAL_DIFFUSE, grey);
    if (things & BALL)
        gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.4f, 12), -0.2, 0, 0.5,
                          GN_MATERIAL_DIFFUSE, grey);
    if (things & MIRROR)
        gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.2f, 12), -0.9, 0, 0.3,
                          GN_MATERIAL_MIRROR, grey);
    gn_test_stage_commit(stage, n_threads);
    gn_test_stage_set_map(stage, 16, 8, paint_room, NULL);
    gn_test_stage_set_lights_from_map(stage, 2);
    gn_test_stage_aim(stage, 45, 35, 40, eye, target); // no multiple of a tile
}

static const struct gn_plan_entry *find_line(const struct gn_test_stage *stage, const char *pass)
{
    for (int i = 0; i < stage->report.n_plan; i++) {
        if (strcmp(stage->report.plan[i].pass, pass) == 0)
            return &stage->report.plan[i];
    }
    fail_msg("no line for %s", pass);
    return NULL;
}

static void assert_left_out(const struct gn_test_stage *stage, const char *pass, const char *why)
{
    const struct gn_plan_entry *line = find_line(stage, pass);
    assert_string_equal(line->why, why);
    assert_false(line->ran);
}

/** A copy of all layers' floats. */
static float *copy_layers(const struct gn_layers *layers, size_t *out_n)
{
    const struct gn_image *images[4] = {&layers->virtual_rgba, &layers->shadow, &layers->added,
                                        &layers->depth};
    size_t n_pixels = (size_t)layers->width * (size_t)layers->height;
    float *copy = malloc(11 * n_pixels * sizeof(*copy));
    assert_non_null(copy);
    *out_n = 0;
    for (int i = 0; i < 4; i++) {
        size_t n = n_pixels * (size_t)images[i]->channels;
        memcpy(copy + *out_n, images[i]->data, n * sizeof(*copy));
        *out_n += n;
    }
    return copy;
}

static void assert_same_bits(const float *a, const float *b, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (memcmp(&a[i], &b[i], sizeof(*a)) != 0)
            fail_msg("float %zu of %zu: %.9g and %.9g", i, n, (double)a[i], (double)b[i]);
    }
}

/** Renders with the omissions and without: equal bits. The report is that of the omissions. */
static void check_omissions(struct gn_test_stage *stage, struct gn_render_options options)
{
    size_t n;
    options.all_passes = true;
    gn_test_stage_render(stage, &options);
    float *all = copy_layers(&stage->layers, &n);
    struct gn_render_report full = stage->report;
    options.all_passes = false;
    gn_test_stage_render(stage, &options);
    float *some = copy_layers(&stage->layers, &n);
    assert_same_bits(all, some, n);
    assert_true(stage->report.rays_shadow <= full.rays_shadow);
    free(all);
    free(some);
}

static void test_omissions_change_nothing(void **state)
{
    (void)state;
    for (int things = 1; things <= ALL_THINGS; things++) {
        struct gn_test_stage stage = {0};
        init_stage(&stage, things, 2);
        for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
            struct gn_render_options options = {.quality = (enum gn_quality)quality};
            if (quality < GN_QUALITY_REFERENCE || things == ALL_THINGS ||
                things == (FLAT_FLOOR | BALL)) // the reference is slow
                check_omissions(&stage, options);
        }
        gn_test_stage_finish(&stage);
    }
}

/** Meshes of more triangles than clusters keep edges of, on and around each other. */
static void test_fine_meshes_change_nothing(void **state)
{
    (void)state;
    const double eye[3] = {0.5, -3, 2};
    const double target[3] = {0, 0, 0.3};
    const struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE};
    for (int fine = GN_TEST_IS_SANITIZED; fine < 2; fine++) {
        struct gn_test_stage stage = {0};
        gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(6, 3), 0, 0, 0,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_sphere(0.3f, fine ? 64 : 8), 0.6, 0.2,
                          0.2, GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.4f, fine ? 64 : 24), -0.1, 0,
                          0.5, GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_commit(&stage, 2);
        gn_test_stage_set_map(&stage, 64, 32, paint_room, NULL);
        if (GN_TEST_IS_SANITIZED)
            gn_test_stage_aim(&stage, 11, 9, 10, eye, target);
        else
            gn_test_stage_aim(&stage, 23, 17, 20, eye, target);
        check_omissions(&stage, options);
        gn_test_stage_finish(&stage);
    }
}

/** Objects that stand on the floor, on a sheet that lies on it, in and on each other. */
static void test_crowded_floors_change_nothing(void **state)
{
    (void)state;
    uint64_t seed = 17;
    uint64_t n_shadow = 0;
    for (int round = 0; round < (GN_TEST_IS_SANITIZED ? 4 : 12); round++) {
        struct gn_test_stage stage = {0};
        const double eye[3] = {2 * gn_test_random_unit(&seed) - 1, -3, 1.5};
        const double target[3] = {0, 0, 0.1};
        gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(6, 1), 0, 0, -0.0004,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(0.9f, 1), 0, 0, 0,
                          GN_MATERIAL_DIFFUSE, grey);
        for (int i = 0; i < 8; i++) {
            float size = 0.15f + 0.3f * (float)gn_test_random_unit(&seed);
            double x = 1.2 * gn_test_random_unit(&seed) - 0.6;
            double y = 1.2 * gn_test_random_unit(&seed) - 0.6;
            bool is_ball = i % 3 == 2;
            struct gn_mesh mesh =
                is_ball ? gn_test_make_sphere(size / 2, 9) : gn_test_make_box(size, size / 2, size);
            gn_test_stage_add(&stage, i % 2 ? GN_RT_REAL : GN_RT_VIRTUAL, mesh, x, y, size / 2,
                              GN_MATERIAL_DIFFUSE, grey);
        }
        gn_test_stage_commit(&stage, 2);
        gn_test_stage_set_map(&stage, 16, 8, paint_room, NULL);
        gn_test_stage_set_lights_from_map(&stage, 2);
        gn_test_stage_aim(&stage, 61, 43, 60, eye, target);
        check_omissions(&stage, (struct gn_render_options){0});
        check_omissions(&stage, (struct gn_render_options){.quality = GN_QUALITY_SEED});
        n_shadow += (uint64_t)stage.report.n_shadow_pixels;
        gn_test_stage_finish(&stage);
    }
    assert_true(n_shadow > 1000);
}

static void test_reference_asks_once_for_many_texels(void **state)
{
    (void)state;
    struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE, .all_passes = true};
    struct gn_test_stage stage = {0};
    init_stage(&stage, ALL_THINGS, 2);
    gn_test_stage_set_map(&stage, 128, 64, paint_room, NULL);
    gn_test_stage_aim(&stage, 8, 6, 7, (const double[3]){0.5, -3, 2}, (const double[3]){0, 0, 0.3});
    gn_test_stage_render(&stage, &options);
    uint64_t all = stage.report.rays_shadow + stage.report.rays_shade;
    options.all_passes = false;
    gn_test_stage_render(&stage, &options);
    uint64_t some = stage.report.rays_shadow + stage.report.rays_shade;
    print_message("# reference: %llu of %llu rays\n", (unsigned long long)some,
                  (unsigned long long)all);
    assert_true(some > 0 && 4 * some < all);
    gn_test_stage_finish(&stage);
}

static void test_culling_saves_rays(void **state)
{
    (void)state;
    struct gn_render_options options = {.all_passes = true};
    struct gn_test_stage stage = {0};
    init_stage(&stage, ALL_THINGS, 2);
    gn_test_stage_render(&stage, &options);
    uint64_t all = stage.report.rays_shadow;
    options.all_passes = false;
    gn_test_stage_render(&stage, &options);
    print_message("# shadow rays: %llu of %llu\n", (unsigned long long)stage.report.rays_shadow,
                  (unsigned long long)all);
    assert_true(stage.report.rays_shadow > 0 && 10 * stage.report.rays_shadow < all);
    gn_test_stage_finish(&stage);
}

static void test_every_reason(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_stage(&stage, FLAT_FLOOR | BOX, 0);
    gn_test_stage_render(&stage, NULL);
    assert_left_out(&stage, "shade", "the scene has no virtual object");
    assert_left_out(&stage, "mirror", "no mirror among the virtual objects");
    assert_left_out(&stage, "shadow", "the scene has no virtual object");
    assert_left_out(&stage, "refine", "no edge in view");
    assert_left_out(&stage, "added",
                    "0 bounces: nothing is added; light by way of mirrors and glass is "
                    "not followed");
    assert_int_equal(stage.report.rays_shade + stage.report.rays_shadow, 0);
    gn_test_stage_finish(&stage);

    init_stage(&stage, BALL, 0);
    gn_test_stage_render(&stage, NULL);
    assert_left_out(&stage, "shadow", "the scene has no real object to receive one");
    assert_true(find_line(&stage, "shade")->ran);
    // No part of a ball hides light from another.
    assert_int_equal(stage.report.rays_shadow + stage.report.rays_shade, 0);
    gn_test_stage_finish(&stage);

    init_stage(&stage, FLAT_FLOOR | BALL, 0);
    gn_test_stage_render(&stage, NULL);
    assert_left_out(&stage, "blockers",
                    "the real geometry is one plane: it hides no light from itself");
    assert_true(find_line(&stage, "shadow")->ran && find_line(&stage, "shade")->ran);
    const struct gn_render_options none = {.no_shadow = true};
    gn_test_stage_render(&stage, &none);
    assert_left_out(&stage, "shadow", "not asked for");
    assert_int_equal(stage.report.rays_shadow, 0);
    const struct gn_render_options irradiance = {.shading = GN_SHADING_IRRADIANCE};
    gn_test_stage_render(&stage, &irradiance);
    assert_left_out(&stage, "shade", "irradiance shading needs no loop over lights");
    assert_int_equal(stage.report.rays_shade, 0);
    // Light from below the floor cannot bring the ball's shadow onto it.
    static const struct gn_light below = {.dir_world = {0, 0.6f, -0.8f}, .irradiance = {1, 1, 1}};
    gn_test_stage_set_lights(&stage, &below, 1);
    check_omissions(&stage, (struct gn_render_options){0});
    assert_left_out(&stage, "shadow",
                    "no light throws a shadow of a virtual object onto a real one");
    assert_int_equal(stage.report.rays_shadow, 0);
    gn_test_stage_set_lights(&stage, &below, 0);
    gn_test_stage_render(&stage, NULL);
    assert_left_out(&stage, "shadow", "no light");
    gn_test_stage_finish(&stage);
}

/** Out of sight the objects hide nothing of what is behind them, and throw the shadow they did. */
static void test_objects_out_of_sight(void **state)
{
    (void)state;
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
        struct gn_test_stage stage = {0};
        init_stage(&stage, quality == GN_QUALITY_REFERENCE ? FLAT_FLOOR | BALL : ALL_THINGS, 0);
        struct gn_render_options options = {.quality = (enum gn_quality)quality,
                                            .single_ray = true};
        size_t n, n_behind = 0;
        gn_test_stage_render(&stage, &options);
        float *with = copy_layers(&stage.layers, &n);
        options.no_virtual = true;
        check_omissions(&stage, options);
        const size_t n_pixels = (size_t)stage.layers.width * (size_t)stage.layers.height;
        for (size_t i = 0; i < n_pixels; i++) {
            const float *shadow = stage.layers.shadow.data + 3 * i;
            for (int k = 0; k < 4; k++)
                assert_true(stage.layers.virtual_rgba.data[4 * i + k] == 0);
            if (with[4 * i + 3] > 0)
                n_behind += shadow[0] < 0.9f;
            else
                assert_same_bits(with + 4 * n_pixels + 3 * i, shadow, 3);
        }
        assert_true(n_behind > 5);
        assert_int_equal(stage.report.n_virtual_pixels, 0);
        assert_int_equal(stage.report.rays_shade, 0);
        assert_left_out(&stage, "shade", "not asked for");
        assert_true(find_line(&stage, "shadow")->ran);
        options.no_shadow = true;
        check_omissions(&stage, options);
        assert_int_equal(stage.report.n_shadow_pixels, 0);
        assert_left_out(&stage, "shadow", "not asked for");
        free(with);
        gn_test_stage_finish(&stage);
    }
    struct gn_test_stage alone = {0};
    init_stage(&alone, BALL, 0);
    check_omissions(&alone, (struct gn_render_options){.no_virtual = true});
    assert_int_equal(alone.report.n_virtual_pixels, 0);
    gn_test_stage_finish(&alone);
    struct gn_test_stage mirror = {0};
    gn_test_stage_add(&mirror, GN_RT_REAL, gn_test_make_plane(6, 3), 0, 0, 0, GN_MATERIAL_MIRROR,
                      grey);
    init_stage(&mirror, BALL, 0);
    gn_test_stage_render(&mirror, NULL);
    assert_true(find_line(&mirror, "optics")->ran);
    check_omissions(&mirror, (struct gn_render_options){.no_virtual = true});
    assert_left_out(&mirror, "optics", "not asked for");
    for (int i = 0; i < 3 * mirror.layers.width * mirror.layers.height; i++) {
        assert_true(mirror.layers.added.data[i] == 0);
        assert_true(mirror.layers.shadow.data[i] == 1);
    }
    gn_test_stage_finish(&mirror);
}

static void test_what_lies_outside_the_picture(void **state)
{
    (void)state;
    const double eye[3] = {0.5, -3, 2};
    const double away[3] = {2.5, -4, 0};
    const double up[3] = {0.5, -3, 9};
    struct gn_test_stage stage = {0};
    init_stage(&stage, ALL_THINGS, 0);
    gn_test_stage_aim(&stage, 45, 35, 40, eye, away);
    check_omissions(&stage, (struct gn_render_options){0});
    assert_left_out(&stage, "shade", "no virtual object in view");
    assert_left_out(&stage, "mirror", "no virtual object in view");
    assert_int_equal(stage.report.rays_shade + stage.report.rays_mirror, 0);
    gn_test_stage_aim(&stage, 45, 35, 40, eye, up);
    check_omissions(&stage, (struct gn_render_options){0});
    assert_left_out(&stage, "shadow", "no diffuse real surface in view");
    assert_int_equal(stage.report.rays_shadow, 0);
    // In the pyramid of rays but hidden by the box: found only by looking.
    const double behind[3] = {3, 0.6, 0.4};
    const double ball[3] = {-0.2, 0.1, 0.5};
    gn_test_stage_aim(&stage, 31, 31, 400, behind, ball);
    check_omissions(&stage, (struct gn_render_options){0});
    assert_left_out(&stage, "shade", "no pixel shows a diffuse virtual surface");
    gn_test_stage_finish(&stage);
}

/** Renders and holds the picture against one of a renderer that never saw another. */
static void check_kept_of(struct gn_test_stage *stage, const struct gn_render_options *options,
                          bool is_kept)
{
    struct gn_renderer *used = stage->renderer;
    size_t n;
    gn_test_stage_render(stage, options);
    struct gn_render_report report = stage->report;
    float *some = copy_layers(&stage->layers, &n);
    assert_int_equal(gn_renderer_create(stage->scene, stage->pool, &stage->renderer, NULL), 0);
    gn_test_stage_render(stage, options);
    float *fresh = copy_layers(&stage->layers, &n);
    assert_true(stage->report.rays_primary > 0);
    assert_int_equal(report.rays_primary, is_kept ? 0 : stage->report.rays_primary);
    assert_same_bits(some, fresh, n);
    gn_renderer_destroy(&stage->renderer);
    stage->renderer = used;
    stage->report = report;
    free(some);
    free(fresh);
}

static void check_kept(struct gn_test_stage *stage, bool is_kept)
{
    const struct gn_render_options options = {.single_ray = true};
    check_kept_of(stage, &options, is_kept);
}

static void test_what_rests_is_seen_once(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_stage(&stage, ALL_THINGS, 2);
    check_kept(&stage, false);
    check_kept(&stage, false); // it rests: from now on it is kept
    check_kept(&stage, true);
    assert_left_out(&stage, "primary",
                    "camera and scene rest: what the pixels' centres see is kept");
    gn_test_stage_set_lights_from_map(&stage, 1); // other lights, other shadows
    check_kept(&stage, true);
    stage.camera.world_from_camera.translation[1] += 1e-9;
    check_kept(&stage, false);
    check_kept(&stage, false);
    check_kept(&stage, true);
    stage.camera.cx += 0.25;
    check_kept(&stage, false);
    check_kept(&stage, false);
    stage.camera.world_from_camera.rotation[3] *= -1;
    check_kept(&stage, false);
    check_kept(&stage, false);
    stage.camera.width -= 7;
    check_kept(&stage, false);
    check_kept(&stage, false);
    check_kept(&stage, true);
    const struct gn_render_options unseen = {.single_ray = true, .no_virtual = true};
    check_kept_of(&stage, &unseen, false);
    check_kept(&stage, false);
    check_kept(&stage, false);
    check_kept(&stage, true);
    // Without the plan's rules every ray is traced.
    const struct gn_render_options all = {.single_ray = true, .all_passes = true};
    gn_test_stage_render(&stage, &all);
    assert_true(stage.report.rays_primary > 0);
    check_kept(&stage, true);
    gn_test_stage_finish(&stage);
}

static void test_threads_change_no_bit(void **state)
{
    (void)state;
    const struct gn_render_options options[4] = {
        {.quality = GN_QUALITY_INTERACTIVE, .estimate_error = true},
        {.quality = GN_QUALITY_SEED, .estimate_error = true},
        {.quality = GN_QUALITY_REFERENCE},
        {.quality = GN_QUALITY_REFERENCE, .bounces = 2, .paths_per_pixel = 8, .seed = 5},
    };
    for (int i = 0; i < 4; i++) {
        float *layers[3];
        double error[3];
        size_t n = 0;
        static const int n_threads[3] = {0, 1, 5};
        for (int j = 0; j < 3; j++) {
            struct gn_test_stage stage = {0};
            init_stage(&stage, ALL_THINGS, n_threads[j]);
            gn_test_stage_render(&stage, &options[i]);
            layers[j] = copy_layers(&stage.layers, &n);
            error[j] = stage.report.estimated_error;
            gn_test_stage_finish(&stage);
        }
        for (int j = 1; j < 3; j++) {
            assert_same_bits(layers[0], layers[j], n);
            assert_memory_equal(&error[0], &error[j], sizeof(error[0]));
        }
        for (int j = 0; j < 3; j++)
            free(layers[j]);
    }
}

static void test_a_warm_frame_takes_no_memory(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_stage(&stage, ALL_THINGS, 2);
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
        const struct gn_render_options options = {.quality = (enum gn_quality)quality};
        long before = gn_test_n_allocations;
        gn_test_stage_render(&stage, &options);
        if (quality == 0)
            assert_true(gn_test_n_allocations > before); // the counter works
        before = gn_test_n_allocations;
        for (int i = 0; i < 3; i++) {
            stage.camera.world_from_camera.translation[0] += 0.01;
            gn_test_stage_render(&stage, &options);
        }
        assert_int_equal(gn_test_n_allocations, before);
    }
    gn_test_stage_finish(&stage);
}

static void refuse(struct gn_test_stage *stage, const struct gn_render_options *options,
                   const char *expected)
{
    struct gn_error error = {0};
    assert_int_equal(gn_renderer_render(stage->renderer, &stage->camera, &stage->state, options,
                                        &stage->layers, &stage->report, &error),
                     -EINVAL);
    if (!strstr(error.text, expected))
        fail_msg("'%s' does not say '%s'", error.text, expected);
}

static void test_what_is_refused(void **state)
{
    (void)state;
    struct gn_test_stage stage = {0};
    init_stage(&stage, ALL_THINGS, 0);
    const struct gn_camera good = stage.camera;
    stage.camera.fx = 0;
    refuse(&stage, NULL, "camera: ");
    stage.camera = good;
    stage.camera.width = -5;
    refuse(&stage, NULL, "camera: ");
    stage.camera = good;
    stage.camera.cx = NAN;
    refuse(&stage, NULL, "camera: ");
    stage.camera = good;
    struct gn_render_options options = {.bounces = 2};
    refuse(&stage, &options, "reference quality only");
    options = (struct gn_render_options){.quality = GN_QUALITY_REFERENCE, .bounces = 17};
    refuse(&stage, &options, "17 bounces");
    options = (struct gn_render_options){.n_lights = GN_LIGHTS_MAX + 1};
    refuse(&stage, &options, "4097 lights");
    options = (struct gn_render_options){.estimate_parts = 17};
    refuse(&stage, &options, "17 of the error's pixels");
    options = (struct gn_render_options){.estimate_parts = 4, .estimate_part = 4};
    refuse(&stage, &options, "part 4 of 4");
    options = (struct gn_render_options){.grid = 5};
    refuse(&stage, &options, "grid of 5");
    options = (struct gn_render_options){.paths_per_pixel = -1};
    refuse(&stage, &options, "paths");
    options = (struct gn_render_options){.quality = (enum gn_quality)7};
    refuse(&stage, &options, "quality");
    options = (struct gn_render_options){.shading = (enum gn_shading)2};
    refuse(&stage, &options, "shading");
    gn_test_stage_render(&stage, NULL); // nothing is lost
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_omissions_change_nothing),
        cmocka_unit_test(test_fine_meshes_change_nothing),
        cmocka_unit_test(test_crowded_floors_change_nothing),
        cmocka_unit_test(test_reference_asks_once_for_many_texels),
        cmocka_unit_test(test_culling_saves_rays),
        cmocka_unit_test(test_every_reason),
        cmocka_unit_test(test_objects_out_of_sight),
        cmocka_unit_test(test_what_lies_outside_the_picture),
        cmocka_unit_test(test_what_rests_is_seen_once),
        cmocka_unit_test(test_threads_change_no_bit),
        cmocka_unit_test(test_a_warm_frame_takes_no_memory),
        cmocka_unit_test(test_what_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
