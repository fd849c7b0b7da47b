/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * No ray escapes from inside a closed mesh, not through shared edges either; not where it has been
 * moved either.
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

/** Turned by no nice angle; its own size away, so that edges are aimed at to some ulps. */
static const struct gn_pose moved_pose = {{0.6, 0.48, -0.64, 0}, {1.3, -0.9, 0.7}};

static void move(float p[static 3], bool is_point)
{
    double x[3] = {p[0], p[1], p[2]};
    if (is_point)
        gn_pose_transform(&moved_pose, x, x);
    else
        gn_pose_rotate(&moved_pose, x, x);
    for (int k = 0; k < 3; k++)
        p[k] = (float)x[k];
}

/** A scene of one mesh; with a source it is moved, and a far one beside it. */
static struct gn_rt *make_scene(const struct gn_mesh *mesh, struct gn_rt **source)
{
    double identity[16];
    gn_mat4_identity(identity);
    struct gn_rt *rt = NULL;
    if (!source) {
        assert_int_equal(gn_rt_create(&rt, NULL), 0);
        assert_int_equal(gn_rt_add_mesh(rt, GN_RT_VIRTUAL, 0, mesh, identity, NULL), 0);
        assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
        return rt;
    }
    const struct gn_pose start = {{1, 0, 0, 0}, {0, 0, 0}};
    const struct gn_pose poses[2] = {moved_pose, {{1, 0, 0, 0}, {100, 0, 0}}};
    assert_int_equal(gn_rt_create(source, NULL), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(gn_rt_add_mover(*source, GN_RT_VIRTUAL, 0, mesh, identity, &start, NULL),
                         0);
    assert_int_equal(gn_rt_commit(*source, NULL, NULL), 0);
    assert_int_equal(gn_rt_create_posed(*source, &rt, NULL), 0);
    assert_int_equal(gn_rt_set_poses(rt, poses, NULL), 0);
    return rt;
}

static int count_escapes(struct gn_mesh mesh, bool at_edges, bool moves)
{
    struct gn_rt *source = NULL;
    struct gn_rt *rt = make_scene(&mesh, moves ? &source : NULL);
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
        if (moves) {
            move(org, true);
            move(dir, false);
        }
        struct gn_rt_hit hit;
        bool is_hit = gn_rt_intersect(rt, GN_RT_VIRTUAL, org, dir, 0.0f, INFINITY, &hit);
        bool is_occluded = gn_rt_is_occluded(rt, GN_RT_VIRTUAL, org, dir, 0.0f, INFINITY);
        n_escapes += !is_hit || !is_occluded;
    }
    gn_rt_destroy(&rt);
    gn_rt_destroy(&source);
    gn_mesh_finish(&mesh);
    return n_escapes;
}

static void test_sphere_holds_random_rays(void **state)
{
    assert_int_equal(count_escapes(gn_test_make_sphere(1.0f, 100), false, *state != NULL), 0);
}

static void test_sphere_holds_rays_at_edges(void **state)
{
    assert_int_equal(count_escapes(gn_test_make_sphere(1.0f, 100), true, *state != NULL), 0);
}

static void test_cube_holds_rays_at_edges(void **state)
{
    assert_int_equal(count_escapes(gn_test_make_cube(1.0f), true, *state != NULL), 0);
}

int main(void)
{
    static char moved[] = "moved";
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere_holds_random_rays),
        cmocka_unit_test(test_sphere_holds_rays_at_edges),
        cmocka_unit_test(test_cube_holds_rays_at_edges),
        {"test_moved_sphere_holds_random_rays", test_sphere_holds_random_rays, NULL, NULL, moved},
        {"test_moved_sphere_holds_rays_at_edges", test_sphere_holds_rays_at_edges, NULL, NULL,
         moved},
        {"test_moved_cube_holds_rays_at_edges", test_cube_holds_rays_at_edges, NULL, NULL, moved},
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
