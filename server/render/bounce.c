/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Indirect light, for the reference: random walks from a diffuse surface, cosine-distributed, with
 * one light of the map tried at each diffuse vertex (chosen in proportion to its luminance); a
 * mirror on the way is followed and, where it shows the environment, takes its radiance, since no
 * light can be tried from it. The light that reaches the first surface directly is not in it.
 * The same seed gives the same walk through the real objects alone and through all of them, up to
 * the first virtual surface: so what a walk brings in common is never more than what it brings
 * among the real objects, and their difference has little noise.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

/** Random numbers: splitmix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number
 * Generators", OOPSLA 2014). */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/** In [0, 1). */
static double next_unit(uint64_t *state)
{
    return (double)(next_random(state) >> 11) * 0x1p-53;
}

/** Cosine-distributed about n. Orthonormal basis: Duff et al., JCGT 6(1), 2017. */
static void sample_cosine(const float n[static 3], uint64_t *random, float out_dir[static 3])
{
    double r2 = next_unit(random);
    double phi = 2 * M_PI * next_unit(random);
    double r = sqrt(r2);
    double sign = copysign(1, n[2]);
    double a = -1 / (sign + n[2]);
    double b = n[0] * n[1] * a;
    const double s[3] = {1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]};
    const double t[3] = {b, sign + n[1] * n[1] * a, -n[1]};
    double d[3];
    double length2 = 0;
    for (int k = 0; k < 3; k++) {
        d[k] = r * cos(phi) * s[k] + r * sin(phi) * t[k] + sqrt(1 - r2) * n[k];
        length2 += d[k] * d[k];
    }
    for (int k = 0; k < 3; k++)
        out_dir[k] = (float)(d[k] / sqrt(length2));
}

/** A light with probability proportional to its luminance. */
static int choose_light(const struct light_list *lights, double u)
{
    int lo = 0;
    int hi = lights->n - 1;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (lights->cdf[mid] > u)
            hi = mid;
        else
            lo = mid + 1;
    }
    return lo;
}

/** One walk. */
struct walk {
    struct gn_surface surface;
    float org[3];
    float dir[3];
    double through[3];
    bool is_touched;  // a virtual surface has had a part
    bool is_specular; // the last vertex was a mirror
};

/** Adds radiance times the walk's share. */
static void add_radiance(const struct walk *walk, const double radiance[static 3],
                         double sums[static 2][3])
{
    for (int k = 0; k < 3; k++)
        sums[walk->is_touched][k] += walk->through[k] * radiance[k];
}

/** Direct light at the walk's vertex, by one modelled surface that a probe sees. */
static void try_place(const struct frame *frame, const struct walk *walk, enum gn_rt_set set,
                      uint64_t *random, double sums[static 2][3], uint64_t *rays)
{
    double radiance[3];
    gn_places_try(frame, &walk->surface, walk->org, set, next_unit(random), radiance, rays);
    for (int k = 0; k < 3; k++)
        radiance[k] *= walk->surface.albedo[k] / M_PI;
    add_radiance(walk, radiance, sums);
}

/** Direct light at the walk's vertex, by one light. */
static void try_light(const struct frame *frame, const struct walk *walk, enum gn_rt_set set,
                      uint64_t *random, double sums[static 2][3], uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    if (lights->n_lit == 0)
        return;
    int l = choose_light(lights, next_unit(random));
    double probability = lights->cdf[l] - (l > 0 ? lights->cdf[l - 1] : 0);
    const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
    float c = surface_cosine(&walk->surface, dir);
    if (!(c > 0) || !(probability > 0))
        return;
    ++*rays;
    if (gn_rt_is_occluded(frame->rt, set, walk->org, dir, 0, INFINITY))
        return;
    if (frame->blend.n > 1) {
        double weights[GN_PROBES_MAX];
        gn_blend_get_weights(&frame->blend, walk->surface.point, weights);
        c *= (float)weights[get_probe(lights, l)];
    }
    double radiance[3];
    for (int k = 0; k < 3; k++)
        radiance[k] = walk->surface.albedo[k] / M_PI * c * lights->irradiance[k][l] / probability;
    add_radiance(walk, radiance, sums);
}

/** Near light at the walk's vertex, by one lamp or piece. Direct light of emissive surfaces is all
 * in this: a walk that runs into one takes nothing, unless it came from a mirror. */
