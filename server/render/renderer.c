/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The assembly: one frame in tiles on the pool. Two rounds with a wait between them: all centres,
 * then the pixels whose neighbourhood asks for more.
 */
#include "server/render/internal.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"

#define DEFAULT_PATHS 256
#define MAX_PATHS 65536
#define MAX_BOUNCES 16

struct gn_renderer {
    const struct gn_scene *scene; // borrowed
    struct gn_pool *pool;         // borrowed, may be NULL
    int n_workers;
    struct scratch *scratches; // [n_workers], owned
    struct light_list lights;
    struct near_store near;
    struct places places;
    size_t n_pixels; // capacity of what follows
    float *rays;     // [h][w][3], owned
    struct feature *features;
    struct tile_figures *figures;
    struct gn_camera rays_camera; // whose rays these are; width 0: none yet
    double slopes[4];
    struct box blockers[MAX_BLOCKERS], wide_blockers[MAX_BLOCKERS]; // [n_blockers]
    int n_blockers;
    struct clusters clusters[2]; // real, virtual
};

int gn_renderer_create(const struct gn_scene *scene, struct gn_pool *pool,
                       struct gn_renderer **out_renderer, struct gn_error *out_error)
{
    *out_renderer = NULL;
    struct gn_renderer *renderer = calloc(1, sizeof(*renderer));
    if (!renderer)
        return gn_error_set(out_error, -ENOMEM, "renderer: out of memory");
    renderer->scene = scene;
    renderer->pool = pool;
    renderer->n_workers = pool ? gn_pool_get_size(pool) : 1;
    // Packets want the alignment of their type.
    size_t bytes = (size_t)renderer->n_workers * sizeof(*renderer->scratches);
    renderer->scratches = aligned_alloc(_Alignof(struct scratch), bytes);
    if (!renderer->scratches) {
        gn_renderer_destroy(&renderer);
        return gn_error_set(out_error, -ENOMEM, "renderer: no memory for %d workers",
                            pool ? gn_pool_get_size(pool) : 1);
    }
    memset(renderer->scratches, 0, bytes);
    renderer->n_blockers = gn_blockers_make(scene, renderer->blockers);
    for (int i = 0; i < 2; i++) {
        static const enum gn_rt_set roles[2] = {GN_RT_REAL, GN_RT_VIRTUAL};
        if (gn_clusters_make(scene, roles[i], &renderer->clusters[i]) < 0) {
            gn_renderer_destroy(&renderer);
            return gn_error_set(out_error, -ENOMEM, "renderer: no memory for the scene's boxes");
        }
    }
    *out_renderer = renderer;
    return 0;
}

void gn_renderer_destroy(struct gn_renderer **renderer)
{
    struct gn_renderer *self = *renderer;
    *renderer = NULL;
    if (!self)
        return;
    for (int i = 0; i < self->n_workers && self->scratches; i++) {
        free(self->scratches[i].cut_texels);
        free(self->scratches[i].cut_places);
    }
    free(self->scratches);
    for (int i = 0; i < 2; i++)
        gn_clusters_finish(&self->clusters[i]);
    gn_render_lights_finish(&self->lights);
    gn_near_store_finish(&self->near);
    gn_places_finish(&self->places);
    free(self->rays);
    free(self->features);
    free(self->figures);
    free(self);
}

static int count_tiles(int side)
{
    return (side + TILE - 1) / TILE;
}

/** Memory for a picture of this size; none is taken while the size stays. */
static int reserve_pixels(struct gn_renderer *renderer, int width, int height)
{
    size_t n = (size_t)width * (size_t)height;
    size_t n_tiles = (size_t)count_tiles(width) * (size_t)count_tiles(height);
    if (renderer->rays_camera.width == width && renderer->rays_camera.height == height)
        return 0;
    renderer->rays_camera.width = 0;
    free(renderer->rays);
    free(renderer->features);
    free(renderer->figures);
    renderer->rays = malloc(3 * n * sizeof(*renderer->rays));
    renderer->features = calloc(n, sizeof(*renderer->features));
    renderer->figures = calloc(n_tiles, sizeof(*renderer->figures));
    return renderer->rays && renderer->features && renderer->figures ? 0 : -ENOMEM;
}

