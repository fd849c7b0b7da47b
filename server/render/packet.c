/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>

bool gn_packet_add(struct scratch *scratch, const float org[static 3], const float dir[static 3],
                   int sample, int light, float weight, float length)
{
    struct gn_rt_packet *packet = &scratch->packet;
    int i = scratch->n_lanes++;
    packet->org_x[i] = org[0];
    packet->org_y[i] = org[1];
    packet->org_z[i] = org[2];
    packet->dir_x[i] = dir[0];
    packet->dir_y[i] = dir[1];
    packet->dir_z[i] = dir[2];
    packet->t_near[i] = 0;
    packet->t_far[i] = length;
    packet->valid[i] = -1;
    scratch->lane_sample[i] = sample;
    scratch->lane_light[i] = light;
    scratch->lane_weight[i] = weight;
    return scratch->n_lanes == GN_RT_PACKET;
}

uint32_t gn_packet_trace(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                         int *out_n, uint64_t *rays)
{
    struct gn_rt_packet *packet = &scratch->packet;
    int n = scratch->n_lanes;
    *out_n = n;
    if (n == 0)
        return 0;
    // Idle lanes repeat the first ray: no number that was never written reaches the tracer.
    for (int i = n; i < GN_RT_PACKET; i++) {
        packet->org_x[i] = packet->org_x[0];
        packet->org_y[i] = packet->org_y[0];
        packet->org_z[i] = packet->org_z[0];
        packet->dir_x[i] = packet->dir_x[0];
        packet->dir_y[i] = packet->dir_y[0];
        packet->dir_z[i] = packet->dir_z[0];
        packet->t_near[i] = 0;
        packet->t_far[i] = INFINITY;
        packet->valid[i] = 0;
    }
    scratch->n_lanes = 0;
    *rays += (uint64_t)n;
    return gn_rt_get_occluded16(frame->rt, set, packet);
}

/** As fminf and fmaxf, which are calls; none of these is NaN. */
static inline float min2(float a, float b)
{
    return a < b ? a : b;
}

static inline float max2(float a, float b)
{
    return a > b ? a : b;
}

/** Slabs: the ray meets the box where the intervals of the three axes and [0, inf) meet. */
static bool meets_slabs(const float lo[static 3], const float hi[static 3],
                        const float dir[static 3])
{
    float t0 = 0;
    float t1 = INFINITY;
    for (int k = 0; k < 3; k++) {
        if (fabsf(dir[k]) < 1e-12f) {
            if (lo[k] > 0 || hi[k] < 0)
                return false;
            continue;
        }
        float inverse = 1.0f / dir[k];
        float a = lo[k] * inverse;
        float b = hi[k] * inverse;
        t0 = max2(t0, min2(a, b));
        t1 = min2(t1, max2(a, b));
    }
    // Rounding of the products: a few parts in 2^24; the box is widened by far more (renderer.c).
    return t0 <= t1 * (1 + 4e-6f);
}

bool gn_box_may_meet(const struct box *box, const float org[static 3], const float dir[static 3])
{
    float lo[3];
    float hi[3];
    for (int k = 0; k < 3; k++) {
        lo[k] = box->min[k] - org[k];
        hi[k] = box->max[k] - org[k];
    }
    return meets_slabs(lo, hi, dir);
}

bool gn_box_may_meet_from_box(const struct box *box, const struct box *from,
                              const float dir[static 3])
{
    // A ray from p in `from` meets `box` where one from the origin meets box - p: the union over
    // all p is the box of differences.
    float lo[3];
    float hi[3];
    for (int k = 0; k < 3; k++) {
        lo[k] = box->min[k] - from->max[k];
        hi[k] = box->max[k] - from->min[k];
    }
    return meets_slabs(lo, hi, dir);
}
