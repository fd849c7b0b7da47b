/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Time of a frame of interactive quality over pixels, lights, triangles and threads, one at a time.
 * Pixels, lights and threads: the rig's room. Triangles: a ball of ever finer triangles over a
 * plane, so that the picture stays the same.
 */
#include "common/thread.h"
#include "tests/bench/performance/performance.h"
#include "tests/bench/timing.h"
#include "tests/meshes.h"
#include "tests/stage.h"

#define WIDTH 320
#define N_LIGHTS 122

static const int widths[] = {80, 160, 320, 640, 1280};
static const int lights[] = {16, 32, 64, 128, 256, 512, 1024};
static const int rings[] = {16, 50, 158, 500}; // of the ball: 4 n (n - 1) triangles

/** What every row is about. */
struct subject {
    struct gn_renderer *renderer;
    const struct gn_camera *camera;
    struct gn_layers *layers;
};

static void measure(const struct gn_performance *run, const struct subject *s,
                    const struct gn_lighting_state *light, const char *axis, double x, FILE *file)
{
    static const struct gn_render_options options = {.quality = GN_QUALITY_INTERACTIVE};
    struct gn_bench_times times = {0};
    struct gn_render_report report;
    for (int round = 0; round < 1 + run->n_repeats; round++) { // the first warms up
        gn_bench_start(&times);
        gn_bench_check(
            gn_renderer_render(s->renderer, s->camera, light, &options, s->layers, &report, NULL),
            "a frame");
        gn_bench_stop(&times);
        if (round == 0)
            times.n = 0;
    }
    struct gn_bench_timing t = gn_bench_sum_up(&times);
    fprintf(file, "%s,%.0f,%.4f,%.4f,%.4f,%.4f,%.4f,%llu\n", axis, x, t.median, t.iqr,
            report.ms_primary, report.ms_shade, report.ms_shadow,
            (unsigned long long)report.rays_shadow);
}

static void measure_room(const struct gn_performance *run, FILE *file)
{
    struct gn_bench_rig rig;
    gn_bench_rig_init(&rig, run->n_threads);
    const struct subject s = {rig.renderer, &rig.camera, &rig.layers};
    struct gn_lighting_state *light = gn_bench_rig_make_seed_light(&rig, N_LIGHTS);
    for (size_t i = 0; i < GN_ARRAY_LEN(widths); i++) {
        gn_bench_rig_aim(&rig, widths[i]);
        measure(run, &s, light, "pixels", (double)rig.camera.width * rig.camera.height, file);
    }
    gn_lighting_state_unref(&light);
    gn_bench_rig_aim(&rig, WIDTH);
    for (size_t i = 0; i < GN_ARRAY_LEN(lights); i++) {
        const struct gn_light_options options = {.n_lights = lights[i]};
        light = gn_bench_rig_make_light(&rig, &options);
        measure(run, &s, light, "lights", light->n_lights, file);
        gn_lighting_state_unref(&light);
    }
    gn_bench_rig_finish(&rig);
}

static void measure_triangles(const struct gn_performance *run, FILE *file)
{
    static const float grey[3] = {0.5f, 0.5f, 0.5f};
    const double eye[3] = {0.12, -0.75, 0.5}, target[3] = {0, 0.03, 0.02};
    struct gn_bench_rig rig;
    gn_bench_rig_init(&rig, 1);
    struct gn_lighting_state *light = gn_bench_rig_make_seed_light(&rig, N_LIGHTS);
    for (size_t i = 0; i < GN_ARRAY_LEN(rings); i++) {
        struct gn_test_stage stage = {0};
        gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(20, 2), 0, 0, 0,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.1f, rings[i]), 0, 0, 0.13,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_commit(&stage, run->n_threads);
        gn_test_stage_aim(&stage, WIDTH, WIDTH * 3 / 4, 1.05 * WIDTH, eye, target);
        const struct subject s = {stage.renderer, &stage.camera, &stage.layers};
        measure(run, &s, light, "triangles", stage.scene->n_virtual_triangles, file);
        gn_test_stage_finish(&stage);
    }
    gn_lighting_state_unref(&light);
    gn_bench_rig_finish(&rig);
}

/** As many as there are processors, by doubling and all. */
static void measure_threads(const struct gn_performance *run, FILE *file)
{
    int n_all = gn_thread_get_cpu_count();
    for (int n = 1; n <= n_all; n = n < n_all && 2 * n > n_all ? n_all : 2 * n) {
        struct gn_bench_rig rig;
        gn_bench_rig_init(&rig, n);
        gn_bench_rig_aim(&rig, 2 * WIDTH);
        const struct subject s = {rig.renderer, &rig.camera, &rig.layers};
        struct gn_lighting_state *light = gn_bench_rig_make_seed_light(&rig, N_LIGHTS);
        measure(run, &s, light, "threads", n, file);
        gn_lighting_state_unref(&light);
        gn_bench_rig_finish(&rig);
    }
}

void gn_performance_measure_scaling(const struct gn_performance *run)
{
    FILE *file =
        gn_performance_open(run, "scaling", "axis,x,ms,iqr,ms_primary,ms_shade,ms_shadow,rays");
    measure_room(run, file);
    measure_triangles(run, file);
    measure_threads(run, file);
    gn_performance_close(file);
}
