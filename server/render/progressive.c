/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/progressive.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/draw.h"
#include "server/render/pass.h"
#include "server/render/reference_lights.h"
#include "server/render/sums.h"

#define DEFAULT_ERROR 1e-3
#define DEFAULT_LIGHTS 64
#define MAX_LIGHTS 1024
/** Rounds before an error is believed: two are the least that show one, and what is rare shows
 * late. */
#define FIRST_ROUND 2
#define TRUSTED_ROUND 4
/** Random paths of a glossy surface in each pass. */
#define PATHS 4

static_assert(GN_PROGRESSIVE_ROUND == REPLICATES && GN_PROGRESSIVE_PASSES_MAX == PASSES_MAX,
              "one pass of each sequence makes a round");

struct gn_progressive {
    struct gn_renderer *renderer; // borrowed
    struct gn_pool *pool;         // borrowed, may be NULL
    struct draw draw;
    struct light_list lights;
    struct places places;
    struct sums sums;
    struct gn_layers start; // the interactive picture
    struct gn_layers shown;
    bool is_shown; // else the start is
    struct gn_camera camera;
    struct gn_lighting_state *light; // a reference; NULL: not begun
    struct gn_render_options options;
    struct gn_progressive_options own;
    struct gn_progressive_figures figures;
};

int gn_progressive_create(struct gn_renderer *renderer, struct gn_pool *pool,
                          struct gn_progressive **out_progressive, struct gn_error *out_error)
{
    *out_progressive = NULL;
    struct gn_progressive *p = calloc(1, sizeof(*p));
    if (!p)
        return gn_error_set(out_error, -ENOMEM, "progressive: out of memory");
    p->renderer = renderer;
    p->pool = pool;
    *out_progressive = p;
    return 0;
}

void gn_progressive_destroy(struct gn_progressive **progressive)
{
    struct gn_progressive *p = *progressive;
    *progressive = NULL;
    if (!p)
        return;
    gn_progressive_rest(p);
    gn_draw_finish(&p->draw);
    gn_render_lights_finish(&p->lights);
    gn_places_finish(&p->places);
    gn_sums_finish(&p->sums);
    gn_layers_finish(&p->start);
    gn_layers_finish(&p->shown);
    free(p);
}

const char *gn_progressive_get_obstacle(const struct gn_scene *scene,
                                        const struct gn_camera *camera,
                                        const struct gn_render_options *options)
{
    if (options->quality == GN_QUALITY_SEED)
        return "seed quality is the paper's picture, not a step to another";
    if (options->quality == GN_QUALITY_REFERENCE)
        return "reference quality is what passes would tend to";
    if (options->shadow_unweighted || options->shadow_ignore_real)
        return "the paper's shadow sums are not what passes tend to";
    if (scene->n_virtual_triangles == 0)
        return "the scene has no virtual object";
    if ((int64_t)camera->width * camera->height > GN_PROGRESSIVE_PIXELS_MAX)
        return "the picture has more than 2097152 pixels";
    return NULL;
}

static int reserve(struct gn_progressive *p, const struct gn_blend *blend)
{
    int64_t capacity = (int64_t)p->own.n_lights + GN_PROBES_MAX + GN_TEXEL_PARTS_MAX;
    bool is_global = false;
    for (int i = 0; i < blend->n; i++)
        is_global |= blend->state[i]->map->geometry != NULL;
    int ret = gn_render_lights_reserve(&p->lights, capacity);
    if (ret == 0)
        ret = gn_places_reserve(&p->places, is_global ? capacity : 0);
    if (ret == 0)
        ret = gn_sums_begin(&p->sums, p->camera.width, p->camera.height);
    if (ret == 0 && (p->shown.width != p->camera.width || p->shown.height != p->camera.height)) {
        gn_layers_finish(&p->shown);
        ret = gn_layers_init(&p->shown, p->camera.width, p->camera.height);
    }
    if (ret == 0)
        ret = gn_draw_make(&p->draw, blend);
    return ret;
}

static int check_own(const struct gn_progressive_options *own, struct gn_error *out_error)
{
    if (!(own->error >= 1e-6 && own->error <= 1))
        return gn_error_set(out_error, -EINVAL, "progressive: error %g, must be 1e-6 to 1",
                            own->error);
    if (own->max_passes < GN_PROGRESSIVE_ROUND || own->max_passes > GN_PROGRESSIVE_PASSES_MAX)
        return gn_error_set(out_error, -EINVAL, "progressive: %d passes, must be %d to %d",
                            own->max_passes, GN_PROGRESSIVE_ROUND, GN_PROGRESSIVE_PASSES_MAX);
    if (own->n_lights < 1 || own->n_lights > MAX_LIGHTS)
        return gn_error_set(out_error, -EINVAL, "progressive: %d lights, must be 1 to %d",
                            own->n_lights, MAX_LIGHTS);
    return 0;
}