/** The table of rays depends on the intrinsics only. */
static void update_rays(struct gn_renderer *renderer, const struct gn_camera *camera)
{
    const struct gn_camera *old = &renderer->rays_camera;
    if (old->width == camera->width && old->height == camera->height && old->fx == camera->fx &&
        old->fy == camera->fy && old->cx == camera->cx && old->cy == camera->cy &&
        memcmp(old->distortion, camera->distortion, sizeof(old->distortion)) == 0)
        return;
    gn_primary_make_rays(camera, renderer->pool, renderer->rays, renderer->slopes);
    renderer->rays_camera = *camera;
}

static int reserve_texels(struct gn_renderer *renderer)
{
    int n_blocks = renderer->lights.n / LANES;
    for (int i = 0; i < renderer->n_workers; i++) {
        struct scratch *scratch = &renderer->scratches[i];
        if (scratch->n_texel_blocks >= n_blocks)
            continue;
        free(scratch->cut_texels);
        scratch->n_texel_blocks = 0;
        scratch->cut_texels = malloc(2 * (size_t)n_blocks * sizeof(*scratch->cut_texels));
        if (!scratch->cut_texels)
            return -ENOMEM;
        scratch->hidden_texels = scratch->cut_texels + n_blocks;
        scratch->n_texel_blocks = n_blocks;
    }
    return 0;
}

/** Why these states cannot light a frame, or NULL. */
static const char *check_light(const struct gn_scene *scene, const struct gn_blend *blend,
                               const struct gn_render_options *options)
{
    struct gn_render_needs needs;
    gn_render_get_needs(scene, options, &needs);
    for (int i = 0; i < blend->n && options->quality != GN_QUALITY_REFERENCE; i++) {
        if (blend->state[i]->n_lights > GN_LIGHTS_MAX)
            return "render: a lighting state has more lights than are used";
        if (!needs.why_no_sh && !blend->state[i]->has_sh)
            return "render: irradiance shading needs the SH irradiance, which this lighting state "
                   "leaves out";
    }
    return NULL;
}

static int reserve_places(struct gn_renderer *renderer)
{
    int n = renderer->places.n;
    for (int i = 0; i < renderer->n_workers; i++) {
        struct scratch *scratch = &renderer->scratches[i];
        if (scratch->n_places >= n)
            continue;
        free(scratch->cut_places);
        scratch->n_places = 0;
        scratch->cut_places = malloc(2 * (size_t)n);
        if (!scratch->cut_places)
            return -ENOMEM;
        scratch->hidden_places = scratch->cut_places + n;
        scratch->n_places = n;
    }
    return 0;
}

