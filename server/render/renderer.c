/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The assembly: memory that frames share, what a request may ask for, and the frame of it. */
#include "server/render/internal.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/render/caustics.h"
#include "server/render/estimate.h"
#include "server/render/kept.h"
#include "server/render/kernels/kernels.h"
#include "server/render/pass.h"
#include "server/render/silhouette.h"

#define DEFAULT_PATHS 256
#define MAX_PATHS 65536
#define MAX_BOUNCES 16
#define MAX_GRID 4

struct gn_renderer {
    const struct gn_scene *scene; // borrowed
    const struct gn_scene *posed; // borrowed: where its movable objects stand
    uint64_t version;             // of the scene that the boxes are of
    uint64_t n_frames;
    atomic_bool is_cancelled;
    struct gn_pool *pool; // borrowed, may be NULL
    int n_workers;
    struct scratch *scratches; // [n_workers], owned
    struct light_list lights;
    struct light_merge merge;
    struct near_store near;
    struct places places;
    size_t n_pixels; // capacity of what follows
    float *rays;     // [h][w][3], owned
    struct feature *features;
    bool *plain; // [blocks], see struct frame
    struct spot *spots;
    struct tile_figures *figures;
    struct kept kept;
    struct gn_camera rays_camera; // whose rays these are; width 0: none yet
    bool has_pass_rays;           // through other points than the centres
    double slopes[4];
    struct blockers blockers;
    struct box wide_blockers[MAX_BLOCKERS];
    struct clusters clusters[2]; // real, virtual
    struct silhouettes silhouettes[2];
    struct estimate *estimate; // owned
    struct caustics caustics;
};

int gn_renderer_create(const struct gn_scene *scene, struct gn_pool *pool,
                       struct gn_renderer **out_renderer, struct gn_error *out_error)
{
    *out_renderer = NULL;
    struct gn_renderer *renderer = calloc(1, sizeof(*renderer));
    if (!renderer)
        return gn_error_set(out_error, -ENOMEM, "renderer: out of memory");
    renderer->scene = renderer->posed = scene;
    renderer->version = scene->version;
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
    if (gn_optics_reserve(scene, renderer->scratches, renderer->n_workers) < 0) {
        gn_renderer_destroy(&renderer);
        return gn_error_set(out_error, -ENOMEM, "renderer: no memory for real mirrors and glass");
    }
    renderer->estimate = aligned_alloc(_Alignof(struct estimate), sizeof(*renderer->estimate));
    if (!renderer->estimate) {
        gn_renderer_destroy(&renderer);
        return gn_error_set(out_error, -ENOMEM, "renderer: no memory for its error's estimate");
    }
    memset(renderer->estimate, 0, sizeof(*renderer->estimate));
    if (gn_blockers_make(scene, &renderer->blockers) < 0 ||
        gn_clusters_make(scene, GN_RT_REAL, &renderer->clusters[0]) < 0 ||
        gn_clusters_make(scene, GN_RT_VIRTUAL, &renderer->clusters[1]) < 0) {
        gn_renderer_destroy(&renderer);
        return gn_error_set(out_error, -ENOMEM, "renderer: no memory for the scene's boxes");
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
        gn_optics_finish(&self->scratches[i]);
    }
    free(self->scratches);
    if (self->estimate)
        gn_estimate_finish(self->estimate);
    free(self->estimate);
    for (int i = 0; i < 2; i++) {
        gn_clusters_finish(&self->clusters[i]);
        gn_silhouettes_finish(&self->silhouettes[i]);
    }
    gn_blockers_finish(&self->blockers);
    gn_render_lights_finish(&self->lights);
    gn_light_merge_finish(&self->merge);
    gn_near_store_finish(&self->near);
    gn_places_finish(&self->places);
    gn_caustics_finish(&self->caustics);
    free(self->rays);
    free(self->features);
    free(self->plain);
    free(self->spots);
    free(self->figures);
    gn_kept_finish(&self->kept);
    free(self);
}

void gn_renderer_cancel(struct gn_renderer *renderer)
{
    atomic_store_explicit(&renderer->is_cancelled, true, memory_order_relaxed);
}

