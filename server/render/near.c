/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/near.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/render/internal.h"

/** Pieces of all meshes that the reference works with. */
#define FINE_PIECES 512

bool gn_near_aim(const struct gn_near_light *light, const float p[static 3],
                 struct near_ray *out_ray)
{
    const float *n = light->normal_world;
    bool is_lamp = n[0] == 0 && n[1] == 0 && n[2] == 0;
    double to[3];
    double distance2 = 0;
    double cosine = 1;
    for (int k = 0; k < 3; k++) {
        to[k] = (double)light->position_world[k] - p[k];
        distance2 += to[k] * to[k];
    }
    double distance = sqrt(distance2);
    double radius = light->radius;
    if (!(distance > 0))
        return false;
    for (int k = 0; k < 3; k++)
        out_ray->dir[k] = (float)(to[k] / distance);
    if (!is_lamp)
        cosine = -(n[0] * to[0] + n[1] * to[1] + n[2] * to[2]) / distance;
    if (!(cosine > 0))
        return false;
    double least = NEAR_MIN_DISTANCE * NEAR_MIN_DISTANCE;
    out_ray->weight = is_lamp ? 1 / fmax(fmax(distance2, radius * radius), least)
                              : cosine / fmax(distance2 + radius * radius, least);
    out_ray->length = (float)(fmax(0, distance - (is_lamp ? radius : 0)) * (1 - NEAR_SHARE));
    return true;
}

void gn_near_get_emission(const struct frame *frame, const struct gn_surface *surface,
                          double out_radiance[static 3])
{
    float rgb[3];
    gn_emission_get_radiance(frame->blend.state[0]->emission, frame->scene, surface, rgb);
    for (int k = 0; k < 3; k++)
        out_radiance[k] = rgb[k];
}

void gn_near_add_emission(const struct frame *frame, struct sample *s)
{
    double rgb[3];
    gn_near_get_emission(frame, &s->surface, rgb);
    for (int k = 0; k < 3; k++)
        s->radiance[k] += s->through[k] * rgb[k];
}

/** Adds a ray to the packet; true where it is full. */
static bool add_ray(struct scratch *scratch, const float org[static 3], const struct near_ray *ray,
                    int sample, int light, float weight)
{
    return gn_packet_add(scratch, org, ray->dir, sample, light, weight, ray->length);
}

/** Adds the light of the packet's free lanes to irradiance[sample]. */
static void flush_light(const struct frame *frame, struct scratch *scratch, double (*irradiance)[3],
                        uint64_t *rays)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, GN_RT_ALL, &n, rays);
    for (int lane = 0; lane < n; lane++) {
        const struct gn_near_light *light = &frame->near.lights[scratch->lane_light[lane]];
        double *e = irradiance[scratch->lane_sample[lane]];
        for (int k = 0; k < 3 && !(hidden >> lane & 1); k++)
            e[k] += (double)scratch->lane_weight[lane] * light->intensity[k];
    }
}

void gn_near_shade(const struct frame *frame, struct scratch *scratch, int n,
                   struct tile_figures *figures)
{
    double irradiance[BATCH][3];
    int m = 0;
    for (int i = 0; i < n; i++) {
        if (scratch->samples[i].kind == SAMPLE_VIRTUAL && scratch->samples[i].is_lit)
            scratch->lit[m++] = i;
    }
    memset(irradiance, 0, (size_t)m * sizeof(irradiance[0]));
    // The irradiance map has all light of the map already.
    int first = frame->options.shading == GN_SHADING_IRRADIANCE ? frame->near.n_placed : 0;
    for (int l = first; l < frame->near.n && m > 0; l++) {
        for (int j = 0; j < m; j++) {
            const struct sample *s = &scratch->samples[scratch->lit[j]];
            struct near_ray ray;
            if (!gn_near_aim(&frame->near.lights[l], s->org, &ray))
                continue;
            double weight = ray.weight * (double)surface_cosine(&s->surface, ray.dir) *
                            gn_placed_get_weight(frame, s, l);
            figures->n_near += weight > 0;
            if (weight > 0 && add_ray(scratch, s->org, &ray, j, l, (float)weight))
                flush_light(frame, scratch, irradiance, &figures->rays_shade);
        }
    }
    flush_light(frame, scratch, irradiance, &figures->rays_shade);
    for (int j = 0; j < m; j++) {
        struct sample *s = &scratch->samples[scratch->lit[j]];
        for (int k = 0; k < 3; k++)
            s->radiance[k] +=
                (double)s->through[k] * s->surface.albedo[k] / M_PI * irradiance[j][k];
    }
}

/** Hull of a box and a point: all rays from the one to the other stay in it. */
static struct box get_hull(const struct box *box, const float p[static 3])
{
    struct box hull = *box;
    for (int k = 0; k < 3; k++) {
        hull.min[k] = fminf(hull.min[k], p[k]);
        hull.max[k] = fmaxf(hull.max[k], p[k]);
    }
    return hull;
}

static bool overlap(const struct box *a, const struct box *b)
{
    bool is_apart = false;
    for (int k = 0; k < 3; k++)
        is_apart |= a->min[k] > b->max[k] || b->min[k] > a->max[k];
    return !is_apart;
}

