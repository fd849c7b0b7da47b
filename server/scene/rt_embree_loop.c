/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/rt_loop.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#ifdef GN_HAVE_EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

struct gn_rt_loop {
    const struct gn_rt *rt;
    enum gn_rt_set set;
    int width;
    size_t n;            // rays
    float *t_far;        // [n] as given
    struct RTCRay *rays; // [n]; width 1
    struct RTCRay16 *packets;
    int (*valid)[GN_RT_PACKET]; // -1: a ray
};

static size_t count_packets(const struct gn_rt_loop *loop)
{
    return (loop->n + GN_RT_PACKET - 1) / GN_RT_PACKET;
}

static void fill_loop(struct gn_rt_loop *loop, const struct gn_rt_packet *packets, int n)
{
    size_t m = 0;
    for (size_t j = 0; j < (size_t)n * GN_RT_PACKET; j++) {
        const struct gn_rt_packet *p = &packets[j / GN_RT_PACKET];
        size_t i = j % GN_RT_PACKET;
        if (!p->valid[i])
            continue;
        struct RTCRay16 *out = &loop->packets[m / GN_RT_PACKET];
        size_t lane = m % GN_RT_PACKET;
        const float org[3] = {p->org_x[i], p->org_y[i], p->org_z[i]};
        const float dir[3] = {p->dir_x[i], p->dir_y[i], p->dir_z[i]};
        loop->rays[m] = (struct RTCRay){
            .org_x = org[0],
            .org_y = org[1],
            .org_z = org[2],
            .tnear = p->t_near[i],
            .dir_x = dir[0],
            .dir_y = dir[1],
            .dir_z = dir[2],
            .mask = 0xffffffffu,
        };
        loop->valid[m / GN_RT_PACKET][lane] = -1;
        out->org_x[lane] = org[0];
        out->org_y[lane] = org[1];
        out->org_z[lane] = org[2];
        out->dir_x[lane] = dir[0];
        out->dir_y[lane] = dir[1];
        out->dir_z[lane] = dir[2];
        out->tnear[lane] = p->t_near[i];
        out->mask[lane] = 0xffffffffu;
        loop->t_far[m++] = p->t_far[i];
    }
}

int gn_rt_loop_create(const struct gn_rt *rt, enum gn_rt_set set,
                      const struct gn_rt_packet *packets, int n, int width,
                      struct gn_rt_loop **out_loop)
{
    struct gn_rt_loop *loop = calloc(1, sizeof(*loop));
    *out_loop = NULL;
    if (!loop)
        return -ENOMEM;
    *loop = (struct gn_rt_loop){.rt = rt, .set = set, .width = width};
    for (size_t j = 0; j < (size_t)n * GN_RT_PACKET; j++)
        loop->n += packets[j / GN_RT_PACKET].valid[j % GN_RT_PACKET] != 0;
    size_t n_packets = count_packets(loop) + 1; // never of size 0
    loop->t_far = calloc(n_packets * GN_RT_PACKET, sizeof(*loop->t_far));
    loop->rays = aligned_alloc(64, n_packets * GN_RT_PACKET * sizeof(*loop->rays));
    loop->packets = aligned_alloc(64, n_packets * sizeof(*loop->packets));
    loop->valid = aligned_alloc(64, n_packets * sizeof(*loop->valid));
    if (!loop->t_far || !loop->rays || !loop->packets || !loop->valid) {
        gn_rt_loop_destroy(&loop);
        return -ENOMEM;
    }
    memset(loop->packets, 0, n_packets * sizeof(*loop->packets));
    memset(loop->valid, 0, n_packets * sizeof(*loop->valid));
    fill_loop(loop, packets, n);
    gn_rt_loop_reset(loop);
    *out_loop = loop;
    return 0;
}

void gn_rt_loop_destroy(struct gn_rt_loop **loop)
{
    struct gn_rt_loop *self = *loop;
    *loop = NULL;
    if (!self)
        return;
    free(self->t_far);
    free(self->rays);
    free(self->packets);
    free(self->valid);
    free(self);
}

void gn_rt_loop_reset(struct gn_rt_loop *loop)
{
    for (size_t i = 0; i < loop->n; i++) {
        loop->rays[i].tfar = loop->t_far[i];
        loop->packets[i / GN_RT_PACKET].tfar[i % GN_RT_PACKET] = loop->t_far[i];
    }
}

#ifdef GN_HAVE_EMBREE4
void gn_rt_loop_run(struct gn_rt_loop *loop)
{
    RTCScene scene = gn_rt_get_tree(loop->rt, loop->set);
    for (size_t i = 0; loop->width == 1 && i < loop->n; i++)
        rtcOccluded1(scene, &loop->rays[i], NULL);
    for (size_t i = 0; loop->width > 1 && i < count_packets(loop); i++)
        rtcOccluded16(loop->valid[i], scene, &loop->packets[i], NULL);
}
#else
void gn_rt_loop_run(struct gn_rt_loop *loop)
{
    RTCScene scene = gn_rt_get_tree(loop->rt, loop->set);
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (size_t i = 0; loop->width == 1 && i < loop->n; i++)
        rtcOccluded1(scene, &context, &loop->rays[i]);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    for (size_t i = 0; loop->width > 1 && i < count_packets(loop); i++)
        rtcOccluded16(loop->valid[i], scene, &context, &loop->packets[i]);
}
#endif

uint64_t gn_rt_loop_count_occluded(const struct gn_rt_loop *loop)
{
    uint64_t n = 0;
    for (size_t i = 0; i < loop->n; i++)
        n += (loop->width == 1 ? loop->rays[i].tfar
                               : loop->packets[i / GN_RT_PACKET].tfar[i % GN_RT_PACKET]) < 0.0f;
    return n;
}
