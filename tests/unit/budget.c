/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The controller of quality, with frames that are simulated: no clock. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "server/render/budget.h"

/** A machine, a view and what they make of a setting. */
struct world {
    uint64_t random;
    double load;    // factor on all times
    double noise;   // standard deviation of the times' logarithm
    double hiccups; // share of frames that take three times as long
    double object;  // share of samples that shading and shadow work on
    double error;   // of one light
    double jump;    // factor on the shadow pass from 32 lights on; 0: none
    int n_lights;   // that there are
    int64_t n_pixels;
    double budget_ms;
    struct gn_budget budget;
    struct gn_budget_choice choice;
    double ms; // of the last frame
};

static double next_unit(struct world *w)
{
    w->random = w->random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(w->random >> 11) + 0.5) * 0x1p-53;
}

static double next_normal(struct world *w)
{
    double r = sqrt(-2 * log(next_unit(w)));
    return r * cos(2 * M_PI * next_unit(w));
}

/** Not the controller's own formula: passes have powers of the lights. */
static void get_outcome(const struct world *w, const struct gn_budget_setting *s,
                        struct gn_budget_outcome *o)
{
    double share = 0.06 + 0.1 / (1 + s->n_lights); // fewer lights, more edges between them
    double samples = (double)w->n_pixels * (1 + (s->grid > 1 ? share * s->grid * s->grid : 0));
    double step = s->shadow_step == 1 ? 1 : s->shadow_step == 2 ? 0.5 : 0.35;
    o->ms_plan = 0.3 + 0.004 * s->n_lights;
    o->ms_primary = 9e-6 * samples;
    o->ms_shade = w->object * samples * (2e-6 + 1.2e-6 * pow(s->n_lights, 0.9));
    o->ms_shadow = samples * step * (2e-6 + 0.3e-6 * pow(s->n_lights, 0.95));
    if (w->jump > 0 && s->n_lights >= 32)
        o->ms_shadow *= w->jump;
    o->n_refined_pixels = s->grid > 1 ? (int64_t)(share * (double)w->n_pixels) : 0;
    o->ms = o->ms_plan + o->ms_primary + o->ms_shade + o->ms_shadow + 6e-6 * (double)w->n_pixels;
    o->n_lights = 0;
    o->estimated_error = w->error * pow(s->n_lights, -0.8);
}

static void run_frame(struct world *w)
{
    const struct gn_budget_frame frame = {w->budget_ms, w->n_pixels, w->n_lights, 4};
    struct gn_budget_outcome o;
    gn_budget_choose(&w->budget, &frame, &w->choice);
    get_outcome(w, &w->choice.setting, &o);
    double factor = w->load * exp(w->noise * next_normal(w));
    if (next_unit(w) < w->hiccups)
        factor *= 3;
    o.ms *= factor;
    o.ms_plan *= factor;
    o.ms_primary *= factor;
    o.ms_shade *= factor;
    o.ms_shadow *= factor;
    w->ms = o.ms;
    gn_budget_learn(&w->budget, &o);
}

static struct world make_world(uint64_t seed, double budget_ms)
{
    return (struct world){.random = seed,
                          .load = 1,
                          .object = 0.15,
                          .error = 0.4,
                          .n_lights = 256,
                          .n_pixels = 640 * 480,
                          .budget_ms = budget_ms};
}

/** The least error that fits, by trying all. */
static double get_best_error(const struct world *w)
{
    double best = INFINITY;
    for (int n = 4; n <= w->n_lights; n++) {
        for (int i = 0; i < 9; i++) {
            const struct gn_budget_setting s = {n, 1 + i % 3, 1 << i / 3};
            struct gn_budget_outcome o;
            get_outcome(w, &s, &o);
            if (o.ms * w->load <= w->budget_ms)
                best = fmin(best, o.estimated_error);
        }
    }
    return best;
}

static const double budgets[] = {8, 12, 16, 24, 33, 48, 66};

