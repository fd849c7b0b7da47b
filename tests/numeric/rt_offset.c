/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gn_rt_offset_origin at all scales and far from the origin: no point of a lit plane shadows itself
 * (acne), and no ray from a wall slips out of a closed room (leak).
 */
#include "server/scene/rt.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "common/pose.h"
#include "tests/meshes.h"

#define N_POINTS 20000
#define DEGREE (3.14159265358979323846 / 180.0)

static const double scales[] = {1e-3, 1.0, 1e3, 1e6};
// Distance of the object from the origin, in its own sizes; -1: the plane goes through the origin.
static const double distances[] = {0.0, 1.0, 1e2, 1e4};

/** Turned by no nice angle about no nice axis, scaled, moved. */
static void make_matrix(double scale, double distance, double out[static 16])
{
    const struct gn_pose pose = {
        .rotation = {0.7384, 0.2615, -0.4523, 0.4268},
        .translation = {0.7 * distance * scale, -0.5 * distance * scale, 0.51 * distance * scale},
    };
    struct gn_pose unit = pose;
    assert_int_equal(gn_pose_normalize(&unit), 0);
    gn_pose_to_matrix(&unit, out);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            out[4 * i + k] *= scale;
    }
}

/** A world scene of one mesh that is 1 m large before the matrix. */
static struct gn_rt *make_scene(struct gn_mesh mesh, const double matrix[static 16])
{
    struct gn_rt *rt = NULL;
    assert_int_equal(gn_rt_create(&rt, NULL), 0);
    assert_int_equal(gn_rt_add_mesh(rt, GN_RT_REAL, 0, &mesh, matrix, NULL), 0);
    assert_int_equal(gn_rt_commit(rt, NULL, NULL), 0);
    gn_mesh_finish(&mesh);
    return rt;
}

static void to_world(const double m[static 16], const double p[static 3], float out[static 3])
{
    double world[3];
    gn_mat4_transform_point(m, p, world);
    for (int k = 0; k < 3; k++)
        out[k] = (float)world[k];
}

/** Unit world direction of an object direction. */
static void turn_to_world(const double m[static 16], const double d[static 3], float out[static 3])
{
    double w[3];
    for (int k = 0; k < 3; k++)
        w[k] = m[4 * k] * d[0] + m[4 * k + 1] * d[1] + m[4 * k + 2] * d[2];
    double length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    for (int k = 0; k < 3; k++)
        out[k] = (float)(w[k] / length);
}

/** Points of a plane of n x n cells that shadow themselves under a light 89.9 degrees off. */
static int count_acne(int n, double scale, double distance)
{
    double m[16];
    make_matrix(scale, distance, m);
    struct gn_rt *rt = make_scene(gn_test_make_plane(1.0f, n), m);
    uint64_t seed = 5;
    int n_acne = 0;
    int n_hits = 0;
    for (int i = 0; i < N_POINTS; i++) {
        const double at[3] = {0.98 * (gn_test_random_unit(&seed) - 0.5),
                              0.98 * (gn_test_random_unit(&seed) - 0.5), 0.7};
        const double phi = 360.0 * DEGREE * gn_test_random_unit(&seed);
        const double down[3] = {0.001, 0.002, -1.0};
        const double light[3] = {sin(89.9 * DEGREE) * cos(phi), sin(89.9 * DEGREE) * sin(phi),
                                 cos(89.9 * DEGREE)};
        float org[3];
        float dir[3];
        float to_light[3];
        to_world(m, at, org);
        turn_to_world(m, down, dir);
        turn_to_world(m, light, to_light);
        struct gn_rt_hit hit;
        if (!gn_rt_intersect(rt, GN_RT_REAL, org, dir, 0.0f, INFINITY, &hit))
            continue;
        n_hits++;
        float start[3];
        gn_rt_offset_origin(hit.point, hit.normal, hit.clearance, to_light, start);
        n_acne += gn_rt_is_occluded(rt, GN_RT_REAL, start, to_light, 0.0f, INFINITY);
    }
    gn_rt_destroy(&rt);
    assert_int_equal(n_hits, N_POINTS);
    return n_acne;
}

static void test_no_acne(void **state)
{
    (void)state;
    for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++) {
        for (size_t d = 0; d < sizeof(distances) / sizeof(distances[0]); d++) {
            for (int n = 1; n <= 16; n *= 16) {
                int n_acne = count_acne(n, scales[s], distances[d]);
                if (n_acne > 0)
                    print_message("# scale %g, %g sizes away, %d cells: %d acne of %d\n", scales[s],
                                  distances[d], n, n_acne, N_POINTS);
                assert_int_equal(n_acne, 0);
            }
        }
    }
}

/** Rays from the inner wall of a closed cube to its inside that reach the outside unhindered. */
static int count_leaks(double scale, double distance)
{
    double m[16];
    make_matrix(scale, distance, m);
    struct gn_rt *rt = make_scene(gn_test_make_cube(1.0f), m);
    uint64_t seed = 6;
    int n_leaks = 0;
    for (int i = 0; i < N_POINTS; i++) {
        const double centre[3] = {0};
        float org[3];
        float dir[3];
        to_world(m, centre, org);
        gn_test_random_direction(&seed, dir);
        struct gn_rt_hit hit;
        if (!gn_rt_intersect(rt, GN_RT_REAL, org, dir, 0.0f, INFINITY, &hit)) {
            n_leaks++;
            continue;
        }
        float inward[3];
        gn_test_random_direction(&seed, inward);
        float side =
            inward[0] * hit.normal[0] + inward[1] * hit.normal[1] + inward[2] * hit.normal[2];
        for (int k = 0; k < 3 && side > 0.0f; k++) // normals point outside
            inward[k] = -inward[k];
        float start[3];
        gn_rt_offset_origin(hit.point, hit.normal, hit.clearance, inward, start);
        n_leaks += !gn_rt_is_occluded(rt, GN_RT_REAL, start, inward, 0.0f, INFINITY);
    }
    gn_rt_destroy(&rt);
    return n_leaks;
}

static void test_no_leaks(void **state)
{
    (void)state;
    for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++) {
        for (size_t d = 0; d < sizeof(distances) / sizeof(distances[0]); d++) {
            int n_leaks = count_leaks(scales[s], distances[d]);
            if (n_leaks > 0)
                print_message("# scale %g, %g sizes away: %d leaks of %d\n", scales[s],
                              distances[d], n_leaks, N_POINTS);
            // A start nearer to an edge than its clearance may lie in the neighbouring wall: such
            // a strip exists only where floats are coarse beside the object.
            assert_true(n_leaks <= (distances[d] >= 1e4 ? N_POINTS / 1000 : 0));
        }
    }
}

static void test_the_step_is_small(void **state)
{
    (void)state;
    // Against the size of the object itself: contact shadows start where they should.
    for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++) {
        double m[16];
        make_matrix(scales[s], 1.0, m);
        struct gn_rt *rt = make_scene(gn_test_make_cube(1.0f), m);
        const double centre[3] = {0};
        float org[3];
        const float dir[3] = {0.0f, 0.0f, 1.0f};
        to_world(m, centre, org);
        struct gn_rt_hit hit;
        assert_true(gn_rt_intersect(rt, GN_RT_REAL, org, dir, 0.0f, INFINITY, &hit));
        assert_true(hit.clearance < 4e-6 * scales[s]);
        gn_rt_destroy(&rt);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_acne),
        cmocka_unit_test(test_no_leaks),
        cmocka_unit_test(test_the_step_is_small),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
