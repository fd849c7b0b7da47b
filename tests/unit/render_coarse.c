/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The shadow term at a coarser resolution against that of every pixel. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "tests/meshes.h"
#include "tests/stage.h"

enum { WIDTH = 80, HEIGHT = 60, N_LIGHTS = 64, SUN = 20 };

static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint_white(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 1;
}

/** A ball over a floor under an even sky and one strong light, whose shadow has an edge; and a box,
 * real, beside it. */
static void init_stage(struct gn_test_stage *stage, int n_threads, float emission)
{
    const double eye[3] = {4, -1, 3};
    const double target[3] = {0, 0, 0};
    struct gn_light lights[N_LIGHTS] = {0};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(6, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    for (int k = 0; k < 3; k++)
        stage->objects[0].emission[k] = emission;
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_cube(0.3f), 0.9, 0.9, 0.3,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.5f, 24), 0, 0, 0.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(stage, n_threads);
    gn_test_stage_set_map(stage, 32, 16, paint_white, NULL);
    for (int i = 0; i < N_LIGHTS; i++) {
        double z = 1 - (i + 0.5) / N_LIGHTS;
        double phi = i * M_PI * (3 - sqrt(5));
        lights[i].dir_world[0] = (float)(sqrt(1 - z * z) * cos(phi));
        lights[i].dir_world[1] = (float)(sqrt(1 - z * z) * sin(phi));
        lights[i].dir_world[2] = (float)z;
        for (int k = 0; k < 3; k++)
            lights[i].irradiance[k] = (float)(1 + k) * (i == SUN ? 30.0f : 1.0f);
    }
    gn_test_stage_set_lights(stage, lights, N_LIGHTS);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 90, eye, target);
}

static size_t count_floats(void)
{
    return (size_t)WIDTH * HEIGHT * 3;
}

/** That stage with a floor that shines: what it sends itself is not cut. */
struct shining {
    struct gn_test_stage stage;
    struct gn_emitters *emitters;
    struct gn_emission *emission;
    struct gn_lighting_state *light;
};

static void init_shining(struct shining *s)
{
    const struct gn_emitter_options options = {.n_pieces = 4};
    init_stage(&s->stage, 2, 20);
    assert_int_equal(gn_emitters_create(s->stage.scene, &options, &s->emitters, NULL), 0);
    s->emission = gn_emitters_get_emission(s->emitters);
    assert_int_equal(gn_lighting_state_create_dark(s->emission, NULL, 0, &s->light, NULL), 0);
    s->stage.state.n_near = s->light->n_near;
    s->stage.state.near = s->light->near;
    s->stage.state.emission = s->light->emission;
}

static void finish_shining(struct shining *s)
{
    gn_lighting_state_unref(&s->light);
    gn_emission_unref(&s->emission);
    gn_emitters_destroy(&s->emitters);
    gn_test_stage_finish(&s->stage);
}

static void test_coarse_shadow_on_what_shines(void **state)
{
    (void)state;
    static float whole[WIDTH * HEIGHT * 3];
    struct shining s = {0};
    double largest = 0;
    int n_changed = 0;
    init_shining(&s);
    struct gn_render_options options = {.single_ray = true};
    gn_test_stage_render(&s.stage, &options);
    memcpy(whole, s.stage.layers.shadow.data, sizeof(whole));
    options.shadow_step = 2;
    gn_test_stage_render(&s.stage, &options);
    const float *coarse = s.stage.layers.shadow.data;
    for (size_t i = 0; i < count_floats(); i++) {
        largest = fmax(largest, fabs((double)coarse[i] - (double)whole[i]));
        n_changed += coarse[i] < 1 && coarse[i] != whole[i];
    }
    print_message("# a floor that shines: off by %.4f at most, %d values of others\n", largest,
                  n_changed);
    assert_true(n_changed > 100);
    assert_true(largest < 0.02);
    finish_shining(&s);
}

static void test_coarse_shadow_is_near(void **state)
{
    (void)state;
    static float whole[WIDTH * HEIGHT * 3];
    struct gn_test_stage stage = {0};
    init_stage(&stage, 2, 0);
    struct gn_render_options options = {.single_ray = true};
    gn_test_stage_render(&stage, &options);
    memcpy(whole, stage.layers.shadow.data, sizeof(whole));
    uint64_t rays = stage.report.rays_shadow;
    for (int step = 2; step <= 4; step *= 2) {
        options.shadow_step = step;
        gn_test_stage_render(&stage, &options);
        double sum = 0;
        int n = 0;
        int n_changed = 0;
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                const float *shadow = gn_image_at(&stage.layers.shadow, x, y);
                const float *own = whole + 3 * ((size_t)y * WIDTH + (size_t)x);
                if (x % step == 0 && y % step == 0)
                    assert_memory_equal(shadow, own, 3 * sizeof(float));
                for (int k = 0; k < 3; k++) {
                    assert_float_equal(shadow[k], own[k], 0.1); // what is not smooth has its own
                    sum += own[k] < 1 ? (shadow[k] - own[k]) * (shadow[k] - own[k]) : 0;
                    n += own[k] < 1;
                }
                n_changed += memcmp(shadow, own, 3 * sizeof(float)) != 0;
            }
        }
        double rmse = sqrt(sum / n);
        print_message("# step %d: RMSE %.4f, %d pixels of others, rays %llu of %llu\n", step, rmse,
                      n_changed, (unsigned long long)stage.report.rays_shadow,
                      (unsigned long long)rays);
        assert_true(rmse < 0.012);
        assert_true(n_changed > 0);
        assert_true(stage.report.rays_shadow < rays);
    }
    gn_test_stage_finish(&stage);
}

static void test_threads_change_no_bit(void **state)
{
    (void)state;
    static float one[WIDTH * HEIGHT * 3];
    const struct gn_render_options options = {.shadow_step = 2};
    for (int n_threads = 1; n_threads <= 3; n_threads += 2) {
        struct gn_test_stage stage = {0};
        init_stage(&stage, n_threads, 0);
        gn_test_stage_render(&stage, &options);
        if (n_threads == 1)
            memcpy(one, stage.layers.shadow.data, sizeof(one));
        assert_memory_equal(one, stage.layers.shadow.data, count_floats() * sizeof(float));
        gn_test_stage_finish(&stage);
    }
}

static void test_only_where_it_may(void **state)
{
    (void)state;
    static float whole[WIDTH * HEIGHT * 3];
    struct gn_test_stage stage = {0};
    init_stage(&stage, 2, 0);
    struct gn_render_options options = {.quality = GN_QUALITY_SEED};
    gn_test_stage_render(&stage, &options);
    memcpy(whole, stage.layers.shadow.data, sizeof(whole));
    options.shadow_step = 4; // the paper's picture stays the paper's
    gn_test_stage_render(&stage, &options);
    assert_memory_equal(whole, stage.layers.shadow.data, sizeof(whole));
    const struct gn_render_options bad = {.shadow_step = 3};
    struct gn_render_report report;
    struct gn_error error;
    assert_true(gn_renderer_render(stage.renderer, &stage.camera, &stage.state, &bad, &stage.layers,
                                   &report, &error) < 0);
    assert_non_null(strstr(error.text, "shadow step of 3"));
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_coarse_shadow_is_near),
        cmocka_unit_test(test_coarse_shadow_on_what_shines),
        cmocka_unit_test(test_threads_change_no_bit),
        cmocka_unit_test(test_only_where_it_may),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