static void test_a_quiet_machine_is_used_and_held(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof(budgets) / sizeof(budgets[0]); i++) {
        struct world w = make_world(1 + i, budgets[i]);
        for (int k = 0; k < 60; k++)
            run_frame(&w);
        uint64_t switches = w.budget.n_switches, misses = w.budget.n_misses;
        for (int k = 0; k < 300; k++)
            run_frame(&w);
        double error = w.error * pow(w.choice.setting.n_lights, -0.8), best = get_best_error(&w);
        print_message("# %g ms: %d lights, grid %d, step %d: %.1f ms, predicted %.1f; error %.4f, "
                      "best %.4f; misses %d\n",
                      budgets[i], w.choice.setting.n_lights, w.choice.setting.grid,
                      w.choice.setting.shadow_step, w.ms, w.choice.predicted_ms, error, best,
                      (int)w.budget.n_misses);
        assert_int_equal(w.budget.n_switches, switches);
        assert_int_equal(w.budget.n_misses, misses);
        assert_int_equal(w.choice.verdict, GN_BUDGET_FITS);
        assert_true(w.ms <= budgets[i]);
        assert_float_equal(w.choice.predicted_ms / w.ms, 1, 0.02);
        // Of the lights alone; grid and step are worth some of them.
        assert_true(error < 2 * best);
        double other =
            sqrt(fmax(0, w.choice.predicted_error * w.choice.predicted_error - error * error));
        assert_true(w.choice.predicted_error >= 0.9 * error && other < 0.03);
    }
}

static void test_noise_makes_no_swings(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof(budgets) / sizeof(budgets[0]); i++) {
        for (int noise = 1; noise <= 3; noise++) {
            struct world w = make_world(100 * i + (uint64_t)noise, budgets[i]);
            w.noise = 0.05 * noise;
            w.hiccups = 0.01 * noise;
            for (int k = 0; k < 100; k++)
                run_frame(&w);
            uint64_t switches = w.budget.n_switches, misses = w.budget.n_misses;
            for (int k = 0; k < 1000; k++)
                run_frame(&w);
            switches = w.budget.n_switches - switches;
            misses = w.budget.n_misses - misses;
            print_message("# %g ms, noise %.2f, hiccups %.2f: %d switches, %d misses of 1000\n",
                          budgets[i], w.noise, w.hiccups, (int)switches, (int)misses);
            assert_true(switches <= 30);
            assert_true(misses <= 120);
        }
    }
}

/** From one number of lights to the next a pass takes several times longer. */
static void test_a_jump_is_not_tried_again_and_again(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof(budgets) / sizeof(budgets[0]); i++) {
        struct world w = make_world(50 + i, budgets[i]);
        w.noise = 0.04;
        w.jump = 4;
        for (int k = 0; k < 60; k++)
            run_frame(&w);
        uint64_t switches = w.budget.n_switches, misses = w.budget.n_misses;
        for (int k = 0; k < 1000; k++)
            run_frame(&w);
        switches = w.budget.n_switches - switches;
        misses = w.budget.n_misses - misses;
        print_message("# %g ms, a jump at 32 lights: %d lights, grid %d; %d switches, %d misses of "
                      "1000\n",
                      budgets[i], w.choice.setting.n_lights, w.choice.setting.grid, (int)switches,
                      (int)misses);
        assert_true(switches <= 12);
        assert_true(misses <= 100);
    }
}

static void test_a_step_of_load_is_followed(void **state)
{
    (void)state;
    for (int seed = 0; seed < 20; seed++) {
        struct world w = make_world(7 + (uint64_t)seed, 33);
        w.noise = 0.03;
        for (int k = 0; k < 200; k++)
            run_frame(&w);
        int before = w.choice.setting.n_lights;
        w.load = 2;
        for (int k = 0; k < 4; k++)
            run_frame(&w);
        int late = 0;
        for (int k = 0; k < 40; k++) {
            run_frame(&w);
            late += w.ms > w.budget_ms;
        }
        int under = w.choice.setting.n_lights;
        assert_true(late <= 3);
        assert_true(under < before);
        w.load = 1;
        for (int k = 0; k < 150; k++)
            run_frame(&w);
        print_message("# load: %d lights, under twice the load %d, %d late; after it %d\n", before,
                      under, late, w.choice.setting.n_lights);
        assert_true(w.choice.setting.n_lights > under);
        assert_true(3 * w.choice.setting.n_lights >= 2 * before);
    }
}

static void test_an_object_that_comes_near_is_followed(void **state)
{
    (void)state;
    struct world w = make_world(5, 16);
    w.object = 0;
    for (int k = 0; k < 200; k++)
        run_frame(&w);
    w.object = 0.5;
    uint64_t misses = w.budget.n_misses;
    for (int k = 0; k < 100; k++)
        run_frame(&w);
    print_message("# near: %d misses of 100, %d lights\n", (int)(w.budget.n_misses - misses),
                  w.choice.setting.n_lights);
    assert_true(w.budget.n_misses - misses <= 12);
    assert_true(w.ms <= w.budget_ms);
}

