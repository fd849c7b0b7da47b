/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What real mirrors and real glass show. From a sample that sees one, its light is followed back
 * through mirrors and glass to its ends, each with the share w of its radiance that arrives:
 *   a diffuse real surface, whose base, lost and gain count w times;
 *   a virtual surface: its radiance is gain; the same way goes on among the real objects alone, and
 *   what it ends at is base, all of it lost;
 *   nothing: the map's radiance is base.
 * The ends are samples too and go through the same passes as those of the camera, in a scratch of
 * their own; so what a mirror shows of a shadow is that shadow. A base is known only where
 * something is lost, or where the pixel's other samples need it to be weighed against.
 */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/ggx.h"
#include "server/render/glass.h"
#include "server/render/random.h"

/** Ends of one tree of ways, of which MAX_WAYS wait at one time; what is beyond sees the map. */
#define MAX_ENDS 32
#define MAX_WAYS 16
/** Ways that bring less of what their tree stands for see the map. */
#define MIN_WEIGHT (1.0 / 256)
/** Facets of rough glass that are tried from each sample: interactive and seed, reference. */
#define FACETS 8
#define REFERENCE_FACETS 64

/** A ray that is still to be traced. */
struct way {
    float point[3]; // of the surface that it leaves
    float org[3], dir[3];
    double weight[3];
    double length; // m, from the camera
    int depth;
    bool is_real_only; // a virtual object is in the way, and this goes on without it
};

struct end {
    int parent; // sample of the batch
    double weight[3];
    bool is_real_only;
};

struct optics {
    struct scratch scratch; // its samples are the ends
    struct end ends[BATCH];
    int n_ends;
    struct way ways[MAX_WAYS];
    int n_ways;
};

/** One sample's tree. */
struct tree {
    const struct frame *frame;
    struct optics *optics;
    struct sample *root;
    int parent, first; // the root's index; the tree's first end
    double least;      // weight of ways that are followed
    uint64_t random;
    struct tile_figures *figures;
};

static bool is_optic(const struct gn_material *material)
{
    return (CLEAR_MATERIALS >> material->type & 1) ||
           (material->type == GN_MATERIAL_GGX &&
            material->roughness * material->roughness < (float)GGX_MIN_ALPHA);
}

bool gn_optics_may_show(const struct gn_scene_object *object)
{
    bool is_any = object->has_material && is_optic(&object->material);
    // Of a mesh's own materials a picture may say how rough they are.
    for (int m = 0; !object->has_material && m < object->mesh.n_materials; m++)
        is_any |= object->mesh.materials[m].factors.type != GN_MATERIAL_DIFFUSE;
    return is_any;
}

bool gn_optics_is_needed(const struct gn_scene *scene)
{
    bool is_any = false;
    for (int i = 0; i < scene->n_objects && scene->n_virtual_triangles > 0; i++)
        is_any |= scene->objects[i].role == GN_RT_REAL && gn_optics_may_show(&scene->objects[i]);
    return is_any;
}

bool gn_optics_is_shown_by(const struct gn_surface *surface)
{
    const struct gn_material material = {.type = surface->material,
                                         .roughness = surface->roughness};
    return is_optic(&material);
}

int gn_optics_reserve(const struct gn_scene *scene, struct scratch *scratches, int n_workers)
{
    for (int i = 0; i < n_workers && gn_optics_is_needed(scene); i++) {
        scratches[i].optics = aligned_alloc(_Alignof(struct optics), sizeof(struct optics));
        if (!scratches[i].optics)
            return -ENOMEM;
        memset(scratches[i].optics, 0, sizeof(struct optics));
    }
    return 0;
}

void gn_optics_finish(struct scratch *scratch)
{
    free(scratch->optics);
    scratch->optics = NULL;
}

static bool is_rough(const struct gn_surface *surface)
{
    return surface->material == GN_MATERIAL_GLASS &&
           surface->roughness * surface->roughness >= (float)GGX_MIN_ALPHA;
}

