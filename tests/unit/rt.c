/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/rt.h"

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "common/pose.h"
#include "tests/meshes.h"

enum { FLOOR = 7, BALL = 9 };

static void add(struct gn_rt *rt, enum gn_rt_set set, uint32_t object, struct gn_mesh mesh,
                const double *matrix)
{
    double identity[16];
    gn_mat4_identity(identity);
    struct gn_error error = {0};
    int ret = gn_rt_add_mesh(rt, set, object, &mesh, matrix ? matrix : identity, &error);
    gn_mesh_finish(&mesh); // copied
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
}

/** A real floor in z = 0 and a virtual ball of radius 0.5 m standing on it. */
static struct gn_rt *make_scene(struct gn_pool *pool)
{
    const double up[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1};
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    add(rt, GN_RT_REAL, FLOOR, gn_test_make_plane(4.0f, 3), NULL);
    add(rt, GN_RT_VIRTUAL, BALL, gn_test_make_sphere(0.5f, 16), up);
    assert_int_equal(gn_rt_commit(rt, pool, NULL), 0);
    return rt;
}

static void test_hit_says_where(void **state)
{
    (void)state;
    struct gn_rt *rt = make_scene(NULL);
    const float org[3] = {1.0f, 0.3f, 2.0f};
    const float down[3] = {0.0f, 0.0f, -1.0f};
    struct gn_rt_hit hit;
    assert_true(gn_rt_intersect(rt, GN_RT_ALL, org, down, 0.0f, INFINITY, &hit));
    assert_int_equal(hit.object, FLOOR);
    assert_float_equal(hit.distance, 2.0f, 1e-6);
    assert_float_equal(hit.point[0], 1.0f, 1e-6);
    assert_float_equal(hit.point[1], 0.3f, 1e-6);
    assert_float_equal(hit.point[2], 0.0f, 0.0);
    assert_float_equal(hit.normal[2], 1.0f, 1e-7);
    assert_true(hit.clearance > 0.0f && hit.clearance < 1e-5f);

    // The winding's normal, not turned to the ray: from below it points away, too.
    const float below[3] = {1.0f, 0.3f, -2.0f};
    const float up[3] = {0.0f, 0.0f, 1.0f};
    assert_true(gn_rt_intersect(rt, GN_RT_ALL, below, up, 0.0f, INFINITY, &hit));
    assert_float_equal(hit.normal[2], 1.0f, 1e-7);
    gn_rt_destroy(&rt);
    assert_null(rt);
}

static void test_triangle_and_barycentrics_name_the_point(void **state)
{
    (void)state;
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    struct gn_mesh plane = gn_test_make_plane(4.0f, 3);
    double identity[16];
    gn_mat4_identity(identity);
    assert_int_equal(gn_rt_add_mesh(rt, GN_RT_REAL, 0, &plane, identity, NULL), 0);
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    uint64_t seed = 1;
    for (int i = 0; i < 1000; i++) {
        const float org[3] = {(float)(4.0 * gn_test_random_unit(&seed) - 2.0),
                              (float)(4.0 * gn_test_random_unit(&seed) - 2.0), 1.0f};
        const float down[3] = {0.0f, 0.0f, -1.0f};
        struct gn_rt_hit hit;
        assert_true(gn_rt_intersect(rt, GN_RT_REAL, org, down, 0.0f, INFINITY, &hit));
        const uint32_t *t = plane.triangles + 3 * (size_t)hit.triangle;
        for (int k = 0; k < 2; k++) {
            float p = (1.0f - hit.u - hit.v) * plane.positions[3 * t[0] + (uint32_t)k] +
                      hit.u * plane.positions[3 * t[1] + (uint32_t)k] +
                      hit.v * plane.positions[3 * t[2] + (uint32_t)k];
            assert_float_equal(p, org[k], 2e-6);
            assert_float_equal(hit.point[k], org[k], 2e-6);
        }
    }
    gn_mesh_finish(&plane);
    gn_rt_destroy(&rt);
}

static void test_sets_are_apart(void **state)
{
    (void)state;
    struct gn_rt *rt = make_scene(NULL);
    const float org[3] = {0.02f, 0.01f, 3.0f}; // above the ball, which hides the floor
    const float down[3] = {0.0f, 0.0f, -1.0f};
    struct gn_rt_hit hit;
    assert_true(gn_rt_intersect(rt, GN_RT_ALL, org, down, 0.0f, INFINITY, &hit));
    assert_int_equal(hit.object, BALL);
    assert_true(gn_rt_intersect(rt, GN_RT_VIRTUAL, org, down, 0.0f, INFINITY, &hit));
    assert_int_equal(hit.object, BALL);
    assert_true(gn_rt_intersect(rt, GN_RT_REAL, org, down, 0.0f, INFINITY, &hit));
    assert_int_equal(hit.object, FLOOR);
    const float aside[3] = {1.5f, 0.0f, 3.0f};
    assert_false(gn_rt_is_occluded(rt, GN_RT_VIRTUAL, aside, down, 0.0f, INFINITY));
    assert_true(gn_rt_is_occluded(rt, GN_RT_REAL, aside, down, 0.0f, INFINITY));
    assert_true(gn_rt_is_occluded(rt, GN_RT_ALL, aside, down, 0.0f, INFINITY));
    gn_rt_destroy(&rt);
}

