/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Glossy reflection and glass of the virtual samples. Interactive: a few directions for each
 * sample, low-discrepancy points turned by the sample's own angle, each a ray through the scene;
 * one that meets nothing sees the map's mean over its share of the lobe, 1 / (n density) (filtered
 * importance sampling: Krivanek and Colbert, "Real-time Shading with Filtered Importance Sampling",
 * EGSR 2008). At glass both ways are followed, at further glossy surfaces one direction, until what
 * is carried is little; the rest of it sees the map as if nothing were in the way. Reference:
 * random walks (bounce.c).
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "server/render/ggx.h"
#include "server/render/glass.h"

/** Directions of a rough surface that the camera, or a mirror, sees. */
#define DIRECTIONS 8
/** Surfaces one after another. */
#define MAX_DEPTH 10
/** Rays that wait at one time: each surface takes one and adds at most two. */
#define MAX_WAITING (DIRECTIONS * 2 + MAX_DEPTH)
/** Rays that carry less of their direction's share are not traced. */
#define MIN_WEIGHT (1.0 / 128)

/** A ray that is still to be traced. */
struct branch {
    float point[3]; // of the surface that it leaves
    float org[3], dir[3];
    double weight[3];
    double solid_angle; // sr, that it stands for
    int depth;
    int first, stride; // of the lights that are tried where it arrives
};

/** What becomes of one sample. */
struct tree {
    const struct frame *frame;
    struct scratch *scratch;
    struct tile_figures *figures;
    double shift[2]; // of the points
    struct branch waiting[MAX_WAITING];
    int n_waiting;
    double radiance[3];
};

/** Adds weight times the mean of the map over solid_angle about dir. */
static void see_map(struct tree *tree, const struct branch *b)
{
    const struct gn_blend *blend = &tree->frame->blend;
    double weights[GN_PROBES_MAX] = {1};
    if (blend->n > 1)
        gn_blend_get_weights(blend, b->point, weights);
    for (int p = 0; p < blend->n; p++) {
        const struct gn_lighting_state *state = blend->state[p];
        float radiance[3];
        if (state->pyramid)
            gn_pyramid_get_radiance(state->pyramid, state->map, b->dir, b->solid_angle, radiance);
        else
            gn_radiance_map_get_radiance(state->map, b->dir, radiance);
        for (int k = 0; k < 3; k++)
            tree->radiance[k] += b->weight[k] * weights[p] * (double)radiance[k];
    }
}

static void push(struct tree *tree, const struct branch *b)
{
    double largest = fmax(b->weight[0], fmax(b->weight[1], b->weight[2]));
    if (!(largest > 0))
        return;
    if (largest * b->stride < MIN_WEIGHT || b->depth > MAX_DEPTH || tree->n_waiting == MAX_WAITING)
        see_map(tree, b);
    else
        tree->waiting[tree->n_waiting++] = *b;
}

/** Point i of n in the unit square: Hammersley's set, turned; by other angles at each surface on
 * the way of each ray (steps of Roberts' sequence R2). */
static void get_point(const struct tree *tree, const struct branch *from, int i, int n,
                      double out[static 2])
{
    static const double steps[2] = {0.7548776662466927, 0.5698402909980532};
    int turns = from->depth * (1 + 3 * DIRECTIONS) + from->first;
    unsigned bits = (unsigned)i;
    double inverse = 0;
    for (double digit = 0.5; bits; digit *= 0.5, bits >>= 1)
        inverse += digit * (bits & 1);
    out[0] = (i + 0.5) / n;
    out[1] = inverse;
    for (int k = 0; k < 2; k++) {
        out[k] += tree->shift[k] + turns * steps[k];
        out[k] -= floor(out[k]);
    }
}

/** Light of lamps, which no ray meets, in the reflection. */
static void add_lamps(struct tree *tree, const struct ggx *ggx, const struct sample *s,
                      const double weight[static 3])
{
    const struct near_lights *near = &tree->frame->near;
    for (int l = near->n_placed; l < near->n; l++) {
        struct near_ray ray;
        double value[3];
        double pdf;
        if (near->lights[l].object != GN_NEAR_NO_OBJECT ||
            !gn_near_aim(&near->lights[l], s->org, &ray))
            continue;
        gn_ggx_eval(ggx, ray.dir, value, &pdf);
        if (!(pdf > 0) || !(dot3(ray.dir, s->surface.normal_horizon) > 0))
            continue;
        tree->figures->rays_shade++;
        if (gn_rt_is_occluded(tree->frame->rt, GN_RT_ALL, s->org, ray.dir, 0, ray.length))
            continue;
        for (int k = 0; k < 3; k++)
            tree->radiance[k] +=
                weight[k] * value[k] * ray.weight * (double)near->lights[l].intensity[k];
    }
}