static int check_request(const struct gn_scene *scene, const struct gn_camera *camera,
                         const struct gn_blend *blend, const struct gn_render_options *options,
                         struct gn_error *out_error)
{
    const char *reason = NULL;
    if (gn_camera_check(camera, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "camera: %s", reason);
    if (options->quality < GN_QUALITY_INTERACTIVE || options->quality > GN_QUALITY_REFERENCE)
        return gn_error_set(out_error, -EINVAL, "render: unknown quality %d", options->quality);
    if (options->shading < GN_SHADING_LIGHTS || options->shading > GN_SHADING_IRRADIANCE)
        return gn_error_set(out_error, -EINVAL, "render: unknown shading %d", options->shading);
    if (options->bounces < 0 || options->bounces > MAX_BOUNCES)
        return gn_error_set(out_error, -EINVAL, "render: %d bounces, must be 0 to %d",
                            options->bounces, MAX_BOUNCES);
    if (options->bounces > 0 && options->quality != GN_QUALITY_REFERENCE)
        return gn_error_set(out_error, -EINVAL,
                            "render: bounces are of the reference quality only; ask for 0");
    if (options->paths_per_pixel < 0 || options->paths_per_pixel > MAX_PATHS)
        return gn_error_set(out_error, -EINVAL, "render: %d paths for each pixel, must be 1 to %d",
                            options->paths_per_pixel, MAX_PATHS);
    reason = check_light(scene, blend, options);
    return reason ? gn_error_set(out_error, -EINVAL, "%s", reason) : 0;
}

static void init_sample(const struct frame *frame, struct sample *sample, int x, int y, int part)
{
    uint64_t pixel = (uint64_t)y * (uint64_t)frame->camera->width + (uint64_t)x;
    sample->seed =
        (frame->options.seed + 1) * UINT64_C(0xd1342543de82ef95) ^ (pixel << 12) ^ (uint64_t)part;
}

/** What each of the n samples sees, and its light. */
static void process_samples(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                            struct tile_figures *figures)
{
    bool is_reference = frame->options.quality == GN_QUALITY_REFERENCE;
    int64_t t0 = gn_clock_get_monotonic_ns();
    gn_primary_trace(frame, scratch->samples, n, figures);
    int64_t t1 = gn_clock_get_monotonic_ns();
    gn_shade_follow_mirrors(frame, scratch->samples, n, figures);
    gn_render_weigh_probes(frame, scratch->samples, n);
    if (is_reference)
        gn_reference_shade(frame, scratch, n, n_paths, figures);
    else
        gn_shade_samples(frame, scratch, n, figures);
    if (!is_reference && frame->near.n > 0)
        gn_near_shade(frame, scratch, n, figures);
    int64_t t2 = gn_clock_get_monotonic_ns();
    if (!frame->run_shadow) {
        for (int i = 0; i < n; i++)
            gn_shadow_clear(&scratch->samples[i]);
    } else if (is_reference) {
        gn_reference_shadow(frame, scratch, n, n_paths, figures);
    } else {
        gn_shadow_samples(frame, scratch, n, figures);
    }
    int64_t t3 = gn_clock_get_monotonic_ns();
    figures->s_primary += 1e-9 * (double)(t1 - t0);
    figures->s_shade += 1e-9 * (double)(t2 - t1);
    figures->s_shadow += 1e-9 * (double)(t3 - t2);
}

/** The paper's ratio of one half of the lights, or of both (half 2). */
static double get_factor(const struct frame *frame, const struct sample *s, int half, int k)
{
    double open = half == 2 ? s->open[0][k] + s->open[1][k] : s->open[half][k];
    double cut = half == 2 ? s->cut[0][k] + s->cut[1][k] : s->cut[half][k];
    return open > frame->floor_irradiance[k] ? 1 - cut / open : 1;
}

/** Half the difference of the halves has the variance of the whole, where lights are samples. */
static void estimate_error(const struct frame *frame, const struct sample *s,
                           struct tile_figures *figures)
{
    if (!s->is_cut)
        return;
    for (int k = 0; k < 3; k++) {
        double e = 0.5 * (get_factor(frame, s, 0, k) - get_factor(frame, s, 1, k));
        figures->error_sum += e * e;
    }
    figures->error_n += 3;
}

/** What the choice of pixels to refine looks at; without bounces, which are noisy. */
static void keep_feature(const struct frame *frame, int x, int y, const struct sample *s)
{
    struct feature *feature =
        &frame->features[(size_t)y * (size_t)frame->camera->width + (size_t)x];
    bool is_virtual = s->kind == SAMPLE_VIRTUAL;
    feature->owner = is_virtual ? s->object + 1 : 0;
    for (int k = 0; k < 3; k++)
        feature->color[k] = (float)(is_virtual  ? s->radiance[k] - s->indirect[k]
                                    : s->is_cut ? get_factor(frame, s, 2, k)
                                                : 1);
}

/** A tile's pixels, in squares of 4 x 4 so that a block of 16 receivers is compact. */
static int list_pixels(const struct frame *frame, int item, int (*out_pixels)[2])
{
    int n = 0;
    for (int i = 0; i < BATCH; i++) {
        int square = i / 16;
        int x = item % frame->tiles_x * TILE + square % 4 * 4 + i % 4;
        int y = item / frame->tiles_x * TILE + square / 4 * 4 + i % 16 / 4;
        if (x >= frame->camera->width || y >= frame->camera->height)
            continue;
        out_pixels[n][0] = x;
        out_pixels[n++][1] = y;
    }
    return n;
}

static void render_centres(void *context, int item, int worker)
{
    const struct frame *frame = context;
    struct scratch *scratch = &frame->scratches[worker];
    struct tile_figures *figures = &frame->figures[item];
    int pixels[BATCH][2];
    int n = list_pixels(frame, item, pixels);
    memset(figures, 0, sizeof(*figures));
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        int x = pixels[i][0];
        int y = pixels[i][1];
        s->group = i;
        init_sample(frame, s, x, y, 0);
        gn_primary_aim(frame,
                       frame->rays + 3 * ((size_t)y * (size_t)frame->camera->width + (size_t)x), s);
    }
    process_samples(frame, scratch, n, frame->options.paths_per_pixel, figures);
    for (int i = 0; i < n; i++) {
        const struct sample *s = &scratch->samples[i];
        int x = pixels[i][0];
        int y = pixels[i][1];
        *gn_image_at(&frame->layers->depth, x, y) = s->depth;
        gn_layers_resolve(frame, x, y, s, 1);
        keep_feature(frame, x, y, s);
        if (frame->run_shadow)
            estimate_error(frame, s, figures);
    }
}

