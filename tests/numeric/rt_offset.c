/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gn_rt_offset_origin at all scales and far from the origin: no point of a lit plane shadows itself
 * (acne), and no ray from a wall slips out of a closed room (leak). Of meshes that rest and of such
 * that have been moved there.
 */
#include "server/scene/rt.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "common/pose.h"
#include "tests/meshes.h"

#define N_POINTS 20000
#define DEGREE (3.14159265358979323846 / 180.0)

static const double scales[] = {1e-3, 1.0, 1e3, 1e6};
// Distance of the object from the origin, in its own sizes; -1: the plane goes through the origin.
static const double distances[] = {0.0, 1.0, 1e2, 1e4};

/** Turned by no nice angle about no nice axis, moved. */
static struct gn_pose make_pose(double scale, double distance)
{
    struct gn_pose pose = {
        .rotation = {0.7384, 0.2615, -0.4523, 0.4268},
        .translation = {0.7 * distance * scale, -0.5 * distance * scale, 0.51 * distance * scale},
    };
    assert_int_equal(gn_pose_normalize(&pose), 0);
    return pose;
}

/** The same, and scaled. */
static void make_matrix(double scale, double distance, double out[static 16])
{
    const struct gn_pose pose = make_pose(scale, distance);
    gn_pose_to_matrix(&pose, out);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            out[4 * i + k] *= scale;
    }
}

/** A scene for rays, and what it shares its meshes with. */
struct scene {
    struct gn_rt *rt, *source; // source may be NULL
};

/** One mesh that is 1 m large before make_matrix. */
static struct scene make_scene(struct gn_mesh mesh, double scale, double distance, bool moves)
{
    struct scene s = {0};
    struct gn_rt **first = moves ? &s.source : &s.rt;
    double matrix[16];
    make_matrix(scale, distance, matrix);
    assert_int_equal(gn_rt_create(first, NULL), 0);
    if (moves) {
        // Its own coordinates begin elsewhere, as those of models often do.
        const double grow[16] = {scale, 0, 0,     3 * scale, 0, scale, 0, 0,
                                 0,     0, scale, 0,         0, 0,     0, 1};
        const struct gn_pose start = {{1, 0, 0, 0}, {0, 0, 0}};
        const double back[3] = {-3 * scale, 0, 0};
        struct gn_pose pose = make_pose(scale, distance);
        double moved[3];
        gn_pose_transform(&pose, back, moved);
        memcpy(pose.translation, moved, sizeof(moved));
        assert_int_equal(gn_rt_add_mover(*first, GN_RT_REAL, 0, &mesh, grow, &start, NULL), 0);
        assert_int_equal(gn_rt_commit(*first, NULL, NULL), 0);
        assert_int_equal(gn_rt_create_posed(*first, &s.rt, NULL), 0);
        assert_int_equal(gn_rt_set_poses(s.rt, &pose, NULL), 0);
    } else {
        assert_int_equal(gn_rt_add_mesh(*first, GN_RT_REAL, 0, &mesh, matrix, NULL), 0);
        assert_int_equal(gn_rt_commit(*first, NULL, NULL), 0);
    }
    gn_mesh_finish(&mesh);
    return s;
}

static void finish_scene(struct scene *s)
{
    gn_rt_destroy(&s->rt);
    gn_rt_destroy(&s->source);
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
static int count_acne(int n, double scale, double distance, bool moves)
{
    double m[16];
    make_matrix(scale, distance, m);
    struct scene scene = make_scene(gn_test_make_plane(1.0f, n), scale, distance, moves);
    const struct gn_rt *rt = scene.rt;
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
    finish_scene(&scene);
    assert_int_equal(n_hits, N_POINTS);
    return n_acne;
}

static void test_no_acne(void **state)
{
    bool moves = *state != NULL;
    for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++) {
        for (size_t d = 0; d < sizeof(distances) / sizeof(distances[0]); d++) {
            for (int n = 1; n <= 16; n *= 16) {
                int n_acne = count_acne(n, scales[s], distances[d], moves);
                if (n_acne > 0)
                    print_message("# scale %g, %g sizes away, %d cells: %d acne of %d\n", scales[s],
                                  distances[d], n, n_acne, N_POINTS);
                assert_int_equal(n_acne, 0);
            }
        }
    }
}

/** Acne beside the world's origin on a mesh of small triangles whose middle is elsewhere: what is
 * far away from the point, the mesh's other coordinates, rounds there all the same. */
