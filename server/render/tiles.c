/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A frame in tiles on the pool. Rounds with a wait between them: all centres; the shadow between
 * those that have it, where it is coarser than the picture; then the pixels whose neighbourhood
 * asks for more.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "common/clock.h"
#include "server/render/pass.h"

static void init_sample(const struct frame *frame, struct sample *sample, int x, int y, int part)
{
    uint64_t pixel = (uint64_t)y * (uint64_t)frame->camera->width + (uint64_t)x;
    sample->seed =
        (frame->options.seed + 1) * UINT64_C(0xd1342543de82ef95) ^ (pixel << 12) ^ (uint64_t)part;
}

void gn_tiles_light_samples(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                            struct tile_figures *figures)
{
    bool is_reference = frame->options.quality == GN_QUALITY_REFERENCE;
    int64_t t1 = gn_clock_get_monotonic_ns();
    gn_shade_follow_mirrors(frame, scratch->samples, n, figures);
    gn_render_weigh_probes(frame, scratch->samples, n);
    gn_specular_shade(frame, scratch, n, n_paths, figures);
    if (is_reference)
        gn_reference_shade(frame, scratch, n, n_paths, figures);
    else
        gn_shade_samples(frame, scratch, n, figures);
    if (frame->pass)
        gn_pass_shade(frame, scratch, n, figures);
    else if (!is_reference && frame->near.n > 0)
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
    figures->s_shade += 1e-9 * (double)(t2 - t1);
    figures->s_shadow += 1e-9 * (double)(t3 - t2);
}

/** Light of the samples, and what they show. */
static void process_samples(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                            struct tile_figures *figures)
{
    gn_tiles_light_samples(frame, scratch, n, n_paths, figures);
    if (frame->run_optics)
        gn_optics_samples(frame, scratch, n, n_paths, figures);
}

/** The paper's ratio. */
static double get_factor(const struct frame *frame, const struct sample *s, int k)
{
    return s->open[k] > frame->floor_irradiance[k] ? 1 - s->cut[k] / s->open[k] : 1;
}

static struct feature *get_feature(const struct frame *frame, int x, int y)
{
    return &frame->features[(size_t)y * (size_t)frame->camera->width + (size_t)x];
}

/** What the choice of pixels to refine looks at; without bounces, which are noisy. */
static void keep_feature(const struct frame *frame, int x, int y, const struct sample *s)
{
    struct feature *feature = get_feature(frame, x, y);
    bool is_virtual = s->kind == SAMPLE_VIRTUAL;
    bool is_shown = !is_virtual && s->shown != 0; // in a mirror
    feature->owner = is_virtual ? s->object + 1
                     : is_shown ? (uint32_t)frame->scene->n_objects + s->shown
                                : 0;
    for (int k = 0; k < 3; k++)
        feature->color[k] = (float)(is_virtual  ? s->radiance[k] - s->indirect[k]
                                    : is_shown  ? s->gain[k] - s->indirect[k]
                                    : s->is_cut ? get_factor(frame, s, k)
                                                : 1);
}

/** Where a block's pixels are. */
static void get_corner(const struct frame *frame, int item, int block, int *out_x, int *out_y)
{
    *out_x = item % frame->tiles_x * TILE + block % BLOCKS * BLOCK;
    *out_y = item / frame->tiles_x * TILE + block / BLOCKS * BLOCK;
}

/** Traces the rays of a tile's pixels, or takes what is kept of them. Returns its blocks. */
static const struct sight *see_blocks(const struct frame *frame, struct scratch *scratch, int item,
                                      struct tile_figures *figures)
{
    struct sight *sights =
        frame->kept ? frame->kept + (size_t)item * BLOCKS * BLOCKS : scratch->sights;
    struct box tile = EMPTY_BOX;
    for (int b = 0; b < BLOCKS * BLOCKS; b++) {
        if (!frame->is_seen) {
            struct sight_rays rays;
            int x;
            int y;
            get_corner(frame, item, b, &x, &y);
            gn_primary_aim_block(frame, x, y, &rays);
            gn_primary_see_block(frame, &rays, &sights[b], figures);
        }
        for (int k = 0; k < 3 && sights[b].is_bounded; k++) {
            tile.min[k] = fminf(tile.min[k], sights[b].box.min[k]);
            tile.max[k] = fmaxf(tile.max[k], sights[b].box.max[k]);
        }
    }
    scratch->n_shadow_lights = 0;
    if (frame->run_shadow && frame->skips && tile.min[0] <= tile.max[0])
        gn_shadow_list_lights(frame, scratch, &tile);
    return sights;
}

