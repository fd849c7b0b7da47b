/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Ggx, glass and smooth normals in the picture. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "tests/meshes.h"
#include "tests/stage.h"

static const float white[3] = {1, 1, 1};
static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const double origin[3] = {0, 0, 0};

static void paint_even(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 1;
}

/* A sky with a wide soft lamp. */
static void paint_sky(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    double c = fmax(0, 0.64 * dir[0] - 0.48 * dir[1] + 0.6 * dir[2]);
    for (int k = 0; k < 3; k++)
        out_rgb[k] = (float)(0.3 + 0.2 * k * (1 + dir[2]) + 12 * pow(c, 40));
}

static void add_ball(struct gn_test_stage *stage, struct gn_mesh mesh, enum gn_material_type type,
                     const float albedo[static 3], float roughness, float metallic)
{
    gn_test_stage_add(stage, GN_RT_VIRTUAL, mesh, 0, 0, 0, type, albedo);
    struct gn_material *material = &stage->objects[stage->n_objects - 1].material;
    material->roughness = roughness;
    material->metallic = metallic;
}

static double get_mean(const struct gn_test_stage *stage)
{
    double sum = 0, covered = 0;
    for (int y = 0; y < stage->layers.height; y++) {
        for (int x = 0; x < stage->layers.width; x++) {
            const float *rgba = gn_image_at(&stage->layers.virtual_rgba, x, y);
            sum += (double)rgba[0] + rgba[1] + rgba[2];
            covered += (double)rgba[3];
        }
    }
    return sum / (3 * covered);
}

static const struct gn_plan_entry *get_line(const struct gn_test_stage *stage, const char *pass)
{
    for (int i = 0; i < stage->report.n_plan; i++) {
        if (strcmp(stage->report.plan[i].pass, pass) == 0)
            return &stage->report.plan[i];
    }
    fail_msg("no line %s", pass);
    return NULL;
}

/** A ball under the light of `paint`. */
static double render_ball(enum gn_material_type type, const float albedo[static 3], float roughness,
                          float metallic, enum gn_quality quality,
                          void (*paint)(void *, const double[static 3], float[static 3]))
{
    const struct gn_render_options options = {
        .quality = quality, .single_ray = true, .paths_per_pixel = 64};
    const double eye[3] = {3, -1, 2};
    struct gn_test_stage stage = {0};
    add_ball(&stage, gn_test_make_sphere(0.5f, 48), type, albedo, roughness, metallic);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 64, 32, paint, NULL);
    gn_test_stage_set_lights_from_map(&stage, 2);
    gn_test_stage_aim(&stage, 24, 24, 60, eye, origin);
    gn_test_stage_render(&stage, &options);
    double mean = get_mean(&stage);
    assert_true(get_line(&stage, "glossy")->ran);
    gn_test_stage_finish(&stage);
    return mean;
}

static void test_a_white_ball_vanishes_in_even_light(void **state)
{
    (void)state;
    static const enum gn_quality qualities[] = {GN_QUALITY_INTERACTIVE, GN_QUALITY_REFERENCE};
    static const float roughnesses[] = {0, 0.2f, 0.6f, 1};
    for (int q = 0; q < 2; q++) {
        for (int r = 0; r < 4; r++) {
            for (int metallic = 0; metallic < 2; metallic++)
                assert_float_equal(render_ball(GN_MATERIAL_GGX, white, roughnesses[r],
                                               (float)metallic, qualities[q], paint_even),
                                   1, 0.02);
        }
        assert_float_equal(render_ball(GN_MATERIAL_GLASS, white, 0, 0, qualities[q], paint_even), 1,
                           0.01);
    }
}

static void test_interactive_is_near_the_reference(void **state)
{
    (void)state;
    static const struct {
        enum gn_material_type type;
        float roughness, metallic;
        double bound;
    } cases[] = {
        {GN_MATERIAL_GGX, 0, 1, 0.01},    {GN_MATERIAL_GGX, 0.2f, 1, 0.03},
        {GN_MATERIAL_GGX, 0.5f, 0, 0.03}, {GN_MATERIAL_GGX, 0.8f, 1, 0.05},
        {GN_MATERIAL_GLASS, 0, 0, 0.02},  {GN_MATERIAL_GLASS, 0.3f, 0, 0.06},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        double means[2];
        for (int q = 0; q < 2; q++)
            means[q] = render_ball(cases[i].type, grey, cases[i].roughness, cases[i].metallic,
                                   q ? GN_QUALITY_REFERENCE : GN_QUALITY_INTERACTIVE, paint_sky);
        print_message("# type %d roughness %.1f: %.4f, reference %.4f\n", (int)cases[i].type,
                      (double)cases[i].roughness, means[0], means[1]);
        assert_float_equal(means[0] / means[1], 1, cases[i].bound);
    }
}

