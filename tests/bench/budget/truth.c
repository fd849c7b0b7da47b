/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Are the errors true that frames under a budget say? Real pictures of the settings that the
 * controller chooses, whose times are counted work and no clock's, beside the texel-exact
 * reference: one ray a pixel in both, since that is what an estimate is of.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/budget.h"
#include "tests/bench/error_time/metrics.h"
#include "tests/bench/error_time/scenes.h"

enum { WIDTH = 96, HEIGHT = 72, FRAMES = 40, MOST = 200, LIGHTS = 256, MAX_PICTURES = 64 };

static const char *const maps[] = {"lamps", "sun", "overcast", "rig"};
/** For the counted work below. */
static const double budgets_ms[] = {1, 2, 4, 8};

struct picture {
    double truth, estimated, predicted;
};

struct run {
    struct gn_bench_scene *scene;
    struct gn_lighting_state *light;
    struct gn_budget budget;
    struct gn_budget_choice choice;
    struct gn_error_sums sums[GN_ERROR_PARTS];
};

static void make_light(struct run *run, const struct gn_bench_map *map, int n_lights)
{
    const struct gn_light_options options = {.no_sh = true, .n_lights = n_lights};
    gn_lighting_state_unref(&run->light);
    assert_int_equal(gn_lighting_state_create(&map->frame, NULL, &options, NULL, &run->light, NULL),
                     0);
    memset(run->sums, 0, sizeof(run->sums));
}

static struct gn_budget_outcome count_work(const struct gn_render_report *r, int n_lights)
{
    struct gn_budget_outcome o = {
        .ms_plan = 1e-3 * n_lights,
        .ms_primary = 5e-5 * (double)r->rays_primary,
        .ms_shade = 1e-4 * (double)r->rays_shade,
        .ms_shadow = 1e-4 * (double)r->rays_shadow + 2e-6 * WIDTH * HEIGHT * n_lights,
        .n_refined_pixels = r->n_refined_pixels,
    };
    o.ms = o.ms_plan + o.ms_primary + o.ms_shade + o.ms_shadow + 0.1;
    return o;
}

static void run_frame(struct run *run, const struct gn_bench_map *map, double budget_ms, int frame)
{
    struct gn_test_stage *stage = &run->scene->stage;
    const struct gn_budget_frame known = {
        .budget_ms = budget_ms, .n_pixels = WIDTH * HEIGHT, .n_lights = LIGHTS};
    uint64_t n_switches = run->budget.n_switches;
    gn_budget_choose(&run->budget, &known, &run->choice);
    if (!run->light || run->budget.n_switches != n_switches)
        make_light(run, map, run->choice.setting.n_lights);
    const struct gn_render_options options = {.grid = run->choice.setting.grid,
                                              .estimate_error = true,
                                              .estimate_parts = GN_ERROR_PARTS,
                                              .estimate_part = frame % GN_ERROR_PARTS};
    assert_int_equal(gn_renderer_render(stage->renderer, &stage->camera, run->light, &options,
                                        &stage->layers, &stage->report, NULL),
                     0);
    run->sums[options.estimate_part] = stage->report.error;
    struct gn_budget_outcome o = count_work(&stage->report, run->choice.setting.n_lights);
    o.estimated_error = gn_error_sums_get(run->sums, GN_ERROR_PARTS);
    gn_budget_learn(&run->budget, &o);
}

static double measure(struct run *run, const struct gn_bench_picture *reference)
{
    struct gn_test_stage *stage = &run->scene->stage;
    const struct gn_render_options options = {.single_ray = true};
    struct gn_bench_errors errors;
    assert_int_equal(gn_renderer_render(stage->renderer, &stage->camera, run->light, &options,
                                        &stage->layers, &stage->report, NULL),
                     0);
    assert_int_equal(gn_bench_measure_errors(reference, &stage->layers, false, &errors), 0);
    return errors.rmse;
}

static struct picture make_picture(struct gn_bench_scene *scene, const struct gn_bench_map *map,
                                   const struct gn_bench_picture *reference, double budget_ms)
{
    struct run run = {.scene = scene};
    // Until all parts of the pixels are of one setting.
    for (int i = 0; i < MOST && (i < FRAMES || run.budget.rested < GN_ERROR_PARTS); i++)
        run_frame(&run, map, budget_ms, i);
    struct picture p = {.truth = measure(&run, reference),
                        .estimated = gn_error_sums_get(run.sums, GN_ERROR_PARTS),
                        .predicted = run.choice.predicted_error};
    print_message("# %s, %s, %g ms: %d lights, grid %d: off by %.4f, estimated %.4f, predicted "
                  "%.4f; %d switches\n",
                  map->name, scene->name, budget_ms, run.choice.setting.n_lights,
                  run.choice.setting.grid, p.truth, p.estimated, p.predicted,
                  (int)run.budget.n_switches);
    gn_lighting_state_unref(&run.light);
    return p;
}

static double get_rank(const struct picture *pictures, int n, size_t offset, int i)
{
    double rank = 0, x, y;
    memcpy(&x, (const char *)&pictures[i] + offset, sizeof(x));
    for (int j = 0; j < n; j++) {
        memcpy(&y, (const char *)&pictures[j] + offset, sizeof(y));
        rank += y < x ? 1 : y > x ? 0 : 0.5;
    }
    return rank;
}

/** Spearman's. */
static double correlate(const struct picture *pictures, int n)
{
    double xy = 0, xx = 0, yy = 0, mean = 0.5 * n;
    for (int i = 0; i < n; i++) {
        double x = get_rank(pictures, n, offsetof(struct picture, truth), i) - mean;
        double y = get_rank(pictures, n, offsetof(struct picture, estimated), i) - mean;
        xy += x * y;
        xx += x * x;
        yy += y * y;
    }
    return xy / sqrt(xx * yy);
}

static void test_what_frames_say_is_true(void **state)
{
    (void)state;
    static struct gn_bench_scene scenes[GN_BENCH_SCENES];
    static struct picture pictures[MAX_PICTURES];
    struct gn_bench_cache cache = {0};
    int n = 0, n_near = 0, n_foreseen = 0;
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_scene_init(&scenes[i], i, WIDTH, HEIGHT);
    for (size_t m = 0; m < sizeof(maps) / sizeof(maps[0]); m++) {
        struct gn_bench_map map;
        assert_int_equal(gn_bench_map_init(maps[m], 150, &map), 0);
        for (int i = 0; i < GN_BENCH_SCENES; i++) {
            struct gn_bench_picture reference;
            assert_int_equal(gn_bench_make_reference(&cache, &scenes[i], &map, 1, &reference), 0);
            for (size_t k = 0; k < sizeof(budgets_ms) / sizeof(budgets_ms[0]); k++)
                pictures[n++] = make_picture(&scenes[i], &map, &reference, budgets_ms[k]);
            gn_bench_picture_finish(&reference);
        }
        gn_bench_map_finish(&map);
    }
    for (int i = 0; i < n; i++) {
        const struct picture *p = &pictures[i];
        n_near += p->estimated >= p->truth / 2 && p->estimated <= 2 * p->truth;
        n_foreseen += p->predicted >= p->truth / 2 && p->predicted <= 2 * p->truth;
    }
    double rank = correlate(pictures, n);
    print_message("# %d pictures: rank correlation %.3f, estimated within a factor of 2 in %d, "
                  "predicted in %d\n",
                  n, rank, n_near, n_foreseen);
    assert_true(rank > 0.9);
    assert_true(10 * n_near >= 9 * n);
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_scene_finish(&scenes[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_what_frames_say_is_true)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
