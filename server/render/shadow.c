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

#include "server/render/pass.h"
#include "server/render/silhouette.h"

/** Is some of the box less than the margin above the tangent plane of one of the receivers? */
static bool is_low(const struct frame *frame, const struct receivers *r, int first, int n,
                   const struct box *box)
{
    bool is_any = false;
    for (int j = first; j < first + n; j++) {
        double height = 0;
        for (int k = 0; k < 3; k++) {
            double g = r->geometric[k][j];
            height += g * ((double)(g > 0 ? box->min[k] : box->max[k]) - r->org[k][j]);
        }
        is_any |= height < (double)frame->margin;
    }
    return is_any;
}

/** Lists the clusters of a silhouette that rays down from a block may meet, widened. */
static void list_low(const struct frame *frame, const struct receivers *r, int block,
                     const struct clusters *clusters, struct low_list *out)
{
    int first = block * LANES;
    int n = r->n - first < LANES ? r->n - first : LANES;
    bool is_real = clusters->role == GN_RT_REAL;
    out->block = block;
    out->n = 0;
    if (!is_real && !is_low(frame, r, first, n, &frame->virtual_box))
        return;
    for (int c = 0; c < clusters->n; c++) {
        const struct cluster *cluster = &clusters->cluster[c];
        if ((is_real && cluster->is_flat) || !is_low(frame, r, first, n, &cluster->box))
            continue;
        struct box *box = &out->boxes[out->n++];
        for (int k = 0; k < 3; k++) {
            box->min[k] = cluster->box.min[k] - frame->margin;
            box->max[k] = cluster->box.max[k] + frame->margin;
        }
    }
}

/** Do rays away from the light, from points of a block, surely miss what its silhouette is of (0:
 * the real one, 1: the virtual one)? Then what their lines meet is on the light's side. */
static bool is_before(const struct frame *frame, struct scratch *scratch, int block,
                      const float dir[static 3], int set)
{
    const float back[3] = {-dir[0], -dir[1], -dir[2]};
    struct low_list *low = &scratch->low[set];
    if (low->block != block)
        list_low(frame, &scratch->receivers, block, &frame->clusters[set], low);
    for (int i = 0; i < low->n; i++) {
        if (gn_box_may_meet_from_box(&low->boxes[i], &scratch->receivers.boxes[block], back))
            return false;
    }
    return true;
}

/** Which lanes of a block does the virtual objects' silhouette hide; rays where it does not say. */
static void cut_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                      const float dir[static 3], struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    const struct silhouette *silhouette = &frame->virtual_silhouettes[light];
    unsigned dark;
    unsigned edge;
    gn_silhouette_get_block(frame, silhouette, r, block, &dark, &edge);
    if ((dark | edge) == 0)
        return;
    unsigned lanes = gn_receivers_get_lit(frame, r, block, dir) & (dark | edge);
    if ((lanes & dark) != 0 && is_before(frame, scratch, block, dir, 1)) {
        scratch->cut[block][light] |= (uint16_t)(lanes & dark);
        lanes &= ~dark;
    }
    gn_receivers_trace(frame, scratch, block, light, lanes, GN_RT_VIRTUAL, scratch->cut,
                       &figures->rays_shadow);
}

/** Lists the lights that virtual objects may hide from a receiver. */
static void list_lights(const struct frame *frame, struct scratch *scratch, int n)
{
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    scratch->n_shadow_lights = 0;
    for (int i = 0; i < n; i++) {
        if (scratch->samples[i].is_receiver)
            grow_box(&box, scratch->samples[i].org);
    }
    if (box.min[0] > box.max[0])
        return;
    for (int l = 0; l < frame->lights->n; l++) {
        if (!frame->virtual_silhouettes ||
            gn_silhouette_get_box(&frame->virtual_silhouettes[l], &box) != SILHOUETTE_FREE)
            scratch->shadow_lights[scratch->n_shadow_lights++] = (int16_t)l;
    }
}

