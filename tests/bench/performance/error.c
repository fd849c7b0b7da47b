/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How near to the truth interactive quality comes in how long, over the number of lights. The error
 * is that of error_time (its scenes, painted maps, references and metrics, 64 x 48, one ray a
 * pixel); the time is that of the same view as it is served, 640 x 480 with its edges refined.
 */
#include "tests/bench/error_time/metrics.h"
#include "tests/bench/performance/performance.h"
#include "tests/bench/timing.h"

/** Pictures whose error is measured; how many times wider the timed ones are; into how many parts a
 * side the references cut texels: theirs differ from those of 4 parts by some 1e-4. */
enum { WIDTH = 64, HEIGHT = 48, TIMES = 10, PARTS = 2 };

static const char *const map_names[] = {"lamps", "overcast", "sun"};
static const int numbers[] = {16, 32, 64, 128, 256, 512, 1024};

/** A scene as it is served. */
struct served {
    struct gn_renderer *renderer;
    struct gn_camera camera;
    struct gn_layers layers;
};

static void init_served(struct served *served, const struct gn_test_stage *stage,
                        struct gn_pool *pool)
{
    struct gn_camera *c = &served->camera;
    *c = stage->camera;
    c->width *= TIMES;
    c->height *= TIMES;
    c->fx *= TIMES;
    c->fy *= TIMES;
    c->cx *= TIMES;
    c->cy *= TIMES;
    gn_bench_check(gn_renderer_create(stage->scene, pool, &served->renderer, NULL), "the renderer");
    gn_bench_check(gn_layers_init(&served->layers, c->width, c->height), "the layers");
}

static void finish_served(struct served *served)
{
    gn_renderer_destroy(&served->renderer);
    gn_layers_finish(&served->layers);
}

static void measure_setting(const struct gn_performance *run, struct gn_bench_scene *scene,
                            struct served *served, const struct gn_bench_map *map,
                            const struct gn_bench_picture *reference,
                            const struct gn_lighting_state *light, int n_asked, FILE *file)
{
    static const struct gn_render_options single = {.single_ray = true}, options = {0};
    struct gn_test_stage *stage = &scene->stage;
    struct gn_render_report report;
    struct gn_bench_times times = {0};
    struct gn_bench_errors errors;
    gn_bench_check(gn_renderer_render(stage->renderer, &stage->camera, light, &single,
                                      &stage->layers, &report, NULL),
                   "a frame");
    gn_bench_check(gn_bench_measure_errors(reference, &stage->layers, false, &errors), "the error");
    for (int round = 0; round < 1 + run->n_repeats; round++) {
        gn_bench_start(&times);
        gn_bench_check(gn_renderer_render(served->renderer, &served->camera, light, &options,
                                          &served->layers, &report, NULL),
                       "a frame");
        gn_bench_stop(&times);
        if (round == 0)
            times.n = 0;
    }
    struct gn_bench_timing t = gn_bench_sum_up(&times);
    fprintf(file, "%s,%s,%d,%d,%.6g,%.3f,%.3f,%llu\n", map->name, scene->name, n_asked,
            report.n_lights, errors.rmse, t.median, t.iqr, (unsigned long long)report.rays_shadow);
}

static void measure_map(const struct gn_performance *run, const char *name,
                        struct gn_bench_scene *scenes, struct served *served, FILE *file)
{
    struct gn_bench_cache cache = {.folder = run->cache};
    struct gn_bench_picture references[GN_BENCH_SCENES];
    struct gn_bench_map map;
    gn_bench_check(gn_bench_map_init(name, 0, &map), name);
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_check(gn_bench_make_reference(&cache, &scenes[i], &map, PARTS, &references[i]),
                       "the reference");
    for (size_t k = 0; k < GN_ARRAY_LEN(numbers); k++) {
        const struct gn_light_options options = {.n_lights = numbers[k], .no_sh = true};
        struct gn_lighting_state *light = NULL;
        gn_bench_check(gn_lighting_state_create(&map.frame, NULL, &options, NULL, &light, NULL),
                       "the light");
        for (int i = 0; i < GN_BENCH_SCENES; i++)
            measure_setting(run, &scenes[i], &served[i], &map, &references[i], light, numbers[k],
                            file);
        gn_lighting_state_unref(&light);
    }
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_picture_finish(&references[i]);
    gn_bench_map_finish(&map);
}

void gn_performance_measure_error(const struct gn_performance *run)
{
    struct gn_bench_scene scenes[GN_BENCH_SCENES];
    struct served served[GN_BENCH_SCENES];
    struct gn_pool *pool = NULL;
    FILE *file = gn_performance_open(run, "error", "map,scene,asked,lights,rmse,ms,iqr,rays");
    gn_bench_check(gn_pool_create(run->n_threads, &pool), "the threads");
    for (int i = 0; i < GN_BENCH_SCENES; i++) {
        gn_bench_scene_init(&scenes[i], i, WIDTH, HEIGHT);
        init_served(&served[i], &scenes[i].stage, pool);
    }
    for (size_t i = 0; i < GN_ARRAY_LEN(map_names); i++)
        measure_map(run, map_names[i], scenes, served, file);
    for (int i = 0; i < GN_BENCH_SCENES; i++) {
        finish_served(&served[i]);
        gn_bench_scene_finish(&scenes[i]);
    }
    gn_pool_destroy(&pool);
    gn_performance_close(file);
}