/** Traces the packet; marks hidden lanes in masks[block][light]. */
static void flush_masks(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                        uint16_t (*masks)[GN_NEAR_LIGHTS_MAX], struct tile_figures *figures)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, set, &n, &figures->rays_shadow);
    figures->n_rays_real += set == GN_RT_REAL ? (uint64_t)n : 0;
    for (int lane = 0; lane < n; lane++) {
        int j = scratch->lane_sample[lane];
        if (hidden >> lane & 1)
            masks[j / LANES][scratch->lane_light[lane]] |= (uint16_t)(1u << (j % LANES));
    }
}

/** The ray of receiver j to light l, and the cosine there; false where none arrives. */
static bool aim_receiver(const struct frame *frame, const struct scratch *scratch, int j, int l,
                         struct near_ray *out_ray, double *out_cosine)
{
    const struct sample *s = &scratch->samples[scratch->receivers.sample[j]];
    if (!gn_near_aim(&frame->near.lights[l], s->org, out_ray))
        return false;
    *out_cosine = (double)surface_cosine(&s->surface, out_ray->dir);
    return *out_cosine > 0;
}

/** Rays of a block's lanes to one light; of the wanted lanes. */
static void trace_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                        unsigned wanted, enum gn_rt_set set, uint16_t (*masks)[GN_NEAR_LIGHTS_MAX],
                        struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    for (int i = 0; i < LANES && block * LANES + i < r->n; i++) {
        int j = block * LANES + i;
        const float org[3] = {r->org[0][j], r->org[1][j], r->org[2][j]};
        struct near_ray ray;
        double cosine;
        if (!(wanted >> i & 1) || !aim_receiver(frame, scratch, j, light, &ray, &cosine))
            continue;
        figures->n_near++;
        if (add_ray(scratch, org, &ray, j, light, 0))
            flush_masks(frame, scratch, set, masks, figures);
    }
}

/** Light of virtual lights on real surfaces, into gain. */
static void add_gain(const struct frame *frame, struct scratch *scratch,
                     struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    double irradiance[BATCH][3];
    memset(irradiance, 0, (size_t)r->n * sizeof(irradiance[0]));
    for (int l = 0; l < frame->near.n; l++) {
        for (int j = 0; j < r->n && frame->near.lights[l].role == GN_RT_VIRTUAL; j++) {
            struct near_ray ray;
            double cosine;
            if (!aim_receiver(frame, scratch, j, l, &ray, &cosine))
                continue;
            const float org[3] = {r->org[0][j], r->org[1][j], r->org[2][j]};
            figures->n_near++;
            if (add_ray(scratch, org, &ray, j, l, (float)(ray.weight * cosine)))
                flush_light(frame, scratch, irradiance, &figures->rays_shadow);
        }
    }
    flush_light(frame, scratch, irradiance, &figures->rays_shadow);
    for (int j = 0; j < r->n; j++) {
        struct sample *s = &scratch->samples[r->sample[j]];
        for (int k = 0; k < 3; k++)
            s->gain[k] += (double)s->surface.albedo[k] / M_PI * irradiance[j][k];
    }
}

void gn_near_find_cut(const struct frame *frame, struct scratch *scratch,
                      struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    for (int b = 0; b < r->n_blocks; b++) {
        memset(scratch->near_cut[b], 0, (size_t)frame->near.n * sizeof(uint16_t));
        memset(scratch->near_hidden[b], 0, (size_t)frame->near.n * sizeof(uint16_t));
    }
    for (int l = 0; l < frame->near.n && frame->near.n_real > 0; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        for (int b = 0; b < r->n_blocks && light->role == GN_RT_REAL; b++) {
            struct box hull = get_hull(&r->boxes[b], light->position_world);
            if (!frame->cull || overlap(&hull, &frame->virtual_box))
                trace_block(frame, scratch, b, l, 0xffff, GN_RT_VIRTUAL, scratch->near_cut,
                            figures);
        }
    }
    flush_masks(frame, scratch, GN_RT_VIRTUAL, scratch->near_cut, figures);
    for (int j = 0; j < r->n; j++) {
        unsigned any = 0;
        for (int l = 0; l < frame->near.n; l++)
            any |= scratch->near_cut[j / LANES][l];
        scratch->samples[r->sample[j]].is_cut |= any >> (j % LANES) & 1;
    }
    if (frame->near.n_virtual > 0)
        add_gain(frame, scratch, figures);
}

void gn_near_find_hidden(const struct frame *frame, struct scratch *scratch,
                         struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    const struct box *boxes[MAX_BLOCKERS];
    int n_boxes = frame->cull ? gn_blockers_list_above(frame, r, boxes) : 0;
    for (int l = 0; l < frame->near.n; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        for (int b = 0; b < r->n_blocks && light->role == GN_RT_REAL; b++) {
            struct box hull = get_hull(&r->boxes[b], light->position_world);
            bool may_hide = !frame->cull;
            for (int i = 0; i < n_boxes && !may_hide; i++)
                may_hide = overlap(&hull, boxes[i]);
            if (may_hide && r->wanted[b])
                trace_block(frame, scratch, b, l, r->wanted[b], GN_RT_REAL, scratch->near_hidden,
                            figures);
        }
    }
    flush_masks(frame, scratch, GN_RT_REAL, scratch->near_hidden, figures);
}