/** Which lights do virtual objects hide? */
static void find_cut(const struct frame *frame, struct scratch *scratch,
                     struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    for (int b = 0; b < r->n_blocks; b++) {
        scratch->low[1].block = -1;
        for (int i = 0; i < scratch->n_shadow_lights; i++) {
            int l = scratch->shadow_lights[i];
            float dir[3];
            gn_render_lights_get_dir(lights, l, dir);
            if (!frame->virtual_silhouettes)
                gn_receivers_trace(frame, scratch, b, l, gn_receivers_get_lit(frame, r, b, dir),
                                   GN_RT_VIRTUAL, scratch->cut, &figures->rays_shadow);
            else if (gn_silhouette_get_box(&frame->virtual_silhouettes[l], &r->boxes[b]) !=
                     SILHOUETTE_FREE)
                cut_block(frame, scratch, b, l, dir, figures);
        }
    }
    gn_receivers_flush(frame, scratch, GN_RT_VIRTUAL, scratch->cut, &figures->rays_shadow);
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

/** A flat real object and the lanes of a block that do not have it under their tangent planes. */
struct flat {
    const struct box *box; // widened
    unsigned lanes;
};

static int list_flat(const struct frame *frame, const struct receivers *r, int block,
                     const struct box *const *boxes, int n, struct flat *out)
{
    int n_out = 0;
    for (int i = 0; i < n; i++) {
        int index = (int)(boxes[i] - frame->wide_blockers);
        const struct box *exact = &frame->blockers[index];
        unsigned lanes = 0;
        for (int lane = 0; lane < LANES && frame->clusters[0].is_flat[index]; lane++) {
            int j = block * LANES + lane;
            double highest = 0;
            for (int k = 0; k < 3; k++) {
                double g = r->geometric[k][j];
                highest += g * ((double)(g > 0 ? exact->max[k] : exact->min[k]) - r->org[k][j]);
            }
            lanes |= (unsigned)(highest > 0) << lane;
        }
        if (lanes != 0)
            out[n_out++] = (struct flat){boxes[i], lanes};
    }
    return n_out;
}

/** Which of a block's lanes do real objects hide from the light? Rays where neither the boxes of
 * the flat ones nor the silhouette of the others say. */
static void hide_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                       const struct flat *flat, int n_flat, uint64_t *rays)
{
    const struct receivers *r = &scratch->receivers;
    const struct silhouette *s = &frame->real_silhouettes[light];
    unsigned lanes = r->wanted[block];
    unsigned dark = 0;
    unsigned edge = 0;
    float dir[3];
    gn_render_lights_get_dir(frame->lights, light, dir);
    if (gn_silhouette_get_box(s, &r->boxes[block]) != SILHOUETTE_FREE)
        gn_silhouette_get_block(frame, s, r, block, &dark, &edge);
    unsigned doubtful = dark | edge;
    for (int i = 0; i < n_flat; i++) {
        if (gn_box_may_meet_from_box(flat[i].box, &r->boxes[block], dir))
            doubtful |= flat[i].lanes;
    }
    lanes &= doubtful;
    if (lanes == 0)
        return;
    lanes &= gn_receivers_get_lit(frame, r, block, dir);
    if ((lanes & dark) != 0 && is_before(frame, scratch, block, dir, 0)) {
        scratch->hidden[block][light] |= (uint16_t)(lanes & dark);
        lanes &= ~dark;
    }
    gn_receivers_trace(frame, scratch, block, light, lanes, GN_RT_REAL, scratch->hidden, rays);
}

