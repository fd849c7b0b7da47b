/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Indirect light, for the reference: random walks from a surface. At each diffuse vertex (a ggx
 * surface's base is one) one light of the map is tried, chosen in proportion to its luminance, and
 * the walk goes on cosine-distributed; that is a bounce. Mirrors, glass and ggx reflection are
 * followed without being one: a walk that leaves them takes what it runs into, the environment too.
 * At ggx reflection the map is also sampled by its luminance (pyramid.h), both ways weighed by the
 * balance heuristic (Veach and Guibas, "Optimally Combining Sampling Techniques for Monte Carlo
 * Rendering", SIGGRAPH 1995). The light that reaches a diffuse first surface directly is not in it.
 * The same seed gives the same walk through the real objects alone and through all of them, up to
 * the first virtual surface: so what a walk brings in common is never more than what it brings
 * among the real objects, and their difference has little noise.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/render/ggx.h"
#include "server/render/glass.h"

/** Vertices of a walk: only light caught inside glass or between mirrors goes farther. */
#define MAX_VERTICES 64

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

/** One walk. */
struct walk {
    struct gn_surface surface; // of ggx: the albedo is the base's
    struct ggx ggx;            // where the surface is of ggx
    float org[3];
    float dir[3];
    double through[3];
    double pdf;          // 1/sr, of dir where it is specular; INFINITY: no other way leads there
    int n_bounces;       // diffuse reflections
    bool is_touched;     // a virtual surface has had a part
    bool skips_caustics; // caustics come to its start by photons
    bool is_clear;       // since its last diffuse reflection it met but mirrors and glass
    bool is_specular;    // dir came of a mirror, glass or ggx reflection
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
    int l = gn_render_lights_choose(lights, next_unit(random));
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

/** Density with which the maps' pyramids are sampled from a point. */
static double get_map_pdf(const struct frame *frame, const double weights[static GN_PROBES_MAX],
                          const float dir[static 3])
{
    double pdf = 0;
    for (int p = 0; p < frame->blend.n; p++)
        pdf += weights[p] * gn_pyramid_get_pdf(frame->blend.state[p]->pyramid, dir);
    return pdf;
}

static void get_map_weights(const struct frame *frame, const struct gn_surface *surface,
                            double out[static GN_PROBES_MAX])
{
    out[0] = 1;
    if (frame->blend.n > 1)
        gn_blend_get_weights(&frame->blend, surface->point, out);
}

/** Ggx reflection of the map, by one direction of its luminance. */
static void try_map(const struct frame *frame, const struct walk *walk, enum gn_rt_set set,
                    uint64_t *random, double sums[static 2][3], uint64_t *rays)
{
    double weights[GN_PROBES_MAX];
    get_map_weights(frame, &walk->surface, weights);
    const double u[2] = {next_unit(random), next_unit(random)};
    double choice = next_unit(random);
    int p = 0;
    while (p < frame->blend.n - 1 && choice >= weights[p])
        choice -= weights[p++];
    float dir[3];
    float radiance[3];
    double value[3];
    double pdf;
    if (!gn_pyramid_sample(frame->blend.state[p]->pyramid, u, dir))
        return;
    gn_ggx_eval(&walk->ggx, dir, value, &pdf);
    if (!(pdf > 0) || !(dot3(dir, walk->surface.normal_horizon) > 0))
        return;
    ++*rays;
    if (gn_rt_is_occluded(frame->rt, set, walk->org, dir, 0, INFINITY))
        return;
    gn_blend_get_radiance(&frame->blend, walk->surface.point, dir, radiance);
    pdf += get_map_pdf(frame, weights, dir);
    for (int k = 0; k < 3; k++)
        value[k] *= (double)radiance[k] / pdf;
    add_radiance(walk, value, sums);
}

/** Ggx reflection of the lamps, which no walk runs into. */
static void try_lamps(const struct frame *frame, struct walk *walk, enum gn_rt_set set,
                      double sums[static 2][3], uint64_t *rays)
{
    bool was_touched = walk->is_touched;
    for (int l = frame->near.n_placed; l < frame->near.n; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        struct near_ray ray;
        double value[3];
        double pdf;
        if (light->object != GN_NEAR_NO_OBJECT || !(light->role & set) ||
            !gn_near_aim(light, walk->org, &ray))
            continue;
        gn_ggx_eval(&walk->ggx, ray.dir, value, &pdf);
        if (!(pdf > 0) || !(dot3(ray.dir, walk->surface.normal_horizon) > 0))
            continue;
        ++*rays;
        if (gn_rt_is_occluded(frame->rt, set, walk->org, ray.dir, 0, ray.length))
            continue;
        for (int k = 0; k < 3; k++)
            value[k] *= ray.weight * (double)light->intensity[k];
        walk->is_touched = was_touched || light->role == GN_RT_VIRTUAL;
        add_radiance(walk, value, sums);
    }
    walk->is_touched = was_touched;
}

/** What the walk, going on from specular reflection, sees past all surfaces. */
static void add_map(const struct frame *frame, const struct walk *walk, double sums[static 2][3])
{
    if (walk->skips_caustics && walk->n_bounces == 1 && walk->is_clear &&
        walk->surface.role == GN_RT_VIRTUAL)
        return;
    float radiance[3];
    double share = 1;
    gn_blend_get_radiance(&frame->blend, walk->surface.point, walk->dir, radiance);
    if (walk->pdf < INFINITY) {
        double weights[GN_PROBES_MAX];
        get_map_weights(frame, &walk->surface, weights);
        share = walk->pdf / (walk->pdf + get_map_pdf(frame, weights, walk->dir));
    }
    const double wide[3] = {share * (double)radiance[0], share * (double)radiance[1],
                            share * (double)radiance[2]};
    add_radiance(walk, wide, sums);
}

static bool has_base(const struct gn_surface *surface)
{
    return (surface->material == GN_MATERIAL_DIFFUSE || surface->material == GN_MATERIAL_GGX) &&
           (surface->albedo[0] > 0 || surface->albedo[1] > 0 || surface->albedo[2] > 0);
}

/** The next vertex. False where the walk ends. */
static bool step(const struct frame *frame, struct walk *walk, enum gn_rt_set set,
                 double sums[static 2][3], uint64_t *rays)
{
    struct gn_rt_hit hit;
    ++*rays;
    if (!gn_rt_intersect(frame->rt, set, walk->org, walk->dir, 0, INFINITY, &hit)) {
        if (walk->is_specular)
            add_map(frame, walk, sums);
        return false;
    }
    gn_scene_get_surface(frame->scene, walk->dir, &hit, &walk->surface);
    struct gn_surface *surface = &walk->surface;
    float pinned[3];
    if (surface->role == GN_RT_REAL && frame->places->n > 0 &&
        gn_blend_get_radiance_at(&frame->blend, surface->point, pinned)) {
        // What the probe sees is among the lights that were tried, but not from a mirror.
        const double wide[3] = {pinned[0], pinned[1], pinned[2]};
        if (walk->is_specular)
            add_radiance(walk, wide, sums);
        return false;
    }
    gn_surface_get_origin(surface, walk->org);
    walk->is_touched |= surface->role == GN_RT_VIRTUAL;
    double sent[3] = {surface->emission[0], surface->emission[1], surface->emission[2]};
    add_radiance(walk, sent, sums); // of file materials, which are not among the lights
    if (walk->is_specular) {
        gn_near_get_emission(frame, surface, sent);
        add_radiance(walk, sent, sums);
    }
    return true;
}

/** Direct light at a new vertex. */
static void try_all(const struct frame *frame, struct walk *walk, enum gn_rt_set set,
                    uint64_t *random, double sums[static 2][3], uint64_t *rays)
{
    if (walk->surface.material == GN_MATERIAL_GGX) {
        gn_ggx_init(&walk->surface, walk->dir, &walk->ggx);
        for (int k = 0; k < 3; k++)
            walk->surface.albedo[k] = (float)walk->ggx.base[k];
        if (walk->ggx.alpha > 0) {
            try_map(frame, walk, set, random, sums, rays);
            try_lamps(frame, walk, set, sums, rays);
        }
    }
    if (walk->surface.material != GN_MATERIAL_DIFFUSE && !has_base(&walk->surface))
        return;
    try_light(frame, walk, set, random, sums, rays);
    if (frame->near.cdf)
        try_near(frame, walk, set, random, sums, rays);
    if (frame->places->n > 0)
        try_place(frame, walk, set, random, sums, rays);
}

/** On by ggx reflection, chosen with `probability`, at u. */
static bool leave_ggx(struct walk *walk, const double u[static 2], double probability)
{
    double weight[3];
    walk->is_specular = true;
    walk->is_clear = false;
    if (!gn_ggx_sample(&walk->ggx, u, walk->dir, weight, &walk->pdf) ||
        !(dot3(walk->dir, walk->surface.normal_horizon) > 0))
        return false;
    for (int k = 0; k < 3; k++)
        walk->through[k] *= weight[k] / probability;
    return true;
}

/** On by one of glass's two ways. */
static bool leave_glass(struct walk *walk, const double u[static 2], double choice)
{
    struct glass_ray ways[2];
    gn_glass_split(&walk->surface, walk->dir, u, &ways[0], &ways[1]);
    double first = ways[0].weight[1] + ways[0].weight[0] + ways[0].weight[2];
    double sum = first + ways[1].weight[0] + ways[1].weight[1] + ways[1].weight[2];
    if (!(sum > 0))
        return false;
    int way = choice * sum >= first;
    double probability = way ? 1 - first / sum : first / sum;
    for (int k = 0; k < 3; k++) {
        walk->through[k] *= ways[way].weight[k] / probability;
        walk->dir[k] = ways[way].dir[k];
    }
    if (way)
        gn_surface_get_origin_behind(&walk->surface, walk->org);
    walk->is_specular = true;
    walk->pdf = INFINITY;
    return true;
}

static bool leave_mirror(struct walk *walk)
{
    gn_shade_reflect(&walk->surface, walk->dir);
    for (int k = 0; k < 3; k++)
        walk->through[k] *= walk->surface.albedo[k];
    walk->is_specular = true;
    walk->pdf = INFINITY;
    return dot3(walk->dir, walk->surface.normal_horizon) > 0;
}

/** On by diffuse reflection, chosen with `probability`: a bounce. */
static bool leave_diffuse(const struct frame *frame, struct walk *walk, uint64_t *random,
                          double probability)
{
    if (++walk->n_bounces > frame->options.bounces)
        return false;
    sample_cosine(walk->surface.normal_shading, random, walk->dir);
    if (!(dot3(walk->dir, walk->surface.normal_horizon) > 0))
        return false;
    // Cosine over its own density is pi; times albedo / pi.
    for (int k = 0; k < 3; k++)
        walk->through[k] *= walk->surface.albedo[k] / probability;
    walk->is_specular = false;
    walk->is_clear = true;
    return true;
}

/** The direction on from a vertex. False where the walk ends. */
static bool leave(const struct frame *frame, struct walk *walk, uint64_t *random)
{
    enum gn_material_type type = walk->surface.material;
    if (type == GN_MATERIAL_MIRROR)
        return leave_mirror(walk);
    if (type == GN_MATERIAL_DIFFUSE)
        return leave_diffuse(frame, walk, random, 1);
    const double u[2] = {next_unit(random), next_unit(random)};
    double choice = next_unit(random);
    if (type == GN_MATERIAL_GLASS)
        return leave_glass(walk, u, choice);
    const double *r = walk->ggx.reflected;
    const float reflected[3] = {(float)r[0], (float)r[1], (float)r[2]};
    double specular = gn_luminance(reflected);
    double base = walk->n_bounces < frame->options.bounces ? gn_luminance(walk->surface.albedo) : 0;
    double probability = base > 0 ? specular / (specular + base) : 1;
    if (choice < probability)
        return leave_ggx(walk, u, probability);
    return leave_diffuse(frame, walk, random, 1 - probability);
}

/** Goes on from a vertex whose own light has been tried. */
static void take_walk(const struct frame *frame, struct walk *walk, enum gn_rt_set set,
                      uint64_t *random, double sums[static 2][3], uint64_t *rays)
{
    for (int vertex = 1; vertex < MAX_VERTICES; vertex++) {
        if (!step(frame, walk, set, sums, rays))
            return;
        try_all(frame, walk, set, random, sums, rays);
        if (!leave(frame, walk, random))
            return;
    }
}

static struct walk start_walk(const struct sample *start)
{
    struct walk walk = {.surface = start->surface, .through = {1, 1, 1}};
    memcpy(walk.org, start->org, sizeof(walk.org));
    memcpy(walk.dir, start->seen_dir, sizeof(walk.dir));
    return walk;
}

void gn_bounce_gather(const struct frame *frame, const struct sample *start, enum gn_rt_set set,
                      int n_paths, double out_common[static 3], double out_touched[static 3],
                      uint64_t *rays)
{
    double sums[2][3] = {{0}};
    uint64_t state = start->seed;
    for (int i = 0; i < n_paths; i++) {
        struct walk walk = start_walk(start);
        uint64_t random = next_random(&state);
        walk.skips_caustics = start->has_photons;
        if (leave_diffuse(frame, &walk, &random, 1))
            take_walk(frame, &walk, set, &random, sums, rays);
    }
    for (int k = 0; k < 3; k++) {
        out_common[k] = sums[0][k] / n_paths;
        out_touched[k] = sums[1][k] / n_paths;
    }
}

/** Point i of the sequence R2, turned by `turn`: evener than random ones, each alone as random
 * (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018). */
static void get_point(int i, const double turn[static 2], double out[static 2])
{
    static const double steps[2] = {0.7548776662466927, 0.5698402909980532};
    for (int k = 0; k < 2; k++) {
        out[k] = turn[k] + (i + 1) * steps[k];
        out[k] -= floor(out[k]);
    }
}

void gn_bounce_gather_specular(const struct frame *frame, const struct sample *start, int n_paths,
                               double out_radiance[static 3], uint64_t *rays)
{
    double sums[2][3] = {{0}};
    uint64_t state = start->seed ^ UINT64_C(0x5851f42d4c957f2d);
    const double turn[2] = {next_unit(&state), next_unit(&state)};
    bool is_ggx = start->surface.material == GN_MATERIAL_GGX;
    for (int i = 0; i < n_paths; i++) {
        struct walk walk = start_walk(start);
        uint64_t random = next_random(&state);
        double u[2];
        get_point(i, turn, u);
        if (is_ggx) {
            gn_ggx_init(&walk.surface, walk.dir, &walk.ggx);
            if (walk.ggx.alpha > 0) {
                try_map(frame, &walk, GN_RT_ALL, &random, sums, rays);
                try_lamps(frame, &walk, GN_RT_ALL, sums, rays);
            }
        }
        if (is_ggx ? leave_ggx(&walk, u, 1) : leave_glass(&walk, u, next_unit(&random)))
            take_walk(frame, &walk, GN_RT_ALL, &random, sums, rays);
    }
    for (int k = 0; k < 3; k++)
        out_radiance[k] = (sums[0][k] + sums[1][k]) / n_paths;
}
