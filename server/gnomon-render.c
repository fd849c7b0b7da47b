/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon-render: one frame from files to files, without any server.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/clock.h"
#include "server/render_cli/cli.h"

/** All that a run owns. */
struct run {
    struct gn_pool *pool;
    struct gn_scene *scene;
    struct gn_render_needs needs;
    struct gn_lighting_state *light;
    struct gn_renderer *renderer;
    struct gn_progressive *progressive; // NULL: the layers below
    struct gn_camera camera;
    struct gn_cli_background background;
    struct gn_layers layers;
    struct gn_render_report report;
    struct gn_cli_budget budget;
    double ms_scene, ms_light;
};

static double get_ms_since(int64_t start_ns)
{
    return 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
}

static int read_inputs(const struct gn_cli_request *request, struct run *run,
                       struct gn_error *out_error)
{
    int ret = gn_camera_read_file(request->camera, &run->camera, out_error);
    gn_match_keep(request->match, &run->camera);
    if (ret == 0 && request->background)
        ret =
            gn_cli_background_read(request->background, &run->camera, &run->background, out_error);
    int64_t start_ns = gn_clock_get_monotonic_ns();
    if (ret == 0)
        ret = gn_scene_read_file(request->scene, run->pool, &run->scene, out_error);
    run->ms_scene = get_ms_since(start_ns);
    start_ns = gn_clock_get_monotonic_ns();
    if (ret == 0) {
        gn_render_get_needs(run->scene, &request->render, &run->needs);
        ret =
            gn_cli_make_light(request, run->scene, &run->needs, run->pool, &run->light, out_error);
    }
    run->ms_light = get_ms_since(start_ns);
    return ret;
}

/** How far the refinement is, now and then; at the end. */
static void tell_progress(const struct gn_progressive_figures *f, int64_t *last_ns)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    if (f->error < 0 || f->n_passes % GN_PROGRESSIVE_ROUND != 0 ||
        (!f->why_done && now_ns - *last_ns < GN_NS_PER_S))
        return;
    *last_ns = now_ns;
    fprintf(stderr, "gnomon-render: %d passes, off by %.2g (shadow %.2g, radiance %.2g)%s%s\n",
            f->n_passes, f->error, f->error_shadow, f->error_radiance, f->why_done ? ": " : "",
            f->why_done ? f->why_done : "");
}

/** The times and rays of one more pass. */
static void add_pass(struct gn_render_report *sum, const struct gn_render_report *pass)
{
    sum->ms_plan += pass->ms_plan;
    sum->ms_primary += pass->ms_primary;
    sum->ms_shade += pass->ms_shade;
    sum->ms_shadow += pass->ms_shadow;
    sum->ms_total += pass->ms_total;
    sum->rays_primary += pass->rays_primary;
    sum->rays_mirror += pass->rays_mirror;
    sum->rays_shade += pass->rays_shade;
    sum->rays_shadow += pass->rays_shadow;
}

static int refine(const struct gn_cli_request *request, struct run *run, struct gn_error *out_error)
{
    const char *obstacle = gn_progressive_get_obstacle(run->scene, &run->camera, &request->render);
    if (obstacle)
        return gn_error_set(out_error, -EINVAL, "--refine: %s", obstacle);
    int ret = gn_progressive_create(run->renderer, run->pool, &run->progressive, out_error);
    if (ret == 0)
        ret = gn_progressive_begin(run->progressive, &run->camera, run->light, &request->render,
                                   &request->refine, &run->report, out_error);
    int64_t last_ns = gn_clock_get_monotonic_ns();
    while (ret == 0 && !gn_progressive_get_figures(run->progressive)->why_done) {
        struct gn_render_report pass;
        ret = gn_progressive_add_pass(run->progressive, &pass, out_error);
        if (ret < 0)
            return ret;
        add_pass(&run->report, &pass);
        tell_progress(gn_progressive_get_figures(run->progressive), &last_ns);
    }
    if (ret < 0)
        return ret;
    run->report.estimated_error = gn_progressive_get_figures(run->progressive)->error_shadow;
    gn_progressive_add_plan(&run->report, true, "asked for");
    return 0;
}

static int render(const struct gn_cli_request *request, struct run *run, struct gn_error *out_error)
{
    int ret = gn_renderer_create(run->scene, run->pool, &run->renderer, out_error);
    if (ret < 0)
        return ret;
    if (request->refine.error > 0)
        return refine(request, run, out_error);
    if ((ret = gn_layers_init(&run->layers, run->camera.width, run->camera.height)) < 0)
        return gn_error_set(out_error, ret, "no memory for layers of %d x %d pixels",
                            run->camera.width, run->camera.height);
    if (request->budget_ms > 0) {
        const struct gn_cli_scene scene = {.scene = run->scene,
                                           .needs = &run->needs,
                                           .renderer = run->renderer,
                                           .camera = &run->camera,
                                           .pool = run->pool};
        return gn_cli_render_within(request, &scene, &run->light, &run->layers, &run->report,
                                    &run->budget, out_error);
    }
    return gn_renderer_render(run->renderer, &run->camera, run->light, &request->render,
                              &run->layers, &run->report, out_error);
}

static int run_request(const struct gn_cli_request *request, struct gn_error *out_error)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    struct run run = {0};
    int ret = gn_cli_check_outputs(request, out_error);
    if (ret < 0)
        return ret;
    if ((ret = gn_pool_create(request->n_threads, &run.pool)) < 0) {
        (void)gn_error_set(out_error, ret, "cannot start %d threads", request->n_threads);
        goto out;
    }
    ret = read_inputs(request, &run, out_error);
    if (ret == 0)
        ret = render(request, &run, out_error);
    if (ret < 0)
        goto out;
    const struct gn_cli_result result = {
        .camera = &run.camera,
        .scene = run.scene,
        .light = run.light,
        .needs = &run.needs,
        .layers = run.progressive ? gn_progressive_get_layers(run.progressive) : &run.layers,
        .background = request->background ? &run.background : NULL,
        .report = &run.report,
        .budget = request->budget_ms > 0 ? &run.budget : NULL,
        .refined = run.progressive ? gn_progressive_get_figures(run.progressive) : NULL,
        .n_threads = gn_pool_get_size(run.pool),
        .seed = request->render.seed,
        .ms_scene = run.ms_scene,
        .ms_light = run.ms_light,
        .ms_total = get_ms_since(start_ns),
    };
    ret = gn_cli_write_outputs(request, &result, run.pool, out_error);
out:
    gn_layers_finish(&run.layers);
    gn_cli_background_finish(&run.background);
    gn_progressive_destroy(&run.progressive);
    gn_renderer_destroy(&run.renderer);
    gn_lighting_state_unref(&run.light);
    gn_scene_destroy(&run.scene);
    gn_pool_destroy(&run.pool);
    return ret;
}

int main(int argc, char *argv[])
{
    struct gn_error error = {0};
    struct gn_cli_request request;
    int ret = gn_cli_request_init(&request, argc, argv, &error);
    if (ret == 0 && gn_options_wants_help(request.options))
        gn_options_print_help(&gn_cli_program, stdout);
    else if (ret == 0 && gn_options_wants_version(request.options))
        printf("gnomon-render %s\n", GN_VERSION);
    else if (ret == 0)
        ret = run_request(&request, &error);
    gn_cli_request_finish(&request);
    if (ret == 0 && fflush(stdout) != 0)
        ret = gn_error_set(&error, -1, "cannot write to standard output");
    if (ret == 0)
        return EXIT_SUCCESS;
    fprintf(stderr, "gnomon-render: %s\n", error.text);
    return EXIT_FAILURE;
}