/** Of n rays from one surface each tries its own share of the lights where it arrives. */
static void set_lights(struct branch *b, int i, int n)
{
    if (n == 1)
        return;
    b->first = i;
    b->stride = n;
}

/** Adds n directions of a ggx surface and leaves its base's albedo. */
static void split_ggx(struct tree *tree, struct sample *s, const struct branch *from, int n)
{
    struct ggx ggx;
    gn_ggx_init(&s->surface, s->seen_dir, &ggx);
    n = ggx.alpha > 0 ? n : 1;
    for (int i = 0; i < n; i++) {
        struct branch b = {.depth = from->depth + 1, .first = from->first, .stride = from->stride};
        double u[2];
        double weight[3];
        double pdf;
        get_point(tree, from, i, n, u);
        if (!gn_ggx_sample(&ggx, u, b.dir, weight, &pdf) ||
            !(dot3(b.dir, s->surface.normal_horizon) > 0))
            continue;
        memcpy(b.point, s->surface.point, sizeof(b.point));
        memcpy(b.org, s->org, sizeof(b.org));
        b.solid_angle = fmax(from->solid_angle, 1 / (n * pdf));
        set_lights(&b, i, n);
        for (int k = 0; k < 3; k++)
            b.weight[k] = from->weight[k] * weight[k] / n;
        push(tree, &b);
    }
    if (ggx.alpha > 0)
        add_lamps(tree, &ggx, s, from->weight);
    for (int k = 0; k < 3; k++)
        s->surface.albedo[k] = (float)ggx.base[k];
}

static void push_glass(struct tree *tree, const struct sample *s, const struct branch *from,
                       const struct glass_ray *ray, bool is_through, double spread, int i, int n)
{
    struct branch b = {.depth = from->depth + 1, .first = from->first, .stride = from->stride};
    set_lights(&b, i, n);
    memcpy(b.point, s->surface.point, sizeof(b.point));
    memcpy(b.dir, ray->dir, sizeof(b.dir));
    memcpy(b.org, s->org, sizeof(b.org));
    if (is_through)
        gn_surface_get_origin_behind(&s->surface, b.org);
    b.solid_angle = fmax(from->solid_angle, spread);
    for (int k = 0; k < 3; k++)
        b.weight[k] = from->weight[k] * ray->weight[k] / n;
    push(tree, &b);
}

static void split_glass(struct tree *tree, const struct sample *s, const struct branch *from, int n)
{
    double alpha = (double)s->surface.roughness * s->surface.roughness;
    bool is_rough = alpha >= GGX_MIN_ALPHA;
    n = is_rough ? n : 1;
    // A facet turns by about alpha, its reflection by twice that; refraction less.
    double spread = is_rough ? fmin(4 * M_PI * alpha * alpha, 2 * M_PI) / n : 0;
    for (int i = 0; i < n; i++) {
        struct glass_ray reflected;
        struct glass_ray refracted;
        double u[2];
        get_point(tree, from, i, n, u);
        gn_glass_split(&s->surface, s->seen_dir, u, &reflected, &refracted);
        push_glass(tree, s, from, &reflected, false, spread, i, n);
        push_glass(tree, s, from, &refracted, true, 0.25 * spread, i, n);
    }
}

static void split_mirror(struct tree *tree, const struct sample *s, const struct branch *from)
{
    struct branch b = *from;
    b.depth++;
    memcpy(b.point, s->surface.point, sizeof(b.point));
    memcpy(b.org, s->org, sizeof(b.org));
    gn_shade_reflect(&s->surface, b.dir);
    for (int k = 0; k < 3; k++)
        b.weight[k] *= s->surface.albedo[k];
    push(tree, &b);
}

/** Adds weight times what the diffuse (base of a) surface sends by light that reaches it. */
static void add_diffuse(struct tree *tree, struct sample *s, const struct branch *b)
{
    const struct frame *frame = tree->frame;
    double irradiance[3] = {0};
    if (!(s->surface.albedo[0] > 0 || s->surface.albedo[1] > 0 || s->surface.albedo[2] > 0))
        return;
    gn_shade_get_irradiance(frame, tree->scratch, s, GN_RT_ALL, b->first, b->stride, irradiance,
                            tree->figures);
    for (int k = 0; k < 3; k++)
        tree->radiance[k] += b->weight[k] * s->surface.albedo[k] / M_PI * irradiance[k];
}

