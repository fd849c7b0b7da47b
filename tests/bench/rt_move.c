/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What it costs to move an object by its pose, against building the scene anew, for 1e3 to 1e6
 * triangles; and for 1 to 4096 objects. One thread.
 */
#include "server/scene/rt.h"

#include <stdio.h>
#include <stdlib.h>

#include "common/clock.h"
#include "common/compare.h"
#include "common/pose.h"
#include "tests/meshes.h"

#define N_ROUNDS 101

static struct gn_pose get_pose(int i)
{
    return (struct gn_pose){{0.8, 0.6, 0, 0}, {0.01 * i, -0.02 * i, 1}};
}

/** Median microseconds of a change of all objects' poses. */
static double measure_move(const struct gn_mesh *mesh, int n_objects)
{
    double identity[16];
    gn_mat4_identity(identity);
    struct gn_rt *source = NULL;
    struct gn_rt *posed = NULL;
    struct gn_pose *poses = calloc((size_t)n_objects, sizeof(*poses));
    double us[N_ROUNDS];
    if (!poses || gn_rt_create(&source, NULL) < 0)
        abort();
    for (int i = 0; i < n_objects; i++) {
        const struct gn_pose pose = get_pose(i);
        if (gn_rt_add_mover(source, GN_RT_VIRTUAL, 0, mesh, identity, &pose, NULL) < 0)
            abort();
    }
    if (gn_rt_commit(source, NULL, NULL) < 0 || gn_rt_create_posed(source, &posed, NULL) < 0)
        abort();
    for (int round = 0; round < N_ROUNDS; round++) {
        for (int i = 0; i < n_objects; i++)
            poses[i] = get_pose(i + round);
        int64_t start = gn_clock_get_monotonic_ns();
        if (gn_rt_set_poses(posed, poses, NULL) < 0)
            abort();
        us[round] = 1e-3 * (double)(gn_clock_get_monotonic_ns() - start);
    }
    gn_rt_destroy(&posed);
    gn_rt_destroy(&source);
    free(poses);
    qsort(us, N_ROUNDS, sizeof(us[0]), gn_compare_doubles);
    return us[N_ROUNDS / 2];
}

/** Microseconds to build a scene of the mesh, the least of three. */
static double measure_build(const struct gn_mesh *mesh)
{
    double least = 0;
    for (int round = 0; round < 3; round++) {
        double m[16];
        const struct gn_pose pose = get_pose(round);
        gn_pose_to_matrix(&pose, m);
        int64_t start = gn_clock_get_monotonic_ns();
        struct gn_rt *rt = NULL;
        if (gn_rt_create(&rt, NULL) < 0 ||
            gn_rt_add_mesh(rt, GN_RT_VIRTUAL, 0, mesh, m, NULL) < 0 ||
            gn_rt_commit(rt, NULL, NULL) < 0)
            abort();
        double us = 1e-3 * (double)(gn_clock_get_monotonic_ns() - start);
        least = round == 0 || us < least ? us : least;
        gn_rt_destroy(&rt);
    }
    return least;
}

int main(void)
{
    static const int rings[] = {16, 50, 158, 500}; // 4n(n-1) triangles
    static const int counts[] = {1, 16, 256, 4096};
    double first = 0;
    double last = 0;
    printf("one object:\n%12s %14s %14s %10s\n", "triangles", "move, us", "build anew, us",
           "ratio");
    for (int i = 0; i < 4; i++) {
        struct gn_mesh ball = gn_test_make_sphere(0.5f, rings[i]);
        last = measure_move(&ball, 1);
        first = i == 0 ? last : first;
        double build = measure_build(&ball);
        printf("%12d %14.1f %14.0f %10.0f\n", ball.n_triangles, last, build, build / last);
        gn_mesh_finish(&ball);
    }
    printf("all objects of 48 triangles:\n%12s %14s\n", "objects", "move, us");
    for (int i = 0; i < 4; i++) {
        struct gn_mesh ball = gn_test_make_sphere(0.5f, 4);
        printf("%12d %14.1f\n", counts[i], measure_move(&ball, counts[i]));
        gn_mesh_finish(&ball);
    }
    // A thousand times the triangles: no more work but noise.
    return last < 5 * first ? 0 : 1;
}
