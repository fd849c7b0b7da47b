/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What real mirrors and real glass show of virtual objects and their shadows. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/meshes.h"
#include "tests/stage.h"

enum { WIDTH = 48, HEIGHT = 36 };

static const float grey[3] = {0.5f, 0.4f, 0.3f};
static const float white[3] = {1, 1, 1};
static const float silver[3] = {0.9f, 0.8f, 0.7f};

/** Light from x > 0 alone, a lamp in it. */
static void paint_right(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    double c = fmax(0, 0.6 * dir[0] + 0.8 * dir[2]);
    for (int k = 0; k < 3; k++)
        out_rgb[k] = dir[0] > 0.02 ? (float)(0.5 + 0.1 * k + 30 * pow(c, 60)) : 0;
}

static void paint_even(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 1;
}

static const struct gn_plan_entry *get_line(const struct gn_test_stage *stage)
{
    for (int i = 0; i < stage->report.n_plan; i++) {
        if (strcmp(stage->report.plan[i].pass, "optics") == 0)
            return &stage->report.plan[i];
    }
    fail_msg("no line optics");
    return NULL;
}

/** A plane of the size across x, seen from x > 0, its middle at (x, 0, z). */
static void add_wall(struct gn_test_stage *stage, float size, double x, double z,
                     enum gn_material_type type, const float albedo[static 3])
{
    static const double turned[16] = {0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(size, 2), 0, 0, 0, type, albedo);
    double *m = stage->objects[stage->n_objects - 1].world_from_object;
    memcpy(m, turned, sizeof(turned));
    m[3] = x;
    m[11] = z;
}

/** A floor and a virtual ball at x > 0; with a mirror across x = 0, or as seen from behind it. */
static void init_room(struct gn_test_stage *stage, bool has_mirror, enum gn_material_type mirror)
{
    const double side = has_mirror ? 1 : -1;
    const double eye[3] = {side * 2.5, -1.8, 1.2};
    const double target[3] = {-side * 0.7, 0.2, 0.2};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(8, 3), 4.001, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 24), 0.7, 0.2, 0.35,
                      GN_MATERIAL_DIFFUSE, grey);
    if (has_mirror)
        add_wall(stage, 40, 0, 0, mirror, silver);
    stage->objects[stage->n_objects - 1].material.metallic = 1; // of ggx
    gn_test_stage_commit(stage, 2);
    gn_test_stage_set_map(stage, 64, 32, paint_right, NULL);
    gn_test_stage_set_lights_from_map(stage, 4);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 64, eye, target);
}

/** The mirror's picture is the one of the camera behind it, its albedo times as bright. */
static void check_mirror(enum gn_material_type mirror, const struct gn_render_options *options)
{
    struct gn_test_stage in_mirror = {0};
    struct gn_test_stage behind = {0};
    int n_virtual = 0;
    int n_shadow = 0;
    init_room(&in_mirror, true, mirror);
    init_room(&behind, false, mirror);
    gn_test_stage_render(&in_mirror, options);
    gn_test_stage_render(&behind, options);
    assert_true(get_line(&in_mirror)->ran);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int x = i % WIDTH;
        int y = i / WIDTH;
        const float *direct = gn_image_at(&in_mirror.layers.virtual_rgba, x, y);
        const float *factor = gn_image_at(&in_mirror.layers.shadow, x, y);
        const float *added = gn_image_at(&in_mirror.layers.added, x, y);
        const float *rgba = gn_image_at(&behind.layers.virtual_rgba, WIDTH - 1 - x, y);
        const float *shadow = gn_image_at(&behind.layers.shadow, WIDTH - 1 - x, y);
        double point[3];
        gn_test_stage_get_point(&in_mirror, x + 0.5, y + 0.5, 0, point);
        if (direct[3] > 0 || point[0] > 0) // not in the mirror
            continue;
        n_virtual += rgba[3] == 1;
        n_shadow += rgba[3] == 0 && shadow[0] < 0.9f;
        double dir[3];
        assert_true(gn_camera_get_ray(&in_mirror.camera, x + 0.5, y + 0.5, dir));
        gn_pose_rotate(&in_mirror.camera.world_from_camera, dir, dir);
        for (int k = 0; k < 3; k++) {
            double more = mirror == GN_MATERIAL_GGX ? pow(1 - fabs(dir[0]), 5) : 0; // Schlick's
            double share = silver[k] + (1 - (double)silver[k]) * more;
            assert_float_equal(added[k], share * rgba[k], 3e-3 * (1 + (double)rgba[k]));
            assert_float_equal(factor[k], rgba[3] == 1 ? 0 : shadow[k], 3e-3);
        }
    }
    assert_true(n_virtual > 60);
    assert_true(n_shadow > 20);
    gn_test_stage_finish(&in_mirror);
    gn_test_stage_finish(&behind);
}

