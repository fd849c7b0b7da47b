/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Objects that move at all scales and far from the origin, where they are traced less exactly than
 * what rests: no rule of the plan may change a bit for that, nor may light get past them.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/pose.h"
#include "proto/attr.h"
#include "server/scene/motion.h"
#include "tests/meshes.h"
#include "tests/numeric/extreme.h"

#define SIDE 32
#define N_PIXELS (SIDE * SIDE)

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const double scales[] = {1e-3, 1e6};
static const double distances[] = {1e2, 1e4};

static void add_mover(struct gn_test_stage *stage, enum gn_rt_set role, struct gn_mesh mesh,
                      const char *name, double x, double y, double z)
{
    gn_test_stage_add(stage, role, mesh, x, y, z, GN_MATERIAL_DIFFUSE, grey);
    struct gn_scene_object *object = &stage->objects[stage->n_objects - 1];
    object->is_movable = true;
    free(object->name);
    object->name = strdup(name);
}

/** Where all movers stand after the i-th step, turned about their own middles. */
static void get_poses(const struct gn_scene *scene, const struct gn_extreme_place *place, int step,
                      struct gn_pose *out)
{
    for (int i = 0; i < scene->n_movable; i++) {
        double angle = 0.4 * step * (i + 1);
        double along = 0.1 * step * place->scale;
        const struct gn_pose turn = {
            .rotation = {cos(angle), 0.48 * sin(angle), -0.36 * sin(angle), 0.8 * sin(angle)},
            .translation = {along, -0.5 * along * i, 0.3 * along}};
        gn_pose_multiply(&scene->objects[scene->movable[i]].pose, &turn, &out[i]);
    }
}

static void count_shadow(void *context, const struct gn_extreme_view *view)
{
    int *n = context;
    for (int i = 0; i < N_PIXELS; i++)
        *n += view->layers->shadow.data[3 * i] < 0.9f;
}

static void check_yard(const struct gn_extreme_place *place)
{
    static const double eye[3] = {1.6, -2.2, 1.8}, target[3] = {0, 0, 0.1};
    static const struct gn_render_options one_ray = {.single_ray = true};
    struct gn_test_stage stage = {0};
    struct gn_motion *motion = NULL;
    int n_shadow = 0;
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(4, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    add_mover(&stage, GN_RT_REAL, gn_test_make_cube(0.5f), "crate", 0.9, 0.6, 0.3);
    add_mover(&stage, GN_RT_VIRTUAL, gn_test_make_cube(0.6f), "cube", 0, 0, 0.6);
    add_mover(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 6), "ball", -0.7, 0.4, 0.4);
    gn_extreme_move_objects(&stage, place);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, place, 16);
    gn_extreme_aim(&stage, place, SIDE, 34, eye, target);
    assert_int_equal(gn_motion_create(stage.scene, &motion, NULL), 0);
    for (int step = 0; step < 3; step++) {
        struct gn_pose poses[3];
        struct gn_scene_snapshot *snapshot = NULL;
        get_poses(stage.scene, place, step, poses);
        assert_int_equal(gn_motion_make_snapshot(motion, poses, &snapshot, NULL), 0);
        gn_extreme_check(&stage, gn_scene_snapshot_get(snapshot), &one_ray, count_shadow,
                         &n_shadow);
        gn_renderer_set_scene(stage.renderer, stage.scene);
        gn_scene_snapshot_unref(&snapshot);
    }
    assert_true(n_shadow > 300);
    gn_motion_destroy(&motion);
    gn_test_stage_finish(&stage);
}

static void test_rules_change_no_bit_far_away(void **state)
{
    (void)state;
    for (size_t s = 0; s < GN_ARRAY_LEN(scales); s++) {
        for (size_t d = 0; d < GN_ARRAY_LEN(distances); d++) {
            const struct gn_extreme_place place = gn_extreme_away(scales[s], distances[d]);
            print_message("# scale %g, %g sizes away\n", scales[s], distances[d]);
            check_yard(&place);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rules_change_no_bit_far_away),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
