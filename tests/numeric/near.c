/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Near light at its extremes: every picture stays finite, every energy balance holds. */
#include "tests/unit/cmocka_setup.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/light_fixture.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint_black(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
}

static bool is_finite_image(const struct gn_image *image)
{
    for (size_t i = 0; i < (size_t)image->width * (size_t)image->height * (size_t)image->channels;
         i++) {
        if (!isfinite(image->data[i]) || image->data[i] < 0)
            return false;
    }
    return true;
}

/** Renders a committed stage by its scene's own light, in all qualities; all must be finite. */
static void check_finite(struct gn_test_stage *stage)
{
    struct gn_emitters *emitters = NULL;
    struct gn_lighting_state *light = NULL;
    gn_test_stage_set_map(stage, 8, 4, paint_black, NULL);
    assert_int_equal(gn_emitters_create(stage->scene, NULL, &emitters, NULL), 0);
    struct gn_emission *emission = gn_emitters_get_emission(emitters);
    assert_non_null(emission);
    assert_int_equal(gn_lighting_state_create_dark(emission, NULL, 0, &light, NULL), 0);
    stage->state.n_near = light->n_near;
    stage->state.near = light->near;
    stage->state.emission = light->emission;
    for (int q = 0; q < 3; q++) {
        const struct gn_render_options options = {.quality = (enum gn_quality)q,
                                                  .bounces = q == GN_QUALITY_REFERENCE ? 2 : 0,
                                                  .paths_per_pixel = 4};
        gn_test_stage_render(stage, &options);
        assert_true(is_finite_image(&stage->layers.virtual_rgba));
        assert_true(is_finite_image(&stage->layers.shadow));
        assert_true(is_finite_image(&stage->layers.added));
        assert_true(isfinite(stage->report.estimated_error));
    }
    gn_lighting_state_unref(&light);
    gn_emission_unref(&emission);
    gn_emitters_destroy(&emitters);
}

/** Floor, ball and lamp, the camera on the lamp's foot. */
static void check_lamp(const struct gn_scene_light *lamp, double size)
{
    struct gn_test_stage stage = {0};
    const double eye[3] = {2 * size, -3 * size, 2 * size}, target[3] = {0, 0, 0};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane((float)(20 * size), 2), 0, 0, 0,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere((float)(0.3 * size), 8), 0, 0,
                      0.5 * size, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    assert_int_equal(gn_scene_set_lights(stage.scene, lamp, 1, NULL), 0);
    gn_test_stage_aim(&stage, 8, 8, 10, eye, target);
    check_finite(&stage);
    gn_test_stage_finish(&stage);
}

static void test_lamps_anywhere_of_any_strength(void **state)
{
    (void)state;
    static const double places[][3] = {
        {0, 0, 0},           // on the floor
        {0, 0, 0.5},         // in the middle of the ball
        {0, 0, 0.8},         // on the ball
        {1e-6, 0, 1e-6},     // a micrometre off the floor
        {0, 0, 1e6},         // 1000 km up
        {1e11, -1e11, 1e11}, // as far as may be
        {0, 0, -1},          // under the floor
    };
    static const float strengths[] = {0, 1e-30f, 1, 1e12f};
    static const float radii[] = {0, 0.4f, 1e10f};
    for (size_t i = 0; i < sizeof(places) / sizeof(places[0]); i++)
        for (size_t j = 0; j < sizeof(strengths) / sizeof(strengths[0]); j++)
            for (size_t k = 0; k < sizeof(radii) / sizeof(radii[0]); k++) {
                struct gn_scene_light lamp = {.radius = radii[k], .role = GN_RT_REAL};
                memcpy(lamp.position, places[i], sizeof(lamp.position));
                lamp.intensity[0] = lamp.intensity[1] = strengths[j];
                check_lamp(&lamp, 1);
                lamp.role = GN_RT_VIRTUAL;
                check_lamp(&lamp, 1);
            }
}

static void test_scenes_of_any_size(void **state)
{
    (void)state;
    static const double sizes[] = {1e-6, 1e-3, 1e3, 1e6};
    for (size_t i = 0; i < sizeof(sizes) / sizeof(sizes[0]); i++) {
        const struct gn_scene_light lamp = {
            {0, 0, 2 * sizes[i]}, {1, 1, 1}, (float)(0.1 * sizes[i]), GN_RT_REAL};
        check_lamp(&lamp, sizes[i]);
    }
}

static void test_the_receiver_at_the_light(void **state)
{
    (void)state;
    // The lamp at the very point that a pixel's ray leaves, and a screen flush with the floor.
    struct gn_test_stage stage = {0};
    const double eye[3] = {0, 0, 3}, target[3] = {0, 0, 0};
    const struct gn_scene_light lamp = {{0, 0, 0}, {1e12f, 1, 1}, 0, GN_RT_REAL};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(4, 1), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(1, 1), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    for (int k = 0; k < 3; k++)
        stage.objects[1].emission[k] = 1e12f;
    gn_test_stage_commit(&stage, 0);
    assert_int_equal(gn_scene_set_lights(stage.scene, &lamp, 1, NULL), 0);
    gn_test_stage_aim(&stage, 9, 9, 10, eye, target);
    check_finite(&stage);
    gn_test_stage_finish(&stage);
}

