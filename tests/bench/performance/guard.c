/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What makes the paper's hardest frame fast stays, and stays right: the picture is the naive
 * loop's, and no more rays are traced than before. Counts only, no times; 160 x 120.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/bench/performance/naive.h"
#include "tests/bench/performance/performance.h"

#define WIDTH 160
#define N_LIGHTS 122

/** Percent of the naive loop's rays that may be left; lower them as the renderer gets better. */
#define PAPER_LIMIT 1.4
#define INTERACTIVE_LIMIT 3.0

struct stage {
    struct gn_bench_rig rig;
    struct gn_lighting_state *light;
    struct gn_naive naive;
    struct gn_image shadow; // the renderer's
};

static int set_up(void **state)
{
    static struct stage s;
    gn_bench_rig_init(&s.rig, 1);
    gn_bench_rig_aim(&s.rig, WIDTH);
    s.light = gn_bench_rig_make_seed_light(&s.rig, N_LIGHTS);
    *state = &s;
    return gn_naive_init(&s.naive, s.rig.scene, s.rig.pool, &s.rig.camera, s.light) ||
           gn_image_init(&s.shadow, s.rig.camera.width, s.rig.camera.height, 3);
}

static int tear_down(void **state)
{
    struct stage *s = *state;
    gn_image_finish(&s->shadow);
    gn_naive_finish(&s->naive);
    gn_lighting_state_unref(&s->light);
    gn_bench_rig_finish(&s->rig);
    return 0;
}

/** Renders, then compares with the loop in both orders. Shares of the loop's rays, percent. */
static double compare(struct stage *s, const struct gn_render_options *options,
                      enum gn_naive_real real)
{
    struct gn_render_options without = *options;
    without.no_shadow = true;
    double share = 100;
    gn_bench_rig_render(&s->rig, s->light, options);
    uint64_t rays = s->rig.report.rays_shadow;
    assert_true(s->rig.report.n_shadow_pixels > 400); // there is something to see
    memcpy(s->shadow.data, s->rig.layers.shadow.data,
           3 * sizeof(float) * (size_t)s->shadow.width * (size_t)s->shadow.height);
    for (int order = 0; order < GN_NAIVE_ORDERS; order++) {
        s->naive.order = (enum gn_naive_order)order;
        s->naive.real = real;
        s->naive.is_unweighted = options->quality == GN_QUALITY_SEED;
        gn_bench_rig_render(&s->rig, s->light, &without);
        gn_naive_run(&s->naive, s->rig.layers.shadow.data);
        struct gn_shadow_difference d = gn_performance_compare(&s->shadow, &s->rig.layers.shadow);
        share = 100.0 * (double)rays / (double)s->naive.n_rays;
        print_message("# %s outside: %lld pixels off, at most %.2g; %.3f %% of its rays\n",
                      order == GN_NAIVE_PIXELS_OUTER ? "pixels" : "lights", (long long)d.n_off,
                      d.largest_code, share);
        assert_int_equal(d.n_off, 0);
    }
    return share;
}

static void test_paper(void **state)
{
    const struct gn_render_options options = {.quality = GN_QUALITY_SEED};
    assert_true(compare(*state, &options, GN_NAIVE_NO_REAL) < PAPER_LIMIT);
}

static void test_interactive(void **state)
{
    const struct gn_render_options options = {.single_ray = true};
    assert_true(compare(*state, &options, GN_NAIVE_REAL_FIRST) < INTERACTIVE_LIMIT);
    (void)compare(*state, &options, GN_NAIVE_REAL_WHERE_CUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_paper),
        cmocka_unit_test(test_interactive),
    };
    return cmocka_run_group_tests_name("performance_guard", tests, set_up, tear_down);
}