/** Does pixels[n][2] again with the grid. */
static void refine_pixels(const struct frame *frame, struct scratch *scratch, int (*pixels)[2],
                          int n, struct tile_figures *figures)
{
    int grid = frame->rule.grid;
    int parts = grid * grid;
    for (int i = 0; i < n * parts; i++) {
        struct sample *s = &scratch->samples[i];
        int x = pixels[i / parts][0];
        int y = pixels[i / parts][1];
        int part = i % parts;
        int row = part / grid;
        double dir[3];
        s->group = i / parts;
        init_sample(frame, s, x, y, 1 + part);
        if (!gn_camera_get_ray(frame->camera, x + (part % grid + 0.5) / grid,
                               y + (row + 0.5) / grid, dir))
            dir[0] = dir[1] = dir[2] = 0;
        const float narrow[3] = {(float)dir[0], (float)dir[1], (float)dir[2]};
        gn_primary_aim(frame, narrow, s);
    }
    int n_paths = (frame->options.paths_per_pixel + parts - 1) / parts;
    process_samples(frame, scratch, n * parts, n_paths, figures);
    for (int i = 0; i < n; i++)
        gn_layers_resolve(frame, pixels[i][0], pixels[i][1], scratch->samples + i * parts, parts);
    figures->n_refined_pixels += n;
}

static void count_pixel(const struct frame *frame, int x, int y, struct tile_figures *figures)
{
    const float *shadow = gn_image_at(&frame->layers->shadow, x, y);
    figures->n_virtual_pixels += gn_image_at(&frame->layers->virtual_rgba, x, y)[3] > 0;
    figures->n_shadow_pixels += shadow[0] < 1 || shadow[1] < 1 || shadow[2] < 1;
}

static void render_edges(void *context, int item, int worker)
{
    const struct frame *frame = context;
    struct scratch *scratch = &frame->scratches[worker];
    struct tile_figures *figures = &frame->figures[item];
    int parts = frame->rule.grid * frame->rule.grid;
    int pixels[BATCH][2];
    int edges[BATCH][2];
    int n_edges = 0;
    int n = list_pixels(frame, item, pixels);
    for (int i = 0; i < n; i++) {
        if (!gn_refine_is_needed(frame, pixels[i][0], pixels[i][1]))
            continue;
        memcpy(edges[n_edges++], pixels[i], sizeof(edges[0]));
        if ((n_edges + 1) * parts > BATCH) {
            refine_pixels(frame, scratch, edges, n_edges, figures);
            n_edges = 0;
        }
    }
    if (n_edges > 0)
        refine_pixels(frame, scratch, edges, n_edges, figures);
    for (int i = 0; i < n; i++)
        count_pixel(frame, pixels[i][0], pixels[i][1], figures);
}

static void widen_box(struct box *box, float by)
{
    for (int k = 0; k < 3; k++) {
        box->min[k] -= by;
        box->max[k] += by;
    }
}

