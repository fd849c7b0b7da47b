/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Occlusion rays from the points of a plane towards random lights past an object of some 800
 * triangles: one by one and sixteen at a time. One thread.
 */
#include "server/scene/rt.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/clock.h"
#include "common/compare.h"
#include "common/pose.h"
#include "tests/meshes.h"

#define N_PACKETS 65536
#define N_ROUNDS 9

static struct gn_rt *make_scene(void)
{
    const double up[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1};
    double identity[16];
    gn_mat4_identity(identity);
    struct gn_mesh plane = gn_test_make_plane(4.0f, 1);
    struct gn_mesh ball = gn_test_make_sphere(0.5f, 15); // 840 triangles
    struct gn_rt *rt = NULL;
    if (gn_rt_create(&rt, NULL) < 0 || gn_rt_add_mesh(rt, GN_RT_REAL, 0, &plane, identity, NULL) ||
        gn_rt_add_mesh(rt, GN_RT_VIRTUAL, 1, &ball, up, NULL) || gn_rt_commit(rt, NULL, NULL))
        abort();
    gn_mesh_finish(&plane);
    gn_mesh_finish(&ball);
    return rt;
}

/** to_one_light: the rays of a packet start at one point each but go to one light; else one point,
 * 16 lights. */
static void make_packets(struct gn_rt_packet *packets, bool to_one_light)
{
    uint64_t seed = 8;
    for (int i = 0; i < N_PACKETS; i++) {
        float dir[3];
        double x = 0.0;
        double y = 0.0;
        for (int k = 0; k < GN_RT_PACKET; k++) {
            if (k == 0 || !to_one_light)
                gn_test_random_direction(&seed, dir);
            if (k == 0) {
                x = 3.0 * gn_test_random_unit(&seed) - 1.5;
                y = 3.0 * gn_test_random_unit(&seed) - 1.5;
            }
            double dx = to_one_light ? 0.01 * (k % 4) : 0.0;
            double dy = to_one_light ? 0.01 * (k / 4) : 0.0;
            packets[i].org_x[k] = (float)(x + dx);
            packets[i].org_y[k] = (float)(y + dy);
            packets[i].org_z[k] = 1e-5f;
            packets[i].dir_x[k] = dir[0];
            packets[i].dir_y[k] = dir[1];
            packets[i].dir_z[k] = fabsf(dir[2]);
            packets[i].t_near[k] = 0.0f;
            packets[i].t_far[k] = INFINITY;
            packets[i].valid[k] = -1;
        }
    }
}

static long trace_single(const struct gn_rt *rt, enum gn_rt_set set,
                         const struct gn_rt_packet *packets)
{
    long n = 0;
    for (int i = 0; i < N_PACKETS; i++) {
        const struct gn_rt_packet *p = &packets[i];
        for (int k = 0; k < GN_RT_PACKET; k++) {
            const float org[3] = {p->org_x[k], p->org_y[k], p->org_z[k]};
            const float dir[3] = {p->dir_x[k], p->dir_y[k], p->dir_z[k]};
            n += gn_rt_is_occluded(rt, set, org, dir, p->t_near[k], p->t_far[k]);
        }
    }
    return n;
}

static long trace_packets(const struct gn_rt *rt, enum gn_rt_set set,
                          const struct gn_rt_packet *packets)
{
    long n = 0;
    for (int i = 0; i < N_PACKETS; i++) {
        for (uint32_t bits = gn_rt_get_occluded16(rt, set, &packets[i]); bits; bits &= bits - 1)
            n++;
    }
    return n;
}

static long measure(const char *name, const struct gn_rt *rt, enum gn_rt_set set,
                    const struct gn_rt_packet *packets,
                    long (*trace)(const struct gn_rt *, enum gn_rt_set,
                                  const struct gn_rt_packet *))
{
    double rates[N_ROUNDS];
    long n_occluded = trace(rt, set, packets); // warm-up
    for (int i = 0; i < N_ROUNDS; i++) {
        int64_t start = gn_clock_get_monotonic_ns();
        (void)trace(rt, set, packets);
        int64_t ns = gn_clock_get_monotonic_ns() - start;
        rates[i] = 1e3 * N_PACKETS * GN_RT_PACKET / (double)ns;
    }
    qsort(rates, N_ROUNDS, sizeof(rates[0]), gn_compare_doubles);
    printf("%-34s median %6.2f Mray/s  [%.2f, %.2f]  occluded %.1f %%\n", name, rates[N_ROUNDS / 2],
           rates[0], rates[N_ROUNDS - 1], 100.0 * (double)n_occluded / (N_PACKETS * GN_RT_PACKET));
    return n_occluded;
}

int main(void)
{
    struct gn_rt_packet *packets = aligned_alloc(64, N_PACKETS * sizeof(*packets));
    if (!packets)
        return 1;
    struct gn_rt *rt = make_scene();
    int ret = 0;
    for (int to_one_light = 0; to_one_light < 2; to_one_light++) {
        make_packets(packets, to_one_light);
        printf("%s\n",
               to_one_light ? "4x4 neighbouring points, one light:" : "one point, 16 lights:");
        long a = measure("  virtual, one by one", rt, GN_RT_VIRTUAL, packets, trace_single);
        long b = measure("  virtual, packets of 16", rt, GN_RT_VIRTUAL, packets, trace_packets);
        ret |= a != b;
    }
    gn_rt_destroy(&rt);
    free(packets);
    return ret;
}
