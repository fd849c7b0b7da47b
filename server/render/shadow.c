/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's shadow factor (section 5.2), per pixel and channel:
 *   U = sum w_i Phi_i V_real,i   S = sum w_i Phi_i V_real,i (1 - V_virtual,i)   factor = 1 - S / U
 * with w_i the cosine (Lambert: albedo and pi cancel) or, as the paper has it, 1 for every light
 * above the surface. Three steps: which lights do virtual objects hide; for pixels with such a
 * light, which do real objects hide; the sums, in the order of the lights.
 *
 * Receivers go through in blocks of 16 neighbours. Left out, and no bit of the result with them,
 * are rays that surely meet nothing or surely something, by the silhouette that the objects have
 * from the light (silhouette.c): of a tile, of a block, then of each receiver. Flat real objects,
 * such as the table that the receivers are points of, are in no silhouette: they are left out where
 * they lie under the tangent planes of all receivers, or by their boxes.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "server/render/silhouette.h"

static void grow_box(struct box *box, const float p[static 3])
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = fminf(box->min[k], p[k]);
        box->max[k] = fmaxf(box->max[k], p[k]);
    }
}

/** Arrays of the real samples; the last block is filled up with receivers that no light reaches. */
static void gather_receivers(const struct sample *samples, int n, int n_probes, struct receivers *r)
{
    static const struct box empty = {{INFINITY, INFINITY, INFINITY},
                                     {-INFINITY, -INFINITY, -INFINITY}};
    r->n = 0;
    r->box = empty;
    for (int i = 0; i < n; i++) {
        const struct sample *s = &samples[i];
        if (!s->is_receiver)
            continue;
        int j = r->n++;
        if (j % LANES == 0)
            r->boxes[j / LANES] = empty;
        r->sample[j] = i;
        for (int k = 0; k < 3; k++) {
            r->org[k][j] = s->org[k];
            r->shading[k][j] = s->surface.normal_shading[k];
            r->geometric[k][j] = s->surface.normal_geometric[k];
        }
        for (int p = 0; p < n_probes && n_probes > 1; p++)
            r->weights[p][j] = s->weights[p];
        grow_box(&r->boxes[j / LANES], s->org);
        grow_box(&r->box, s->org);
    }
    r->n_blocks = (r->n + LANES - 1) / LANES;
    for (int j = r->n; j < r->n_blocks * LANES; j++) {
        for (int k = 0; k < 3; k++)
            r->org[k][j] = r->shading[k][j] = r->geometric[k][j] = 0;
        for (int p = 0; p < n_probes; p++)
            r->weights[p][j] = 0;
    }
}

/** surface_cosine() of a block's 16 receivers. */
static void get_cosines(const struct receivers *r, int block, const float dir[static 3],
                        float out[static LANES])
{
    const float *s[3];
    const float *g[3];
    for (int k = 0; k < 3; k++) {
        s[k] = r->shading[k] + block * LANES;
        g[k] = r->geometric[k] + block * LANES;
    }
    for (int i = 0; i < LANES; i++) {
        float c = s[0][i] * dir[0] + s[1][i] * dir[1] + s[2][i] * dir[2];
        float d = g[0][i] * dir[0] + g[1][i] * dir[1] + g[2][i] * dir[2];
        c = d > 0 ? c : 0;
        out[i] = c > 0 ? c : 0;
    }
}

static void get_light_dir(const struct light_list *lights, int l, float out_dir[static 3])
{
    for (int k = 0; k < 3; k++)
        out_dir[k] = lights->dir[k][l];
}

/** Traces the packet; marks hidden lanes in masks[block][light]. */
static void flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                  uint16_t (*masks)[GN_LIGHTS_MAX], struct tile_figures *figures)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, set, &n, &figures->rays_shadow);
    if (set == GN_RT_REAL)
        figures->n_rays_real += (uint64_t)n;
    for (int lane = 0; lane < n; lane++) {
        int j = scratch->lane_sample[lane];
        if (hidden >> lane & 1)
            masks[j / LANES][scratch->lane_light[lane]] |= (uint16_t)(1u << (j % LANES));
    }
}