void gn_renderer_set_scene(struct gn_renderer *renderer, const struct gn_scene *posed)
{
    renderer->posed = posed;
    if (posed->version == renderer->version)
        return;
    renderer->version = posed->version;
    gn_blockers_pose(&renderer->blockers, posed);
    for (int i = 0; i < 2; i++) {
        if (renderer->clusters[i].movers.n == 0)
            continue;
        gn_clusters_pose(&renderer->clusters[i], posed);
        gn_silhouettes_forget(&renderer->silhouettes[i]);
    }
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
    free(renderer->plain);
    free(renderer->spots);
    renderer->spots = NULL;
    free(renderer->figures);
    renderer->rays = malloc(3 * n * sizeof(*renderer->rays));
    renderer->features = calloc(n, sizeof(*renderer->features));
    renderer->figures = calloc(n_tiles, sizeof(*renderer->figures));
    renderer->plain = calloc(n_tiles * BLOCKS * BLOCKS, sizeof(*renderer->plain));
    if (!renderer->rays || !renderer->features || !renderer->plain || !renderer->figures)
        return -ENOMEM;
    return gn_kept_reserve(&renderer->kept, n_tiles * BLOCKS * BLOCKS);
}

/** The table of rays depends on the intrinsics only, and on the pass. The slopes' bounds hold for
 * all points of the pixels. */
static void update_rays(struct gn_renderer *renderer, const struct gn_camera *camera,
                        const struct pass *pass)
{
    bool is_same = gn_primary_has_same_rays(&renderer->rays_camera, camera);
    if (pass && is_same)
        gn_primary_make_rays(camera, pass, renderer->pool, renderer->rays, NULL);
    else if (!is_same || renderer->has_pass_rays)
        gn_primary_make_rays(camera, pass, renderer->pool, renderer->rays, renderer->slopes);
    renderer->rays_camera = *camera;
    renderer->has_pass_rays = pass != NULL;
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
    for (int i = 0; i < blend->n; i++) {
        if (!needs.why_no_pyramid && !blend->state[i]->pyramid)
            return "render: glossy materials need the map's pyramid, which this lighting state "
                   "leaves out";
    }
    for (int i = 0; i < blend->n && options->quality != GN_QUALITY_REFERENCE; i++) {
        if (blend->state[i]->n_lights > GN_LIGHTS_MAX)
            return "render: a lighting state has more lights than are used";
        if (!needs.why_no_sh && !blend->state[i]->has_sh)
            return "render: irradiance shading needs the SH irradiance, which this lighting state "
                   "leaves out";
    }
    return NULL;
}

static const struct places *get_places(const struct gn_renderer *renderer,
                                       const struct frame *frame)
{
    return frame->pass ? frame->pass->places : &renderer->places;
}

