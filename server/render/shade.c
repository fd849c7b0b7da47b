/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

void gn_shade_reflect(const struct gn_surface *surface, float dir[static 3])
{
    const float *n = surface->normal_shading;
    float c = 2 * dot3(dir, n);
    float out[3] = {dir[0] - c * n[0], dir[1] - c * n[1], dir[2] - c * n[2]};
    if (!(dot3(out, surface->normal_horizon) > 0)) { // an interpolated normal may point inside
        n = surface->normal_geometric;
        c = 2 * dot3(dir, n);
        for (int k = 0; k < 3; k++)
            out[k] = dir[k] - c * n[k];
    }
    float scale = 1 / sqrtf(dot3(out, out));
    for (int k = 0; k < 3; k++)
        dir[k] = out[k] * scale;
}

/** Mirrors of one sample: radiance where the environment is seen, else a lit surface. */
static void follow_mirrors(const struct frame *frame, struct sample *s,
                           struct tile_figures *figures)
{
    float dir[3] = {s->dir[0], s->dir[1], s->dir[2]};
    figures->n_mirrors++;
    for (int depth = 1; s->surface.material == GN_MATERIAL_MIRROR; depth++) {
        struct gn_rt_hit hit;
        for (int k = 0; k < 3; k++)
            s->through[k] *= s->surface.albedo[k];
        gn_shade_reflect(&s->surface, dir);
        bool met = false;
        if (depth <= MIRROR_DEPTH) {
            figures->rays_mirror++;
            met = gn_rt_intersect(frame->rt, GN_RT_ALL, s->org, dir, 0, INFINITY, &hit);
        }
        if (!met) {
            float radiance[3];
            gn_blend_get_radiance(&frame->blend, s->surface.point, dir, radiance);
            for (int k = 0; k < 3; k++)
                s->radiance[k] = (double)s->through[k] * radiance[k];
            s->is_lit = false;
            return;
        }
        gn_scene_get_surface_filtered(frame->scene, dir, &hit, hit.distance * frame->pixel_angle,
                                      &s->surface);
        float pinned[3];
        if (s->surface.role == GN_RT_REAL && s->surface.material != GN_MATERIAL_MIRROR &&
            gn_blend_get_radiance_at(&frame->blend, s->surface.point, pinned)) {
            for (int k = 0; k < 3; k++)
                s->radiance[k] = (double)s->through[k] * pinned[k];
            s->is_lit = false;
            return;
        }
        gn_surface_get_origin(&s->surface, s->org);
    }
    memcpy(s->seen_dir, dir, sizeof(s->seen_dir));
}

void gn_shade_follow_mirrors(const struct frame *frame, struct sample *samples, int n,
                             struct tile_figures *figures)
{
    for (int i = 0; i < n; i++) {
        struct sample *s = &samples[i];
        if (s->kind != SAMPLE_VIRTUAL)
            continue;
        s->is_lit = true;
        memcpy(s->seen_dir, s->dir, sizeof(s->seen_dir));
        for (int k = 0; k < 3; k++) {
            s->through[k] = 1;
            s->radiance[k] = s->indirect[k] = 0;
        }
        if (s->surface.material == GN_MATERIAL_MIRROR)
            follow_mirrors(frame, s, figures);
        figures->n_lit += s->is_lit;
    }
}

/** Diffuse radiance of irradiance E: albedo / pi E. */
static void reflect_irradiance(struct sample *s, const double irradiance[static 3])
{
    for (int k = 0; k < 3; k++)
        s->radiance[k] += (double)s->through[k] * s->surface.albedo[k] / M_PI * irradiance[k];
}

/** By the SH irradiance. */
static void look_up_irradiance(const struct frame *frame, const struct sample *s,
                               double sum[static 3])
{
    const double normal[3] = {s->surface.normal_shading[0], s->surface.normal_shading[1],
                              s->surface.normal_shading[2]};
    for (int p = 0; p < frame->blend.n; p++) {
        double e[3];
        gn_irradiance_get(&frame->blend.state[p]->irradiance, normal, e);
        for (int k = 0; k < 3; k++)
            sum[k] += e[k] * (frame->blend.n > 1 ? (double)s->weights[p] : 1);
    }
}

static void shade_by_irradiance(const struct frame *frame, struct sample *s)
{
    double sum[3] = {0};
    look_up_irradiance(frame, s, sum);
    reflect_irradiance(s, sum);
}

/** Cosine between normals that see much the same light. */
#define ALIKE 0.998f

static bool is_seen_directly(const struct sample *s)
{
    return s->kind == SAMPLE_VIRTUAL && s->is_lit &&
           memcmp(s->seen_dir, s->dir, sizeof(s->dir)) == 0;
}

