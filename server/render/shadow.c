/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's shadow factor (section 5.2), per pixel and channel:
 *   U = sum w_i Phi_i V_real,i   S = sum w_i Phi_i V_real,i (1 - V_virtual,i)   factor = 1 - S / U
 * with w_i the cosine (Lambert: albedo and pi cancel) or, as the paper has it, 1 for every light
 * above the surface. Three steps: which lights do virtual objects hide; for pixels with such a
 * light, which do real objects hide (both: occlusion.c); the sums, in the order of the lights.
 */
#include "server/render/internal.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "server/render/pass.h"
#include "server/render/silhouette.h"

void gn_shadow_list_lights(const struct frame *frame, struct scratch *scratch,
                           const struct box *box)
{
    scratch->n_shadow_lights = 0;
    if (frame->virtual_silhouettes) {
        scratch->n_shadow_lights =
            gn_silhouettes_list(frame, frame->virtual_silhouettes, box, scratch->shadow_lights);
        return;
    }
    for (int l = 0; l < frame->lights->n; l++)
        scratch->shadow_lights[scratch->n_shadow_lights++] = (int16_t)l;
}

bool gn_shadow_is_free(const struct frame *frame, const struct scratch *scratch,
                       const struct box *box)
{
    for (int i = 0; i < scratch->n_shadow_lights; i++) {
        int l = scratch->shadow_lights[i];
        if (!frame->virtual_silhouettes ||
            gn_silhouette_get_box(&frame->virtual_silhouettes->of[l], box) != SILHOUETTE_FREE)
            return false;
    }
    return !gn_near_can_cast(frame, box);
}

/** Marks the samples that some light is cut off from. */
static void mark_cut(const struct frame *frame, struct scratch *scratch)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
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

/** True where all of a block's receivers have the same normals. */
static bool has_one_normal(const struct receivers *r, int block)
{
    int first = block * LANES;
    bool is_one = true;
    for (int j = first + 1; j < first + LANES && j < r->n; j++) {
        for (int k = 0; k < 3; k++)
            is_one &= r->shading[k][j] == r->shading[k][first] &&
                      r->geometric[k][j] == r->geometric[k][first];
    }
    return is_one;
}

/** All light of a block's receivers, whatever hides it. Most real surfaces are flat: their sums are
 * kept. */
static void sum_whole(const struct frame *frame, struct scratch *scratch, int block,
                      double out[static 3][LANES])
{
    const struct receivers *r = &scratch->receivers;
    bool is_kept = frame->blend.n == 1 && has_one_normal(r, block);
    struct whole key;
    for (int k = 0; k < 3; k++) {
        key.shading[k] = r->shading[k][block * LANES];
        key.geometric[k] = r->geometric[k][block * LANES];
    }
    if (scratch->wholes_of != frame->serial)
        scratch->n_wholes = 0;
    scratch->wholes_of = frame->serial;
    for (int i = 0; i < WHOLES && i < scratch->n_wholes && is_kept; i++) {
        const struct whole *whole = &scratch->wholes[i];
        if (memcmp(whole, &key, offsetof(struct whole, irradiance)) != 0)
            continue;
        for (int k = 0; k < 3; k++) {
            for (int lane = 0; lane < LANES; lane++)
                out[k][lane] = whole->irradiance[k];
        }
        return;
    }
    gn_receivers_sum(frame, r, block, NULL, frame->options.shadow_unweighted, out);
    if (!is_kept)
        return;
    for (int k = 0; k < 3; k++)
        key.irradiance[k] = out[k][0];
    scratch->wholes[scratch->n_wholes++ % WHOLES] = key;
}

/** U, all light less what is hidden, and S of a block's receivers. */
static void sum_block(const struct frame *frame, struct scratch *scratch, int block)
{
    const struct receivers *r = &scratch->receivers;
    bool unweighted = frame->options.shadow_unweighted;
    double whole[3][LANES];
    double hidden[3][LANES];
    double cut[3][LANES];
    for (int l = 0; l < frame->lights->n; l++)
        scratch->mask[l] = scratch->cut[block][l] & ~scratch->hidden[block][l];
    sum_whole(frame, scratch, block, whole);
    gn_receivers_sum(frame, r, block, scratch->hidden[block], unweighted, hidden);
    gn_receivers_sum(frame, r, block, scratch->mask, unweighted, cut);
    for (int i = 0; i < LANES; i++) {
        if (!(r->wanted[block] >> i & 1))
            continue;
        struct sample *s = &scratch->samples[r->sample[block * LANES + i]];
        for (int k = 0; k < 3; k++) {
            s->open[k] = whole[k][i] - hidden[k][i];
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
    gn_receivers_begin(r);
    for (int i = 0; i < n; i++) {
        gn_shadow_clear(&scratch->samples[i]);
        if (scratch->samples[i].is_receiver)
            gn_receivers_add(r, scratch->samples, i, frame->blend.n);
    }
    gn_receivers_end(r, frame->blend.n);
    if (r->n == 0 && !frame->pass) // what sees nothing has its share in a pass
        return;
    scratch->n_shadow_lights = 0;
    if (r->n > 0)
        gn_shadow_list_lights(frame, scratch, &r->box);
    if (scratch->n_shadow_lights == 0 && frame->near.n == 0 && !frame->pass)
        return;
    gn_occlusion_clear(frame, scratch);
    gn_occlusion_find_cut(frame, scratch, &figures->rays_shadow);
    mark_cut(frame, scratch);
    if (frame->near.n > 0 && !frame->pass)
        gn_near_find_cut(frame, scratch, figures);
    gn_shadow_find_groups(frame, scratch->samples, n, groups);
    bool is_any_wanted = false;
    for (int j = 0; j < r->n; j++) {
        bool is_wanted = groups[scratch->samples[r->sample[j]].group];
        r->wanted[j / LANES] |= (uint16_t)(is_wanted << (j % LANES));
        is_any_wanted |= is_wanted;
    }
    if (!is_any_wanted && !frame->pass)
        return;
    if (frame->run_blockers) {
        uint64_t rays = 0;
        gn_occlusion_find_hidden(frame, scratch, &rays);
        figures->rays_shadow += rays;
        figures->n_rays_real += rays;
    }
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
