/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Near light in the renderer against closed forms and plain geometry. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "server/render/ggx.h"
#include "tests/light_fixture.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static const float white[3] = {1, 1, 1};
static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const struct gn_render_options interactive = {.quality = GN_QUALITY_INTERACTIVE};
static const struct gn_render_options reference = {.quality = GN_QUALITY_REFERENCE,
                                                   .supersample_all = true};

/** A stage in the dark, lit by what its scene has. */
struct lit_stage {
    struct gn_test_stage stage;
    struct gn_emitters *emitters;
    struct gn_emission *emission;
    struct gn_lighting_state *light;
};

static void paint_black(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
}

static void light(struct lit_stage *s, const struct gn_scene_light *lamps, int n_lamps,
                  int n_pieces)
{
    const struct gn_emitter_options options = {.n_pieces = n_pieces};
    gn_test_stage_commit(&s->stage, 2);
    gn_test_stage_set_map(&s->stage, 8, 4, paint_black, NULL);
    assert_int_equal(gn_scene_set_lights(s->stage.scene, lamps, n_lamps, NULL), 0);
    assert_int_equal(gn_emitters_create(s->stage.scene, &options, &s->emitters, NULL), 0);
    s->emission = gn_emitters_get_emission(s->emitters);
    assert_int_equal(gn_lighting_state_create_dark(s->emission, NULL, 0, &s->light, NULL), 0);
    s->stage.state.n_near = s->light->n_near;
    s->stage.state.near = s->light->near;
    s->stage.state.emission = s->light->emission;
}

static void finish(struct lit_stage *s)
{
    gn_lighting_state_unref(&s->light);
    gn_emission_unref(&s->emission);
    gn_emitters_destroy(&s->emitters);
    gn_test_stage_finish(&s->stage);
}