/** Rays of a block's lanes to one light. */
static void trace_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                        const float dir[static 3], unsigned lanes, enum gn_rt_set set,
                        uint16_t (*masks)[GN_LIGHTS_MAX], struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    for (; lanes != 0; lanes &= lanes - 1) {
        int j = block * LANES + __builtin_ctz(lanes);
        const float org[3] = {r->org[0][j], r->org[1][j], r->org[2][j]};
        if (gn_packet_add(scratch, org, dir, j, light, 0, INFINITY))
            flush(frame, scratch, set, masks, figures);
    }
}

/** Bit i: lane i is above the horizon of the light, and of `lanes`. */
static unsigned get_lit_lanes(const struct receivers *r, int block, const float dir[static 3],
                              unsigned lanes)
{
    float cosines[LANES];
    unsigned lit = 0;
    get_cosines(r, block, dir, cosines);
    for (int i = 0; i < LANES; i++)
        lit |= (unsigned)(cosines[i] > 0) << i;
    return lit & lanes;
}

/** Do rays away from the light, from points of the box, surely miss the virtual objects? Then what
 * their lines meet is on the light's side. */
static bool is_before_virtual(const struct frame *frame, const struct box *box,
                              const float dir[static 3])
{
    const float back[3] = {-dir[0], -dir[1], -dir[2]};
    return !gn_box_may_meet_from_box(&frame->virtual_box, box, back);
}

/** Which lanes of a block does the virtual objects' silhouette hide; rays where it does not say. */
static void cut_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                      const float dir[static 3], struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    const struct silhouette *silhouette = &frame->virtual_silhouettes[light];
    unsigned dark;
    unsigned edge;
    gn_silhouette_get_block(silhouette, r, block, &dark, &edge);
    if ((dark | edge) == 0)
        return;
    unsigned lanes = get_lit_lanes(r, block, dir, dark | edge);
    if ((lanes & dark) != 0 && is_before_virtual(frame, &r->boxes[block], dir)) {
        scratch->cut[block][light] |= (uint16_t)(lanes & dark);
        lanes &= ~dark;
    }
    trace_block(frame, scratch, block, light, dir, lanes, GN_RT_VIRTUAL, scratch->cut, figures);
}

/** Which lights do virtual objects hide? */
static void find_cut(const struct frame *frame, struct scratch *scratch,
                     struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    for (int l = 0; l < lights->n; l++) {
        float dir[3];
        get_light_dir(lights, l, dir);
        const struct silhouette *s =
            frame->virtual_silhouettes ? &frame->virtual_silhouettes[l] : NULL;
        if (s && gn_silhouette_get_box(s, &r->box) == SILHOUETTE_FREE)
            continue;
        for (int b = 0; b < r->n_blocks; b++) {
            if (!s)
                trace_block(frame, scratch, b, l, dir, get_lit_lanes(r, b, dir, 0xffff),
                            GN_RT_VIRTUAL, scratch->cut, figures);
            else if (gn_silhouette_get_box(s, &r->boxes[b]) != SILHOUETTE_FREE)
                cut_block(frame, scratch, b, l, dir, figures);
        }
    }
    flush(frame, scratch, GN_RT_VIRTUAL, scratch->cut, figures);
    for (int b = 0; b < r->n_blocks; b++) {
        unsigned any = 0;
        for (int l = 0; l < lights->n; l++)
            any |= scratch->cut[b][l];
        for (int i = 0; i < LANES; i++) {
            if (any >> i & 1)
                scratch->samples[r->sample[b * LANES + i]].is_cut = true;
        }
    }
}

