/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Meshes that move: a posed scene against one built anew with the meshes at the same places.
 */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "common/pose.h"
#include "server/scene/rt.h"
#include "tests/meshes.h"

#define N_RAYS 20000

enum { FLOOR = 3, BALL = 5, BOX = 7, ROCK = 8 };

static const double twice[16] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
static const struct gn_pose at_rest = {{1, 0, 0, 0}, {0, 0, 0.5}};

/** A real floor that rests, a virtual ball and a real box that move, a virtual rock that rests;
 * where poses are given, nothing moves and they say where ball and box are. */
static struct gn_rt *make_room(const struct gn_pose *poses)
{
    double identity[16];
    double m[16];
    gn_mat4_identity(identity);
    const double aside[16] = {1, 0, 0, 1.5, 0, 1, 0, 0, 0, 0, 1, 0.2, 0, 0, 0, 1};
    struct gn_mesh floor = gn_test_make_plane(4.0f, 3);
    struct gn_mesh ball = gn_test_make_sphere(0.25f, 12);
    struct gn_mesh box = gn_test_make_cube(0.3f);
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    assert_int_equal(gn_rt_add_mesh(rt, GN_RT_REAL, FLOOR, &floor, identity, NULL), 0);
    assert_int_equal(gn_rt_add_mesh(rt, GN_RT_VIRTUAL, ROCK, &box, aside, NULL), 0);
    if (poses) {
        gn_pose_to_matrix(&poses[0], m);
        gn_mat4_multiply(m, twice, m);
        assert_int_equal(gn_rt_add_mesh(rt, GN_RT_VIRTUAL, BALL, &ball, m, NULL), 0);
        gn_pose_to_matrix(&poses[1], m);
        assert_int_equal(gn_rt_add_mesh(rt, GN_RT_REAL, BOX, &box, m, NULL), 0);
    } else {
        assert_int_equal(gn_rt_add_mover(rt, GN_RT_VIRTUAL, BALL, &ball, twice, &at_rest, NULL), 0);
        assert_int_equal(gn_rt_add_mover(rt, GN_RT_REAL, BOX, &box, identity, &at_rest, NULL), 0);
    }
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    gn_mesh_finish(&floor);
    gn_mesh_finish(&ball);
    gn_mesh_finish(&box);
    return rt;
}

static struct gn_pose draw_pose(uint64_t *seed)
{
    struct gn_pose pose = {{0.2 + gn_test_random_unit(seed)}, {0}};
    double sum = pose.rotation[0] * pose.rotation[0];
    for (int k = 0; k < 3; k++) {
        pose.rotation[1 + k] = gn_test_random_unit(seed) - 0.5;
        sum += pose.rotation[1 + k] * pose.rotation[1 + k];
        pose.translation[k] = 2 * gn_test_random_unit(seed) - 1;
    }
    for (int k = 0; k < 4; k++)
        pose.rotation[k] /= sqrt(sum);
    return pose;
}

static void draw_ray(uint64_t *seed, float org[static 3], float dir[static 3])
{
    gn_test_random_direction(seed, dir);
    for (int k = 0; k < 3; k++)
        org[k] = (float)(2 * gn_test_random_unit(seed) - 1);
}

/** Rays that hit other things or elsewhere: few where all stands alike, those that pass an edge
 * within some ulps. */
static int count_differences(const struct gn_rt *a, const struct gn_rt *b, enum gn_rt_set set,
                             uint64_t *seed, int *n_moved)
{
    int n = 0;
    for (int i = 0; i < N_RAYS; i++) {
        float org[3];
        float dir[3];
        struct gn_rt_hit x = {0};
        struct gn_rt_hit y = {0};
        draw_ray(seed, org, dir);
        bool is_hit = gn_rt_intersect(a, set, org, dir, 0.0f, INFINITY, &x);
        bool other = gn_rt_intersect(b, set, org, dir, 0.0f, INFINITY, &y);
        assert_int_equal(gn_rt_is_occluded(a, set, org, dir, 0.0f, INFINITY), is_hit);
        *n_moved += is_hit && (x.object == BALL || x.object == BOX);
        bool differs = is_hit != other || x.object != y.object || x.triangle != y.triangle ||
                       fabsf(x.distance - y.distance) > 2e-5f;
        for (int k = 0; k < 3; k++)
            differs = differs || fabsf(x.point[k] - y.point[k]) > 2e-5f ||
                      fabsf(x.normal[k] - y.normal[k]) > 1e-5f;
        n += differs;
    }
    return n;
}