static void see_map(struct tree *tree, const struct way *way)
{
    float radiance[3];
    gn_blend_get_radiance(&tree->frame->blend, way->point, way->dir, radiance);
    for (int k = 0; k < 3; k++) {
        double sent = way->weight[k] * (double)radiance[k];
        tree->root->base[k] += sent;
        tree->root->lost[k] += way->is_real_only ? sent : 0;
    }
}

static void push(struct tree *tree, const struct way *way)
{
    struct optics *optics = tree->optics;
    double largest = fmax(way->weight[0], fmax(way->weight[1], way->weight[2]));
    if (!(largest > 0))
        return;
    if (largest < tree->least || way->depth > MIRROR_DEPTH || optics->n_ways == MAX_WAYS)
        see_map(tree, way);
    else
        optics->ways[optics->n_ways++] = *way;
}

static void add_end(struct tree *tree, const struct gn_surface *surface, const struct way *way)
{
    struct optics *optics = tree->optics;
    int i = optics->n_ends++;
    struct sample *s = &optics->scratch.samples[i];
    bool is_virtual = surface->role == GN_RT_VIRTUAL;
    *s = (struct sample){
        .group = tree->parent,
        .seed = tree->root->seed + (uint64_t)(i - tree->first + 1) * UINT64_C(0x9e3779b97f4a7c15),
        .kind = is_virtual ? SAMPLE_VIRTUAL : SAMPLE_REAL,
        .object = surface->object,
        .surface = *surface,
        .is_receiver = !is_virtual && !way->is_real_only,
    };
    memcpy(s->dir, way->dir, sizeof(s->dir));
    memcpy(s->seen_dir, way->dir, sizeof(s->seen_dir));
    gn_surface_get_origin(surface, s->org);
    optics->ends[i] = (struct end){.parent = tree->parent, .is_real_only = way->is_real_only};
    memcpy(optics->ends[i].weight, way->weight, sizeof(way->weight));
    tree->figures->n_receivers += s->is_receiver;
}

/** On from a polished surface; its base is an end. */
static void split_ggx(struct tree *tree, const struct gn_surface *surface, const struct way *on)
{
    static const double u[2] = {0.5, 0.5};
    struct ggx ggx;
    struct way reflected = *on;
    struct gn_surface base = *surface;
    double weight[3];
    double pdf;
    gn_ggx_init(surface, on->dir, &ggx);
    for (int k = 0; k < 3; k++)
        base.albedo[k] = (float)ggx.base[k];
    if ((base.albedo[0] > 0 || base.albedo[1] > 0 || base.albedo[2] > 0) &&
        tree->optics->n_ends - tree->first < MAX_ENDS)
        add_end(tree, &base, on);
    if (!gn_ggx_sample(&ggx, u, reflected.dir, weight, &pdf) ||
        !(dot3(reflected.dir, surface->normal_horizon) > 0))
        return;
    for (int k = 0; k < 3; k++)
        reflected.weight[k] *= weight[k];
    push(tree, &reflected);
}

/** On from a clear surface that `way` has met. */
static void split(struct tree *tree, const struct gn_surface *surface, const struct way *way)
{
    struct way on = *way;
    on.depth++;
    memcpy(on.point, surface->point, sizeof(on.point));
    gn_surface_get_origin(surface, on.org);
    if (surface->material == GN_MATERIAL_MIRROR) {
        gn_shade_reflect(surface, on.dir);
        for (int k = 0; k < 3; k++)
            on.weight[k] *= (double)surface->albedo[k];
        push(tree, &on);
        return;
    }
    if (surface->material == GN_MATERIAL_GGX) {
        split_ggx(tree, surface, &on);
        return;
    }
    struct glass_ray rays[2];
    const double u[2] = {random_unit(&tree->random), random_unit(&tree->random)};
    gn_glass_split(surface, way->dir, u, &rays[0], &rays[1]);
    for (int i = 0; i < 2; i++) {
        if (i == 1)
            gn_surface_get_origin_behind(surface, on.org);
        memcpy(on.dir, rays[i].dir, sizeof(on.dir));
        for (int k = 0; k < 3; k++)
            on.weight[k] = way->weight[k] * rays[i].weight[k];
        push(tree, &on);
    }
}

