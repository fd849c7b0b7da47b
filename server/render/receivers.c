/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Samples in blocks of 16, their rays to distant lights, and the sums of those lights. */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "server/render/kernels/kernels.h"

/** Fewer rays of a block to a light wait for others, to fill a packet. */
#define MIN_WIDE 12

static const struct box empty_box = {{INFINITY, INFINITY, INFINITY},
                                     {-INFINITY, -INFINITY, -INFINITY}};

void gn_receivers_begin(struct receivers *r)
{
    r->n = 0;
    r->box = empty_box;
}

void gn_receivers_add(struct receivers *r, const struct sample *samples, int i, int n_probes)
{
    const struct sample *s = &samples[i];
    int j = r->n++;
    if (j % LANES == 0)
        r->boxes[j / LANES] = empty_box;
    r->sample[j] = i;
    for (int k = 0; k < 3; k++) {
        r->org[k][j] = s->org[k];
        r->shading[k][j] = s->surface.normal_shading[k];
        r->geometric[k][j] = s->surface.normal_horizon[k];
    }
    for (int p = 0; p < n_probes && n_probes > 1; p++)
        r->weights[p][j] = s->weights[p];
    grow_box(&r->boxes[j / LANES], s->org);
    grow_box(&r->box, s->org);
}

void gn_receivers_end(struct receivers *r, int n_probes)
{
    r->n_blocks = (r->n + LANES - 1) / LANES;
    for (int j = r->n; j < r->n_blocks * LANES; j++) {
        for (int k = 0; k < 3; k++)
            r->org[k][j] = r->shading[k][j] = r->geometric[k][j] = 0;
        for (int p = 0; p < n_probes; p++)
            r->weights[p][j] = 0;
    }
}

static struct gn_kernel_surfaces get_surfaces(const struct receivers *r, int block)
{
    struct gn_kernel_surfaces surfaces;
    for (int k = 0; k < 3; k++) {
        surfaces.shading[k] = r->shading[k] + block * LANES;
        surfaces.geometric[k] = r->geometric[k] + block * LANES;
    }
    return surfaces;
}

unsigned gn_receivers_get_lit(const struct frame *frame, const struct receivers *r, int block,
                              const float dir[static 3])
{
    const struct gn_kernel_surfaces surfaces = get_surfaces(r, block);
    return frame->kernels->get_lit(&surfaces, dir);
}

void gn_receivers_flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                        uint16_t (*masks)[GN_LIGHTS_MAX], uint64_t *rays)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, set, &n, rays);
    for (; hidden != 0; hidden &= hidden - 1) {
        int lane = __builtin_ctz(hidden);
        int j = scratch->lane_sample[lane];
        masks[j / LANES][scratch->lane_light[lane]] |= (uint16_t)(1u << (j % LANES));
    }
}

/** A block's lanes as one packet, without a copy of each. */
static void trace_wide(const struct frame *frame, const struct scratch *scratch, int block,
                       int light, unsigned lanes, enum gn_rt_set set,
                       uint16_t (*masks)[GN_LIGHTS_MAX], uint64_t *rays)
{
    const struct receivers *r = &scratch->receivers;
    struct gn_rt_packet packet;
    float dir[3];
    gn_render_lights_get_dir(frame->lights, light, dir);
    memcpy(packet.org_x, r->org[0] + block * LANES, sizeof(packet.org_x));
    memcpy(packet.org_y, r->org[1] + block * LANES, sizeof(packet.org_y));
    memcpy(packet.org_z, r->org[2] + block * LANES, sizeof(packet.org_z));
    for (int i = 0; i < LANES; i++) {
        packet.dir_x[i] = dir[0];
        packet.dir_y[i] = dir[1];
        packet.dir_z[i] = dir[2];
        packet.t_near[i] = 0;
        packet.t_far[i] = INFINITY;
        packet.valid[i] = -(int32_t)(lanes >> i & 1);
    }
    *rays += (uint64_t)__builtin_popcount(lanes);
    masks[block][light] |= (uint16_t)gn_rt_get_occluded16(frame->rt, set, &packet);
}

void gn_receivers_trace(const struct frame *frame, struct scratch *scratch, int block, int light,
                        unsigned lanes, enum gn_rt_set set, uint16_t (*masks)[GN_LIGHTS_MAX],
                        uint64_t *rays)
{
    const struct receivers *r = &scratch->receivers;
    float dir[3];
    gn_render_lights_get_dir(frame->lights, light, dir);
    if (__builtin_popcount(lanes) >= MIN_WIDE) {
        trace_wide(frame, scratch, block, light, lanes, set, masks, rays);
        return;
    }
    for (; lanes != 0; lanes &= lanes - 1) {
        int j = block * LANES + __builtin_ctz(lanes);
        const float org[3] = {r->org[0][j], r->org[1][j], r->org[2][j]};
        if (gn_packet_add(scratch, org, dir, j, light, 0, INFINITY))
            gn_receivers_flush(frame, scratch, set, masks, rays);
    }
}

void gn_receivers_sum(const struct frame *frame, const struct receivers *r, int block,
                      const uint16_t *mask, bool unweighted, double out[static 3][LANES])
{
    const struct light_list *lights = frame->lights;
    struct gn_kernel_sum sum = {
        .surfaces = get_surfaces(r, block),
        .n = lights->n,
        .mask = mask,
        .unweighted = unweighted,
        .n_parts = frame->blend.n,
        .ends = lights->ends,
        .weights = r->weights[0] + block * LANES,
        .weights_stride = BATCH,
    };
    for (int k = 0; k < 3; k++) {
        sum.dir[k] = lights->dir[k];
        sum.irradiance[k] = lights->irradiance[k];
    }
    frame->kernels->sum_lights(&sum, out);
}