static void test_posed_scene_is_as_one_built_anew(void **state)
{
    (void)state;
    struct gn_rt *source = make_room(NULL);
    struct gn_rt *posed = NULL;
    assert_int_equal(gn_rt_create_posed(source, &posed, NULL), 0);
    uint64_t seed = 1;
    for (int round = 0; round < 6; round++) {
        struct gn_pose poses[2] = {at_rest, at_rest};
        if (round > 0) { // first as they are
            poses[0] = draw_pose(&seed);
            poses[1] = draw_pose(&seed);
            assert_int_equal(gn_rt_set_poses(posed, poses, NULL), 0);
        }
        struct gn_rt *anew = make_room(poses);
        for (int set = GN_RT_REAL; set <= GN_RT_ALL; set++) {
            int n_moved = 0;
            int n = count_differences(posed, anew, (enum gn_rt_set)set, &seed, &n_moved);
            assert_true(n <= 4); // of 20,000
            assert_true(n_moved > 100);
        }
        gn_rt_destroy(&anew);
    }
    gn_rt_destroy(&posed);
    gn_rt_destroy(&source);
}

static void test_scenes_do_not_disturb_each_other(void **state)
{
    (void)state;
    struct gn_rt *source = make_room(NULL);
    struct gn_rt *a = NULL;
    struct gn_rt *b = NULL;
    uint64_t seed = 2;
    const struct gn_pose poses[2] = {draw_pose(&seed), draw_pose(&seed)};
    const struct gn_pose rest[2] = {at_rest, at_rest};
    assert_int_equal(gn_rt_create_posed(source, &a, NULL), 0);
    assert_int_equal(gn_rt_create_posed(source, &b, NULL), 0);
    assert_int_equal(gn_rt_set_poses(a, poses, NULL), 0);
    struct gn_rt *moved = make_room(poses);
    struct gn_rt *unmoved = make_room(rest);
    int n_moved = 0;
    assert_true(count_differences(a, moved, GN_RT_ALL, &seed, &n_moved) <= 4);
    assert_true(count_differences(b, unmoved, GN_RT_ALL, &seed, &n_moved) <= 4);
    assert_true(count_differences(source, unmoved, GN_RT_ALL, &seed, &n_moved) <= 4);
    assert_true(count_differences(a, unmoved, GN_RT_ALL, &seed, &n_moved) > 100);
    gn_rt_destroy(&a); // b goes on
    assert_true(count_differences(b, unmoved, GN_RT_ALL, &seed, &n_moved) <= 4);
    gn_rt_destroy(&b);
    gn_rt_destroy(&source);
    gn_rt_destroy(&moved);
    gn_rt_destroy(&unmoved);
}

/** Ray i of a packet. */
static void set_ray(struct gn_rt_packet *packet, int i, const float org[static 3],
                    const float dir[static 3], float far)
{
    packet->org_x[i] = org[0];
    packet->org_y[i] = org[1];
    packet->org_z[i] = org[2];
    packet->dir_x[i] = dir[0];
    packet->dir_y[i] = dir[1];
    packet->dir_z[i] = dir[2];
    packet->t_far[i] = far;
    packet->valid[i] = -1;
}

static void test_packets_agree_with_single_rays(void **state)
{
    (void)state;
    struct gn_rt *source = make_room(NULL);
    struct gn_rt *rt = NULL;
    uint64_t seed = 3;
    assert_int_equal(gn_rt_create_posed(source, &rt, NULL), 0);
    for (int round = 0; round < 1000; round++) {
        const struct gn_pose poses[2] = {draw_pose(&seed), draw_pose(&seed)};
        if (round % 100 == 0)
            assert_int_equal(gn_rt_set_poses(rt, poses, NULL), 0);
        for (int set = GN_RT_REAL; set <= GN_RT_ALL; set++) {
            struct gn_rt_packet packet = {0};
            uint32_t expected = 0;
            for (int i = 0; i < GN_RT_PACKET; i++) {
                float org[3];
                float dir[3];
                draw_ray(&seed, org, dir);
                set_ray(&packet, i, org, dir, i % 2 ? INFINITY : 0.8f);
                packet.valid[i] = gn_test_random(&seed) % 4 ? -1 : 0;
                if (packet.valid[i] &&
                    gn_rt_is_occluded(rt, (enum gn_rt_set)set, org, dir, 0.0f, packet.t_far[i]))
                    expected |= UINT32_C(1) << i;
            }
            assert_int_equal(gn_rt_get_occluded16(rt, (enum gn_rt_set)set, &packet), expected);
        }
    }
    gn_rt_destroy(&rt);
    gn_rt_destroy(&source);
}