/* A lamp of 2 degrees across. */
static void paint_lamp(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    bool is_lamp = -0.64 * dir[0] + 0.48 * dir[1] + 0.6 * dir[2] > cos(M_PI / 180);
    out_rgb[0] = out_rgb[1] = out_rgb[2] = is_lamp ? 1000 : 0.1f;
}

/** A few directions see a small lamp in every pixel alike, since each stands for its share of the
 * lobe; as points they would hit it now and then. */
static void test_a_small_lamp_does_not_sparkle(void **state)
{
    (void)state;
    const struct gn_render_options options = {.single_ray = true};
    const double eye[3] = {3, -1, 2};
    enum { SIDE = 32 };
    struct gn_test_stage stage = {0};
    add_ball(&stage, gn_test_make_plane(20, 4), GN_MATERIAL_GGX, white, 0.6f, 1);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 512, 256, paint_lamp, NULL);
    gn_test_stage_set_lights_from_map(&stage, 8);
    gn_test_stage_aim(&stage, SIDE, SIDE, 2000, eye, origin);
    gn_test_stage_render(&stage, &options);
    double sum = 0, squares = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double value = stage.layers.virtual_rgba.data[4 * i];
        sum += value / (SIDE * SIDE);
        squares += value * value / (SIDE * SIDE);
    }
    assert_true(sqrt(squares - sum * sum) < 0.7 * sum); // as points 12 times
    const struct gn_render_options exact = {
        .quality = GN_QUALITY_REFERENCE, .single_ray = true, .paths_per_pixel = 32};
    gn_test_stage_render(&stage, &exact);
    double share = sum / get_mean(&stage); // its highlight is wider, and dimmer at the top
    assert_true(share > 0.5 && share < 1.1);
    gn_test_stage_finish(&stage);
}

static void test_glass_bends(void **state)
{
    (void)state;
    // A camera that looks through a ball of glass sees the sky upside down: z > 0 is bright.
    const struct gn_render_options options = {.single_ray = true};
    const double eye[3] = {0, -4, 0};
    struct gn_test_stage stage = {0};
    add_ball(&stage, gn_test_make_sphere(0.5f, 96), GN_MATERIAL_GLASS, white, 0, 0);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 64, 32, paint_sky, NULL);
    gn_test_stage_set_lights_from_map(&stage, 2);
    gn_test_stage_aim(&stage, 41, 41, 120, eye, origin);
    gn_test_stage_render(&stage, &options);
    const float *above = gn_image_at(&stage.layers.virtual_rgba, 20, 14);
    const float *below = gn_image_at(&stage.layers.virtual_rgba, 20, 26);
    assert_true(below[2] > 1.2f * above[2]);
    // Through the middle: two surfaces of 4 %, with what goes to and fro: (1 - r) / (1 + r), and
    // 2 r / (1 + r) from behind the camera.
    const float *middle = gn_image_at(&stage.layers.virtual_rgba, 20, 20);
    float ahead[3], behind[3];
    const float y[2][3] = {{0, 1, 0}, {0, -1, 0}};
    gn_radiance_map_get_radiance(stage.map, y[0], ahead);
    gn_radiance_map_get_radiance(stage.map, y[1], behind);
    for (int k = 0; k < 3; k++)
        assert_float_equal(middle[k], 0.92308f * ahead[k] + 0.07692f * behind[k], 2e-3);
    gn_test_stage_finish(&stage);
}

static void test_without_gloss_nothing_of_it_runs(void **state)
{
    (void)state;
    const double eye[3] = {3, -1, 2};
    struct gn_render_needs needs;
    struct gn_test_stage stage = {0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_cube(0.5f), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(4, 1), 0, 0, -0.3, GN_MATERIAL_GGX,
                      grey);
    stage.objects[1].material.roughness = 0.3f; // no mirror
    gn_test_stage_commit(&stage, 0);
    const struct gn_render_options options = {0};
    gn_render_get_needs(stage.scene, &options, &needs);
    assert_string_equal(needs.why_no_pyramid, "no glossy material among the virtual objects");
    gn_test_stage_set_map(&stage, 64, 32, paint_sky, NULL);
    gn_pyramid_unref(&stage.state.pyramid); // nobody asked for it
    gn_test_stage_set_lights_from_map(&stage, 4);
    gn_test_stage_aim(&stage, 32, 32, 40, eye, origin);
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage, "glossy")->ran);
    assert_string_equal(get_line(&stage, "glossy")->why,
                        "neither ggx nor glass among the virtual objects");
    assert_int_equal(stage.report.rays_mirror, 0);
    gn_test_stage_finish(&stage);
}