static void follow(struct tree *tree, struct way *way)
{
    const struct frame *frame = tree->frame;
    struct gn_rt_hit hit;
    struct gn_surface surface;
    tree->figures->rays_mirror++;
    if (tree->optics->n_ends - tree->first == MAX_ENDS ||
        !gn_rt_intersect(frame->rt, way->is_real_only ? GN_RT_REAL : GN_RT_ALL, way->org, way->dir,
                         0, INFINITY, &hit)) {
        see_map(tree, way);
        return;
    }
    double length = way->length + (double)hit.distance;
    gn_scene_get_surface_filtered(frame->scene, way->dir, &hit, (float)length * frame->pixel_angle,
                                  &surface);
    if (surface.role == GN_RT_VIRTUAL) {
        add_end(tree, &surface, way);
        tree->root->shown = tree->root->shown ? tree->root->shown : surface.object + 1;
        way->is_real_only = true;
        push(tree, way);
    } else if (gn_optics_is_shown_by(&surface)) {
        way->length = length;
        split(tree, &surface, way);
    } else {
        add_end(tree, &surface, way);
    }
}

/** Tree `index` of n of the root. */
static void follow_all(struct tree *tree, int index, int n)
{
    struct optics *optics = tree->optics;
    struct sample *root = tree->root;
    struct way way = {.length = root->depth, .weight = {1.0 / n, 1.0 / n, 1.0 / n}};
    memcpy(way.dir, root->dir, sizeof(way.dir));
    tree->first = optics->n_ends;
    tree->random = root->seed ^ ((uint64_t)index * UINT64_C(0xd1342543de82ef95));
    split(tree, &root->surface, &way);
    while (optics->n_ways > 0) {
        way = optics->ways[--optics->n_ways];
        follow(tree, &way);
    }
}

/** In a pass of the global model: what modelled surfaces send. */
static void add_places(const struct frame *frame, struct scratch *scratch, struct sample *s,
                       uint64_t *rays)
{
    double sums[2][3] = {{0}};
    (void)gn_places_find_hidden(frame, scratch, s, GN_RT_REAL, scratch->hidden_places, rays);
    memset(scratch->cut_places, 0, (size_t)frame->places->n);
    gn_places_sum(frame, s, scratch->hidden_places, scratch->cut_places, false, sums);
    for (int k = 0; k < 3; k++)
        s->open[k] += sums[0][k];
}

/** What a receiver sends among the real objects alone. */
static void get_base(const struct frame *frame, struct scratch *scratch, struct sample *s,
                     int n_paths, struct tile_figures *figures)
{
    if (frame->options.quality == GN_QUALITY_REFERENCE) {
        gn_reference_sum_uncut(frame, scratch, s, n_paths, figures);
        return;
    }
    memset(s->cut, 0, sizeof(s->cut));
    gn_shade_get_irradiance(frame, scratch, s, GN_RT_REAL, 0, 1, s->open, figures);
    if (frame->pass && frame->places->n > 0)
        add_places(frame, scratch, s, &figures->rays_shadow);
    gn_shadow_weigh(frame, s);
}

/** Adds what is lost at a virtual surface: never nothing, so that where the model is black the
 * camera's light goes as well. */
static void lose(const struct frame *frame, const struct end *end, struct sample *s)
{
    for (int k = 0; k < 3; k++)
        s->lost[k] = s->base[k] += end->weight[k] > 0 ? frame->floor_irradiance[k] / M_PI : 0;
}

