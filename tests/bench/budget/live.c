/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Budgets on this machine: the rig's room as a camera that moves sees it, 320 and 640 px wide, in
 * light made in the number that the controller wants, on all processors. One line for each: what it
 * settled for, the times of the frames after the first ones, and how many were late.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/compare.h"
#include "server/render/budget.h"
#include "tests/bench/rig_frame.h"
#include "tests/bench/timing.h"

enum { FRAMES = 120, FIRST = 40, LIGHTS = 256 };

/** About the object, a little. */
static void move(struct gn_bench_rig *rig, int width, int frame)
{
    gn_bench_rig_aim(rig, width);
    rig->camera.world_from_camera.translation[0] += 0.02 * sin(0.05 * frame);
    rig->camera.world_from_camera.translation[2] += 0.01 * sin(0.03 * frame);
}

static struct gn_lighting_state *make_light(struct gn_bench_rig *rig, int n_lights)
{
    return gn_bench_rig_make_light(rig,
                                   &(struct gn_light_options){.no_sh = true, .n_lights = n_lights});
}

static void run_frame(struct gn_bench_rig *rig, struct gn_lighting_state **light,
                      struct gn_budget *budget, struct gn_error_sums sums[static GN_ERROR_PARTS],
                      int width, double budget_ms, int frame, struct gn_budget_choice *choice,
                      double *out_ms)
{
    const struct gn_budget_frame known = {.budget_ms = budget_ms,
                                          .n_pixels = width * (width * 3 / 4),
                                          .n_lights = LIGHTS,
                                          .max_step = GN_BUDGET_MAX_STEP};
    uint64_t n_switches = budget->n_switches;
    gn_budget_choose(budget, &known, choice);
    if (!*light || budget->n_switches != n_switches) {
        gn_lighting_state_unref(light);
        *light = make_light(rig, choice->setting.n_lights);
        for (int i = 0; i < GN_ERROR_PARTS; i++)
            sums[i] = (struct gn_error_sums){0};
    }
    move(rig, width, frame);
    const struct gn_render_options options = {.grid = choice->setting.grid,
                                              .shadow_step = choice->setting.shadow_step,
                                              .estimate_error = true,
                                              .estimate_parts = GN_ERROR_PARTS,
                                              .estimate_part = frame % GN_ERROR_PARTS};
    gn_bench_rig_render(rig, *light, &options);
    const struct gn_render_report *r = &rig->report;
    sums[options.estimate_part] = r->error;
    const struct gn_budget_outcome outcome = {
        .ms = r->ms_total,
        .ms_plan = r->ms_plan,
        .ms_primary = r->ms_primary,
        .ms_shade = r->ms_shade,
        .ms_shadow = r->ms_shadow,
        .n_refined_pixels = r->n_refined_pixels,
        .estimated_error = gn_error_sums_get(sums, GN_ERROR_PARTS),
    };
    gn_budget_learn(budget, &outcome);
    *out_ms = outcome.ms;
}

static void run(struct gn_bench_rig *rig, int width, double budget_ms)
{
    struct gn_budget budget = {0};
    struct gn_budget_choice choice;
    struct gn_error_sums sums[GN_ERROR_PARTS] = {0};
    struct gn_lighting_state *light = NULL;
    double ms[FRAMES];
    uint64_t misses = 0, switches = 0;
    for (int i = 0; i < FRAMES; i++) {
        if (i == FIRST) {
            misses = budget.n_misses;
            switches = budget.n_switches;
        }
        run_frame(rig, &light, &budget, sums, width, budget_ms, i, &choice, &ms[i]);
    }
    qsort(ms + FIRST, FRAMES - FIRST, sizeof(*ms), gn_compare_doubles);
    printf("%5d %6.0f  %-9s %6d %5d %5d %11.1f %8.1f %6.1f %5d/%d %9d %12.4f %10.4f\n", width,
           budget_ms, gn_budget_get_verdict_name(choice.verdict), choice.setting.n_lights,
           choice.setting.grid, choice.setting.shadow_step, choice.predicted_ms,
           ms[FIRST + (FRAMES - FIRST) / 2], ms[FIRST + (FRAMES - FIRST) * 9 / 10],
           (int)(budget.n_misses - misses), FRAMES - FIRST, (int)(budget.n_switches - switches),
           choice.predicted_error, gn_error_sums_get(sums, GN_ERROR_PARTS));
    gn_lighting_state_unref(&light);
}

int main(void)
{
    static const double budgets_ms[] = {8, 16, 33, 66};
    struct gn_bench_rig rig;
    gn_bench_rig_init(&rig, 0);
    printf("%5s %6s  %-9s %6s %5s %5s %11s %8s %6s %9s %9s %12s %10s\n", "width", "budget",
           "verdict", "lights", "grid", "step", "predicted", "median", "90 %", "late", "switches",
           "pred. error", "estimated");
    for (size_t i = 0; i < sizeof(budgets_ms) / sizeof(budgets_ms[0]); i++) {
        run(&rig, 320, budgets_ms[i]);
        run(&rig, 640, budgets_ms[i]);
    }
    gn_bench_rig_finish(&rig);
    return 0;
}
