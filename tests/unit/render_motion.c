/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Frames of a scene whose objects move: no rule of the plan changes a bit wherever they go, what
 * is rendered is what a scene built there gives, and no memory is taken.
 */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/scene/motion.h"
#include "tests/allocations.h"
#include "tests/meshes.h"
#include "tests/stage.h"

#define N_STEPS 5

static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint_sky(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    for (int k = 0; k < 3; k++)
        out_rgb[k] = (float)(0.2 + (k + 1) * fmax(0, 0.6 * dir[0] - 0.3 * dir[1] + 0.7 * dir[2]));
}

static void set_movable(struct gn_test_stage *stage, const char *name)
{
    struct gn_scene_object *object = &stage->objects[stage->n_objects - 1];
    free(object->name);
    object->name = strdup(name);
    assert_non_null(object->name);
    object->is_movable = true;
}

/** A floor and a wall, a virtual cube at rest; a virtual ball of 80 triangles (its clusters have
 * edges) and one of 1.5 thousand, a virtual cube of twice the size and a real box that move. */
static void add_objects(struct gn_test_stage *stage, int n_pebbles)
{
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(6, 3), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.1f, 2, 1), 1.5, 0, 0.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_cube(0.3f), -0.6, 0.5, 0.15,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.2f, 5), 0, 0, 0.2,
                      GN_MATERIAL_DIFFUSE, grey);
    set_movable(stage, "ball");
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.15f, 20), 0.5, 0.5, 0.2,
                      GN_MATERIAL_MIRROR, grey);
    set_movable(stage, "fine ball");
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_cube(0.1f), 0.5, -0.5, 0.3,
                      GN_MATERIAL_DIFFUSE, grey);
    for (int k = 0; k < 3; k++)
        stage->objects[stage->n_objects - 1].world_from_object[5 * k] = 2;
    set_movable(stage, "cube");
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.2f, 0.3f, 0.6f), -0.5, -0.7, 0.3,
                      GN_MATERIAL_DIFFUSE, grey);
    set_movable(stage, "box");
    // So many that clusters and boxes are shared, also by what moves and what rests.
    for (int i = 0; i < n_pebbles; i++) {
        gn_test_stage_add(stage, i % 3 ? GN_RT_VIRTUAL : GN_RT_REAL, gn_test_make_cube(0.05f),
                          0.2 * (i % 10) - 1, 0.2 * (i / 10) - 1, 0.025, GN_MATERIAL_DIFFUSE, grey);
        if (i % 9 == 4) {
            char name[16];
            snprintf(name, sizeof(name), "pebble %d", i);
            set_movable(stage, name);
        }
    }
}

static void light(struct gn_test_stage *stage, int width, int height)
{
    const double eye[3] = {-2.2, -2, 1.8};
    const double target[3] = {0.1, 0, 0.1};
    gn_test_stage_set_map(stage, 16, 8, paint_sky, NULL);
    gn_test_stage_set_lights_from_map(stage, 2);
    gn_test_stage_aim(stage, width, height, width * 1.1, eye, target);
}

/** Poses along a path: the first as in the scene; turned about no nice axis, to the floor and into
 * each other, at last out of the picture. */
static void get_poses(const struct gn_scene *scene, int step, struct gn_pose *out)
{
    for (int i = 0; i < scene->n_movable; i++) {
        const struct gn_pose *first = &scene->objects[scene->movable[i]].pose;
        double angle = 0.37 * step * (i % 3 + 1);
        const struct gn_pose turn = {
            .rotation = {cos(angle), 0.48 * sin(angle), -0.36 * sin(angle), 0.8 * sin(angle)},
            .translation = {0.15 * step * cos(i), 0.12 * step * sin(1.3 * i), 0.04 * step - 0.02}};
        out[i] = *first;
        if (step == 0)
            continue;
        gn_pose_multiply(first, &turn, &out[i]);
        out[i].translation[0] += step == N_STEPS - 1 ? 30 : 0;
    }
}

static void render(struct gn_test_stage *stage, const struct gn_scene *posed,
                   const struct gn_render_options *options, bool all_passes, struct gn_layers *out)
{
    struct gn_render_options o = *options;
    o.all_passes = all_passes;
    struct gn_error error = {0};
    gn_renderer_set_scene(stage->renderer, posed);
    assert_int_equal(gn_renderer_render(stage->renderer, &stage->camera, &stage->state, &o, out,
                                        &stage->report, &error),
                     0);
}

static void assert_equal_images(const struct gn_image *a, const struct gn_image *b)
{
    assert_memory_equal(a->data, b->data,
                        sizeof(float) * (size_t)a->width * (size_t)a->height * (size_t)a->channels);
}