static void add_floor(struct lit_stage *s, enum gn_rt_set role)
{
    gn_test_stage_add(&s->stage, role, gn_test_make_plane(20, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      white);
}

/** A mesh that faces down from height z, sending `emission`. */
static void add_screen(struct lit_stage *s, enum gn_rt_set role, struct gn_mesh mesh, double z,
                       float emission)
{
    gn_test_stage_add(&s->stage, role, mesh, 0, 0, z, GN_MATERIAL_DIFFUSE, grey);
    struct gn_scene_object *object = &s->stage.objects[s->stage.n_objects - 1];
    object->world_from_object[5] = -1; // half a turn about x
    object->world_from_object[10] = -1;
    for (int k = 0; k < 3; k++)
        object->emission[k] = emission * (float)(k + 1);
}

/** Renders the middle pixel on (x, 0, 0), seen from the side. */
static void look(struct lit_stage *s, double x, const struct gn_render_options *options)
{
    const double eye[3] = {x + 3, -4, 0.5}, foot[3] = {x, 0, 0};
    gn_test_stage_aim(&s->stage, 3, 3, 40000, eye, foot);
    gn_test_stage_render(&s->stage, options);
}

/** Irradiance of the virtual white floor there, channel 0. */
static double get_irradiance(struct lit_stage *s, double x, const struct gn_render_options *options)
{
    look(s, x, options);
    const float *rgb = gn_image_at(&s->stage.layers.virtual_rgba, 1, 1);
    assert_near(rgb[1], 2.0 * rgb[0], 1e-5 * rgb[1]);
    return M_PI * rgb[0];
}

static void test_lamp_over_a_plane(void **state)
{
    (void)state;
    static const double xs[] = {0, 0.5, 1, 3};
    for (int i = 0; i < 2; i++) {
        const struct gn_scene_light lamp = {{0, 0, 1.25}, {8, 16, 24}, i ? 0.2f : 0, GN_RT_REAL};
        struct lit_stage s = {0};
        add_floor(&s, GN_RT_VIRTUAL);
        light(&s, &lamp, 1, 0);
        for (size_t j = 0; j < sizeof(xs) / sizeof(xs[0]); j++) {
            double d2 = xs[j] * xs[j] + 1.25 * 1.25;
            double expected = 8 * 1.25 / sqrt(d2) / d2; // a sphere's, too, above the horizon
            assert_near(get_irradiance(&s, xs[j], &interactive), expected, 3e-5 * expected);
            double found = get_irradiance(&s, xs[j], &reference);
            assert_near(found, expected, (i ? 2e-3 : 3e-5) * expected);
        }
        finish(&s);
    }
}

static void test_lamp_in_a_glossy_plane(void **state)
{
    (void)state;
    static const double xs[] = {0.5, 1, 3};
    const struct gn_scene_light lamp = {{0, 0, 1.25}, {8, 16, 24}, 0, GN_RT_REAL};
    struct lit_stage s = {0};
    add_floor(&s, GN_RT_VIRTUAL);
    s.stage.objects[0].material = (struct gn_material){.type = GN_MATERIAL_GGX,
                                                       .albedo = {1, 1, 1},
                                                       .roughness = 0.6f,
                                                       .metallic = 1,
                                                       .ior = 1.5f};
    light(&s, &lamp, 1, 0);
    for (size_t j = 0; j < sizeof(xs) / sizeof(xs[0]); j++) {
        struct gn_surface surface = {.roughness = 0.6f,
                                     .metallic = 1,
                                     .albedo = {1, 1, 1},
                                     .ior = 1.5f,
                                     .normal_shading = {0, 0, 1}};
        double d2 = xs[j] * xs[j] + 1.25 * 1.25, value[3], pdf;
        const float from_eye[3] = {(float)(-3 / sqrt(25.25)), (float)(4 / sqrt(25.25)),
                                   (float)(-0.5 / sqrt(25.25))};
        const float to_lamp[3] = {(float)(-xs[j] / sqrt(d2)), 0, (float)(1.25 / sqrt(d2))};
        struct ggx ggx;
        gn_ggx_init(&surface, from_eye, &ggx);
        gn_ggx_eval(&ggx, to_lamp, value, &pdf);
        double expected = M_PI * value[0] * 8 / d2;
        assert_near(get_irradiance(&s, xs[j], &interactive), expected, 1e-3 * expected);
        assert_near(get_irradiance(&s, xs[j], &reference), expected, 1e-3 * expected);
    }
    finish(&s);
}

/** Form factor of a rectangle w x h at height c, its middle above the point's (x, 0): the sum over
 * corners of Howell's configuration B-3. */
static double get_rectangle_factor(double w, double h, double c, double x)
{
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        double a = (i % 2 ? 0.5 * w + x : 0.5 * w - x) / c, b = 0.5 * h / c;
        double ra = sqrt(1 + a * a), rb = sqrt(1 + b * b);
        sum += (a / ra * atan(b / ra) + b / rb * atan(a / rb)) / (2 * M_PI);
    }
    return sum;
}

static void test_rectangle_over_a_plane(void **state)
{
    (void)state;
    static const struct {
        int n;
        double bound[2]; // at a distance of the side, at a quarter of it
    } cases[] = {{1, {0.2, 0.8}}, {32, {0.0032, 0.1}}, {512, {2.1e-4, 6e-3}}};
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        for (int j = 0; j < 2; j++) {
            double c = j ? 0.25 : 1, worst = 0;
            struct lit_stage s = {0};
            add_floor(&s, GN_RT_VIRTUAL);
            add_screen(&s, GN_RT_REAL, gn_test_make_plane(1, 1), c, 7);
            light(&s, NULL, 0, cases[i].n);
            for (int k = 0; k < 4; k++) {
                double x = 0.33 * k;
                double expected = 7 * M_PI * get_rectangle_factor(1, 1, c, x);
                double error = get_irradiance(&s, x, &interactive) / expected - 1;
                worst = fmax(worst, fabs(error));
                // 512 pieces, each exact, whatever the state has.
                if (i == 0) {
                    error = get_irradiance(&s, x, &reference) / expected - 1;
                    print_message("# reference at %.2f: off by %.2g\n", x, error);
                    assert_true(fabs(error) < 1e-4);
                }
            }
            print_message("# %d pieces, %g sides away: off by up to %.3g\n", cases[i].n, c, worst);
            assert_true(worst < cases[i].bound[j]);
            finish(&s);
        }
    }
}

