/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Progressive pictures against the reference that they tend to. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "server/render/progressive.h"
#include "tests/allocations.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const float red[3] = {0.7f, 0.3f, 0.2f};

/** Lamps in a grey room, a window, and colour. */
static void paint_room(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    static const double lamps[2][3] = {{0.6, 0, 0.8}, {-0.48, 0.36, 0.8}};
    out_rgb[0] = 0.5f;
    out_rgb[1] = 0.4f + 0.2f * (float)dir[2];
    out_rgb[2] = 0.3f;
    if (dir[1] > 0.7 && dir[2] > 0.1 && dir[2] < 0.5)
        out_rgb[2] = 6;
    for (int i = 0; i < 2; i++) {
        double c = dir[0] * lamps[i][0] + dir[1] * lamps[i][1] + dir[2] * lamps[i][2];
        if (c > 0.995)
            out_rgb[0] = out_rgb[1] = out_rgb[2] = 60;
    }
}

/** A sun in a blue sky. */
static void paint_sun(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    double c = dir[0] * 0.6 + dir[1] * 0.0 + dir[2] * 0.8;
    out_rgb[0] = dir[2] > 0 ? 0.3f : 0.05f;
    out_rgb[1] = dir[2] > 0 ? 0.4f : 0.05f;
    out_rgb[2] = dir[2] > 0 ? 0.8f : 0.05f;
    if (c > 0.9995)
        out_rgb[0] = out_rgb[1] = out_rgb[2] = 3000;
}

struct scene {
    struct gn_test_stage stage;
    struct gn_progressive *progressive;
    struct gn_layers reference;
};

/** A ball of a material and a box over a table with a real box on it. */
static void set_up(struct scene *s, enum gn_material_type type, int n_threads)
{
    const double eye[3] = {0.6, -3, 1.6};
    const double target[3] = {0, 0, 0.3};
    struct gn_test_stage *stage = &s->stage;
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(6, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.3f, 0.3f, 0.8f), 0.8, 0.2, 0.4,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.4f, 24), -0.3, 0, 0.6, type, red);
    gn_test_stage_commit(stage, n_threads);
    gn_test_stage_aim(stage, 32, 24, 27, eye, target);
    stage->state.references = 1;
    assert_int_equal(gn_progressive_create(stage->renderer, stage->pool, &s->progressive, NULL), 0);
}

static void tear_down(struct scene *s)
{
    gn_progressive_destroy(&s->progressive);
    gn_layers_finish(&s->reference);
    gn_test_stage_finish(&s->stage);
}

/** Into s->reference. */
static void render_reference(struct scene *s, bool single_ray)
{
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .single_ray = single_ray, .supersample_all = !single_ray};
    gn_test_stage_render(&s->stage, &options);
    s->reference = s->stage.layers;
    memset(&s->stage.layers, 0, sizeof(s->stage.layers));
}