static void assert_equal_layers(const struct gn_layers *a, const struct gn_layers *b)
{
    assert_equal_images(&a->virtual_rgba, &b->virtual_rgba);
    assert_equal_images(&a->shadow, &b->shadow);
    assert_equal_images(&a->added, &b->added);
    assert_equal_images(&a->depth, &b->depth);
}

static void check_rules(int n_pebbles, enum gn_quality quality, int width)
{
    const struct gn_render_options options = {.quality = quality};
    struct gn_test_stage stage = {0};
    struct gn_layers all = {0};
    struct gn_layers ruled = {0};
    struct gn_motion *motion = NULL;
    struct gn_pose poses[GN_TEST_STAGE_MAX];
    int64_t n_shadows = 0;
    add_objects(&stage, n_pebbles);
    gn_test_stage_commit(&stage, 2);
    light(&stage, width, width * 3 / 4);
    assert_int_equal(gn_layers_init(&all, width, width * 3 / 4), 0);
    assert_int_equal(gn_layers_init(&ruled, width, width * 3 / 4), 0);
    assert_int_equal(gn_motion_create(stage.scene, &motion, NULL), 0);
    for (int step = 0; step < N_STEPS; step++) {
        struct gn_scene_snapshot *snapshot = NULL;
        get_poses(stage.scene, step, poses);
        assert_int_equal(gn_motion_make_snapshot(motion, poses, &snapshot, NULL), 0);
        const struct gn_scene *posed = gn_scene_snapshot_get(snapshot);
        render(&stage, posed, &options, true, &all);
        uint64_t n_rays = stage.report.rays_shadow;
        render(&stage, posed, &options, false, &ruled);
        assert_true(stage.report.rays_shadow < n_rays); // the rules do something
        n_shadows += stage.report.n_shadow_pixels;
        assert_equal_layers(&all, &ruled);
        gn_scene_snapshot_unref(&snapshot);
    }
    assert_true(n_shadows > 20);
    gn_layers_finish(&all);
    gn_layers_finish(&ruled);
    gn_test_stage_finish(&stage);
    gn_motion_destroy(&motion);
}

static void test_rules_change_no_bit(void **state)
{
    (void)state;
    check_rules(0, GN_QUALITY_INTERACTIVE, 48);
    check_rules(0, GN_QUALITY_REFERENCE, 16);
}

static void test_rules_change_no_bit_with_shared_boxes(void **state)
{
    (void)state;
    check_rules(88, GN_QUALITY_INTERACTIVE, 40);
    check_rules(88, GN_QUALITY_REFERENCE, 12);
}

/** Pixels that differ: of the edges of objects, where a float's last bits decide. */
static int count_differences(const struct gn_image *a, const struct gn_image *b)
{
    int n = 0;
    for (int i = 0; i < a->width * a->height; i++) {
        float most = 0;
        for (int k = 0; k < a->channels; k++) {
            float x = a->data[i * a->channels + k];
            float y = b->data[i * a->channels + k];
            most = fmaxf(most, x == y ? 0 : fabsf(x - y));
        }
        n += most > 1e-3f;
    }
    return n;
}

static void test_moved_scene_looks_as_one_built_there(void **state)
{
    (void)state;
    const struct gn_render_options options = {0};
    struct gn_test_stage stage = {0};
    struct gn_motion *motion = NULL;
    struct gn_pose poses[GN_TEST_STAGE_MAX];
    add_objects(&stage, 0);
    gn_test_stage_commit(&stage, 0);
    light(&stage, 64, 48);
    assert_int_equal(gn_motion_create(stage.scene, &motion, NULL), 0);
    for (int step = 0; step < 4; step++) {
        struct gn_test_stage anew = {0};
        struct gn_scene_snapshot *snapshot = NULL;
        get_poses(stage.scene, step, poses);
        assert_int_equal(gn_motion_make_snapshot(motion, poses, &snapshot, NULL), 0);
        const struct gn_scene *posed = gn_scene_snapshot_get(snapshot);
        gn_renderer_set_scene(stage.renderer, posed);
        gn_test_stage_render(&stage, &options);
        add_objects(&anew, 0);
        for (int i = 0; i < anew.n_objects; i++) {
            memcpy(anew.objects[i].world_from_object, posed->objects[i].world_from_object,
                   sizeof(anew.objects[i].world_from_object));
            anew.objects[i].is_movable = false;
        }
        gn_test_stage_commit(&anew, 0);
        light(&anew, 64, 48);
        gn_test_stage_render(&anew, &options);
        assert_true(stage.report.n_virtual_pixels > 100 && stage.report.n_shadow_pixels > 100);
        assert_true(count_differences(&stage.layers.virtual_rgba, &anew.layers.virtual_rgba) < 15);
        assert_true(count_differences(&stage.layers.shadow, &anew.layers.shadow) < 15);
        assert_true(count_differences(&stage.layers.depth, &anew.layers.depth) < 15);
        gn_test_stage_finish(&anew);
        gn_renderer_set_scene(stage.renderer, stage.scene);
        gn_scene_snapshot_unref(&snapshot);
    }
    gn_test_stage_finish(&stage);
    gn_motion_destroy(&motion);
}

