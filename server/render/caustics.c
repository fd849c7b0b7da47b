/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Caustics, for the reference: light of the map and of lamps that virtual mirrors and glass throw
 * onto real diffuse surfaces. Photons are aimed at the balls about these objects, followed through
 * mirrors and glass until they arrive at a diffuse surface, and what it sends of each to the camera
 * is added to the pixel that sees it (Arvo, "Backward Ray Tracing", 1986; Dutre, Lafortune and
 * Willems, "Monte Carlo Light Tracing with Direct Computation of Pixel Intensities", 1993):
 *   added += flux albedo / pi cos / (distance^2 solid angle of the pixel),
 * which has no kernel and is right on the mean at any number of photons. Just these paths, whose
 * first surface is a virtual mirror or glass and all others but the last are clear, are left out
 * of the random walks (bounce.c), which would find them by luck. What walks run into stays theirs:
 * light of emissive meshes, and in the global model of modelled surfaces; by way of ggx surfaces;
 * onto virtual surfaces; and what a real mirror shows of a caustic.
 */
#include "server/render/caustics.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/glass.h"
#include "server/render/random.h"

/** Photons of a chunk, which one worker follows; chunks whose splats wait to be added. */
#define CHUNK 4096
#define ROUND 64
/** As a walk's. */
#define MAX_VERTICES 64

/** What a photon brings to a pixel. */
struct splat {
    uint32_t pixel;
    float radiance[3];
};

static bool is_clear(const struct gn_surface *surface)
{
    return (CLEAR_MATERIALS >> surface->material & 1) != 0;
}

static double dot_double(const float a[static 3], const float b[static 3])
{
    return (double)a[0] * b[0] + (double)a[1] * b[1] + (double)a[2] * b[2];
}

/** A surface whose normals stand for a smooth one sends on what arrives on that, not on its facet:
 * the ratio of the cosines (Veach, "Non-symmetric Scattering in Light Transport Algorithms", EGSR
 * 1996). */
static double get_share(const struct gn_surface *surface, const float dir[static 3])
{
    double facet = fabs(dot_double(surface->normal_geometric, dir));
    return facet > 0 ? fabs(dot_double(surface->normal_shading, dir)) / facet : 0;
}

/** On from a clear surface. False where the photon ends. */
static bool leave_clear(struct photon *photon, uint64_t *random)
{
    const struct gn_surface *surface = &photon->surface;
    double share = get_share(surface, photon->dir);
    gn_surface_get_origin(surface, photon->org);
    if (surface->material == GN_MATERIAL_MIRROR) {
        gn_shade_reflect(surface, photon->dir);
        for (int k = 0; k < 3; k++)
            photon->flux[k] *= (double)surface->albedo[k];
    } else {
        struct glass_ray ways[2];
        const double u[2] = {random_unit(random), random_unit(random)};
        gn_glass_split(surface, photon->dir, u, &ways[0], &ways[1]);
        double reflected = ways[0].weight[0] + ways[0].weight[1] + ways[0].weight[2];
        double sum = reflected + ways[1].weight[0] + ways[1].weight[1] + ways[1].weight[2];
        if (!(sum > 0))
            return false;
        int way = random_unit(random) * sum >= reflected;
        for (int k = 0; k < 3; k++) {
            photon->flux[k] *= ways[way].weight[k] * sum / (way ? sum - reflected : reflected);
            photon->dir[k] = ways[way].dir[k];
        }
        if (way)
            gn_surface_get_origin_behind(surface, photon->org);
    }
    double left = get_share(surface, photon->dir);
    for (int k = 0; k < 3; k++)
        photon->flux[k] *= left > 0 ? share / left : 0;
    return true;
}