static void test_a_mirror_shows_what_is_before_it(void **state)
{
    (void)state;
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
        const struct gn_render_options options = {.quality = (enum gn_quality)quality,
                                                  .single_ray = true};
        check_mirror(GN_MATERIAL_MIRROR, &options);
        check_mirror(GN_MATERIAL_GGX, &options);
    }
}

/** Under even light whatever mirrors all shows the same: shadow 1 + added is 1. (Of rays that meet
 * an edge of the glass some are lost.) */
static void check_furnace(const struct gn_test_stage *stage)
{
    int64_t n_lost = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const float *factor = gn_image_at(&stage->layers.shadow, i % WIDTH, i / WIDTH);
        const float *added = gn_image_at(&stage->layers.added, i % WIDTH, i / WIDTH);
        const float *rgba = gn_image_at(&stage->layers.virtual_rgba, i % WIDTH, i / WIDTH);
        n_lost += factor[0] < 1;
        for (int k = 0; k < 3; k++)
            assert_float_equal((factor[k] + added[k]) * (1 - rgba[3]) + rgba[k], 1, 5e-3);
    }
    assert_true(n_lost > 50);
}

static void init_furnace(struct gn_test_stage *stage, float roughness)
{
    const double eye[3] = {2.5, -1.5, 0.2};
    const double target[3] = {0, 0.2, 0.1};
    add_wall(stage, 2, -0.5, 0, GN_MATERIAL_MIRROR, white);
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.05f, 1, 1), 0.6, -0.5, 0,
                      GN_MATERIAL_GLASS, white);
    stage->objects[stage->n_objects - 1].material.roughness = roughness;
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 24), 0, 0.2, 0,
                      GN_MATERIAL_MIRROR, white);
    gn_test_stage_commit(stage, 2);
    gn_test_stage_set_map(stage, 16, 8, paint_even, NULL);
    gn_test_stage_set_lights_from_map(stage, 2);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 40, eye, target);
}

static void test_no_light_is_lost_or_won_under_even_light(void **state)
{
    (void)state;
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
        const struct gn_render_options options = {.quality = (enum gn_quality)quality};
        struct gn_test_stage stage = {0};
        init_furnace(&stage, 0);
        gn_test_stage_render(&stage, &options);
        check_furnace(&stage);
        gn_test_stage_finish(&stage);
    }
}

/** A ball and its shadow on a floor, looked down at, with or without a pane between. */
static void init_pane(struct gn_test_stage *stage, bool has_pane, enum gn_material_type floor)
{
    const double eye[3] = {0.9, 0, 3};
    const double target[3] = {0.9, 0, 0};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(8, 3), 0, 0, 0, floor, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 24), 1, 0, 0.35,
                      GN_MATERIAL_DIFFUSE, grey);
    if (has_pane) // near the camera, where it takes no light from the rest
        gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.5f, 0.5f, 0.002f), 0.9, 0, 2.8,
                          GN_MATERIAL_GLASS, white);
    gn_test_stage_commit(stage, 2);
    gn_test_stage_set_map(stage, 64, 32, paint_right, NULL);
    gn_test_stage_set_lights_from_map(stage, 4);
    const struct gn_light light = {.dir_world = {0.8, 0, 0.6}, .irradiance = {3, 2, 1}};
    gn_test_stage_set_lights(stage, &light, 1);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 60, eye, target);
}