static void test_disc_on_its_axis(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        double c = i == 0 ? 0.1 : i == 1 ? 1 : 5;
        struct lit_stage s = {0};
        add_floor(&s, GN_RT_VIRTUAL);
        add_screen(&s, GN_RT_REAL, gn_test_make_disc(0.5f, 720), c, 3);
        light(&s, NULL, 0, 1); // one piece: a disc's factor on its axis is exact
        double expected = M_PI * 3 * 0.25 / (0.25 + c * c);
        assert_near(get_irradiance(&s, 0, &interactive), expected, 1e-3 * expected);
        assert_near(get_irradiance(&s, 0, &reference), expected, 1e-3 * expected);
        finish(&s);
    }
}

static float get_factor(struct lit_stage *s, double x, const struct gn_render_options *options)
{
    look(s, x, options);
    return gn_image_at(&s->stage.layers.shadow, 1, 1)[1];
}

static void test_shadow_of_a_disc_under_a_lamp(void **state)
{
    (void)state;
    // A lamp at 2 m, a disc of 0.3 m at 0.5 m: a shadow of 0.4 m.
    const struct gn_scene_light lamp = {{0, 0, 2}, {8, 16, 24}, 0, GN_RT_REAL};
    struct lit_stage s = {0};
    add_floor(&s, GN_RT_REAL);
    gn_test_stage_add(&s.stage, GN_RT_VIRTUAL, gn_test_make_disc(0.3f, 720), 0, 0, 0.5,
                      GN_MATERIAL_DIFFUSE, grey);
    // Real and virtual objects behind the lamp hide nothing of it.
    gn_test_stage_add(&s.stage, GN_RT_REAL, gn_test_make_plane(5, 1), 0, 0, 2.01,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(&s.stage, GN_RT_VIRTUAL, gn_test_make_plane(5, 1), 0, 0, 2.02,
                      GN_MATERIAL_DIFFUSE, grey);
    light(&s, &lamp, 1, 0);
    const struct gn_render_options *qualities[] = {&interactive, &reference};
    for (int i = 0; i < 2; i++) {
        assert_true(get_factor(&s, 0, qualities[i]) == 0);
        assert_true(get_factor(&s, 0.395, qualities[i]) == 0);
        assert_true(get_factor(&s, 0.405, qualities[i]) == 1);
        assert_true(get_factor(&s, 3, qualities[i]) == 1);
    }
    finish(&s);
}

/** RMS difference of two pictures' factors where either is a shadow. */
static double compare(const struct gn_image *a, const struct gn_image *b)
{
    double sum = 0;
    int n = 0;
    for (int i = 0; i < a->width * a->height; i++) {
        const float *x = a->data + (size_t)i * 3, *y = b->data + (size_t)i * 3;
        for (int k = 0; k < 3 && (x[1] < 0.995f || y[1] < 0.995f); k++) {
            sum += ((double)x[k] - (double)y[k]) * ((double)x[k] - (double)y[k]);
            n++;
        }
    }
    assert_true(n > 300);
    return sqrt(sum / n);
}

static void paint_sky(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    for (int k = 0; k < 3; k++)
        out_rgb[k] = dir[2] > 0.5 && dir[0] > 0.3 ? 0.1f : 0;
}

/** Renders as both and returns the true error; *out_estimated: what the frame says. */
static double judge(struct lit_stage *s, double *out_estimated)
{
    const double eye[3] = {0, -3, 2.2}, target[3] = {0, 0, 0};
    const struct gn_render_options exact = {.quality = GN_QUALITY_REFERENCE, .single_ray = true};
    const struct gn_render_options fast = {.single_ray = true, .estimate_error = true};
    struct gn_image truth;
    gn_test_stage_aim(&s->stage, 96, 72, 80, eye, target);
    gn_test_stage_render(&s->stage, &exact);
    truth = s->stage.layers.shadow;
    memset(&s->stage.layers.shadow, 0, sizeof(s->stage.layers.shadow));
    gn_layers_finish(&s->stage.layers);
    gn_test_stage_render(&s->stage, &fast);
    *out_estimated = s->stage.report.estimated_error;
    double error = compare(&truth, &s->stage.layers.shadow);
    gn_image_finish(&truth);
    return error;
}

static void test_the_error_of_near_light_is_known(void **state)
{
    (void)state;
    static const int n_pieces[] = {1, 4, 16};
    const struct gn_scene_light lamp = {{1, 0, 2}, {1, 2, 3}, 0.2f, GN_RT_REAL};
    for (int with_sky = 0; with_sky < 2; with_sky++) {
        double last = INFINITY;
        for (size_t i = 0; i < sizeof(n_pieces) / sizeof(n_pieces[0]); i++) {
            struct lit_stage s = {0};
            double estimated;
            add_floor(&s, GN_RT_REAL);
            add_screen(&s, GN_RT_REAL, gn_test_make_plane(1, 1), 1.5, 3);
            gn_test_stage_add(&s.stage, GN_RT_VIRTUAL, gn_test_make_disc(0.3f, 64), 0, 0, 0.5,
                              GN_MATERIAL_DIFFUSE, grey);
            light(&s, &lamp, 1, n_pieces[i]);
            if (with_sky) {
                gn_test_stage_set_map(&s.stage, 64, 32, paint_sky, NULL);
                gn_test_stage_set_lights_from_map(&s.stage, 8);
            }
            double error = judge(&s, &estimated);
            print_message("# %d pieces and a lamp%s: off by %.4f, estimated %.4f\n", n_pieces[i],
                          with_sky ? ", sky" : "", error, estimated);
            assert_true(estimated > error / 1.5 && estimated < 1.5 * error);
            assert_true(estimated < last);
            last = estimated;
            finish(&s);
        }
    }
}

static void test_real_objects_hide_near_light(void **state)
{
    (void)state;
    // Two lamps of equal irradiance at the origin; the virtual disc hides the first, a real one, at
    // x = 0 only, hides the second.
    const struct gn_scene_light lamps[2] = {{{1, 0, 1}, {2, 4, 6}, 0, GN_RT_REAL},
                                            {{-1, 0, 1}, {2, 4, 6}, 0, GN_RT_REAL}};
    for (int with_real = 0; with_real < 2; with_real++) {
        struct lit_stage s = {0};
        add_floor(&s, GN_RT_REAL);
        gn_test_stage_add(&s.stage, GN_RT_VIRTUAL, gn_test_make_disc(0.1f, 64), 0.5, 0, 0.5,
                          GN_MATERIAL_DIFFUSE, grey);
        if (with_real)
            gn_test_stage_add(&s.stage, GN_RT_REAL, gn_test_make_disc(0.1f, 64), -0.5, 0, 0.5,
                              GN_MATERIAL_DIFFUSE, grey);
        light(&s, lamps, 2, 0);
        float expected = with_real ? 0 : 0.5f; // 1 - S / U
        float fast = get_factor(&s, 0, &interactive);
        print_message("# real disc %d: factor %g, expected %g\n", with_real, (double)fast,
                      (double)expected);
        assert_true(fabsf(fast - expected) < 1e-5f);
        assert_true(s.stage.report.estimated_error < 0); // not asked for
        assert_int_equal(s.stage.report.n_lights, 2);
        assert_true(fabsf(get_factor(&s, 0, &reference) - expected) < 1e-5f);
        finish(&s);
    }
}

/** The shadow factor at (x, 0, 0) under a square of side 1 at 1 m, a ball of 0.2 m about
 * (0, 0, 0.4): the integral over the square by the midpoint rule, the ball asked in closed form. */
static double integrate_penumbra(double x)
{
    enum { N = 600 };
    double open = 0, cut = 0;
    for (int i = 0; i < N * N; i++) {
        double dx = (i % N + 0.5) / N - 0.5 - x, dy = ((double)(i / N) + 0.5) / N - 0.5;
        double d2 = dx * dx + dy * dy + 1;
        double along = (-x * dx + 0.4) / d2; // of the ball's middle, as a share of the ray
        double px = x + along * dx, py = along * dy, pz = along - 0.4;
        open += 1 / (d2 * d2);
        cut += px * px + py * py + pz * pz < 0.04 ? 1 / (d2 * d2) : 0;
    }
    return 1 - cut / open;
}

static void test_penumbra_of_a_ball_under_a_screen(void **state)
{
    (void)state;
    struct lit_stage s = {0};
    add_floor(&s, GN_RT_REAL);
    add_screen(&s, GN_RT_REAL, gn_test_make_plane(1, 1), 1, 5);
    gn_test_stage_add(&s.stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.2f, 96), 0, 0, 0.4,
                      GN_MATERIAL_DIFFUSE, grey);
    light(&s, NULL, 0, 256);
    for (int i = 0; i < 5; i++) {
        double x = 0.12 * i, expected = integrate_penumbra(x);
        double fast = get_factor(&s, x, &interactive), slow = get_factor(&s, x, &reference);
        print_message("# x %.2f: expected %.4f, interactive %.4f, reference %.4f\n", x, expected,
                      fast, slow);
        assert_near(slow, expected, 4e-3); // 512 strata, 16 rays each
        assert_near(fast, expected, 0.02);
    }
    finish(&s);
}