/** Picture solid angle of a pixel's area about (x, y), sr. 0: not known. */
static double get_pixel_angle(const struct gn_camera *camera, double x, double y)
{
    double d[4][3];
    double a[3];
    double b[3];
    if (!gn_camera_get_ray(camera, x - 0.5, y, d[0]) ||
        !gn_camera_get_ray(camera, x + 0.5, y, d[1]) ||
        !gn_camera_get_ray(camera, x, y - 0.5, d[2]) ||
        !gn_camera_get_ray(camera, x, y + 0.5, d[3]))
        return 0;
    for (int k = 0; k < 3; k++) {
        a[k] = d[1][k] - d[0][k];
        b[k] = d[3][k] - d[2][k];
    }
    const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    return sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
}

/** What the diffuse surface where the photon has arrived sends of it to the camera. False: the
 * camera does not see it. */
static bool make_splat(const struct photon_job *job, const struct photon *photon, struct splat *out)
{
    const struct frame *frame = job->frame;
    const struct gn_surface *surface = &photon->surface;
    double share = get_share(surface, photon->dir);
    double to[3];
    double p[3] = {0};
    double xy[2];
    double distance2 = 0;
    float org[3];
    gn_surface_get_origin(surface, org);
    for (int k = 0; k < 3; k++) {
        to[k] = (double)frame->origin[k] - org[k];
        distance2 += to[k] * to[k];
    }
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            p[k] -= frame->world_from_camera[3 * i + k] * to[i];
    double distance = sqrt(distance2);
    if (!(distance > 0) || !gn_camera_project(frame->camera, p, xy) || !(xy[0] >= 0) ||
        !(xy[1] >= 0) || !(xy[0] < frame->camera->width) || !(xy[1] < frame->camera->height))
        return false;
    const float dir[3] = {(float)(to[0] / distance), (float)(to[1] / distance),
                          (float)(to[2] / distance)};
    double cosine = dot_double(surface->normal_geometric, dir);
    double angle = get_pixel_angle(frame->camera, xy[0], xy[1]);
    if (!(cosine > 0) || !(angle > 0) ||
        gn_rt_is_occluded(frame->rt, frame->seen, org, dir, 0, (float)distance))
        return false;
    out->pixel = (uint32_t)xy[1] * (uint32_t)frame->camera->width + (uint32_t)xy[0];
    for (int k = 0; k < 3; k++)
        out->radiance[k] = (float)(photon->flux[k] * share * (double)surface->albedo[k] / M_PI *
                                   cosine / (distance2 * angle) / (double)job->n);
    return true;
}

/** Does the photon meet the next surface? Fills it. */
static bool step(const struct frame *frame, struct photon *photon, uint64_t *rays)
{
    struct gn_rt_hit hit;
    ++*rays;
    if (!gn_rt_intersect(frame->rt, GN_RT_ALL, photon->org, photon->dir, 0, INFINITY, &hit))
        return false;
    gn_scene_get_surface(frame->scene, photon->dir, &hit, &photon->surface);
    return true;
}

/** Follows photon i. True where it brings something to a pixel. */
static bool follow_photon(const struct photon_job *job, uint64_t i, struct splat *out,
                          uint64_t *rays)
{
    const struct frame *frame = job->frame;
    struct photon photon;
    uint32_t object;
    int light;
    uint64_t random = (frame->options.seed + 1) * UINT64_C(0xd1342543de82ef95) ^ (i << 20);
    if (!gn_photons_send(job, i, &photon, &object, &light, rays) || !step(frame, &photon, rays) ||
        photon.surface.object != object || !is_clear(&photon.surface))
        return false;
    if (light >= 0 && frame->blend.n > 1) { // its probe counts as much as it does there
        double weights[GN_PROBES_MAX];
        gn_blend_get_weights(&frame->blend, photon.surface.point, weights);
        for (int k = 0; k < 3; k++)
            photon.flux[k] *= weights[get_probe(frame->lights, light)];
    }
    for (int vertex = 1; vertex < MAX_VERTICES; vertex++) {
        const struct gn_surface *surface = &photon.surface;
        float pinned[3];
        if (!leave_clear(&photon, &random) || !step(frame, &photon, rays))
            return false;
        if (!is_clear(surface)) // what shows things is no receiver: its base is left to walks
            return surface->role == GN_RT_REAL &&
                   !(frame->run_optics && gn_optics_is_shown_by(surface)) &&
                   make_splat(job, &photon, out);
        if (surface->role == GN_RT_REAL && frame->places->n > 0 &&
            gn_blend_get_radiance_at(&frame->blend, surface->point, pinned))
            return false; // a walk ends here, so it has not left the rest to us
    }
    return false;
}