/** n long and thin triangles about the z axis, every third of them without any area. */
static struct gn_mesh make_fan(int n)
{
    struct gn_mesh mesh = {.n_vertices = 3 * n, .n_triangles = n};
    mesh.positions = calloc((size_t)n, 9 * sizeof(float));
    mesh.triangles = calloc((size_t)n, 3 * sizeof(uint32_t));
    assert_true(mesh.positions && mesh.triangles);
    for (int i = 0; i < n; i++) {
        for (int c = 0; c < 3; c++) {
            double angle = 2 * M_PI * (i + (c == 2 && i % 3)) / n;
            float *p = mesh.positions + 9 * (size_t)i + 3 * (size_t)c;
            p[0] = c ? (float)cos(angle) : 0;
            p[1] = c ? (float)sin(angle) : 0;
            p[2] = 1;
            mesh.triangles[3 * i + c] = (uint32_t)(3 * i + (c ? 3 - c : 0)); // faces down
        }
    }
    return mesh;
}

static void test_thousands_of_triangles(void **state)
{
    (void)state;
    enum { N = 3000 };
    struct gn_test_stage stage = {0};
    const double eye[3] = {2, -3, 0.5}, target[3] = {0, 0, 0};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(20, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, make_fan(N), 0, 0, 0, GN_MATERIAL_DIFFUSE, grey);
    stage.objects[1].emission[0] = 5;
    gn_test_stage_commit(&stage, 0);
    double area = N * 2 / 3 * 0.5 * sin(2 * M_PI / N);
    for (int n = 1; n <= 1024; n *= 32) {
        const struct gn_emitter_options options = {.n_pieces = n};
        struct gn_emitters *emitters = NULL;
        assert_int_equal(gn_emitters_create(stage.scene, &options, &emitters, NULL), 0);
        struct gn_emission *sent = gn_emitters_get_emission(emitters);
        double sum = 0;
        assert_int_equal(sent->n_lights, n);
        for (int i = 0; i < n; i++) {
            sum += sent->lights[i].intensity[0];
            assert_true(fabsf(sent->lights[i].normal_world[2] + 1) < 1e-6f);
        }
        assert_near(sum / (5 * area), 1, 1e-5);
        gn_emission_unref(&sent);
        gn_emitters_destroy(&emitters);
    }
    gn_test_stage_aim(&stage, 8, 8, 10, eye, target);
    check_finite(&stage);
    gn_test_stage_finish(&stage);
}

static void test_pictures_of_any_size_and_value(void **state)
{
    (void)state;
    static const int sides[] = {1, 3, 4096};
    static const float values[] = {1, FLT_MAX, INFINITY, FLT_MIN};
    struct gn_test_stage stage = {0};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(2, 1), 0, 0, 1, GN_MATERIAL_DIFFUSE,
                      grey);
    stage.objects[0].emission_stream = strdup("tv");
    stage.objects[0].emission_scale = 3;
    gn_test_stage_commit(&stage, 0);
    struct gn_emitters *emitters = NULL;
    assert_int_equal(gn_emitters_create(stage.scene, NULL, &emitters, NULL), 0);
    for (size_t i = 0; i < sizeof(sides) / sizeof(sides[0]); i++)
        for (size_t j = 0; j < (sides[i] > 100 ? 1 : sizeof(values) / sizeof(values[0])); j++) {
            struct gn_image image;
            assert_int_equal(gn_image_init(&image, sides[i], sides[i], 3), 0);
            double all = 0, sum = 0;
            for (size_t k = 0; k < (size_t)image.width * (size_t)image.height; k++) {
                image.data[3 * k] = values[j] * (float)(k % 7);
                all += fmin(image.data[3 * k] > 0 ? image.data[3 * k] : 0, 1e12);
            }
            assert_int_equal(gn_emitters_set_picture(emitters, 0, &image, NULL), 0);
            struct gn_emission *sent = gn_emitters_get_emission(emitters);
            for (int k = 0; k < sent->n_lights; k++) {
                sum += sent->lights[k].intensity[0];
                assert_true(isfinite(sent->lights[k].position_world[0]) &&
                            isfinite(sent->lights[k].intensity[0]));
            }
            // The quad's 4 m^2 send the picture's mean.
            double expected = 3 * 4 * all / ((double)image.width * image.height);
            assert_near(sum, expected, 1e-5 * expected + 1e-37);
            gn_emission_unref(&sent);
            gn_image_finish(&image);
        }
    gn_emitters_destroy(&emitters);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lamps_anywhere_of_any_strength),
        cmocka_unit_test(test_scenes_of_any_size),
        cmocka_unit_test(test_the_receiver_at_the_light),
        cmocka_unit_test(test_thousands_of_triangles),
        cmocka_unit_test(test_pictures_of_any_size_and_value),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