/** Does the block show nothing of the virtual objects? */
static bool is_plain(const struct frame *frame, const struct scratch *scratch,
                     const struct sight *sight)
{
    return frame->skips && sight->is_bounded &&
           (!frame->run_shadow || sight->hits.met == 0 ||
            gn_shadow_is_free(frame, scratch, &sight->box));
}

/** Takes what a tile's pixels see where it is not plain. Returns the number of samples. */
static int see_tile(const struct frame *frame, struct scratch *scratch, int item, int (*pixels)[2],
                    struct tile_figures *figures)
{
    const struct sight *sights = see_blocks(frame, scratch, item, figures);
    int n = 0;
    for (int b = 0; b < BLOCKS * BLOCKS; b++) {
        struct sight_rays rays;
        int corner[2];
        get_corner(frame, item, b, &corner[0], &corner[1]);
        if (corner[0] >= frame->camera->width || corner[1] >= frame->camera->height)
            continue;
        bool plain = is_plain(frame, scratch, &sights[b]);
        *gn_refine_plain_at(frame, corner[0], corner[1]) = plain;
        if (plain) {
            gn_layers_write_plain(frame, corner[0], corner[1], sights[b].depth);
            figures->n_receivers += (uint64_t)__builtin_popcount(sights[b].hits.met);
            continue;
        }
        gn_primary_aim_block(frame, corner[0], corner[1], &rays);
        for (int i = 0; i < LANES; i++) {
            int x = corner[0] + i % BLOCK;
            int y = corner[1] + i / BLOCK;
            if (x >= frame->camera->width || y >= frame->camera->height)
                continue;
            struct sample *s = &scratch->samples[n];
            gn_primary_take(frame, &rays, &sights[b].hits, i, s, figures);
            s->group = n;
            init_sample(frame, s, x, y, 0);
            pixels[n][0] = x;
            pixels[n++][1] = y;
        }
    }
    return n;
}

static void render_centres(void *context, int item, int worker)
{
    const struct frame *frame = context;
    struct scratch *scratch = &frame->scratches[worker];
    struct tile_figures *figures = &frame->figures[item];
    int pixels[BATCH][2];
    memset(figures, 0, sizeof(*figures));
    if (is_cancelled(frame))
        return;
    int64_t start = gn_clock_get_monotonic_ns();
    int n = see_tile(frame, scratch, item, pixels, figures);
    scratch->grid = 1;
    figures->s_primary += 1e-9 * (double)(gn_clock_get_monotonic_ns() - start);
    for (int i = 0; i < n && frame->shadow_step > 1; i++)
        gn_coarse_put_off(frame, pixels[i][0], pixels[i][1], &scratch->samples[i]);
    if (n > 0)
        process_samples(frame, scratch, n, frame->options.paths_per_pixel, figures);
    for (int i = 0; i < n; i++) {
        const struct sample *s = &scratch->samples[i];
        int x = pixels[i][0];
        int y = pixels[i][1];
        if (frame->pass) {
            gn_pass_add_sample(frame->pass, x, y, s);
            continue;
        }
        *gn_image_at(&frame->layers->depth, x, y) = s->depth;
        gn_layers_resolve(frame, x, y, s, 1);
        keep_feature(frame, x, y, s);
    }
}