static void follow_chunk(void *context, int item, int worker)
{
    const struct photon_job *job = context;
    const struct caustics *c = job->caustics;
    uint64_t first = (job->first_chunk + (uint64_t)item) * CHUNK;
    struct splat *splats = c->splats + (size_t)item * CHUNK;
    (void)worker;
    c->counts[item] = 0;
    c->rays[item] = 0;
    for (uint64_t i = first; i < first + CHUNK && i < job->n; i++)
        c->counts[item] += follow_photon(job, i, &splats[c->counts[item]], &c->rays[item]);
}

/** Memory for a frame of n pixels of a scene. */
static int reserve(struct caustics *c, const struct gn_scene *scene, size_t n)
{
    if (!c->splats) {
        c->splats = malloc((size_t)ROUND * CHUNK * sizeof(*c->splats));
        c->counts = malloc(ROUND * sizeof(*c->counts));
        c->rays = malloc(ROUND * sizeof(*c->rays));
        c->targets = malloc((size_t)scene->n_objects * sizeof(*c->targets));
        if (!c->splats || !c->counts || !c->rays || !c->targets) {
            gn_caustics_finish(c);
            return -ENOMEM;
        }
    }
    if (c->n_pixels < n) {
        free(c->sums);
        c->sums = malloc(3 * n * sizeof(*c->sums));
        c->n_pixels = c->sums ? n : 0;
    }
    return c->sums ? 0 : -ENOMEM;
}

void gn_caustics_finish(struct caustics *c)
{
    free(c->splats);
    free(c->counts);
    free(c->rays);
    free(c->targets);
    free(c->sums);
    memset(c, 0, sizeof(*c));
}

/** Adds what has arrived to the layer, where it is of the part that no virtual object covers. */
static void add_to_layer(const struct frame *frame, const double *sums)
{
    size_t n = (size_t)frame->camera->width * (size_t)frame->camera->height;
    for (size_t i = 0; i < n; i++) {
        float open = 1 - frame->layers->virtual_rgba.data[4 * i + 3];
        for (size_t k = 0; k < 3 && open > 0; k++)
            frame->layers->added.data[3 * i + k] += (float)(sums[3 * i + k] / (double)open);
    }
}

int gn_caustics_add(struct caustics *c, struct frame *frame, struct gn_pool *pool)
{
    size_t n_pixels = (size_t)frame->camera->width * (size_t)frame->camera->height;
    struct photon_job job;
    if (!frame->run_caustics)
        return 0;
    int ret = reserve(c, frame->scene, n_pixels);
    if (ret < 0)
        return ret;
    gn_photons_prepare(c, frame, &job);
    memset(c->sums, 0, 3 * n_pixels * sizeof(*c->sums));
    uint64_t n_chunks = (job.n + CHUNK - 1) / CHUNK;
    for (; job.first_chunk < n_chunks; job.first_chunk += ROUND) {
        uint64_t left = n_chunks - job.first_chunk;
        int n = (int)(left < ROUND ? left : ROUND);
        gn_pool_run(pool, n, follow_chunk, &job);
        for (int i = 0; i < n; i++) { // in one order, whatever the pool's size
            frame->rays_caustics += c->rays[i];
            frame->n_photons += (uint64_t)c->counts[i];
            for (int j = 0; j < c->counts[i]; j++) {
                const struct splat *splat = &c->splats[(size_t)i * CHUNK + (size_t)j];
                for (size_t k = 0; k < 3; k++)
                    c->sums[3 * (size_t)splat->pixel + k] += (double)splat->radiance[k];
            }
        }
    }
    add_to_layer(frame, c->sums);
    return 0;
}