/** Boxes for tests of rays are widened by far more than single-precision slabs can be off. */
static void init_boxes(struct frame *frame, struct gn_renderer *renderer)
{
    float largest = 0;
    frame->has_real =
        gn_rt_get_bounds(frame->rt, GN_RT_REAL, frame->real_box.min, frame->real_box.max);
    frame->has_virtual =
        gn_rt_get_bounds(frame->rt, GN_RT_VIRTUAL, frame->virtual_box.min, frame->virtual_box.max);
    for (int k = 0; k < 3; k++) {
        if (frame->has_real)
            largest =
                fmaxf(largest, fmaxf(fabsf(frame->real_box.min[k]), fabsf(frame->real_box.max[k])));
        if (frame->has_virtual)
            largest = fmaxf(
                largest, fmaxf(fabsf(frame->virtual_box.min[k]), fabsf(frame->virtual_box.max[k])));
    }
    frame->margin = 1e-5f * largest;
    frame->clusters = renderer->clusters;
    widen_box(&frame->virtual_box, frame->margin);
    for (int i = 0; i < renderer->n_blockers; i++) {
        renderer->wide_blockers[i] = renderer->blockers[i];
        widen_box(&renderer->wide_blockers[i], frame->margin);
    }
    frame->blockers = renderer->blockers;
    frame->wide_blockers = renderer->wide_blockers;
    frame->n_blockers = renderer->n_blockers;
}

static void init_light(struct frame *frame)
{
    double largest = 0;
    for (int k = 0; k < 3; k++) {
        frame->floor_irradiance[k] = 1e-6 * frame->lights->total[k];
        largest = fmax(largest, frame->lights->total[k]);
    }
    frame->floor_radiance = (float)(0.05 * largest / M_PI);
}

static void init_frame(struct frame *frame, struct gn_renderer *renderer)
{
    double m[16];
    gn_pose_to_matrix(&frame->camera->world_from_camera, m);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            frame->world_from_camera[3 * i + k] = m[4 * i + k];
        frame->origin[i] = (float)m[4 * i + 3];
    }
    frame->scene = renderer->scene;
    frame->rt = renderer->scene->rt;
    frame->rays = renderer->rays;
    frame->lights = &renderer->lights;
    frame->places = &renderer->places;
    frame->features = renderer->features;
    frame->figures = renderer->figures;
    frame->scratches = renderer->scratches;
    frame->tiles_x = count_tiles(frame->camera->width);
    frame->tiles_y = count_tiles(frame->camera->height);
    frame->rule = gn_refine_rules[frame->options.quality];
    if (frame->options.single_ray)
        frame->rule.grid = 1;
    if (frame->options.quality == GN_QUALITY_SEED)
        frame->options.shadow_unweighted = frame->options.shadow_ignore_real = true;
    if (frame->options.paths_per_pixel == 0)
        frame->options.paths_per_pixel = DEFAULT_PATHS;
    init_boxes(frame, renderer);
    init_light(frame);
}

static void sum_figures(const struct frame *frame, struct tile_figures *sum)
{
    memset(sum, 0, sizeof(*sum));
    for (int i = 0; i < frame->tiles_x * frame->tiles_y; i++) {
        const struct tile_figures *f = &frame->figures[i];
        sum->s_primary += f->s_primary;
        sum->s_shade += f->s_shade;
        sum->s_shadow += f->s_shadow;
        sum->rays_primary += f->rays_primary;
        sum->rays_mirror += f->rays_mirror;
        sum->rays_shade += f->rays_shade;
        sum->rays_shadow += f->rays_shadow;
        sum->n_mirrors += f->n_mirrors;
        sum->n_near += f->n_near;
        sum->n_lit += f->n_lit;
        sum->n_receivers += f->n_receivers;
        sum->n_rays_real += f->n_rays_real;
        sum->error_sum += f->error_sum;
        sum->error_n += f->error_n;
        sum->n_virtual_pixels += f->n_virtual_pixels;
        sum->n_shadow_pixels += f->n_shadow_pixels;
        sum->n_refined_pixels += f->n_refined_pixels;
    }
}