static int reserve_places(struct gn_renderer *renderer, const struct places *places)
{
    int n = (int)places->capacity;
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
    if (options->n_lights < 0 || options->n_lights > GN_LIGHTS_MAX)
        return gn_error_set(out_error, -EINVAL, "render: %d lights, must be 1 to %d",
                            options->n_lights, GN_LIGHTS_MAX);
    if (options->estimate_parts < 0 || options->estimate_parts > GN_ERROR_PARTS ||
        options->estimate_part < 0 ||
        options->estimate_part >= (options->estimate_parts > 0 ? options->estimate_parts : 1))
        return gn_error_set(out_error, -EINVAL,
                            "render: part %d of %d of the error's pixels, must be under 1 to %d",
                            options->estimate_part, options->estimate_parts, GN_ERROR_PARTS);
    if (options->grid < 0 || options->grid > MAX_GRID)
        return gn_error_set(out_error, -EINVAL, "render: a grid of %d rays, must be 1 to %d",
                            options->grid, MAX_GRID);
    if (options->shadow_step < 0 || options->shadow_step > GN_SHADOW_STEP_MAX ||
        options->shadow_step == 3)
        return gn_error_set(out_error, -EINVAL, "render: a shadow step of %d, must be 1, 2 or 4",
                            options->shadow_step);
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
    frame->solid_box = EMPTY_BOX;
    for (int i = 0; i < frame->clusters[0].n; i++) {
        const struct cluster *cluster = &frame->clusters[0].cluster[i];
        for (int k = 0; k < 3 && !cluster->is_flat; k++) {
            frame->solid_box.min[k] = fminf(frame->solid_box.min[k], cluster->box.min[k]);
            frame->solid_box.max[k] = fmaxf(frame->solid_box.max[k], cluster->box.max[k]);
        }
    }
    widen_box(&frame->solid_box, frame->margin);
    widen_box(&frame->virtual_box, frame->margin);
    for (int i = 0; i < renderer->blockers.n; i++) {
        renderer->wide_blockers[i] = renderer->blockers.boxes[i];
        widen_box(&renderer->wide_blockers[i], frame->margin);
    }
    frame->blockers = renderer->blockers.boxes;
    frame->wide_blockers = renderer->wide_blockers;
    frame->n_blockers = renderer->blockers.n;
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
    frame->serial = ++renderer->n_frames;
    frame->is_cancelled = &renderer->is_cancelled;
    frame->scene = renderer->posed;
    frame->rt = renderer->posed->rt;
    frame->pixel_angle = (float)(1 / fmax(frame->camera->fx, frame->camera->fy));
    frame->kernels = gn_kernels_get();
    frame->rays = renderer->rays;
    frame->lights = frame->pass ? frame->pass->lights : &renderer->lights;
    frame->places = get_places(renderer, frame);
    frame->features = renderer->features;
    frame->plain = renderer->plain;
    frame->spots = renderer->spots;
    frame->figures = renderer->figures;
    frame->scratches = renderer->scratches;
    frame->tiles_x = count_tiles(frame->camera->width);
    frame->tiles_y = count_tiles(frame->camera->height);
    frame->rule = gn_refine_rules[frame->options.quality];
    if (frame->options.grid > 0 && frame->rule.grid > 1)
        frame->rule.grid = frame->options.grid;
    if (frame->options.single_ray)
        frame->rule.grid = 1;
    if (frame->options.quality == GN_QUALITY_SEED)
        frame->options.shadow_unweighted = frame->options.shadow_ignore_real = true;
    if (frame->options.paths_per_pixel == 0)
        frame->options.paths_per_pixel = DEFAULT_PATHS;
    init_boxes(frame, renderer);
    init_light(frame);
}

/** Silhouettes for the passes that the plan has; the reference has ways of its own. */
static int make_silhouettes(struct gn_renderer *renderer, struct frame *frame)
{
    if (!frame->cull || frame->options.quality == GN_QUALITY_REFERENCE)
        return 0;
    for (int i = 0; i < 2; i++) {
        bool is_real = i == 0;
        const struct silhouettes **out =
            is_real ? &frame->real_silhouettes : &frame->virtual_silhouettes;
        bool shades = is_real && frame->run_light_loop;
        if (!shades && (!frame->run_shadow || (is_real && !frame->run_blockers)))
            continue;
        int ret = gn_silhouettes_make(&renderer->silhouettes[i], &renderer->clusters[i], is_real,
                                      frame->lights, frame->margin, renderer->pool);
        if (ret < 0)
            return ret;
        *out = &renderer->silhouettes[i];
    }
    return 0;
}