static void test_a_pane_shows_what_is_behind_it(void **state)
{
    (void)state;
    const struct gn_render_options options = {.single_ray = true};
    struct gn_test_stage through = {0};
    struct gn_test_stage direct = {0};
    // Normal incidence, ior 1.5: 4 % of the light at each face; twice there and back is left out.
    const double passed = 0.96 * 0.96;
    int n_virtual = 0;
    int n_shadow = 0;
    init_pane(&through, true, GN_MATERIAL_DIFFUSE);
    init_pane(&direct, false, GN_MATERIAL_DIFFUSE);
    gn_test_stage_render(&through, &options);
    gn_test_stage_render(&direct, &options);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int x = i % WIDTH;
        int y = i / WIDTH;
        if (abs(x - WIDTH / 2) > 12 || abs(y - HEIGHT / 2) > 12)
            continue; // the pane's middle: rays near its normal
        const float *rgba = gn_image_at(&direct.layers.virtual_rgba, x, y);
        const float *shadow = gn_image_at(&direct.layers.shadow, x, y);
        const float *factor = gn_image_at(&through.layers.shadow, x, y);
        const float *added = gn_image_at(&through.layers.added, x, y);
        assert_true(gn_image_at(&through.layers.virtual_rgba, x, y)[3] == 0);
        n_virtual += rgba[3] == 1 && rgba[0] > 0.05f;
        n_shadow += rgba[3] == 0 && shadow[0] < 0.5f;
        for (int k = 0; k < 3; k++) {
            assert_float_equal(added[k], passed * (double)rgba[k], 0.004 + 0.03 * (double)rgba[k]);
            if (rgba[3] == 0 && shadow[k] > 0.99f)
                assert_float_equal(factor[k], 1, 0.01);
        }
    }
    assert_true(n_virtual > 50);
    assert_true(n_shadow > 20);
    gn_test_stage_finish(&through);
    gn_test_stage_finish(&direct);
}

/** Mean light that a rough pane adds by a ball on the camera's side of it, which is all it mirrors:
 * some hundredths of what its facets are tried for. */
static double get_glare(enum gn_quality quality)
{
    const struct gn_render_options options = {.quality = quality, .single_ray = true};
    const double eye[3] = {3, 0, 0};
    const double target[3] = {0, 0, 0};
    struct gn_test_stage stage = {0};
    double sum = 0;
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_box(0.05f, 1, 1), -0.1, 0, 0,
                      GN_MATERIAL_GLASS, white);
    stage.objects[0].material.roughness = 0.3f;
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.6f, 24), 1.5, 1.2, 0,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 2);
    gn_test_stage_set_map(&stage, 16, 8, paint_even, NULL);
    gn_test_stage_set_lights_from_map(&stage, 2);
    gn_test_stage_aim(&stage, 32, 24, 50, eye, target);
    gn_test_stage_render(&stage, &options);
    for (int i = 0; i < 32 * 24; i++) {
        if (gn_image_at(&stage.layers.virtual_rgba, i % 32, i / 32)[3] == 0)
            sum += (double)gn_image_at(&stage.layers.added, i % 32, i / 32)[1];
    }
    gn_test_stage_finish(&stage);
    return sum / (32 * 24);
}

static void test_rough_glass_mirrors_a_little(void **state)
{
    (void)state;
    double interactive = get_glare(GN_QUALITY_INTERACTIVE);
    double reference = get_glare(GN_QUALITY_REFERENCE);
    print_message("# glare %.6f, reference %.6f\n", interactive, reference);
    assert_true(reference > 1e-4);
    assert_float_equal(interactive / reference, 1, 0.2);
}