static void fill_report(const struct frame *frame, int n_workers, struct gn_render_report *report)
{
    struct tile_figures sum;
    sum_figures(frame, &sum);
    gn_plan_finish(frame, &sum, report);
    report->ms_primary = 1e3 * sum.s_primary / n_workers;
    report->ms_shade = 1e3 * sum.s_shade / n_workers;
    report->ms_shadow = 1e3 * sum.s_shadow / n_workers;
    report->rays_primary = sum.rays_primary;
    report->rays_mirror = sum.rays_mirror;
    report->rays_shade = sum.rays_shade;
    report->rays_shadow = sum.rays_shadow;
    report->n_lights = frame->lights->n_lit + frame->places->n + frame->near.n;
    report->n_virtual_pixels = sum.n_virtual_pixels;
    report->n_shadow_pixels = sum.n_shadow_pixels;
    report->n_refined_pixels = sum.n_refined_pixels;
    // The reference's directions are cells of a map, not samples of it: halves say nothing.
    bool is_known = frame->options.quality != GN_QUALITY_REFERENCE && frame->run_shadow;
    report->estimated_error = !is_known         ? -1
                              : sum.error_n > 0 ? sqrt(sum.error_sum / (double)sum.error_n)
                                                : 0;
}

static int prepare(struct gn_renderer *renderer, const struct gn_camera *camera,
                   const struct gn_blend *blend, enum gn_quality quality, struct gn_layers *layers,
                   struct gn_error *out_error)
{
    int ret = 0;
    if (layers->width != camera->width || layers->height != camera->height) {
        gn_layers_finish(layers);
        ret = gn_layers_init(layers, camera->width, camera->height);
        if (ret < 0)
            return gn_error_set(out_error, ret, "render: no memory for layers of %d x %d",
                                camera->width, camera->height);
    }
    ret = reserve_pixels(renderer, camera->width, camera->height);
    if (ret == 0)
        ret = gn_places_reserve(&renderer->places, 0);
    if (ret == 0)
        ret = quality == GN_QUALITY_REFERENCE
                  ? gn_reference_make_lights(blend, &renderer->lights, &renderer->places)
                  : gn_render_lights_from_blend(blend, &renderer->lights, &renderer->near.placed);
    if (ret == 0 && quality == GN_QUALITY_REFERENCE)
        ret = reserve_texels(renderer);
    if (ret == 0 && quality == GN_QUALITY_REFERENCE)
        ret = reserve_places(renderer);
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    update_rays(renderer, camera);
    return 0;
}

int gn_renderer_render(struct gn_renderer *renderer, const struct gn_camera *camera,
                       const struct gn_lighting_state *light,
                       const struct gn_render_options *options, struct gn_layers *layers,
                       struct gn_render_report *out_report, struct gn_error *out_error)
{
    static const struct gn_render_options defaults = {0};
    struct gn_render_report report = {0};
    int64_t start_ns = gn_clock_get_monotonic_ns();
    if (!options)
        options = &defaults;
    struct frame frame = {.camera = camera, .options = *options, .layers = layers};
    gn_blend_init(&frame.blend, light);
    int ret = check_request(renderer->scene, camera, &frame.blend, options, out_error);
    if (ret == 0)
        ret = prepare(renderer, camera, &frame.blend, options->quality, layers, out_error);
    if (ret < 0)
        return ret;

    bool is_reference = options->quality == GN_QUALITY_REFERENCE;
    ret = gn_near_prepare(&renderer->near, renderer->scene, light, is_reference, &frame.near);
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    init_frame(&frame, renderer);
    gn_plan_make(&frame, renderer->slopes, &report);
    report.ms_plan = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);

    int n_tiles = frame.tiles_x * frame.tiles_y;
    gn_pool_run(renderer->pool, n_tiles, render_centres, &frame);
    gn_pool_run(renderer->pool, n_tiles, render_edges, &frame);
    fill_report(&frame, renderer->n_workers, &report);
    report.ms_total = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
    *out_report = report;
    return 0;
}
