/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One frame: from scene, lighting state and view to layers. The plan says which passes run and why
 * the others do not; the passes are in primary.c, shade.c, shadow.c, reference.c.
 */
#ifndef GN_SERVER_RENDER_RENDER_H
#define GN_SERVER_RENDER_RENDER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/camera.h"
#include "common/image.h"
#include "common/pool.h"
#include "server/light/state.h"
#include "server/scene/scene.h"

enum gn_quality {
    GN_QUALITY_INTERACTIVE = 0,
    GN_QUALITY_SEED = 1,      // the 2007 paper to the letter
    GN_QUALITY_REFERENCE = 2, // every texel, exact visibility: slow, the judge of the others
};

/**
 * How diffuse virtual objects are lit: the paper's two variants, the lights with shadow rays or the
 * irradiance of the normal, evaluated where the paper looks up a map of it. REFERENCE integrates
 * the map whatever is asked for here.
 */
enum gn_shading { GN_SHADING_LIGHTS = 0, GN_SHADING_IRRADIANCE = 1 };
/** Their names, as a list of choices in that order. */
#define GN_SHADING_NAMES "lights|irradiance"

/** Largest shadow_step. */
#define GN_SHADOW_STEP_MAX 4

/** All-zero is the default of the quality. */
struct gn_render_options {
    enum gn_quality quality;
    enum gn_shading shading;
    bool no_virtual;         // leave virtual objects out of sight; their shadow and light stay
    bool no_shadow;          // leave the shadow on real surfaces out
    bool shadow_unweighted;  // the paper's sums without the cosine (SEED implies it)
    bool shadow_ignore_real; // real blockers do not count in the sums (SEED implies it)
    bool all_passes;         // switch every omission of the plan off (for tests)
    bool single_ray;         // no pixel gets a grid (to compare light alone)
    bool estimate_error;     // the report's estimated_error: takes about 150 000 more rays
    int estimate_parts;      // [1, GN_ERROR_PARTS]; only one pixel in so many is asked for it, with
    int estimate_part;       // another part of them for each of [0, estimate_parts); default: all
    bool supersample_all;    // every pixel gets its quality's grid (to test the choice of them)
    int n_lights; // most lights of the lighting state, [1, GN_LIGHTS_MAX]; those that are more are
                  // merged (light_merge.h); default: all. Not of the reference
    int grid;     // rays per side of pixels that get a grid, [1, 4]; default: the quality's own.
                  // Not of seed, which has none
    int shadow_step; // interactive, of diffuse real surfaces without near light on them: only each
                     // 2nd or 4th pixel of a row and column has its own shadow, those between a
                     // mean where it is smooth (coarse.c); default: 1, every pixel
    int bounces;     // reference only: indirect bounces, [0, 16]
    int paths_per_pixel; // reference with bounces: random paths, [1, 65536], default 256
    uint64_t seed;       // of the reference's random paths
};

/** What of a lighting state the frames of a room can use; NULL: needed. Strings are static. */
struct gn_render_needs {
    const char *why_no_lights;
    const char *why_no_sh; // the harmonics and the irradiance of any normal
    const char *why_no_pyramid;
};
/** For all frames of the scene with these options, of any view. */
void gn_render_get_needs(const struct gn_scene *scene, const struct gn_render_options *options,
                         struct gn_render_needs *out_needs);

/**
 * The picture's layers; linear radiance. With B the radiance that the modelled real scene sends to
 * the pixel without the virtual objects, C the part of B whose light paths no virtual object cuts,
 * and T the radiance with the virtual objects in the scene: shadow = C / B, added = T - C. So
 * shadow * background + added tends to the truth as background tends to B; without bounces C / B is
 * the paper's 1 - ShadowColor / UnShadowColor and added is 0.
 * Thread-safety: unsafe; sized once, reused frame by frame.
 */
struct gn_layers {
    int width, height;
    struct gn_image virtual_rgba; // [h][w][4], premultiplied linear radiance, coverage
    struct gn_image shadow;       // [h][w][3], [0, 1]
    struct gn_image added;        // [h][w][3], linear radiance by the manifest's albedos, >= 0
    struct gn_image depth; // [h][w][1], m along the camera's z at the pixel's centre, or INFINITY
};
/** Allocates. Returns 0, -EINVAL (a side out of range), -ENOMEM; *layers is zeroed on failure. */
GN_MUST_USE int gn_layers_init(struct gn_layers *layers, int width, int height);
/** Frees and zeroes. A zeroed one is fine. */
void gn_layers_finish(struct gn_layers *layers);