static void test_virtual_light_is_added(void **state)
{
    (void)state;
    const struct gn_scene_light lamp = {{0, 0, 1.25}, {8, 16, 24}, 0, GN_RT_VIRTUAL};
    const struct gn_render_options *qualities[] = {&interactive, &reference};
    struct lit_stage s = {0};
    add_floor(&s, GN_RT_REAL);
    add_screen(&s, GN_RT_VIRTUAL, gn_test_make_plane(1, 1), 2, 7);
    gn_test_stage_add(&s.stage, GN_RT_REAL, gn_test_make_disc(0.1f, 64), -0.5, 0, 0.625,
                      GN_MATERIAL_DIFFUSE, grey); // hides the lamp at x = -1
    light(&s, &lamp, 1, 128);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            double x = j ? -1 : 0, d2 = x * x + 1.25 * 1.25;
            double from_lamp = j ? 0 : 8 * 1.25 / sqrt(d2) / d2;
            double from_screen = 7 * M_PI * get_rectangle_factor(1, 1, 2, x);
            if (j) // the small disc hides a part of the screen, too: the lamp alone is exact
                from_screen = 0;
            look(&s, x, qualities[i]);
            double added = M_PI * (double)gn_image_at(&s.stage.layers.added, 1, 1)[0];
            if (j)
                assert_true(added < 7 * M_PI * get_rectangle_factor(1, 1, 2, x) * 1.001);
            else
                assert_near(added, from_lamp + from_screen, 1e-3 * added);
            assert_true(gn_image_at(&s.stage.layers.shadow, 1, 1)[0] == 1); // no real light, no cut
        }
    }
    finish(&s);
}