static void begin(struct scene *s, const struct gn_render_options *options,
                  const struct gn_progressive_options *own)
{
    struct gn_error error = {0};
    struct gn_render_report report;
    int ret = gn_progressive_begin(s->progressive, &s->stage.camera, &s->stage.state, options, own,
                                   &report, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
}

/** Until there have been n passes in all. */
static const struct gn_progressive_figures *run_to(struct scene *s, int n)
{
    const struct gn_progressive_figures *f = gn_progressive_get_figures(s->progressive);
    struct gn_render_report report;
    while (f->n_passes < n) {
        assert_null(f->why_done);
        assert_int_equal(gn_progressive_add_pass(s->progressive, &report, NULL), 0);
    }
    return f;
}

/** What is off. */
struct off {
    double shadow, radiance;
};

static double get_put(const struct gn_layers *l, int i, int k)
{
    const float *rgba = l->virtual_rgba.data + 4 * i;
    return rgba[k] + (1 - (double)rgba[3]) * l->added.data[3 * i + k];
}

/** As the figures' errors, truly. */
static struct off compare(const struct gn_layers *a, const struct gn_layers *reference)
{
    double shadow = 0, n_shadow = 0, put = 0, mean = 0, n_put = 0;
    int n = a->width * a->height;
    for (int i = 0; i < 3 * n; i++) {
        mean += get_put(reference, i / 3, i % 3);
        n_put += get_put(reference, i / 3, i % 3) > 0 || get_put(a, i / 3, i % 3) > 0;
    }
    mean /= n_put;
    for (int i = 0; i < 3 * n; i++) {
        double f = reference->shadow.data[i],
               real = 1 - reference->virtual_rgba.data[i / 3 * 4 + 3];
        double d = real * (a->shadow.data[i] - f);
        double e = fmin(get_put(a, i / 3, i % 3), 4 * mean) -
                   fmin(get_put(reference, i / 3, i % 3), 4 * mean);
        if (real > 0 && (f < 1 || a->shadow.data[i] < 1)) {
            shadow += d * d;
            n_shadow++;
        }
        put += e * e;
    }
    return (struct off){sqrt(shadow / n_shadow), sqrt(put / n_put) / mean};
}

static struct off compare_now(const struct scene *s)
{
    return compare(gn_progressive_get_layers(s->progressive), &s->reference);
}

/** Rounds 2, 4, 8 ... to n: no worse than the start, and as far off as they say. */
static void converge(struct scene *s, const char *name, const struct gn_render_options *options,
                     int n)
{
    const struct gn_progressive_options own = {.error = 1e-6};
    int n_rounds = 0, n_far = 0;
    begin(s, options, &own);
    struct off start = compare_now(s), first = {0}, last = {0};
    for (int i = 8; i <= n; i *= 2) {
        const struct gn_progressive_figures *f = run_to(s, i);
        last = compare_now(s);
        first = i == 8 ? last : first;
        print_message("# %s, %d passes: shadow off by %.5f, says %.5f (start %.5f); radiance %.5f, "
                      "says %.5f (%.5f)\n",
                      name, i, last.shadow, f->error_shadow, start.shadow, last.radiance,
                      f->error_radiance, start.radiance);
        assert_true(last.shadow <= 1.1 * start.shadow);
        assert_true(last.radiance <= 1.1 * start.radiance);
        assert_float_equal(f->error, fmax(f->error_shadow, f->error_radiance), 0);
        n_far += f->error_shadow < 0.5 * last.shadow || f->error_shadow > 2 * last.shadow;
        n_far += f->error_radiance < 0.5 * last.radiance || f->error_radiance > 2 * last.radiance;
        n_rounds += 2;
    }
    assert_true(5 * n_far <= n_rounds);
    // Faster than random passes, whose error falls as 1 / sqrt n.
    assert_true(last.shadow < first.shadow * sqrt(8.0 / n));
    assert_true(last.radiance < first.radiance * sqrt(8.0 / n));
}

static void test_it_converges_to_the_reference(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        const struct gn_render_options options = {.single_ray = true};
        struct scene s = {0};
        set_up(&s, GN_MATERIAL_DIFFUSE, 2);
        gn_test_stage_set_map(&s.stage, 96, 48, i == 0 ? paint_room : paint_sun, NULL);
        gn_test_stage_set_lights_from_map(&s.stage, 8);
        render_reference(&s, true);
        converge(&s, i == 0 ? "room" : "sun", &options, 256);
        struct off off = compare_now(&s);
        assert_true(off.shadow < 1e-3 && off.radiance < 2e-3);
        tear_down(&s);
    }
}

/** The reference's radiance in a picture `times` as wide, and so many pixels' mean. */
static void render_fine_reference(struct scene *s, int times)
{
    const struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE, .no_shadow = true};
    struct gn_camera coarse = s->stage.camera;
    struct gn_camera *c = &s->stage.camera;
    c->width *= times;
    c->height *= times;
    c->fx *= times;
    c->fy *= times;
    c->cx *= times;
    c->cy *= times;
    gn_test_stage_render(&s->stage, &options);
    *c = coarse;
    assert_int_equal(gn_layers_init(&s->reference, c->width, c->height), 0);
    for (int y = 0; y < c->height * times; y++) {
        for (int x = 0; x < c->width * times; x++) {
            const float *from = gn_image_at(&s->stage.layers.virtual_rgba, x, y);
            float *to = gn_image_at(&s->reference.virtual_rgba, x / times, y / times);
            for (int k = 0; k < 4; k++)
                to[k] += from[k] / (float)(times * times);
        }
    }
    gn_layers_finish(&s->stage.layers);
}

static void test_rays_cover_the_pixels(void **state)
{
    (void)state;
    struct scene s = {0};
    const struct gn_render_options options = {.no_shadow = true};
    const struct gn_progressive_options own = {.error = 1e-6};
    set_up(&s, GN_MATERIAL_DIFFUSE, 2);
    gn_test_stage_set_map(&s.stage, 64, 32, paint_room, NULL);
    gn_test_stage_set_lights_from_map(&s.stage, 8);
    render_fine_reference(&s, 4);
    begin(&s, &options, &own);
    double start = compare_now(&s).radiance;
    double error = run_to(&s, 128)->error_radiance, off = compare_now(&s).radiance;
    print_message("# edges: radiance off by %.4f, says %.4f (start %.4f)\n", off, error, start);
    assert_true(off < 0.4 * start && off < 2 * error && error < 2 * off);
    tear_down(&s);
}