static void test_gloss_needs_the_pyramid(void **state)
{
    (void)state;
    const double eye[3] = {3, -1, 2};
    struct gn_render_needs needs;
    struct gn_error error = {0};
    struct gn_test_stage stage = {0};
    add_ball(&stage, gn_test_make_sphere(0.5f, 8), GN_MATERIAL_GGX, white, 0.3f, 1);
    gn_test_stage_commit(&stage, 0);
    const struct gn_render_options options = {0};
    gn_render_get_needs(stage.scene, &options, &needs);
    assert_null(needs.why_no_pyramid);
    gn_test_stage_set_map(&stage, 64, 32, paint_sky, NULL);
    gn_pyramid_unref(&stage.state.pyramid);
    gn_test_stage_set_lights_from_map(&stage, 4);
    gn_test_stage_aim(&stage, 8, 8, 10, eye, origin);
    assert_int_equal(gn_renderer_render(stage.renderer, &stage.camera, &stage.state, &options,
                                        &stage.layers, &stage.report, &error),
                     -EINVAL);
    assert_non_null(strstr(error.text, "pyramid"));
    // Out of view it does not run, and says so.
    const double away[3] = {6, -2, 4};
    gn_test_stage_set_map(&stage, 64, 32, paint_sky, NULL);
    gn_test_stage_aim(&stage, 8, 8, 10, eye, away);
    gn_test_stage_render(&stage, &options);
    assert_string_equal(get_line(&stage, "glossy")->why, "no virtual object in view");
    gn_test_stage_finish(&stage);
}

/** A coarse ball lit from +x, seen from -y: along its equator light falls off as the cosine does,
 * without a facet in its own shadow. The facet in the middle just looks away from the light: it
 * would be black for a fifth of the radius. */
static void check_terminator(enum gn_quality quality)
{
    static const struct gn_light light = {.dir_world = {0.9998f, 0.02f, 0},
                                          .irradiance = {1, 1, 1}};
    const struct gn_render_options options = {.quality = quality, .single_ray = true};
    const double eye[3] = {0, -40, 0.02};
    enum { SIDE = 160 };
    struct gn_test_stage stage = {0};
    add_ball(&stage, gn_test_make_sphere(1, 7), GN_MATERIAL_DIFFUSE, white, 0, 0);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_even, NULL);
    gn_test_stage_set_lights(&stage, &light, 1);
    gn_test_stage_aim(&stage, SIDE, SIDE, 2600, eye, origin);
    gn_test_stage_render(&stage, &options);
    const float *row = gn_image_at(&stage.layers.virtual_rgba, 0, SIDE / 2);
    float before = 0;
    int n_lit = 0;
    for (int x = 0; x < SIDE; x++) {
        if (row[4 * x + 3] < 1)
            continue;
        float value = row[4 * x] * (float)M_PI;
        double place = (x + 0.5 - SIDE / 2) / 2600 * 40; // of the smooth ball's normal: about it
        if (place > 0.08 && place < 0.9) {
            n_lit++;
            assert_true(value > 0.6 * place - 0.03); // no black facet
        }
        if (place < 0.9)
            assert_true(value >= before - 0.012f); // never darker towards the light
        before = value;
    }
    assert_true(n_lit > 40);
    gn_test_stage_finish(&stage);
}

static void test_a_coarse_ball_has_a_smooth_terminator(void **state)
{
    (void)state;
    check_terminator(GN_QUALITY_INTERACTIVE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_white_ball_vanishes_in_even_light),
        cmocka_unit_test(test_interactive_is_near_the_reference),
        cmocka_unit_test(test_a_small_lamp_does_not_sparkle),
        cmocka_unit_test(test_glass_bends),
        cmocka_unit_test(test_without_gloss_nothing_of_it_runs),
        cmocka_unit_test(test_gloss_needs_the_pyramid),
        cmocka_unit_test(test_a_coarse_ball_has_a_smooth_terminator),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