static void test_emission_is_seen(void **state)
{
    (void)state;
    const struct gn_render_options *qualities[] = {&interactive, &reference};
    struct lit_stage s = {0};
    add_screen(&s, GN_RT_VIRTUAL, gn_test_make_plane(1, 1), 1, 7);
    light(&s, NULL, 0, 4);
    for (int i = 0; i < 2; i++) {
        const double below[3] = {0.3, 0.2, -1}, above[3] = {0.3, 0.2, 3}, middle[3] = {0, 0, 1};
        gn_test_stage_aim(&s.stage, 3, 3, 40000, below, middle);
        gn_test_stage_render(&s.stage, qualities[i]);
        const float *rgba = gn_image_at(&s.stage.layers.virtual_rgba, 1, 1);
        assert_true(rgba[0] == 7 && rgba[2] == 21 && rgba[3] == 1);
        gn_test_stage_aim(&s.stage, 3, 3, 40000, above, middle);
        gn_test_stage_render(&s.stage, qualities[i]);
        rgba = gn_image_at(&s.stage.layers.virtual_rgba, 1, 1);
        assert_true(rgba[0] == 0 && rgba[3] == 1); // its back is dark
    }
    finish(&s);
}

static const char *find_why(const struct gn_test_stage *stage, const char *pass, bool *out_ran)
{
    for (int i = 0; i < stage->report.n_plan; i++) {
        if (strcmp(stage->report.plan[i].pass, pass) == 0) {
            *out_ran = stage->report.plan[i].ran;
            return stage->report.plan[i].why;
        }
    }
    return "";
}