static void test_a_held_snapshot_stays(void **state)
{
    (void)state;
    const struct gn_render_options options = {0};
    struct gn_test_stage stage = {0};
    struct gn_layers first = {0};
    struct gn_layers later = {0};
    struct gn_motion *motion = NULL;
    struct gn_scene_snapshot *held[GN_SCENE_SNAPSHOTS_MAX] = {NULL};
    struct gn_scene_snapshot *none = NULL;
    struct gn_pose poses[GN_TEST_STAGE_MAX];
    struct gn_error error = {0};
    add_objects(&stage, 0);
    gn_test_stage_commit(&stage, 0);
    light(&stage, 64, 48);
    assert_int_equal(gn_layers_init(&first, 64, 48), 0);
    assert_int_equal(gn_layers_init(&later, 64, 48), 0);
    assert_int_equal(gn_motion_create(stage.scene, &motion, NULL), 0);
    for (int i = 0; i < GN_SCENE_SNAPSHOTS_MAX; i++) {
        get_poses(stage.scene, i + 1, poses);
        assert_int_equal(gn_motion_make_snapshot(motion, poses, &held[i], NULL), 0);
        if (i == 0)
            render(&stage, gn_scene_snapshot_get(held[0]), &options, false, &first);
    }
    assert_int_equal(gn_motion_make_snapshot(motion, poses, &none, &error), -EBUSY);
    assert_null(none);
    assert_non_null(strstr(error.text, "in use"));
    render(&stage, gn_scene_snapshot_get(held[1]), &options, false, &later);
    assert_true(count_differences(&first.shadow, &later.shadow) > 20);
    render(&stage, gn_scene_snapshot_get(held[0]), &options, false, &later);
    assert_equal_layers(&first, &later);

    // A second holder keeps it from being made anew; without one it is.
    struct gn_scene_snapshot *again = gn_scene_snapshot_ref(held[3]);
    gn_scene_snapshot_unref(&held[3]);
    assert_null(held[3]);
    assert_int_equal(gn_motion_make_snapshot(motion, poses, &none, NULL), -EBUSY);
    gn_scene_snapshot_unref(&again);
    assert_int_equal(gn_motion_make_snapshot(motion, poses, &none, NULL), 0);
    gn_scene_snapshot_unref(&none);
    poses[0].translation[2] = 1e12;
    assert_int_equal(gn_motion_make_snapshot(motion, poses, &none, &error), -EINVAL);
    assert_null(none);
    for (int i = 0; i < GN_SCENE_SNAPSHOTS_MAX; i++)
        gn_scene_snapshot_unref(&held[i]);
    gn_layers_finish(&first);
    gn_layers_finish(&later);
    gn_test_stage_finish(&stage);
    gn_motion_destroy(&motion);
}

static void test_moving_takes_no_memory(void **state)
{
    (void)state;
    const struct gn_render_options options = {0};
    struct gn_test_stage stage = {0};
    struct gn_motion *motion = NULL;
    struct gn_pose poses[GN_TEST_STAGE_MAX];
    long before = 0;
    add_objects(&stage, 40);
    gn_test_stage_commit(&stage, 2);
    light(&stage, 64, 48);
    assert_int_equal(gn_layers_init(&stage.layers, 64, 48), 0);
    assert_int_equal(gn_motion_create(stage.scene, &motion, NULL), 0);
    for (int step = 0; step < N_STEPS; step++) {
        struct gn_scene_snapshot *snapshot = NULL;
        if (step == 1) {
            assert_true(gn_test_n_allocations > 0); // the counter works
            before = gn_test_n_allocations;
        }
        get_poses(stage.scene, step, poses);
        assert_int_equal(gn_motion_make_snapshot(motion, poses, &snapshot, NULL), 0);
        render(&stage, gn_scene_snapshot_get(snapshot), &options, false, &stage.layers);
        gn_scene_snapshot_unref(&snapshot);
    }
    assert_int_equal(gn_test_n_allocations, before);
    gn_test_stage_finish(&stage);
    gn_motion_destroy(&motion);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rules_change_no_bit),
        cmocka_unit_test(test_rules_change_no_bit_with_shared_boxes),
        cmocka_unit_test(test_moved_scene_looks_as_one_built_there),
        cmocka_unit_test(test_a_held_snapshot_stays),
        cmocka_unit_test(test_moving_takes_no_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