int gn_progressive_begin(struct gn_progressive *p, const struct gn_camera *camera,
                         struct gn_lighting_state *light, const struct gn_render_options *options,
                         const struct gn_progressive_options *own,
                         struct gn_render_report *out_report, struct gn_error *out_error)
{
    struct gn_blend blend;
    gn_progressive_rest(p);
    p->own = own ? *own : (struct gn_progressive_options){0};
    p->own.error = p->own.error == 0 ? DEFAULT_ERROR : p->own.error;
    p->own.max_passes = p->own.max_passes == 0 ? GN_PROGRESSIVE_PASSES_MAX : p->own.max_passes;
    p->own.n_lights = p->own.n_lights == 0 ? DEFAULT_LIGHTS : p->own.n_lights;
    int ret = check_own(&p->own, out_error);
    if (ret < 0)
        return ret;
    ret = gn_renderer_render(p->renderer, camera, light, options, &p->start, out_report, out_error);
    if (ret < 0)
        return ret;
    p->camera = *camera;
    p->options = *options;
    p->options.paths_per_pixel = PATHS;
    gn_blend_init(&blend, light);
    ret = reserve(p, &blend);
    if (ret < 0)
        return gn_error_set(out_error, ret, "progressive: no memory for %d x %d pixels",
                            camera->width, camera->height);
    memcpy(p->shown.depth.data, p->start.depth.data,
           (size_t)camera->width * (size_t)camera->height * sizeof(float));
    p->light = gn_lighting_state_ref(light);
    return 0;
}

void gn_progressive_rest(struct gn_progressive *p)
{
    gn_lighting_state_unref(&p->light);
    p->is_shown = false;
    p->figures =
        (struct gn_progressive_figures){.error_shadow = -1, .error_radiance = -1, .error = -1};
}

/** After a round. */
static void judge(struct gn_progressive *p)
{
    struct sums_error error;
    struct gn_progressive_figures *f = &p->figures;
    int round = f->n_passes / REPLICATES;
    if (round >= FIRST_ROUND) {
        gn_sums_judge(&p->sums, &p->start, p->pool, &error);
        gn_sums_resolve(&p->sums, &p->start, &error, p->pool, &p->shown);
        p->is_shown = true;
        f->error_shadow = error.shadow;
        f->error_radiance = error.put;
        f->error = fmax(error.shadow, error.put);
    }
    if (round >= TRUSTED_ROUND && f->error <= p->own.error)
        f->why_done = "converged: its error is no more than was asked for";
    else if (f->n_passes + REPLICATES > p->own.max_passes)
        f->why_done = "all passes are done";
}

int gn_progressive_add_pass(struct gn_progressive *p, struct gn_render_report *out_report,
                            struct gn_error *out_error)
{
    assert(p->light && !p->figures.why_done);
    int sequence = p->sums.n_passes % REPLICATES, index = p->sums.n_passes / REPLICATES;
    const struct pass pass = {.lights = &p->lights,
                              .places = &p->places,
                              .sums = &p->sums,
                              .is_centred = p->options.single_ray,
                              .sequence = sequence,
                              .index = index};
    struct gn_render_options options = p->options;
    options.seed = p->options.seed + (uint64_t)p->sums.n_passes;
    gn_draw_lights(&p->draw, sequence, index, p->own.n_lights, &p->lights, &p->places);
    int ret = gn_renderer_add_pass(p->renderer, &p->camera, p->light, &options, &pass, out_report,
                                   out_error);
    if (ret < 0)
        return ret;
    p->figures.n_passes = ++p->sums.n_passes;
    if (p->sums.n_passes % REPLICATES == 0)
        judge(p);
    return 0;
}

const struct gn_layers *gn_progressive_get_layers(const struct gn_progressive *p)
{
    return p->is_shown ? &p->shown : &p->start;
}

const struct gn_progressive_figures *gn_progressive_get_figures(const struct gn_progressive *p)
{
    return &p->figures;
}

void gn_progressive_add_plan(struct gn_render_report *report, bool ran, const char *why)
{
    assert(report->n_plan < GN_PLAN_MAX);
    report->plan[report->n_plan++] = (struct gn_plan_entry){"progressive", ran, why};
}
