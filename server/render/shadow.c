/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's shadow factor (section 5.2), per pixel and channel:
 *   U = sum w_i Phi_i V_real,i   S = sum w_i Phi_i V_real,i (1 - V_virtual,i)   factor = 1 - S / U
 * with w_i the cosine (Lambert: albedo and pi cancel) or, as the paper has it, 1 for every light
 * above the surface. Two steps: which lights do virtual objects hide; then, only for pixels with
 * such a light, the sums.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

static float weigh_light(const struct frame *frame, const struct gn_surface *surface,
                         const float dir[static 3])
{
    float c = surface_cosine(surface, dir);
    return c > 0 && frame->options.shadow_unweighted ? 1 : c;
}

static void flush_virtual(const struct frame *frame, struct scratch *scratch,
                          struct tile_figures *figures)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, GN_RT_VIRTUAL, &n, &figures->rays_shadow);
    for (int lane = 0; lane < n; lane++) {
        if (!(hidden >> lane & 1))
            continue;
        int j = scratch->lane_sample[lane];
        int light = scratch->lane_light[lane];
        scratch->blocked[j][light / 64] |= UINT64_C(1) << (light % 64);
        scratch->samples[scratch->lit[j]].is_cut = true;
    }
}

/** Which lights do virtual objects hide from the m samples of scratch->lit? */
static void find_blocked(const struct frame *frame, struct scratch *scratch, int m,
                         struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    size_t words = (size_t)(lights->n + 63) / 64;
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int j = 0; j < m; j++) {
        const float *org = scratch->samples[scratch->lit[j]].org;
        memset(scratch->blocked[j], 0, words * sizeof(uint64_t));
        for (int k = 0; k < 3; k++) {
            box.min[k] = fminf(box.min[k], org[k]);
            box.max[k] = fmaxf(box.max[k], org[k]);
        }
    }
    for (int l = 0; l < lights->n; l++) {
        const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
        if (frame->cull && !gn_box_may_meet_from_box(&frame->virtual_box, &box, dir))
            continue;
        for (int j = 0; j < m; j++) {
            const struct sample *s = &scratch->samples[scratch->lit[j]];
            if (!(surface_cosine(&s->surface, dir) > 0))
                continue;
            if (frame->cull && !gn_box_may_meet(&frame->virtual_box, s->org, dir))
                continue;
            if (gn_packet_add(scratch, s->org, dir, j, l, 0))
                flush_virtual(frame, scratch, figures);
        }
    }
    flush_virtual(frame, scratch, figures);
}

static void add_light(const struct frame *frame, struct scratch *scratch, int j, int light,
                      double weight)
{
    struct sample *s = &scratch->samples[scratch->lit[j]];
    bool is_cut = scratch->blocked[j][light / 64] >> (light % 64) & 1;
    for (int k = 0; k < 3; k++) {
        double e = weight * frame->lights->irradiance[k][light];
        s->open[light & 1][k] += e;
        if (is_cut)
            s->cut[light & 1][k] += e;
    }
}

static void flush_real(const struct frame *frame, struct scratch *scratch,
                       struct tile_figures *figures)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, GN_RT_REAL, &n, &figures->rays_shadow);
    figures->n_rays_real += (uint64_t)n;
    for (int lane = 0; lane < n; lane++) {
        if (!(hidden >> lane & 1))
            add_light(frame, scratch, scratch->lane_sample[lane], scratch->lane_light[lane],
                      scratch->lane_weight[lane]);
    }
}

/** U and S of those of the m samples that are cut (or whose pixel is). */
static void sum_lights(const struct frame *frame, struct scratch *scratch, int m,
                       const bool *groups, struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    for (int l = 0; l < lights->n; l++) {
        const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
        for (int j = 0; j < m; j++) {
            const struct sample *s = &scratch->samples[scratch->lit[j]];
            if (!groups[s->group])
                continue;
            float w = weigh_light(frame, &s->surface, dir);
            if (!(w > 0))
                continue;
            if (!frame->run_blockers)
                add_light(frame, scratch, j, l, w);
            else if (gn_packet_add(scratch, s->org, dir, j, l, w))
                flush_real(frame, scratch, figures);
        }
    }
    flush_real(frame, scratch, figures);
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
    for (int k = 0; k < 3; k++) {
        double u = s->open[0][k] + s->open[1][k];
        double cut = s->cut[0][k] + s->cut[1][k];
        // The ratio does not know the albedo, so a black one may not make it 0 / 0.
        double brdf = fmax(s->surface.albedo[k], 1e-3) / M_PI;
        s->base[k] = brdf * u;
        s->lost[k] = u > frame->floor_irradiance[k] ? brdf * cut : 0;
    }
}

void gn_shadow_see_nothing(const struct frame *frame, struct sample *s)
{
    float radiance[3];
    gn_radiance_map_get_radiance(frame->state->map, s->dir, radiance);
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
    bool groups[BATCH];
    int m = 0;
    for (int i = 0; i < n; i++) {
        gn_shadow_clear(&scratch->samples[i]);
        if (scratch->samples[i].is_receiver)
            scratch->lit[m++] = i;
    }
    if (m == 0)
        return;
    find_blocked(frame, scratch, m, figures);
    gn_shadow_find_groups(frame, scratch->samples, n, groups);
    sum_lights(frame, scratch, m, groups, figures);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (!groups[s->group])
            continue;
        if (s->is_receiver)
            gn_shadow_weigh(frame, s);
        else if (s->kind != SAMPLE_VIRTUAL)
            gn_shadow_see_nothing(frame, s);
    }
}