/** The flat ones of n boxes that rays from `from` may meet, into out. */
static int list_flat(const struct frame *frame, const struct box *const *boxes, int n,
                     const struct box *from, const float dir[static 3], const struct box **out)
{
    int n_out = 0;
    for (int i = 0; i < n; i++) {
        if (frame->clusters[0].is_flat[boxes[i] - frame->wide_blockers] &&
            gn_box_may_meet_from_box(boxes[i], from, dir))
            out[n_out++] = boxes[i];
    }
    return n_out;
}

/** Lanes of a block that real objects may hide from the light: those that a flat one's box or the
 * others' silhouette does not rule out. */
static unsigned get_doubtful_lanes(const struct frame *frame, const struct scratch *scratch,
                                   int block, int light, const float dir[static 3],
                                   const struct box *const *flat, int n_flat)
{
    const struct receivers *r = &scratch->receivers;
    const struct silhouette *s = &frame->real_silhouettes[light];
    unsigned dark = 0;
    unsigned edge = 0;
    for (int i = 0; i < n_flat; i++) {
        if (gn_box_may_meet_from_box(flat[i], &r->boxes[block], dir))
            return 0xffff;
    }
    if (gn_silhouette_get_box(s, &r->boxes[block]) != SILHOUETTE_FREE)
        gn_silhouette_get_block(s, r, block, &dark, &edge);
    return dark | edge;
}

/** Which lights do real objects hide from the wanted receivers? */
static void find_hidden(const struct frame *frame, struct scratch *scratch,
                        struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    const struct box *boxes[MAX_BLOCKERS];
    int n_boxes = frame->real_silhouettes ? gn_blockers_list_above(frame, r, boxes) : 0;
    for (int l = 0; l < lights->n; l++) {
        const struct silhouette *s = frame->real_silhouettes ? &frame->real_silhouettes[l] : NULL;
        const struct box *flat[MAX_BLOCKERS];
        float dir[3];
        get_light_dir(lights, l, dir);
        int n_flat = s ? list_flat(frame, boxes, n_boxes, &r->box, dir, flat) : 0;
        if (s && n_flat == 0 && gn_silhouette_get_box(s, &r->box) == SILHOUETTE_FREE)
            continue;
        for (int b = 0; b < r->n_blocks; b++) {
            unsigned lanes = r->wanted[b];
            if (lanes != 0 && s)
                lanes &= get_doubtful_lanes(frame, scratch, b, l, dir, flat, n_flat);
            if (lanes != 0)
                trace_block(frame, scratch, b, l, dir, get_lit_lanes(r, b, dir, lanes), GN_RT_REAL,
                            scratch->hidden, figures);
        }
    }
    flush(frame, scratch, GN_RT_REAL, scratch->hidden, figures);
}

/** U and S of a block's receivers. */
static void sum_block(const struct frame *frame, struct scratch *scratch, int block)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    double open[2][3][LANES] = {{{0}}};
    double cut[2][3][LANES] = {{{0}}};
    for (int l = 0; l < lights->n; l++) {
        float dir[3];
        float w[LANES];
        get_light_dir(lights, l, dir);
        get_cosines(r, block, dir, w);
        unsigned hidden = scratch->hidden[block][l];
        unsigned is_cut = scratch->cut[block][l];
        for (int i = 0; i < LANES && (hidden || frame->options.shadow_unweighted); i++)
            w[i] = !(w[i] > 0) || (hidden >> i & 1)   ? 0
                   : frame->options.shadow_unweighted ? 1
                                                      : w[i];
        for (int i = 0; i < LANES && frame->blend.n > 1; i++)
            w[i] *= r->weights[get_probe(lights, l)][block * LANES + i];
        for (int k = 0; k < 3; k++) {
            double irradiance = lights->irradiance[k][l];
            double *sum = open[l & 1][k];
            for (int i = 0; i < LANES; i++)
                sum[i] += irradiance * (double)w[i];
            for (int i = 0; i < LANES && is_cut; i++) {
                if (is_cut >> i & 1)
                    cut[l & 1][k][i] += irradiance * (double)w[i];
            }
        }
    }
    for (int i = 0; i < LANES; i++) {
        if (!(r->wanted[block] >> i & 1))
            continue;
        struct sample *s = &scratch->samples[r->sample[block * LANES + i]];
        for (int k = 0; k < 6; k++) {
            s->open[k / 3][k % 3] = open[k / 3][k % 3][i];
            s->cut[k / 3][k % 3] = cut[k / 3][k % 3][i];
        }
    }
}