void gn_near_sum(const struct frame *frame, struct scratch *scratch, struct tile_figures *figures)
{
    const struct receivers *r = &scratch->receivers;
    for (int j = 0; j < r->n; j++) {
        struct sample *s = &scratch->samples[r->sample[j]];
        unsigned bit = 1u << (j % LANES);
        if (!(r->wanted[j / LANES] & bit))
            continue;
        for (int l = 0; l < frame->near.n; l++) {
            const struct gn_near_light *light = &frame->near.lights[l];
            struct near_ray ray;
            double cosine;
            bool is_hidden = frame->run_blockers && (scratch->near_hidden[j / LANES][l] & bit);
            if (light->role != GN_RT_REAL || is_hidden ||
                !aim_receiver(frame, scratch, j, l, &ray, &cosine))
                continue;
            figures->n_near++;
            double weight = ray.weight * (frame->options.shadow_unweighted ? 1 : cosine) *
                            gn_placed_get_weight(frame, s, l);
            bool is_cut = scratch->near_cut[j / LANES][l] & bit;
            for (int k = 0; k < 3; k++) {
                double e = weight * (double)light->intensity[k];
                s->open[k] += e;
                s->cut[k] += is_cut ? e : 0;
            }
        }
    }
}

bool gn_near_can_cast(const struct frame *frame, const struct box *box)
{
    for (int l = 0; l < frame->near.n; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        struct box hull = get_hull(box, light->position_world);
        if (light->role == GN_RT_VIRTUAL || overlap(&hull, &frame->virtual_box))
            return true;
    }
    return false;
}

/** The reference's own pieces, with the state's pictures on them. */
static int prepare_fine(struct near_store *store, const struct gn_scene *scene,
                        struct gn_emission *emission, struct near_lights *near)
{
    int ret = 0;
    if (!store->fine) {
        const struct gn_emitter_options options = {.n_pieces = FINE_PIECES};
        ret = gn_emitters_create(scene, &options, &store->fine, NULL);
    }
    if (ret == 0)
        ret = gn_emitters_take_pictures(store->fine, emission);
    if (ret < 0)
        return ret;
    gn_emission_unref(&store->emission);
    store->emission = gn_emitters_get_emission(store->fine);
    if (!store->emission)
        return 0;
    near->n = store->emission->n_lights;
    near->lights = store->emission->lights;
    near->pieces = gn_emitters_get_pieces(store->fine);
    near->first_piece = scene->n_lights;
    return 0;
}

static int fill_cdf(struct near_store *store, struct near_lights *near)
{
    double sum = 0;
    if (near->n > store->capacity) {
        free(store->cdf);
        store->cdf = malloc((size_t)near->n * sizeof(*store->cdf));
        store->capacity = store->cdf ? near->n : 0;
    }
    if (near->n > 0 && !store->cdf)
        return -ENOMEM;
    for (int l = 0; l < near->n; l++) {
        // A lamp sends all around, 4 pi of it; a piece pi.
        sum += gn_luminance(near->lights[l].intensity) *
               (near->lights[l].object == GN_NEAR_NO_OBJECT ? 4 : 1);
        store->cdf[l] = sum;
    }
    for (int l = 0; l < near->n && sum > 0; l++)
        store->cdf[l] /= sum;
    near->cdf = sum > 0 ? store->cdf : NULL;
    return 0;
}

int gn_near_prepare(struct near_store *store, const struct gn_scene *scene,
                    const struct gn_lighting_state *state, bool is_reference,
                    struct near_lights *out_near)
{
    struct near_lights near = {.n = state->n_near, .lights = state->near};
    const struct placed_lights *placed = &store->placed;
    int ret = 0;
    if (!is_reference && placed->n > 0) {
        if (state->n_near > 0)
            memcpy(placed->lights + placed->n, state->near,
                   (size_t)state->n_near * sizeof(*state->near));
        near.lights = placed->lights;
        near.n = placed->n + state->n_near;
        near.n_placed = placed->n;
        memcpy(near.ends, placed->ends, sizeof(near.ends));
    }
    if (is_reference && state->emission)
        ret = prepare_fine(store, scene, state->emission, &near);
    if (ret == 0 && is_reference)
        ret = fill_cdf(store, &near);
    if (ret < 0)
        return ret;
    for (int l = 0; l < near.n; l++) {
        near.n_real += near.lights[l].role == GN_RT_REAL;
        near.n_virtual += near.lights[l].role == GN_RT_VIRTUAL;
    }
    *out_near = near;
    return 0;
}

void gn_near_store_finish(struct near_store *store)
{
    free(store->placed.lights);
    gn_emission_unref(&store->emission);
    gn_emitters_destroy(&store->fine);
    free(store->cdf);
    memset(store, 0, sizeof(*store));
}