/** Lights the ends and adds them to the batch's samples. */
static void flush(const struct frame *frame, struct scratch *scratch, bool is_grid, int n_paths,
                  struct tile_figures *figures)
{
    struct optics *optics = scratch->optics;
    struct scratch *inner = &optics->scratch;
    bool is_summed[BATCH] = {false}; // by parent
    // The batch's own samples are done with these.
    inner->cut_texels = scratch->cut_texels;
    inner->hidden_texels = scratch->hidden_texels;
    inner->cut_places = scratch->cut_places;
    inner->hidden_places = scratch->hidden_places;
    inner->grid = 1;
    gn_tiles_light_samples(frame, inner, optics->n_ends, n_paths, figures);
    if (frame->run_shadow)
        gn_shadow_find_groups(frame, inner->samples, optics->n_ends, is_summed);
    for (int i = 0; i < optics->n_ends; i++) {
        const struct end *end = &optics->ends[i];
        struct sample *s = &inner->samples[i];
        struct sample *root = &scratch->samples[end->parent];
        bool is_virtual = s->kind == SAMPLE_VIRTUAL;
        bool is_known = is_summed[end->parent] && !end->is_real_only;
        bool is_needed = is_grid || root->shown != 0 || is_rough(&root->surface);
        if (!is_virtual && !is_known && is_needed)
            get_base(frame, inner, s, n_paths, figures);
        if (end->is_real_only)
            lose(frame, end, s);
        for (int k = 0; k < 3; k++) {
            double gain = is_virtual ? s->radiance[k] : end->is_real_only ? 0 : s->gain[k];
            root->gain[k] += end->weight[k] * gain;
            root->indirect[k] += is_virtual ? end->weight[k] * s->indirect[k] : 0;
            root->base[k] += is_virtual ? 0 : end->weight[k] * s->base[k];
            root->lost[k] += is_virtual ? 0 : end->weight[k] * s->lost[k];
        }
    }
    optics->n_ends = 0;
}

/** The ratio of the picture's contrast. */
static void set_ratio(struct sample *s)
{
    for (int k = 0; k < 3; k++) {
        s->open[k] = s->base[k];
        s->cut[k] = s->lost[k];
        s->is_cut |= s->lost[k] > 0;
    }
}

/** base of the other samples of a pixel that loses light in a mirror or glass. */
static void weigh_others(const struct frame *frame, struct scratch *scratch, int n,
                         const bool *is_summed, int n_paths, struct tile_figures *figures)
{
    bool is_cut[BATCH] = {false};
    for (int i = 0; i < n; i++) {
        const struct sample *s = &scratch->samples[i];
        is_cut[s->group] |=
            s->kind == SAMPLE_REAL && s->is_cut && gn_optics_is_shown_by(&s->surface);
    }
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (!is_cut[s->group] || is_summed[s->group] || s->kind == SAMPLE_VIRTUAL)
            continue;
        if (s->is_receiver)
            get_base(frame, scratch, s, n_paths, figures);
        else if (s->kind == SAMPLE_NOTHING)
            gn_shadow_see_nothing(frame, s);
    }
}

void gn_optics_samples(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                       struct tile_figures *figures)
{
    struct optics *optics = scratch->optics;
    bool is_summed[BATCH] = {false}; // by group
    // Then every base is weighed.
    bool is_grid = frame->pass || (n > 1 && scratch->samples[1].group == scratch->samples[0].group);
    uint64_t n_before = figures->n_optics;
    int n_facets = frame->options.quality == GN_QUALITY_REFERENCE ? REFERENCE_FACETS : FACETS;
    if (frame->run_shadow)
        gn_shadow_find_groups(frame, scratch->samples, n, is_summed);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (s->kind != SAMPLE_REAL || !gn_optics_is_shown_by(&s->surface))
            continue;
        int n_trees = is_rough(&s->surface) ? n_facets : 1;
        struct tree tree = {.frame = frame,
                            .optics = optics,
                            .root = s,
                            .parent = i,
                            .least = MIN_WEIGHT / n_trees,
                            .figures = figures};
        figures->n_optics++;
        gn_shadow_clear(s);
        memset(s->indirect, 0, sizeof(s->indirect));
        for (int j = 0; j < n_trees; j++) {
            if (optics->n_ends + MAX_ENDS > BATCH)
                flush(frame, scratch, is_grid, n_paths, figures);
            follow_all(&tree, j, n_trees);
        }
    }
    if (figures->n_optics == n_before)
        return;
    flush(frame, scratch, is_grid, n_paths, figures);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (s->kind == SAMPLE_REAL && gn_optics_is_shown_by(&s->surface))
            set_ratio(s);
    }
    if (is_grid)
        weigh_others(frame, scratch, n, is_summed, n_paths, figures);
}