/** Traces one ray. */
static void follow(struct tree *tree, const struct branch *b)
{
    const struct frame *frame = tree->frame;
    struct gn_rt_hit hit;
    struct sample s = {.kind = SAMPLE_VIRTUAL};
    float pinned[3];
    double sent[3];
    tree->figures->rays_mirror++;
    if (!gn_rt_intersect(frame->rt, GN_RT_ALL, b->org, b->dir, 0, INFINITY, &hit)) {
        see_map(tree, b);
        return;
    }
    float footprint = hit.distance * fmaxf((float)sqrt(b->solid_angle), frame->pixel_angle);
    gn_scene_get_surface_filtered(frame->scene, b->dir, &hit, footprint, &s.surface);
    gn_surface_get_origin(&s.surface, s.org);
    memcpy(s.seen_dir, b->dir, sizeof(s.seen_dir));
    enum gn_material_type type = s.surface.material;
    bool is_clear = type == GN_MATERIAL_MIRROR || type == GN_MATERIAL_GLASS;
    if (s.surface.role == GN_RT_REAL && !is_clear &&
        gn_blend_get_radiance_at(&frame->blend, s.surface.point, pinned)) {
        for (int k = 0; k < 3; k++)
            tree->radiance[k] += b->weight[k] * (double)pinned[k];
        return;
    }
    gn_near_get_emission(frame, &s.surface, sent);
    for (int k = 0; k < 3; k++)
        tree->radiance[k] += b->weight[k] * (sent[k] + (double)s.surface.emission[k]);
    if (type == GN_MATERIAL_MIRROR)
        split_mirror(tree, &s, b);
    else if (type == GN_MATERIAL_GLASS)
        split_glass(tree, &s, b, 1);
    else if (type == GN_MATERIAL_GGX)
        split_ggx(tree, &s, b, 1);
    gn_render_weigh_probes(frame, &s, 1);
    if (!is_clear)
        add_diffuse(tree, &s, b);
}

/** Two numbers in [0, 1) of the sample's own. */
static void get_shift(const struct sample *s, double out[static 2])
{
    uint64_t z = s->seed;
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    z ^= z >> 31;
    out[0] = (double)(z >> 32) * 0x1p-32;
    out[1] = (double)(z & 0xffffffff) * 0x1p-32;
}

static void shade_by_tree(const struct frame *frame, struct scratch *scratch, struct sample *s,
                          int n_directions, struct tile_figures *figures)
{
    struct tree tree = {.frame = frame, .scratch = scratch, .figures = figures};
    const struct branch root = {.weight = {1, 1, 1}, .stride = 1};
    double alpha = (double)s->surface.roughness * s->surface.roughness;
    get_shift(s, tree.shift);
    if (s->surface.material == GN_MATERIAL_GGX)
        split_ggx(&tree, s, &root, n_directions);
    else
        split_glass(&tree, s, &root, n_directions);
    while (tree.n_waiting > 0) {
        struct branch b = tree.waiting[--tree.n_waiting];
        follow(&tree, &b);
    }
    for (int k = 0; k < 3; k++) {
        s->radiance[k] += s->through[k] * tree.radiance[k];
        // What is rough has no edges that a grid of rays would have to find, but noise.
        s->indirect[k] += alpha >= GGX_MIN_ALPHA ? s->through[k] * tree.radiance[k] : 0;
    }
}

static void shade_by_walks(const struct frame *frame, struct sample *s, int n_paths,
                           struct tile_figures *figures)
{
    double radiance[3];
    gn_bounce_gather_specular(frame, s, n_paths, radiance, &figures->rays_shade);
    for (int k = 0; k < 3; k++) {
        s->radiance[k] += s->through[k] * radiance[k];
        s->indirect[k] += s->through[k] * radiance[k];
    }
    if (s->surface.material != GN_MATERIAL_GGX)
        return;
    struct ggx ggx;
    gn_ggx_init(&s->surface, s->seen_dir, &ggx);
    for (int k = 0; k < 3; k++)
        s->surface.albedo[k] = (float)ggx.base[k];
}

void gn_specular_shade(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                       struct tile_figures *figures)
{
    // A grid's rays share the pixel's directions.
    int all = frame->options.paths_per_pixel;
    int n_directions = (DIRECTIONS * n_paths + all - 1) / all;
    for (int i = 0; i < n && !is_cancelled(frame); i++) {
        struct sample *s = &scratch->samples[i];
        if (s->kind != SAMPLE_VIRTUAL || !s->is_lit)
            continue;
        for (int k = 0; k < 3; k++)
            s->radiance[k] += (double)s->through[k] * s->surface.emission[k];
        if (s->surface.material != GN_MATERIAL_GGX && s->surface.material != GN_MATERIAL_GLASS)
            continue;
        figures->n_glossy++;
        if (frame->options.quality == GN_QUALITY_REFERENCE || frame->pass)
            shade_by_walks(frame, s, n_paths, figures);
        else
            shade_by_tree(frame, scratch, s, n_directions, figures);
        const float *base = s->surface.albedo;
        s->is_lit =
            s->surface.material == GN_MATERIAL_GGX && (base[0] > 0 || base[1] > 0 || base[2] > 0);
        figures->n_lit -= !s->is_lit;
        if (!s->is_lit)
            gn_near_add_emission(frame, s); // else shading does
    }
}