static void test_one_late_frame_is_let_pass(void **state)
{
    (void)state;
    struct world w = make_world(5, 33);
    for (int k = 0; k < 100; k++)
        run_frame(&w);
    uint64_t switches = w.budget.n_switches;
    w.load = 5;
    run_frame(&w);
    assert_true(w.ms > w.budget_ms);
    w.load = 1;
    for (int k = 0; k < 50; k++)
        run_frame(&w);
    assert_int_equal(w.budget.n_switches, switches);
}

static void test_extremes(void **state)
{
    (void)state;
    struct world w = make_world(1, 1e-3);
    for (int k = 0; k < 50; k++)
        run_frame(&w);
    assert_int_equal(w.choice.verdict, GN_BUDGET_TOO_SMALL);
    assert_int_equal(w.choice.setting.n_lights, GN_BUDGET_LEAST_LIGHTS);
    assert_int_equal(w.choice.setting.grid, 1);
    assert_int_equal(w.choice.setting.shadow_step, 4);
    assert_int_equal(w.budget.n_misses, 50);

    w = make_world(1, 1e9);
    run_frame(&w);
    assert_int_equal(w.choice.verdict, GN_BUDGET_LEARNS);
    assert_true(w.choice.predicted_ms < 0 && w.choice.predicted_error < 0);
    for (int k = 0; k < 50; k++)
        run_frame(&w);
    assert_int_equal(w.choice.setting.n_lights, 256);
    assert_int_equal(w.choice.setting.grid, 3);
    assert_int_equal(w.choice.setting.shadow_step, 1);
    assert_int_equal(w.choice.verdict, GN_BUDGET_FITS);

    w = make_world(1, 33);
    w.n_lights = 0;
    for (int k = 0; k < 50; k++)
        run_frame(&w);
    assert_int_equal(w.choice.setting.n_lights, 0);
    assert_true(isfinite(w.choice.predicted_ms) && w.choice.predicted_ms > 0);
    w.n_lights = 3; // light comes
    for (int k = 0; k < 50; k++)
        run_frame(&w);
    assert_int_equal(w.choice.setting.n_lights, 3);
}

static void test_numbers_that_are_none(void **state)
{
    (void)state;
    static const double bad[] = {NAN, INFINITY, -INFINITY, -1, 0, 1e308};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        struct world w = make_world(1, 33);
        for (int k = 0; k < 30; k++)
            run_frame(&w);
        struct gn_budget_outcome o = {bad[i], bad[i], bad[i], bad[i], bad[i], -5, bad[i], -7};
        const struct gn_budget_frame frame = {bad[i], -1, -1, -1};
        struct gn_budget_choice choice;
        gn_budget_learn(&w.budget, &o);
        gn_budget_choose(&w.budget, &frame, &choice);
        assert_int_equal(choice.setting.n_lights, 0);
        assert_in_range(choice.setting.grid, 1, 3);
        assert_true(isfinite(choice.predicted_ms));
        gn_budget_learn(&w.budget, &o);
        for (int k = 0; k < 100; k++) {
            run_frame(&w);
            assert_true(isfinite(w.choice.predicted_ms) && isfinite(w.choice.predicted_error));
        }
        assert_true(w.ms <= w.budget_ms);
        assert_true(w.choice.setting.n_lights > 16);
    }
}

static void test_a_size_is_foreseen(void **state)
{
    (void)state;
    struct world w = make_world(3, 33);
    for (int k = 0; k < 100; k++)
        run_frame(&w);
    w.n_pixels *= 2;
    run_frame(&w);
    assert_true(w.ms <= w.budget_ms);
    assert_float_equal(w.choice.predicted_ms / w.ms, 1, 0.1);
    w.n_pixels /= 2;
    w.budget_ms = 12;
    run_frame(&w);
    assert_true(w.ms <= w.budget_ms);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_quiet_machine_is_used_and_held),
        cmocka_unit_test(test_noise_makes_no_swings),
        cmocka_unit_test(test_a_jump_is_not_tried_again_and_again),
        cmocka_unit_test(test_a_step_of_load_is_followed),
        cmocka_unit_test(test_an_object_that_comes_near_is_followed),
        cmocka_unit_test(test_one_late_frame_is_let_pass),
        cmocka_unit_test(test_extremes),
        cmocka_unit_test(test_numbers_that_are_none),
        cmocka_unit_test(test_a_size_is_foreseen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