/** Memory for the frame's picture, and its light. */
static int prepare(struct gn_renderer *renderer, const struct frame *frame,
                   struct gn_error *out_error)
{
    const struct gn_camera *camera = frame->camera;
    const struct gn_blend *blend = &frame->blend;
    struct gn_layers *layers = frame->layers;
    bool is_reference = frame->options.quality == GN_QUALITY_REFERENCE;
    int ret = 0;
    if (layers && (layers->width != camera->width || layers->height != camera->height)) {
        gn_layers_finish(layers);
        ret = gn_layers_init(layers, camera->width, camera->height);
        if (ret < 0)
            return gn_error_set(out_error, ret, "render: no memory for layers of %d x %d",
                                camera->width, camera->height);
    }
    ret = reserve_pixels(renderer, camera->width, camera->height);
    if (ret == 0 && frame->options.shadow_step > 1 && !renderer->spots) {
        size_t n = (size_t)camera->width * (size_t)camera->height;
        renderer->spots = calloc(n, sizeof(*renderer->spots));
        ret = renderer->spots ? 0 : -ENOMEM;
    }
    if (ret == 0)
        ret = gn_places_reserve(&renderer->places, 0);
    if (ret == 0 && !frame->pass)
        ret = is_reference
                  ? gn_reference_make_lights(blend, &renderer->lights, &renderer->places)
                  : gn_render_lights_from_blend(blend, frame->options.n_lights, &renderer->merge,
                                                &renderer->lights, &renderer->near.placed);
    if (ret == 0 && is_reference)
        ret = reserve_texels(renderer);
    if (ret == 0 && (is_reference || frame->pass))
        ret = reserve_places(renderer, get_places(renderer, frame));
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    update_rays(renderer, camera, frame->pass);
    return 0;
}

/** One frame, or (frame->pass) one pass of many, whose layers stay as they are. */
static int render_frame(struct gn_renderer *renderer, struct frame *frame,
                        const struct gn_lighting_state *light, struct gn_render_report *out_report,
                        struct gn_error *out_error)
{
    struct gn_render_report report = {0};
    int64_t start_ns = gn_clock_get_monotonic_ns();
    gn_blend_init(&frame->blend, light);
    int ret =
        check_request(renderer->scene, frame->camera, &frame->blend, &frame->options, out_error);
    if (ret == 0)
        ret = prepare(renderer, frame, out_error);
    if (ret < 0)
        return ret;

    bool is_exact = frame->options.quality == GN_QUALITY_REFERENCE || frame->pass;
    ret = gn_near_prepare(&renderer->near, renderer->scene, light, is_exact, &frame->near);
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    init_frame(frame, renderer);
    gn_kept_begin(&renderer->kept, frame);
    gn_plan_make(frame, renderer->slopes, &report);
    ret = make_silhouettes(renderer, frame);
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    report.ms_plan = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);

    gn_tiles_render(frame, renderer->pool);
    if (is_cancelled(frame))
        return gn_error_set(out_error, -ECANCELED, "render: the frame was cancelled");
    gn_kept_end(&renderer->kept, frame);
    ret = frame->pass ? 0 : gn_caustics_add(&renderer->caustics, frame, renderer->pool);
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    gn_report_fill(frame, renderer->n_workers, &report);
    struct near_lights near = {0};
    if (gn_estimate_needs_near(frame))
        ret = gn_near_prepare(&renderer->near, renderer->scene, light, true, &near);
    if (ret == 0)
        ret = gn_estimate_make(renderer->estimate, frame, &near, renderer->pool, &report);
    if (ret < 0)
        return gn_error_set(out_error, ret, "render: out of memory");
    report.ms_total = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
    *out_report = report;
    return 0;
}

int gn_renderer_render(struct gn_renderer *renderer, const struct gn_camera *camera,
                       const struct gn_lighting_state *light,
                       const struct gn_render_options *options, struct gn_layers *layers,
                       struct gn_render_report *out_report, struct gn_error *out_error)
{
    struct frame frame = {.camera = camera, .layers = layers};
    if (options)
        frame.options = *options;
    return render_frame(renderer, &frame, light, out_report, out_error);
}

int gn_renderer_add_pass(struct gn_renderer *renderer, const struct gn_camera *camera,
                         const struct gn_lighting_state *light,
                         const struct gn_render_options *options, const struct pass *pass,
                         struct gn_render_report *out_report, struct gn_error *out_error)
{
    struct frame frame = {.camera = camera, .options = *options, .pass = pass};
    frame.options.shading = GN_SHADING_LIGHTS;
    frame.options.single_ray = true;
    frame.options.estimate_error = false;
    return render_frame(renderer, &frame, light, out_report, out_error);
}