/** Where it mirrors what is black, a polished floor has the shadow of a plain one. */
static void test_a_polished_floor_has_its_shadow(void **state)
{
    (void)state;
    const struct gn_render_options options = {.single_ray = true};
    struct gn_test_stage polished = {0};
    struct gn_test_stage plain = {0};
    int n_shadow = 0;
    init_pane(&polished, false, GN_MATERIAL_GGX);
    init_pane(&plain, false, GN_MATERIAL_DIFFUSE);
    gn_test_stage_render(&polished, &options);
    gn_test_stage_render(&plain, &options);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int x = i % WIDTH;
        int y = i / WIDTH;
        double p[3];
        const float *a = gn_image_at(&polished.layers.shadow, x, y);
        const float *b = gn_image_at(&plain.layers.shadow, x, y);
        gn_test_stage_get_point(&plain, x + 0.5, y + 0.5, 0, p);
        if (p[0] > 0.8 || gn_image_at(&plain.layers.virtual_rgba, x, y)[3] > 0)
            continue;
        n_shadow += b[0] < 0.5f;
        for (int k = 0; k < 3; k++)
            assert_float_equal(a[k], b[k], 1e-4);
    }
    assert_true(n_shadow > 20);
    gn_test_stage_finish(&polished);
    gn_test_stage_finish(&plain);
}

static void assert_same(const struct gn_image *a, const struct gn_image *b)
{
    size_t n = (size_t)WIDTH * HEIGHT * (size_t)a->channels;
    assert_memory_equal(a->data, b->data, n * sizeof(*a->data));
}

static void test_omissions_change_nothing(void **state)
{
    (void)state;
    for (int quality = 0; quality <= GN_QUALITY_REFERENCE; quality++) {
        struct gn_render_options options = {.quality = (enum gn_quality)quality};
        struct gn_test_stage some = {0};
        struct gn_test_stage all = {0};
        init_room(&some, true, GN_MATERIAL_MIRROR);
        init_room(&all, true, GN_MATERIAL_MIRROR);
        gn_test_stage_render(&some, &options);
        options.all_passes = true;
        gn_test_stage_render(&all, &options);
        assert_same(&some.layers.shadow, &all.layers.shadow);
        assert_same(&some.layers.added, &all.layers.added);
        assert_same(&some.layers.virtual_rgba, &all.layers.virtual_rgba);
        gn_test_stage_finish(&some);
        gn_test_stage_finish(&all);
    }
}

static void test_the_plan_says_why_not(void **state)
{
    (void)state;
    const struct gn_render_options options = {0};
    const double away[3] = {9, -1.8, 1.2};
    const double eye[3] = {2.5, -1.8, 1.2};
    struct gn_test_stage stage = {0};
    init_room(&stage, false, GN_MATERIAL_MIRROR);
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage)->ran);
    assert_string_equal(get_line(&stage)->why, "no mirror or glass among the real objects");
    gn_test_stage_finish(&stage);

    init_room(&stage, true, GN_MATERIAL_MIRROR);
    gn_test_stage_aim(&stage, WIDTH, HEIGHT, 40, eye, away);
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage)->ran);
    assert_string_equal(get_line(&stage)->why, "no real mirror or glass in view");
    assert_int_equal(stage.report.rays_mirror, 0);
    gn_test_stage_finish(&stage);

    add_wall(&stage, 2, 0, 0, GN_MATERIAL_MIRROR, white);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_even, NULL);
    gn_test_stage_set_lights_from_map(&stage, 2);
    gn_test_stage_aim(&stage, WIDTH, HEIGHT, 40, eye, (const double[3]){0});
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage)->ran);
    assert_string_equal(get_line(&stage)->why, "the scene has no virtual object");
    assert_int_equal(stage.report.rays_mirror, 0);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_mirror_shows_what_is_before_it),
        cmocka_unit_test(test_no_light_is_lost_or_won_under_even_light),
        cmocka_unit_test(test_a_pane_shows_what_is_behind_it),
        cmocka_unit_test(test_rough_glass_mirrors_a_little),
        cmocka_unit_test(test_a_polished_floor_has_its_shadow),
        cmocka_unit_test(test_omissions_change_nothing),
        cmocka_unit_test(test_the_plan_says_why_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