static void test_segment_ends_count(void **state)
{
    (void)state;
    struct gn_rt *rt = make_scene(NULL);
    const float org[3] = {1.5f, 0.1f, 3.0f};
    const float down[3] = {0.0f, 0.0f, -1.0f};
    struct gn_rt_hit hit = {.object = 123};
    assert_false(gn_rt_intersect(rt, GN_RT_ALL, org, down, 0.0f, 2.99f, &hit));
    assert_false(gn_rt_intersect(rt, GN_RT_ALL, org, down, 3.01f, INFINITY, &hit));
    assert_int_equal(hit.object, 123); // untouched
    assert_false(gn_rt_is_occluded(rt, GN_RT_ALL, org, down, 0.0f, 2.99f));
    assert_false(gn_rt_is_occluded(rt, GN_RT_ALL, org, down, 3.01f, INFINITY));
    assert_true(gn_rt_is_occluded(rt, GN_RT_ALL, org, down, 2.99f, 3.01f));
    gn_rt_destroy(&rt);
}

static void test_mirroring_keeps_the_winding_normal_outside(void **state)
{
    (void)state;
    const double mirror[16] = {-2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    add(rt, GN_RT_VIRTUAL, BALL, gn_test_make_cube(1.0f), mirror);
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    uint64_t seed = 2;
    const float centre[3] = {0};
    for (int i = 0; i < 1000; i++) {
        float dir[3];
        gn_test_random_direction(&seed, dir);
        struct gn_rt_hit hit;
        assert_true(gn_rt_intersect(rt, GN_RT_ALL, centre, dir, 0.0f, INFINITY, &hit));
        float out = hit.normal[0] * dir[0] + hit.normal[1] * dir[1] + hit.normal[2] * dir[2];
        assert_true(out > 0.0f);
    }
    gn_rt_destroy(&rt);
}

/** The packet's nearest hits are those of its rays one by one; idle lanes meet nothing. */
static void check_nearest(const struct gn_rt *rt, const struct gn_rt_packet *packet)
{
    struct gn_rt_packet_hits hits;
    float low[3] = {INFINITY, INFINITY, INFINITY};
    float high[3] = {-INFINITY, -INFINITY, -INFINITY};
    float min[3];
    float max[3];
    gn_rt_intersect16(rt, GN_RT_ALL, packet, &hits);
    for (int i = 0; i < GN_RT_PACKET; i++) {
        const float org[3] = {packet->org_x[i], packet->org_y[i], packet->org_z[i]};
        const float dir[3] = {packet->dir_x[i], packet->dir_y[i], packet->dir_z[i]};
        struct gn_rt_hit hit;
        struct gn_rt_hit wide;
        bool expected =
            packet->valid[i] != 0 &&
            gn_rt_intersect(rt, GN_RT_ALL, org, dir, packet->t_near[i], packet->t_far[i], &hit);
        assert_int_equal(hits.met >> i & 1, expected);
        if (!expected)
            continue;
        gn_rt_get_hit(rt, &hits, i, &wide);
        assert_int_equal(hits.object[i], hit.object);
        assert_int_equal(wide.object, hit.object);
        assert_int_equal(wide.triangle, hit.triangle);
        assert_float_equal(wide.distance, hit.distance, 1e-5);
        for (int k = 0; k < 3; k++) {
            low[k] = wide.point[k] < low[k] ? wide.point[k] : low[k];
            high[k] = wide.point[k] > high[k] ? wide.point[k] : high[k];
        }
        for (int k = 0; k < 3; k++) {
            assert_float_equal(wide.point[k], hit.point[k], 1e-5);
            assert_float_equal(wide.normal[k], hit.normal[k], 0);
        }
    }
    gn_rt_bound_points(rt, &hits, min, max);
    assert_memory_equal(min, low, sizeof(low));
    assert_memory_equal(max, high, sizeof(high));
}

static void test_packet_agrees_with_single_rays(void **state)
{
    (void)state;
    struct gn_rt *rt = make_scene(NULL);
    uint64_t seed = 3;
    int n_occluded = 0;
    for (int round = 0; round < 500; round++) {
        struct gn_rt_packet packet = {0};
        uint32_t expected = 0;
        for (int i = 0; i < GN_RT_PACKET; i++) {
            float dir[3];
            gn_test_random_direction(&seed, dir);
            const float org[3] = {(float)(2.0 * gn_test_random_unit(&seed) - 1.0),
                                  (float)(2.0 * gn_test_random_unit(&seed) - 1.0), 0.75f};
            packet.org_x[i] = org[0];
            packet.org_y[i] = org[1];
            packet.org_z[i] = org[2];
            packet.dir_x[i] = dir[0];
            packet.dir_y[i] = dir[1];
            packet.dir_z[i] = dir[2];
            packet.t_near[i] = 0.01f;
            packet.t_far[i] = i % 2 ? INFINITY : 0.8f;
            packet.valid[i] = gn_test_random(&seed) % 4 ? -1 : 0;
            if (packet.valid[i] &&
                gn_rt_is_occluded(rt, GN_RT_ALL, org, dir, 0.01f, packet.t_far[i])) {
                expected |= UINT32_C(1) << i;
                n_occluded++;
            }
        }
        assert_int_equal(gn_rt_get_occluded16(rt, GN_RT_ALL, &packet), expected);
        check_nearest(rt, &packet);
    }
    assert_in_range(n_occluded, 1000, 5000); // neither all nor none
    gn_rt_destroy(&rt);
}

static void test_bounds(void **state)
{
    (void)state;
    struct gn_rt *rt = make_scene(NULL);
    float low[3];
    float high[3];
    assert_true(gn_rt_get_bounds(rt, GN_RT_VIRTUAL, low, high));
    assert_float_equal(low[2], 0.0f, 1e-6);
    assert_float_equal(high[2], 1.0f, 1e-6);
    assert_true(gn_rt_get_bounds(rt, GN_RT_ALL, low, high));
    assert_float_equal(low[0], -2.0f, 1e-6);
    assert_float_equal(high[2], 1.0f, 1e-6);
    gn_rt_destroy(&rt);

    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    assert_false(gn_rt_get_bounds(rt, GN_RT_ALL, low, high));
    const float x[3] = {1.0f, 0.0f, 0.0f};
    assert_false(gn_rt_is_occluded(rt, GN_RT_ALL, x, x, 0.0f, INFINITY));
    gn_rt_destroy(&rt);
}

static void test_bad_input_is_refused(void **state)
{
    (void)state;
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    struct gn_mesh cube = gn_test_make_cube(1.0f);
    const struct {
        int element;
        double value;
        const char *says;
    } cases[] = {
        {0, NAN, "element 0 is not finite"},
        {7, INFINITY, "element 7 is not finite"},
        {12, 1.0, "last row"},
        {15, 2.0, "last row"},
        {5, 0.0, "singular"},
        {3, 2e11, "at most"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        double m[16];
        gn_mat4_identity(m);
        m[cases[i].element] = cases[i].value;
        struct gn_error error = {0};
        assert_int_equal(gn_rt_add_mesh(rt, GN_RT_REAL, 0, &cube, m, &error), -EINVAL);
        assert_non_null(strstr(error.text, cases[i].says));
    }
    float low[3];
    float high[3];
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    assert_false(gn_rt_get_bounds(rt, GN_RT_ALL, low, high)); // nothing was added
    double identity[16];
    gn_mat4_identity(identity);
    assert_int_equal(gn_rt_add_mesh(rt, GN_RT_REAL, 0, &cube, identity, NULL), -EINVAL);
    gn_mesh_finish(&cube);
    gn_rt_destroy(&rt);
}

static void test_threads_build_the_same_scene(void **state)
{
    (void)state;
    // Twice as many workers as processors: no more of them join than there are slots.
    struct gn_pool *pool = NULL;
    assert_int_equal(gn_pool_create(8, &pool), 0);
    struct gn_rt *one = make_scene(NULL);
    struct gn_rt *many = make_scene(pool);
    uint64_t seed = 4;
    for (int i = 0; i < 20000; i++) {
        const float org[3] = {0.1f, 0.2f, 3.0f};
        float dir[3];
        gn_test_random_direction(&seed, dir);
        struct gn_rt_hit a = {0};
        struct gn_rt_hit b = {0};
        bool hit = gn_rt_intersect(one, GN_RT_ALL, org, dir, 0.0f, INFINITY, &a);
        assert_int_equal(hit, gn_rt_intersect(many, GN_RT_ALL, org, dir, 0.0f, INFINITY, &b));
        assert_memory_equal(&a, &b, sizeof(a));
    }
    gn_rt_destroy(&one);
    gn_rt_destroy(&many);
    gn_pool_destroy(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hit_says_where),
        cmocka_unit_test(test_triangle_and_barycentrics_name_the_point),
        cmocka_unit_test(test_sets_are_apart),
        cmocka_unit_test(test_segment_ends_count),
        cmocka_unit_test(test_mirroring_keeps_the_winding_normal_outside),
        cmocka_unit_test(test_packet_agrees_with_single_rays),
        cmocka_unit_test(test_bounds),
        cmocka_unit_test(test_bad_input_is_refused),
        cmocka_unit_test(test_threads_build_the_same_scene),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