/** Works out the shadow of pixels[n][2] that waited. */
static void see_again(const struct frame *frame, struct scratch *scratch, int (*pixels)[2], int n,
                      struct tile_figures *figures)
{
    scratch->grid = 1;
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        int x = pixels[i][0];
        int y = pixels[i][1];
        s->group = i;
        init_sample(frame, s, x, y, 0);
        gn_primary_aim(frame,
                       frame->rays + 3 * ((size_t)y * (size_t)frame->camera->width + (size_t)x), s);
    }
    int64_t start = gn_clock_get_monotonic_ns();
    gn_primary_trace(frame, scratch->samples, n, figures);
    figures->s_primary += 1e-9 * (double)(gn_clock_get_monotonic_ns() - start);
    process_samples(frame, scratch, n, frame->options.paths_per_pixel, figures);
    for (int i = 0; i < n; i++) {
        gn_layers_resolve(frame, pixels[i][0], pixels[i][1], &scratch->samples[i], 1);
        keep_feature(frame, pixels[i][0], pixels[i][1], &scratch->samples[i]);
    }
}

/** Between the pixels whose shadow is known. */
static void render_between(void *context, int item, int worker)
{
    const struct frame *frame = context;
    int again[BATCH][2];
    int n = 0;
    for (int i = 0; i < BATCH; i++) {
        int x;
        int y;
        float factor[3];
        float color[3];
        get_corner(frame, item, i / LANES, &x, &y);
        x += i % BLOCK;
        y += i % LANES / BLOCK;
        if (!gn_coarse_waits(frame, x, y))
            continue;
        if (!gn_coarse_interpolate(frame, x, y, factor, color)) {
            again[n][0] = x;
            again[n++][1] = y;
            continue;
        }
        memcpy(gn_image_at(&frame->layers->shadow, x, y), factor, sizeof(factor));
        memcpy(get_feature(frame, x, y)->color, color, sizeof(color));
    }
    if (n > 0)
        see_again(frame, &frame->scratches[worker], again, n, &frame->figures[item]);
}

/** Does pixels[n][2] again with the grid. */
static void refine_pixels(const struct frame *frame, struct scratch *scratch, int (*pixels)[2],
                          int n, struct tile_figures *figures)
{
    int grid = frame->rule.grid;
    int parts = grid * grid;
    scratch->grid = grid;
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
    int64_t start = gn_clock_get_monotonic_ns();
    gn_primary_trace(frame, scratch->samples, n * parts, figures);
    figures->s_primary += 1e-9 * (double)(gn_clock_get_monotonic_ns() - start);
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

/** Pixels of a tile that need the grid or show something: those of blocks that are not plain, or
 * next to one that is not. */
static int list_pixels(const struct frame *frame, int item, int (*out_pixels)[2])
{
    int n = 0;
    for (int b = 0; b < BLOCKS * BLOCKS; b++) {
        int x;
        int y;
        get_corner(frame, item, b, &x, &y);
        if (x >= frame->camera->width || y >= frame->camera->height ||
            gn_refine_is_all_plain(frame, x, y))
            continue;
        for (int i = 0; i < LANES; i++) {
            out_pixels[n][0] = x + i % BLOCK;
            out_pixels[n][1] = y + i / BLOCK;
            n +=
                out_pixels[n][0] < frame->camera->width && out_pixels[n][1] < frame->camera->height;
        }
    }
    return n;
}

static void render_edges(void *context, int item, int worker)
{
    const struct frame *frame = context;
    struct scratch *scratch = &frame->scratches[worker];
    struct tile_figures *figures = &frame->figures[item];
    int parts = frame->rule.grid * frame->rule.grid;
    int pixels[BATCH + 1][2];
    int edges[BATCH][2];
    int n_edges = 0;
    int n = is_cancelled(frame) ? 0 : list_pixels(frame, item, pixels);
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

void gn_tiles_render(struct frame *frame, struct gn_pool *pool)
{
    int n_tiles = frame->tiles_x * frame->tiles_y;
    gn_pool_run(pool, n_tiles, render_centres, frame);
    if (frame->shadow_step > 1)
        gn_pool_run(pool, n_tiles, render_between, frame);
    if (!frame->pass)
        gn_pool_run(pool, n_tiles, render_edges, frame);
}