static void test_the_plan_says_why(void **state)
{
    (void)state;
    static const struct {
        struct gn_scene_light lamp;
        int n;
        bool ran;
        const char *why;
    } cases[] = {
        {{{0, 0, 2}, {1, 2, 3}, 0, GN_RT_REAL}, 0, false, "no lamp"},
        {{{0, 0, 2}, {0, 0, 0}, 0, GN_RT_REAL}, 1, false, "dark"},
        {{{0, 0, -2}, {1, 2, 3}, 0, GN_RT_REAL}, 1, false, "reaches"},
        {{{0, 0, 2}, {1, 2, 3}, 0, GN_RT_REAL}, 1, true, "tried"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct lit_stage s = {0};
        bool ran = false;
        add_floor(&s, GN_RT_VIRTUAL);
        light(&s, &cases[i].lamp, cases[i].n, 0);
        look(&s, 0, &interactive);
        const char *why = find_why(&s.stage, "near", &ran);
        print_message("# near: %s\n", why);
        assert_true(ran == cases[i].ran && strstr(why, cases[i].why));
        finish(&s);
    }
}

static void test_omissions_change_no_bit(void **state)
{
    (void)state;
    const struct gn_scene_light lamps[3] = {{{0.5, 0.4, 1.2}, {2, 4, 6}, 0.05f, GN_RT_REAL},
                                            {{-1, 0.2, 0.3}, {1, 4, 2}, 0, GN_RT_REAL},
                                            {{0.1, -1, 0.6}, {2, 1, 1}, 0, GN_RT_VIRTUAL}};
    struct lit_stage s = {0};
    add_floor(&s, GN_RT_REAL);
    add_screen(&s, GN_RT_REAL, gn_test_make_plane(1, 1), 1, 5);
    gn_test_stage_add(&s.stage, GN_RT_REAL, gn_test_make_box(0.1f, 0.2f, 0.3f), -0.3, 0.3, 0.15,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(&s.stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.2f, 12), 0, 0, 0.3,
                      GN_MATERIAL_DIFFUSE, grey);
    light(&s, lamps, 3, 8);
    const double eye[3] = {1.5, -2, 1}, target[3] = {0, 0, 0.2};
    for (int i = 0; i < 2; i++) {
        struct gn_render_options options = {.quality =
                                                i ? GN_QUALITY_REFERENCE : GN_QUALITY_INTERACTIVE};
        float *kept[3];
        const struct gn_image *images[3] = {&s.stage.layers.virtual_rgba, &s.stage.layers.shadow,
                                            &s.stage.layers.added};
        int side = i ? 12 : 48;
        gn_test_stage_aim(&s.stage, side, side, 1.2 * side, eye, target);
        gn_test_stage_render(&s.stage, &options);
        for (int j = 0; j < 3; j++) {
            size_t bytes = (size_t)(side * side * images[j]->channels) * sizeof(float);
            kept[j] = test_malloc(bytes);
            memcpy(kept[j], images[j]->data, bytes);
        }
        options.all_passes = true;
        gn_test_stage_render(&s.stage, &options);
        for (int j = 0; j < 3; j++) {
            size_t bytes = (size_t)(side * side * images[j]->channels) * sizeof(float);
            assert_memory_equal(kept[j], images[j]->data, bytes);
            test_free(kept[j]);
        }
    }
    finish(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lamp_over_a_plane),
        cmocka_unit_test(test_lamp_in_a_glossy_plane),
        cmocka_unit_test(test_rectangle_over_a_plane),
        cmocka_unit_test(test_disc_on_its_axis),
        cmocka_unit_test(test_shadow_of_a_disc_under_a_lamp),
        cmocka_unit_test(test_the_error_of_near_light_is_known),
        cmocka_unit_test(test_real_objects_hide_near_light),
        cmocka_unit_test(test_penumbra_of_a_ball_under_a_screen),
        cmocka_unit_test(test_virtual_light_is_added),
        cmocka_unit_test(test_emission_is_seen),
        cmocka_unit_test(test_the_plan_says_why),
        cmocka_unit_test(test_omissions_change_no_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