/** What glossy materials show, which the interactive picture takes from a few directions. */
static void test_glossy_materials(void **state)
{
    (void)state;
    static const enum gn_material_type types[] = {GN_MATERIAL_MIRROR, GN_MATERIAL_GLASS,
                                                  GN_MATERIAL_GGX};
    for (int i = 0; i < 3; i++) {
        struct scene s = {0};
        const struct gn_render_options options = {.single_ray = true, .no_shadow = true};
        const struct gn_progressive_options own = {.error = 1e-6};
        set_up(&s, types[i], 2);
        gn_test_stage_set_map(&s.stage, 64, 32, paint_room, NULL);
        gn_test_stage_set_lights_from_map(&s.stage, 8);
        const struct gn_render_options exact = {.quality = GN_QUALITY_REFERENCE,
                                                .single_ray = true,
                                                .no_shadow = true,
                                                .paths_per_pixel = 4096};
        gn_test_stage_render(&s.stage, &exact);
        s.reference = s.stage.layers;
        memset(&s.stage.layers, 0, sizeof(s.stage.layers));
        begin(&s, &options, &own);
        double start = compare_now(&s).radiance;
        double error = run_to(&s, 128)->error_radiance, off = compare_now(&s).radiance;
        print_message("# material %d: radiance off by %.4f, says %.4f (start %.4f)\n", types[i],
                      off, error, start);
        assert_true(off < 1.1 * start && off < 0.06);
        // What is off at the walks' rarest finds is not all seen: a lamp through two surfaces.
        assert_true(off < 2.5 * error + 0.002 && error < 2.5 * off + 0.002);
        tear_down(&s);
    }
}

/** Lamps of the room, whose light is lost in a shadow, or virtual ones, whose light is added. */
static void test_lamps(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct scene s = {0};
        enum gn_rt_set role = i == 0 ? GN_RT_REAL : GN_RT_VIRTUAL;
        const struct gn_scene_light lamps[2] = {{{0.5, -0.5, 1.4}, {8, 6, 4}, 0, role},
                                                {{-1, 0.2, 0.9}, {2, 3, 4}, 0, role}};
        struct gn_emitters *emitters = NULL;
        struct gn_emission *emission = NULL;
        struct gn_lighting_state *dark = NULL;
        const struct gn_emitter_options pieces = {0};
        const struct gn_render_options options = {.single_ray = true};
        set_up(&s, GN_MATERIAL_DIFFUSE, 2);
        gn_test_stage_set_map(&s.stage, 64, 32, paint_room, NULL);
        gn_test_stage_set_lights_from_map(&s.stage, 8);
        assert_int_equal(gn_scene_set_lights(s.stage.scene, lamps, 2, NULL), 0);
        assert_int_equal(gn_emitters_create(s.stage.scene, &pieces, &emitters, NULL), 0);
        emission = gn_emitters_get_emission(emitters);
        assert_int_equal(gn_lighting_state_create_dark(emission, NULL, 0, &dark, NULL), 0);
        s.stage.state.n_near = dark->n_near;
        s.stage.state.near = dark->near;
        s.stage.state.emission = dark->emission;
        render_reference(&s, true);
        converge(&s, i == 0 ? "lamps" : "virtual lamps", &options, 128);
        struct off off = compare_now(&s);
        assert_true(off.shadow < 4e-3 && off.radiance < 6e-3);
        gn_lighting_state_unref(&dark);
        gn_emission_unref(&emission);
        gn_emitters_destroy(&emitters);
        tear_down(&s);
    }
}

