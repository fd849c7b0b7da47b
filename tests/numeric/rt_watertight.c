/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * No ray escapes from inside a closed mesh, not through shared edges either.
 */
#include "server/scene/rt.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "common/pose.h"
#include "tests/meshes.h"

#define N_RAYS 1000000

static int count_escapes(struct gn_mesh mesh, bool at_edges)
{
    double identity[16];
    gn_mat4_identity(identity);
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    assert_int_equal(gn_rt_add_mesh(rt, GN_RT_VIRTUAL, 0, &mesh, identity, NULL), 0);
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    uint64_t seed = 7;
    int n_escapes = 0;
    for (int i = 0; i < N_RAYS; i++) {
        float org[3];
        float dir[3];
        gn_test_random_direction(&seed, dir);
        for (int k = 0; k < 3; k++)
            org[k] = (float)(0.4 * gn_test_random_unit(&seed) - 0.2);
        if (at_edges) {
            const uint32_t *t =
                mesh.triangles + 3 * (gn_test_random(&seed) % (uint64_t)mesh.n_triangles);
            float share = (float)gn_test_random_unit(&seed);
            float length = 0.0f;
            for (int k = 0; k < 3; k++) {
                float a = mesh.positions[3 * (size_t)t[0] + (size_t)k];
                float b = mesh.positions[3 * (size_t)t[1] + (size_t)k];
                dir[k] = a + share * (b - a) - org[k];
                length += dir[k] * dir[k];
            }
            for (int k = 0; k < 3; k++)
                dir[k] /= sqrtf(length);
        }
        struct gn_rt_hit hit;
        bool is_hit = gn_rt_intersect(rt, GN_RT_VIRTUAL, org, dir, 0.0f, INFINITY, &hit);
        bool is_occluded = gn_rt_is_occluded(rt, GN_RT_VIRTUAL, org, dir, 0.0f, INFINITY);
        n_escapes += !is_hit || !is_occluded;
    }
    gn_rt_destroy(&rt);
    gn_mesh_finish(&mesh);
    return n_escapes;
}

static void test_sphere_holds_random_rays(void **state)
{
    (void)state;
    assert_int_equal(count_escapes(gn_test_make_sphere(1.0f, 100), false), 0);
}

static void test_sphere_holds_rays_at_edges(void **state)
{
    (void)state;
    assert_int_equal(count_escapes(gn_test_make_sphere(1.0f, 100), true), 0);
}

static void test_cube_holds_rays_at_edges(void **state)
{
    (void)state;
    assert_int_equal(count_escapes(gn_test_make_cube(1.0f), true), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere_holds_random_rays),
        cmocka_unit_test(test_sphere_holds_rays_at_edges),
        cmocka_unit_test(test_cube_holds_rays_at_edges),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