/**
 * The sample whose irradiance is taken for the i-th: of a grid each row's on the diagonal where it
 * is much like it, else its own. What a pixel shows of a surface is its albedo's and its outline's
 * detail more than its light's; rays to the lights are most of a grid's cost.
 */
static int find_irradiance(const struct scratch *scratch, int i)
{
    const struct sample *s = &scratch->samples[i];
    int grid = scratch->grid;
    int row = i % (grid * grid) / grid;
    int there = i - i % (grid * grid) + row * grid + row;
    const struct sample *t = &scratch->samples[there];
    bool is_alike = is_seen_directly(s) && is_seen_directly(t) && t->object == s->object &&
                    dot3(t->surface.normal_shading, s->surface.normal_shading) > ALIKE &&
                    dot3(t->surface.normal_horizon, s->surface.normal_horizon) > ALIKE;
    return is_alike ? there : i;
}

void gn_shade_samples(const struct frame *frame, struct scratch *scratch, int n,
                      struct tile_figures *figures)
{
    struct receivers *r = &scratch->receivers;
    int from[BATCH]; // whose irradiance; -1: none is needed
    double irradiance[BATCH][3];
    gn_receivers_begin(r);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        from[i] = -1;
        if (s->kind != SAMPLE_VIRTUAL || !s->is_lit)
            continue;
        gn_near_add_emission(frame, s);
        if (frame->options.shading == GN_SHADING_IRRADIANCE) {
            shade_by_irradiance(frame, s);
            continue;
        }
        from[i] = find_irradiance(scratch, i);
        if (from[i] == i)
            gn_receivers_add(r, scratch->samples, i, frame->blend.n);
    }
    gn_receivers_end(r, frame->blend.n);
    gn_occlusion_find_all(frame, scratch, &figures->rays_shade);
    for (int b = 0; b < r->n_blocks; b++) {
        double sums[3][LANES];
        for (int l = 0; l < frame->lights->n; l++)
            scratch->mask[l] = (uint16_t)~scratch->hidden[b][l];
        gn_receivers_sum(frame, r, b, scratch->mask, false, sums);
        for (int i = 0; i < LANES && b * LANES + i < r->n; i++) {
            for (int k = 0; k < 3; k++)
                irradiance[r->sample[b * LANES + i]][k] = sums[k][i];
        }
    }
    for (int i = 0; i < n; i++) {
        if (from[i] >= 0)
            reflect_irradiance(&scratch->samples[i], irradiance[from[i]]);
    }
}

/** Adds the light of the packet's free lanes. */
static void flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                  double irradiance[static 3], struct tile_figures *figures)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, set, &n, &figures->rays_shade);
    for (int lane = 0; lane < n; lane++) {
        if (hidden >> lane & 1)
            continue;
        int light = scratch->lane_light[lane];
        for (int k = 0; k < 3; k++)
            irradiance[k] +=
                (double)scratch->lane_weight[lane] * frame->lights->irradiance[k][light];
    }
}

void gn_shade_get_irradiance(const struct frame *frame, struct scratch *scratch,
                             const struct sample *s, enum gn_rt_set set, int first, int stride,
                             double out_irradiance[static 3], struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    double sum[3] = {0};
    bool by_map = frame->options.shading == GN_SHADING_IRRADIANCE;
    if (by_map)
        look_up_irradiance(frame, s, sum);
    for (int l = first; l < lights->n && !by_map; l += stride) {
        const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
        float c = surface_cosine(&s->surface, dir) * (float)stride;
        if (frame->blend.n > 1)
            c *= s->weights[get_probe(lights, l)];
        if (c > 0 && gn_packet_add(scratch, s->org, dir, 0, l, c, INFINITY))
            flush(frame, scratch, set, sum, figures);
    }
    flush(frame, scratch, set, sum, figures);
    for (int l = first + (by_map ? frame->near.n_placed : 0); l < frame->near.n; l += stride) {
        const struct gn_near_light *light = &frame->near.lights[l];
        struct near_ray ray;
        if (!(light->role & set) || !gn_near_aim(light, s->org, &ray))
            continue;
        double weight = ray.weight * (double)surface_cosine(&s->surface, ray.dir) *
                        gn_placed_get_weight(frame, s, l) * stride;
        if (!(weight > 0))
            continue;
        figures->n_near++;
        figures->rays_shade++;
        bool is_hidden = gn_rt_is_occluded(frame->rt, set, s->org, ray.dir, 0, ray.length);
        for (int k = 0; k < 3 && !is_hidden; k++)
            sum[k] += weight * (double)light->intensity[k];
    }
    memcpy(out_irradiance, sum, sizeof(sum));
}