static void test_it_stops_where_it_was_asked_to(void **state)
{
    (void)state;
    struct scene s = {0};
    const struct gn_render_options options = {0};
    struct gn_progressive_options own = {.error = 0.05};
    struct gn_error error = {0};
    struct gn_render_report report;
    set_up(&s, GN_MATERIAL_DIFFUSE, 2);
    gn_test_stage_set_map(&s.stage, 96, 48, paint_room, NULL);
    gn_test_stage_set_lights_from_map(&s.stage, 8);
    begin(&s, &options, &own);
    const struct gn_progressive_figures *f = run_to(&s, 4);
    assert_true(f->error < 0); // one round says nothing
    while (!f->why_done)
        run_to(&s, f->n_passes + 1);
    assert_true(f->n_passes >= 16 && f->n_passes % 4 == 0 && f->n_passes < 200);
    assert_true(f->error <= 0.05);

    own = (struct gn_progressive_options){.error = 1e-6, .max_passes = 11};
    begin(&s, &options, &own);
    assert_true(f->n_passes == 0 && !f->why_done && f->error < 0);
    run_to(&s, 8);
    assert_string_equal(f->why_done, "all passes are done");

    own.max_passes = 3;
    assert_int_equal(gn_progressive_begin(s.progressive, &s.stage.camera, &s.stage.state, &options,
                                          &own, &report, &error),
                     -EINVAL);
    assert_string_equal(error.text, "progressive: 3 passes, must be 4 to 1024");
    own = (struct gn_progressive_options){.error = 2};
    assert_int_equal(gn_progressive_begin(s.progressive, &s.stage.camera, &s.stage.state, &options,
                                          &own, &report, NULL),
                     -EINVAL);
    own = (struct gn_progressive_options){.n_lights = -1};
    assert_int_equal(gn_progressive_begin(s.progressive, &s.stage.camera, &s.stage.state, &options,
                                          &own, &report, NULL),
                     -EINVAL);
    tear_down(&s);
}

static void test_threads_change_no_bit_and_passes_take_no_memory(void **state)
{
    (void)state;
    struct scene s[2] = {0};
    const struct gn_render_options options = {0};
    const struct gn_progressive_options own = {.error = 1e-6};
    for (int i = 0; i < 2; i++) {
        set_up(&s[i], GN_MATERIAL_GGX, i == 0 ? 0 : 3);
        gn_test_stage_set_map(&s[i].stage, 96, 48, paint_room, NULL);
        gn_test_stage_set_lights_from_map(&s[i].stage, 8);
        begin(&s[i], &options, &own);
        run_to(&s[i], 8);
        long before = gn_test_n_allocations;
        run_to(&s[i], 16);
        begin(&s[i], &options, &own);
        run_to(&s[i], 16);
        assert_int_equal(gn_test_n_allocations - before, 0);
    }
    const struct gn_layers *a = gn_progressive_get_layers(s[0].progressive);
    const struct gn_layers *b = gn_progressive_get_layers(s[1].progressive);
    size_t n = (size_t)a->width * (size_t)a->height * sizeof(float);
    assert_memory_equal(a->virtual_rgba.data, b->virtual_rgba.data, 4 * n);
    assert_memory_equal(a->shadow.data, b->shadow.data, 3 * n);
    assert_memory_equal(a->depth.data, b->depth.data, n);
    assert_true(gn_progressive_get_figures(s[0].progressive)->error ==
                gn_progressive_get_figures(s[1].progressive)->error);
    tear_down(&s[0]);
    tear_down(&s[1]);
}

static void test_obstacles(void **state)
{
    (void)state;
    struct scene s = {0};
    struct gn_camera large = {.width = 2048, .height = 1025};
    set_up(&s, GN_MATERIAL_DIFFUSE, 0);
    struct gn_render_options options = {0};
    const struct gn_scene *scene = s.stage.scene;
    assert_null(gn_progressive_get_obstacle(scene, &s.stage.camera, &options));
    assert_non_null(gn_progressive_get_obstacle(scene, &large, &options));
    large.height = 1024;
    assert_null(gn_progressive_get_obstacle(scene, &large, &options));
    options.quality = GN_QUALITY_SEED;
    assert_non_null(gn_progressive_get_obstacle(scene, &s.stage.camera, &options));
    options.quality = GN_QUALITY_REFERENCE;
    assert_non_null(gn_progressive_get_obstacle(scene, &s.stage.camera, &options));
    options = (struct gn_render_options){.shadow_unweighted = true};
    assert_non_null(gn_progressive_get_obstacle(scene, &s.stage.camera, &options));
    options = (struct gn_render_options){.shadow_ignore_real = true};
    assert_non_null(gn_progressive_get_obstacle(scene, &s.stage.camera, &options));
    tear_down(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_it_converges_to_the_reference),
        cmocka_unit_test(test_rays_cover_the_pixels),
        cmocka_unit_test(test_glossy_materials),
        cmocka_unit_test(test_lamps),
        cmocka_unit_test(test_it_stops_where_it_was_asked_to),
        cmocka_unit_test(test_threads_change_no_bit_and_passes_take_no_memory),
        cmocka_unit_test(test_obstacles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