/** Which lights do real objects hide from the wanted receivers? */
static void find_hidden(const struct frame *frame, struct scratch *scratch,
                        struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    const struct box *boxes[MAX_BLOCKERS];
    int n_boxes = frame->real_silhouettes ? gn_blockers_list_above(frame, r, boxes) : 0;
    uint64_t n_rays = 0;
    scratch->low[0].block = -1;
    for (int b = 0; b < r->n_blocks; b++) {
        struct flat flat[MAX_BLOCKERS];
        int n_flat = r->wanted[b] != 0 ? list_flat(frame, r, b, boxes, n_boxes, flat) : 0;
        for (int l = 0; l < lights->n && r->wanted[b] != 0; l++) {
            float dir[3];
            gn_render_lights_get_dir(lights, l, dir);
            if (frame->real_silhouettes)
                hide_block(frame, scratch, b, l, flat, n_flat, &n_rays);
            else
                gn_receivers_trace(frame, scratch, b, l,
                                   gn_receivers_get_lit(frame, r, b, dir) & r->wanted[b],
                                   GN_RT_REAL, scratch->hidden, &n_rays);
        }
    }
    gn_receivers_flush(frame, scratch, GN_RT_REAL, scratch->hidden, &n_rays);
    figures->rays_shadow += n_rays;
    figures->n_rays_real += n_rays;
}

/** U and S of a block's receivers. */
static void sum_block(const struct frame *frame, struct scratch *scratch, int block)
{
    const struct receivers *r = &scratch->receivers;
    double open[3][LANES];
    double cut[3][LANES];
    gn_receivers_sum(frame, scratch, block, scratch->hidden[block], scratch->cut[block],
                     frame->options.shadow_unweighted, open, cut);
    for (int i = 0; i < LANES; i++) {
        if (!(r->wanted[block] >> i & 1))
            continue;
        struct sample *s = &scratch->samples[r->sample[block * LANES + i]];
        for (int k = 0; k < 3; k++) {
            s->open[k] = open[k][i];
            s->cut[k] = cut[k][i];
        }
    }
}

void gn_shadow_find_groups(const struct frame *frame, const struct sample *samples, int n,
                           bool *out_groups)
{
    memset(out_groups, 0, BATCH * sizeof(*out_groups));
    for (int i = 0; i < n; i++) {
        if (samples[i].is_cut || frame->run_bounces || frame->pass)
            out_groups[samples[i].group] = true;
    }
}

void gn_shadow_weigh(const struct frame *frame, struct sample *s)
{
    double emitted[3];
    gn_near_get_emission(frame, &s->surface, emitted);
    for (int k = 0; k < 3; k++) {
        // The ratio does not know the albedo, so a black one may not make it 0 / 0.
        double brdf = fmax(s->surface.albedo[k], 1e-3) / M_PI;
        s->base[k] = brdf * s->open[k] + emitted[k];
        s->lost[k] = s->open[k] > frame->floor_irradiance[k] ? brdf * s->cut[k] : 0;
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
    list_lights(frame, scratch, n);
    if (scratch->n_shadow_lights == 0 && frame->near.n == 0 && !frame->pass)
        return;
    gn_receivers_begin(r);
    for (int i = 0; i < n; i++) {
        if (scratch->samples[i].is_receiver)
            gn_receivers_add(r, scratch->samples, i, frame->blend.n);
    }
    gn_receivers_end(r, frame->blend.n);
    if (r->n == 0)
        return;
    for (int b = 0; b < r->n_blocks; b++) {
        memset(scratch->cut[b], 0, (size_t)frame->lights->n * sizeof(uint16_t));
        memset(scratch->hidden[b], 0, (size_t)frame->lights->n * sizeof(uint16_t));
        r->wanted[b] = 0;
    }
    find_cut(frame, scratch, figures);
    if (frame->near.n > 0 && !frame->pass)
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
    if (frame->run_blockers && frame->near.n_real > 0 && !frame->pass)
        gn_near_find_hidden(frame, scratch, figures);
    for (int b = 0; b < r->n_blocks; b++) {
        if (r->wanted[b])
            sum_block(frame, scratch, b);
    }
    if (frame->pass)
        gn_pass_light_receivers(frame, scratch, n, figures);
    else if (frame->near.n > 0)
        gn_near_sum(frame, scratch, figures);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (groups[s->group] && s->is_receiver)
            gn_shadow_weigh(frame, s);
        else if (groups[s->group] && s->kind != SAMPLE_VIRTUAL)
            gn_shadow_see_nothing(frame, s);
    }
}