/** Rays as a frame has them: from neighbours to one light, whose directions have zeros, too. */
static void test_packets_to_one_light(void **state)
{
    (void)state;
    struct gn_mesh ball = gn_test_make_sphere(0.25f, 5);
    struct gn_rt *rt = NULL;
    double identity[16];
    uint64_t seed = 6;
    int n = 0;
    gn_mat4_identity(identity);
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    for (int i = 0; i < 4; i++) {
        const struct gn_pose pose = {{1, 0, 0, 0}, {0.5 * (i % 2), -0.5 * (i / 2), 0.1 * i}};
        assert_int_equal(gn_rt_add_mover(rt, GN_RT_VIRTUAL, BALL, &ball, identity, &pose, NULL), 0);
    }
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    for (int round = 0; round < 20000; round++) {
        struct gn_rt_packet packet = {0};
        uint32_t expected = 0;
        float at[3];
        float dir[3];
        draw_ray(&seed, at, dir);
        if (round % 10 == 0) {
            dir[0] = dir[1] = 0;
            dir[2] = round % 20 ? 1 : -1;
        }
        for (int i = 0; i < GN_RT_PACKET; i++) {
            const float org[3] = {at[0] + 0.02f * (float)(i % 4), at[1] + 0.02f * (float)(i / 4),
                                  at[2]};
            set_ray(&packet, i, org, dir, INFINITY);
            expected |= (uint32_t)gn_rt_is_occluded(rt, GN_RT_ALL, org, dir, 0.0f, INFINITY) << i;
        }
        assert_int_equal(gn_rt_get_occluded16(rt, GN_RT_ALL, &packet), expected);
        n += expected != 0;
    }
    assert_in_range(n, 1000, 19000);
    gn_mesh_finish(&ball);
    gn_rt_destroy(&rt);
}

static void test_bounds_hold_what_moves(void **state)
{
    (void)state;
    struct gn_rt *source = make_room(NULL);
    struct gn_rt *rt = NULL;
    uint64_t seed = 4;
    assert_int_equal(gn_rt_create_posed(source, &rt, NULL), 0);
    for (int round = 0; round < 20; round++) {
        const struct gn_pose poses[2] = {draw_pose(&seed), draw_pose(&seed)};
        assert_int_equal(gn_rt_set_poses(rt, poses, NULL), 0);
        struct gn_rt *anew = make_room(poses);
        for (int set = GN_RT_REAL; set <= GN_RT_ALL; set++) {
            float a[2][3];
            float b[2][3];
            assert_true(gn_rt_get_bounds(rt, (enum gn_rt_set)set, a[0], a[1]));
            assert_true(gn_rt_get_bounds(anew, (enum gn_rt_set)set, b[0], b[1]));
            for (int k = 0; k < 3; k++) {
                assert_true(a[0][k] <= b[0][k] && a[1][k] >= b[1][k]);
                assert_true(a[0][k] > b[0][k] - 0.5f && a[1][k] < b[1][k] + 0.5f);
            }
        }
        gn_rt_destroy(&anew);
    }
    gn_rt_destroy(&rt);
    gn_rt_destroy(&source);
}

static void test_what_is_no_place_is_refused(void **state)
{
    (void)state;
    struct gn_rt *source = make_room(NULL);
    struct gn_rt *rt = NULL;
    struct gn_rt *again = NULL;
    struct gn_error error = {0};
    struct gn_pose poses[2] = {at_rest, at_rest};
    assert_int_equal(gn_rt_create_posed(source, &rt, NULL), 0);
    float before[2][3];
    float after[2][3];
    assert_true(gn_rt_get_bounds(rt, GN_RT_VIRTUAL, before[0], before[1]));
    poses[0].translation[1] = 3;
    for (int i = 0; i < 2; i++) {
        poses[1].translation[0] = i ? NAN : 2e11; // the other one's is good
        assert_int_equal(gn_rt_set_poses(rt, poses, &error), -EINVAL);
        assert_non_null(strstr(error.text, "m from the origin; at most 1e+11 m"));
    }
    assert_true(gn_rt_get_bounds(rt, GN_RT_VIRTUAL, after[0], after[1]));
    assert_memory_equal(before, after, sizeof(before)); // nothing moved
    assert_int_equal(gn_rt_set_poses(source, poses, &error), -EINVAL);
    assert_non_null(strstr(error.text, "only a posed scene"));
    assert_int_equal(gn_rt_create_posed(rt, &again, &error), -EINVAL);
    assert_null(again);
    gn_rt_destroy(&rt);
    gn_rt_destroy(&source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_posed_scene_is_as_one_built_anew),
        cmocka_unit_test(test_scenes_do_not_disturb_each_other),
        cmocka_unit_test(test_packets_agree_with_single_rays),
        cmocka_unit_test(test_packets_to_one_light),
        cmocka_unit_test(test_bounds_hold_what_moves),
        cmocka_unit_test(test_what_is_no_place_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