static void try_near(const struct frame *frame, struct walk *walk, enum gn_rt_set set,
                     uint64_t *random, double sums[static 2][3], uint64_t *rays)
{
    double irradiance[3];
    enum gn_rt_set role;
    bool was_touched = walk->is_touched;
    gn_near_reference_try(frame, &walk->surface, walk->org, set, next_random(random), irradiance,
                          &role, rays);
    for (int k = 0; k < 3; k++)
        irradiance[k] *= walk->surface.albedo[k] / M_PI;
    walk->is_touched |= role == GN_RT_VIRTUAL;
    add_radiance(walk, irradiance, sums);
    walk->is_touched = was_touched;
}

/** The next vertex. False where the walk ends. */
static bool step(const struct frame *frame, struct walk *walk, enum gn_rt_set set,
                 double sums[static 2][3], uint64_t *rays)
{
    struct gn_rt_hit hit;
    ++*rays;
    if (!gn_rt_intersect(frame->rt, set, walk->org, walk->dir, 0, INFINITY, &hit)) {
        if (walk->is_specular) {
            float radiance[3];
            gn_blend_get_radiance(&frame->blend, walk->surface.point, walk->dir, radiance);
            const double wide[3] = {radiance[0], radiance[1], radiance[2]};
            add_radiance(walk, wide, sums);
        }
        return false;
    }
    gn_scene_get_surface(frame->scene, walk->dir, &hit, &walk->surface);
    float pinned[3];
    if (walk->surface.role == GN_RT_REAL && frame->places->n > 0 &&
        gn_blend_get_radiance_at(&frame->blend, walk->surface.point, pinned)) {
        // What the probe sees is among the lights that were tried, but not from a mirror.
        const double wide[3] = {pinned[0], pinned[1], pinned[2]};
        if (walk->is_specular)
            add_radiance(walk, wide, sums);
        return false;
    }
    const struct gn_surface *surface = &walk->surface;
    gn_rt_offset_origin(surface->point, surface->normal_geometric, surface->clearance,
                        surface->normal_geometric, walk->org);
    walk->is_touched |= surface->role == GN_RT_VIRTUAL;
    if (walk->is_specular) {
        double radiance[3];
        gn_near_get_emission(frame, surface, radiance);
        add_radiance(walk, radiance, sums);
    }
    walk->is_specular = surface->material == GN_MATERIAL_MIRROR;
    return true;
}

static void take_walk(const struct frame *frame, const struct sample *start, enum gn_rt_set set,
                      uint64_t random, double sums[static 2][3], uint64_t *rays)
{
    struct walk walk = {.surface = start->surface};
    memcpy(walk.org, start->org, sizeof(walk.org));
    for (int k = 0; k < 3; k++)
        walk.through[k] = 1;
    for (int bounce = 1;; bounce++) {
        bool is_last = bounce > frame->options.bounces;
        if (is_last && !walk.is_specular)
            return;
        if (walk.is_specular)
            gn_shade_reflect(&walk.surface, walk.dir);
        else
            sample_cosine(walk.surface.normal_shading, &random, walk.dir);
        if (!(dot3(walk.dir, walk.surface.normal_geometric) > 0))
            return;
        // Cosine over its own density is pi; times albedo / pi.
        for (int k = 0; k < 3; k++)
            walk.through[k] *= walk.surface.albedo[k];
        // After the last vertex, a mirror, only the environment counts.
        if (!step(frame, &walk, set, sums, rays) || is_last)
            return;
        if (!walk.is_specular)
            try_light(frame, &walk, set, &random, sums, rays);
        if (!walk.is_specular && frame->near.cdf)
            try_near(frame, &walk, set, &random, sums, rays);
        if (!walk.is_specular && frame->places->n > 0)
            try_place(frame, &walk, set, &random, sums, rays);
    }
}

void gn_bounce_gather(const struct frame *frame, const struct sample *start, enum gn_rt_set set,
                      int n_paths, double out_common[static 3], double out_touched[static 3],
                      uint64_t *rays)
{
    double sums[2][3] = {{0}};
    uint64_t state = start->seed;
    for (int i = 0; i < n_paths; i++)
        take_walk(frame, start, set, next_random(&state), sums, rays);
    for (int k = 0; k < 3; k++) {
        out_common[k] = sums[0][k] / n_paths;
        out_touched[k] = sums[1][k] / n_paths;
    }
}
