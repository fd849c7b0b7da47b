/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/performance/naive.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/** Receivers that a worker does at a time: their sums stay in the first cache. */
#define CHUNK 256

/** Sums of one receiver. */
struct sums {
    float open[3], cut[3];
};

struct gn_naive_scratch {
    uint64_t n_rays;
    struct sums sums[CHUNK];
    bool is_cut[CHUNK];
    uint8_t hits[GN_LIGHTS_MAX * CHUNK]; // by light, then receiver; or one receiver's, by light
};

static inline float dot(const float a[static 3], const float b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** Weight of the light there; 0: it is below the horizon. */
static inline float weigh(const struct gn_naive *naive, const struct gn_naive_receiver *r,
                          const struct gn_naive_light *light)
{
    float c = dot(r->shading, light->dir);
    if (!(c > 0) || !(dot(r->geometric, light->dir) > 0))
        return 0;
    return naive->is_unweighted ? 1 : c;
}

static inline bool trace(const struct gn_naive *naive, enum gn_rt_set set,
                         const struct gn_naive_receiver *r, const struct gn_naive_light *light,
                         uint64_t *n_rays)
{
    ++*n_rays;
    return gn_rt_is_occluded(naive->rt, set, r->org, light->dir, 0, INFINITY);
}

static inline void add(float sum[static 3], const struct gn_naive_light *light, float weight)
{
    for (int k = 0; k < 3; k++)
        sum[k] += weight * light->irradiance[k];
}

static void write_factor(const struct gn_naive *naive, const struct gn_naive_receiver *r,
                         const struct sums *s)
{
    float *out = naive->shadow + 3 * (size_t)r->pixel;
    for (int k = 0; k < 3; k++)
        out[k] = s->open[k] > naive->floor[k] ? fmaxf(1 - s->cut[k] / s->open[k], 0) : 1;
}

/** One light at one receiver, one real ray or none, one virtual ray or none. */
static inline void add_light(const struct gn_naive *naive, const struct gn_naive_receiver *r,
                             const struct gn_naive_light *light, struct sums *s, uint64_t *n_rays)
{
    float w = weigh(naive, r, light);
    if (!(w > 0))
        return;
    if (naive->real == GN_NAIVE_REAL_FIRST && trace(naive, GN_RT_REAL, r, light, n_rays))
        return;
    add(s->open, light, w);
    if (trace(naive, GN_RT_VIRTUAL, r, light, n_rays))
        add(s->cut, light, w);
}

static void run_pixels_outer(const struct gn_naive *naive, struct gn_naive_scratch *scratch,
                             const struct gn_naive_receiver *receivers, int n)
{
    uint64_t n_rays = 0;
    for (int i = 0; i < n; i++) {
        struct sums s = {{0}, {0}};
        for (int l = 0; l < naive->n_lights; l++)
            add_light(naive, &receivers[i], &naive->lights[l], &s, &n_rays);
        write_factor(naive, &receivers[i], &s);
    }
    scratch->n_rays += n_rays;
}

static void run_lights_outer(const struct gn_naive *naive, struct gn_naive_scratch *scratch,
                             const struct gn_naive_receiver *receivers, int n)
{
    uint64_t n_rays = 0;
    memset(scratch->sums, 0, (size_t)n * sizeof(scratch->sums[0]));
    for (int l = 0; l < naive->n_lights; l++) {
        for (int i = 0; i < n; i++)
            add_light(naive, &receivers[i], &naive->lights[l], &scratch->sums[i], &n_rays);
    }
    for (int i = 0; i < n; i++)
        write_factor(naive, &receivers[i], &scratch->sums[i]);
    scratch->n_rays += n_rays;
}

/** Virtual objects first; hits is [light]. */
static void run_pixels_outer_where_cut(const struct gn_naive *naive,
                                       struct gn_naive_scratch *scratch,
                                       const struct gn_naive_receiver *receivers, int n)
{
    uint64_t n_rays = 0;
    for (int i = 0; i < n; i++) {
        const struct gn_naive_receiver *r = &receivers[i];
        struct sums s = {{0}, {0}};
        bool is_cut = false;
        for (int l = 0; l < naive->n_lights; l++) {
            const struct gn_naive_light *light = &naive->lights[l];
            bool hit = weigh(naive, r, light) > 0 && trace(naive, GN_RT_VIRTUAL, r, light, &n_rays);
            scratch->hits[l] = hit;
            is_cut |= hit;
        }
        if (!is_cut)
            continue;
        for (int l = 0; l < naive->n_lights; l++) {
            const struct gn_naive_light *light = &naive->lights[l];
            float w = weigh(naive, r, light);
            if (!(w > 0) || trace(naive, GN_RT_REAL, r, light, &n_rays))
                continue;
            add(s.open, light, w);
            if (scratch->hits[l])
                add(s.cut, light, w);
        }
        write_factor(naive, r, &s);
    }
    scratch->n_rays += n_rays;
}

/** The same, light by light; hits is [light][receiver]. */
static void run_lights_outer_where_cut(const struct gn_naive *naive,
                                       struct gn_naive_scratch *scratch,
                                       const struct gn_naive_receiver *receivers, int n)
{
    uint64_t n_rays = 0;
    memset(scratch->is_cut, 0, sizeof(scratch->is_cut));
    memset(scratch->sums, 0, (size_t)n * sizeof(scratch->sums[0]));
    for (int l = 0; l < naive->n_lights; l++) {
        const struct gn_naive_light *light = &naive->lights[l];
        for (int i = 0; i < n; i++) {
            bool hit = weigh(naive, &receivers[i], light) > 0 &&
                       trace(naive, GN_RT_VIRTUAL, &receivers[i], light, &n_rays);
            scratch->hits[l * CHUNK + i] = hit;
            scratch->is_cut[i] |= hit;
        }
    }
    for (int l = 0; l < naive->n_lights; l++) {
        const struct gn_naive_light *light = &naive->lights[l];
        for (int i = 0; i < n; i++) {
            const struct gn_naive_receiver *r = &receivers[i];
            if (!scratch->is_cut[i])
                continue;
            float w = weigh(naive, r, light);
            if (!(w > 0) || trace(naive, GN_RT_REAL, r, light, &n_rays))
                continue;
            add(scratch->sums[i].open, light, w);
            if (scratch->hits[l * CHUNK + i])
                add(scratch->sums[i].cut, light, w);
        }
    }
    for (int i = 0; i < n; i++) {
        if (scratch->is_cut[i])
            write_factor(naive, &receivers[i], &scratch->sums[i]);
    }
    scratch->n_rays += n_rays;
}

static void run_chunk(void *context, int item, int worker)
{
    const struct gn_naive *naive = context;
    struct gn_naive_scratch *scratch = &naive->scratches[worker];
    int first = item * CHUNK;
    int n = naive->n_receivers - first < CHUNK ? naive->n_receivers - first : CHUNK;
    const struct gn_naive_receiver *receivers = naive->receivers + first;
    bool is_by_pixel = naive->order == GN_NAIVE_PIXELS_OUTER;
    if (naive->real == GN_NAIVE_REAL_WHERE_CUT)
        (is_by_pixel ? run_pixels_outer_where_cut : run_lights_outer_where_cut)(naive, scratch,
                                                                                receivers, n);
    else
        (is_by_pixel ? run_pixels_outer : run_lights_outer)(naive, scratch, receivers, n);
}

void gn_naive_run(struct gn_naive *naive, float *shadow)
{
    int n_workers = naive->pool ? gn_pool_get_size(naive->pool) : 1;
    naive->shadow = shadow;
    for (int i = 0; i < n_workers; i++)
        naive->scratches[i].n_rays = 0;
    gn_pool_run(naive->pool, (naive->n_receivers + CHUNK - 1) / CHUNK, run_chunk, naive);
    naive->n_rays = 0;
    for (int i = 0; i < n_workers; i++)
        naive->n_rays += naive->scratches[i].n_rays;
}

/** What the centre of pixel (x, y) sees, as the renderer finds it. */
static bool find_receiver(const struct gn_scene *scene, const struct gn_camera *camera,
                          const double m[static 16], int x, int y, struct gn_naive_receiver *out)
{
    double d[3];
    float dir[3];
    struct gn_rt_hit hit;
    struct gn_surface surface;
    if (!gn_camera_get_ray(camera, x + 0.5, y + 0.5, d))
        return false;
    const float narrow[3] = {(float)d[0], (float)d[1], (float)d[2]};
    const float org[3] = {(float)m[3], (float)m[7], (float)m[11]};
    for (int k = 0; k < 3; k++)
        dir[k] =
            (float)(m[4 * k] * narrow[0] + m[4 * k + 1] * narrow[1] + m[4 * k + 2] * narrow[2]);
    if (!gn_rt_intersect(scene->rt, GN_RT_ALL, org, dir, 0, INFINITY, &hit))
        return false;
    gn_scene_get_surface(scene, dir, &hit, &surface);
    if (surface.role != GN_RT_REAL || surface.material != GN_MATERIAL_DIFFUSE)
        return false;
    gn_rt_offset_origin(surface.point, surface.normal_geometric, surface.clearance,
                        surface.normal_geometric, out->org);
    memcpy(out->shading, surface.normal_shading, sizeof(out->shading));
    memcpy(out->geometric, surface.normal_geometric, sizeof(out->geometric));
    out->pixel = y * camera->width + x;
    return true;
}

static void find_receivers(struct gn_naive *naive, const struct gn_scene *scene,
                           const struct gn_camera *camera)
{
    double m[16];
    gn_pose_to_matrix(&camera->world_from_camera, m);
    for (int y = 0; y < camera->height; y++) {
        for (int x = 0; x < camera->width; x++) {
            if (find_receiver(scene, camera, m, x, y, &naive->receivers[naive->n_receivers]))
                naive->n_receivers++;
        }
    }
}

int gn_naive_init(struct gn_naive *naive, const struct gn_scene *scene, struct gn_pool *pool,
                  const struct gn_camera *camera, const struct gn_lighting_state *light)
{
    size_t n_pixels = (size_t)camera->width * (size_t)camera->height;
    size_t n_workers = pool ? (size_t)gn_pool_get_size(pool) : 1;
    double total[3] = {0};
    *naive = (struct gn_naive){.rt = scene->rt, .pool = pool, .n_lights = light->n_lights};
    naive->receivers = malloc(n_pixels * sizeof(*naive->receivers));
    naive->lights = malloc((size_t)light->n_lights * sizeof(*naive->lights));
    naive->scratches = malloc(n_workers * sizeof(*naive->scratches));
    if (!naive->receivers || !naive->lights || !naive->scratches) {
        gn_naive_finish(naive);
        return -ENOMEM;
    }
    for (int i = 0; i < light->n_lights; i++) {
        memcpy(naive->lights[i].dir, light->lights[i].dir_world, sizeof(naive->lights[i].dir));
        for (int k = 0; k < 3; k++) {
            naive->lights[i].irradiance[k] = light->lights[i].irradiance[k];
            total[k] += light->lights[i].irradiance[k];
        }
    }
    for (int k = 0; k < 3; k++)
        naive->floor[k] = (float)(1e-6 * total[k]);
    find_receivers(naive, scene, camera);
    return 0;
}

void gn_naive_finish(struct gn_naive *naive)
{
    free(naive->receivers);
    free(naive->lights);
    free(naive->scratches);
    *naive = (struct gn_naive){0};
}