static int count_acne_at_the_origin(struct gn_rt *rt, const struct gn_pose *pose, uint64_t *seed)
{
    double m[16];
    int n_acne = 0;
    gn_pose_to_matrix(pose, m);
    assert_int_equal(gn_rt_set_poses(rt, pose, NULL), 0);
    for (int i = 0; i < N_POINTS / 20; i++) {
        const double phi = 360.0 * DEGREE * gn_test_random_unit(seed);
        const double at[3] = {4.5 + 0.02 * (gn_test_random_unit(seed) - 0.5),
                              3.1 + 0.02 * (gn_test_random_unit(seed) - 0.5), 0.01};
        const double down[3] = {0.001, 0.002, -1.0};
        const double light[3] = {sin(89.9 * DEGREE) * cos(phi), sin(89.9 * DEGREE) * sin(phi),
                                 cos(89.9 * DEGREE)};
        float org[3];
        float dir[3];
        float to_light[3];
        float start[3];
        to_world(m, at, org);
        turn_to_world(m, down, dir);
        turn_to_world(m, light, to_light);
        struct gn_rt_hit hit;
        assert_true(gn_rt_intersect(rt, GN_RT_REAL, org, dir, 0.0f, INFINITY, &hit));
        gn_rt_offset_origin(hit.point, hit.normal, hit.clearance, to_light, start);
        n_acne += gn_rt_is_occluded(rt, GN_RT_REAL, start, to_light, 0.0f, INFINITY);
    }
    return n_acne;
}

static void test_no_acne_at_the_origin_of_a_moved_mesh(void **state)
{
    (void)state;
    const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    const double corner[3] = {-4.5, -3.1, 0};
    const struct gn_pose start = {{1, 0, 0, 0}, {0, 0, 0}};
    struct gn_mesh plane = gn_test_make_plane(10.0f, 500);
    struct scene scene = {0};
    uint64_t seed = 8;
    int n_acne = 0;
    assert_int_equal(gn_rt_create(&scene.source, NULL), 0);
    assert_int_equal(gn_rt_add_mover(scene.source, GN_RT_REAL, 0, &plane, identity, &start, NULL),
                     0);
    assert_int_equal(gn_rt_commit(scene.source, NULL, NULL), 0);
    assert_int_equal(gn_rt_create_posed(scene.source, &scene.rt, NULL), 0);
    gn_mesh_finish(&plane);
    for (int i = 0; i < 200; i++) {
        struct gn_pose pose = {.rotation = {0.9}};
        for (int k = 0; k < 3; k++)
            pose.rotation[1 + k] = gn_test_random_unit(&seed) - 0.5;
        double length = 0.0;
        for (int k = 0; k < 4; k++)
            length += pose.rotation[k] * pose.rotation[k];
        for (int k = 0; k < 4; k++)
            pose.rotation[k] /= sqrt(length);
        gn_pose_rotate(&pose, corner, pose.translation);
        n_acne += count_acne_at_the_origin(scene.rt, &pose, &seed);
    }
    finish_scene(&scene);
    assert_int_equal(n_acne, 0);
}

/** Rays from the inner wall of a closed cube to its inside that reach the outside unhindered. */
static int count_leaks(double scale, double distance, bool moves)
{
    double m[16];
    make_matrix(scale, distance, m);
    struct scene scene = make_scene(gn_test_make_cube(1.0f), scale, distance, moves);
    const struct gn_rt *rt = scene.rt;
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
    finish_scene(&scene);
    return n_leaks;
}

static void test_no_leaks(void **state)
{
    bool moves = *state != NULL;
    for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++) {
        for (size_t d = 0; d < sizeof(distances) / sizeof(distances[0]); d++) {
            int n_leaks = count_leaks(scales[s], distances[d], moves);
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
    bool moves = *state != NULL;
    // Against the size of the object itself: contact shadows start where they should.
    for (size_t s = 0; s < sizeof(scales) / sizeof(scales[0]); s++) {
        double m[16];
        make_matrix(scales[s], 1.0, m);
        struct scene scene = make_scene(gn_test_make_cube(1.0f), scales[s], 1.0, moves);
        const double centre[3] = {0};
        float org[3];
        const float dir[3] = {0.0f, 0.0f, 1.0f};
        to_world(m, centre, org);
        struct gn_rt_hit hit;
        assert_true(gn_rt_intersect(scene.rt, GN_RT_REAL, org, dir, 0.0f, INFINITY, &hit));
        assert_true(hit.clearance < 4e-6 * scales[s]);
        finish_scene(&scene);
    }
}

int main(void)
{
    static char moved[] = "moved";
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_acne),
        cmocka_unit_test(test_no_leaks),
        cmocka_unit_test(test_the_step_is_small),
        cmocka_unit_test(test_no_acne_at_the_origin_of_a_moved_mesh),
        {"test_no_acne_where_moved", test_no_acne, NULL, NULL, moved},
        {"test_no_leaks_where_moved", test_no_leaks, NULL, NULL, moved},
        {"test_the_step_is_small_where_moved", test_the_step_is_small, NULL, NULL, moved},
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