/** Most passes a plan lists. */
#define GN_PLAN_MAX 16

/** Most parts of the pixels that are asked for the error. */
#define GN_ERROR_PARTS 16

/** What asked pixels say of the error of the shadow's factor. */
struct gn_error_sums {
    double square, square2; // sum over pixels of the mean over channels, and of its square
    int n;                  // affected pixels
};
/** The RMS error; < 0: of too few pixels. Where the mean is less than its own standard error, that
 * error takes its place. */
double gn_error_sums_get(const struct gn_error_sums *sums, int n_sums);

/** One line of the plan. Strings are static. */
struct gn_plan_entry {
    const char *pass; // "primary", "shade", "mirror", "shadow", "added", ...
    bool ran;
    const char *why;
};

/** The receipt's figures of one frame. */
struct gn_render_report {
    int n_plan;
    struct gn_plan_entry plan[GN_PLAN_MAX];
    double ms_plan, ms_total;               // wall time
    double ms_primary, ms_shade, ms_shadow; // the workers' time in the pass / number of workers
    double ms_estimate;                     // wall time of estimated_error
    uint64_t rays_primary, rays_mirror;     // nearest-hit rays: through pixels, after mirrors
    uint64_t rays_shade, rays_shadow;       // visibility rays (and, with bounces, path segments)
    uint64_t rays_estimate;                 // all rays of estimated_error
    int n_lights;                           // lights used; reference: directions of the map used
    /**
     * Of the shadow factor against the reference's, RMS over the affected pixels and channels, one
     * ray a pixel (grids at edges make a coarse picture better than that); < 0: not known or not
     * asked for. From rays of its own at about 500 pixels (estimate.h); tests/bench/error_time says
     * how near it is.
     */
    double estimated_error;
    struct gn_error_sums error; // that it is made of; of several parts those are put together
    int64_t n_virtual_pixels, n_shadow_pixels; // pixels with coverage > 0, with a factor < 1
    int64_t n_refined_pixels;                  // pixels that got more than their centre's ray
};

/** Keeps what frames share (scratch memory per size). Thread-safety: unsafe (one frame at a time).
 */
struct gn_renderer;
/** scene is borrowed until the renderer is destroyed; pool too (may be NULL). */
GN_MUST_USE int gn_renderer_create(const struct gn_scene *scene, struct gn_pool *pool,
                                   struct gn_renderer **out_renderer, struct gn_error *out_error);
/**
 * Renders from now on the scene's movable objects where a snapshot of the scene (scene/motion.h),
 * or the scene itself, has them. posed is borrowed until the next call, or destroy. Costs O(movable
 * objects): clusters of triangles and boxes follow.
 */
void gn_renderer_set_scene(struct gn_renderer *renderer, const struct gn_scene *posed);
/**
 * Ends the frame that is rendered, and all later ones, soon: they return -ECANCELED and leave their
 * layers undefined. Thread-safety: safe, at any time until destroy.
 */
void gn_renderer_cancel(struct gn_renderer *renderer);
/** NULL-safe; nulls *renderer. */
void gn_renderer_destroy(struct gn_renderer **renderer);

/**
 * Renders one view. One ray goes through each pixel's centre; pixels at edges get a grid of rays
 * (render/refine.c has the rule and the table of grids). A pixel's shadow factor is the ratio of
 * its rays' sums, so that an edge between two real surfaces weighs them by the light they send.
 * layers must have been made by gn_layers_init; it is resized where its size
 * differs from the camera's (the only allocation; none while the size stays, but once for the first
 * frame with a shadow_step and the first with fewer lights than there are). Same bits whatever
 * the pool's size. Returns 0, -EINVAL and a sentence, -ENOMEM, -ECANCELED.
 */
GN_MUST_USE int gn_renderer_render(struct gn_renderer *renderer, const struct gn_camera *camera,
                                   const struct gn_lighting_state *light,
                                   const struct gn_render_options *options,
                                   struct gn_layers *layers, struct gn_render_report *out_report,
                                   struct gn_error *out_error);

#endif