void gn_shadow_find_groups(const struct frame *frame, const struct sample *samples, int n,
                           bool *out_groups)
{
    memset(out_groups, 0, BATCH * sizeof(*out_groups));
    for (int i = 0; i < n; i++) {
        if (samples[i].is_cut || frame->run_bounces)
            out_groups[samples[i].group] = true;
    }
}

void gn_shadow_weigh(const struct frame *frame, struct sample *s)
{
    double emitted[3];
    gn_near_get_emission(frame, &s->surface, emitted);
    for (int k = 0; k < 3; k++) {
        double u = s->open[0][k] + s->open[1][k];
        double cut = s->cut[0][k] + s->cut[1][k];
        // The ratio does not know the albedo, so a black one may not make it 0 / 0.
        double brdf = fmax(s->surface.albedo[k], 1e-3) / M_PI;
        s->base[k] = brdf * u + emitted[k];
        s->lost[k] = u > frame->floor_irradiance[k] ? brdf * cut : 0;
    }
}

void gn_shadow_see_nothing(const struct frame *frame, struct sample *s)
{
    float radiance[3];
    gn_blend_get_radiance(&frame->blend, frame->origin, s->dir, radiance);
    for (int k = 0; k < 3; k++)
        s->base[k] = radiance[k];
}

void gn_shadow_clear(struct sample *s)
{
    memset(s->open, 0, sizeof(s->open));
    memset(s->cut, 0, sizeof(s->cut));
    memset(s->base, 0, sizeof(s->base));
    memset(s->lost, 0, sizeof(s->lost));
    memset(s->gain, 0, sizeof(s->gain));
    s->is_summed = false;
}

void gn_shadow_samples(const struct frame *frame, struct scratch *scratch, int n,
                       struct tile_figures *figures)
{
    struct receivers *r = &scratch->receivers;
    bool groups[BATCH];
    for (int i = 0; i < n; i++)
        gn_shadow_clear(&scratch->samples[i]);
    gather_receivers(scratch->samples, n, frame->blend.n, r);
    if (r->n == 0)
        return;
    for (int b = 0; b < r->n_blocks; b++) {
        memset(scratch->cut[b], 0, (size_t)frame->lights->n * sizeof(uint16_t));
        memset(scratch->hidden[b], 0, (size_t)frame->lights->n * sizeof(uint16_t));
        r->wanted[b] = 0;
    }
    find_cut(frame, scratch, figures);
    if (frame->near.n > 0)
        gn_near_find_cut(frame, scratch, figures);
    gn_shadow_find_groups(frame, scratch->samples, n, groups);
    bool is_any_wanted = false;
    for (int j = 0; j < r->n; j++) {
        bool is_wanted = groups[scratch->samples[r->sample[j]].group];
        r->wanted[j / LANES] |= (uint16_t)(is_wanted << (j % LANES));
        is_any_wanted |= is_wanted;
    }
    if (!is_any_wanted)
        return;
    if (frame->run_blockers)
        find_hidden(frame, scratch, figures);
    if (frame->run_blockers && frame->near.n_real > 0)
        gn_near_find_hidden(frame, scratch, figures);
    for (int b = 0; b < r->n_blocks; b++) {
        if (r->wanted[b])
            sum_block(frame, scratch, b);
    }
    if (frame->near.n > 0)
        gn_near_sum(frame, scratch, figures);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (groups[s->group] && s->is_receiver)
            gn_shadow_weigh(frame, s);
        else if (groups[s->group] && s->kind != SAMPLE_VIRTUAL)
            gn_shadow_see_nothing(frame, s);
    }
}
