/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Each setting of the benchmarks' table gives its number of lights. */
#include "tests/unit/cmocka_setup.h"

#include "tests/bench/seed_settings.h"

static void test_counts(void **state)
{
    static const int paper[GN_SEED_SETTINGS] = {59, 76, 86, 122, 178};
    struct gn_image image;
    struct gn_environment_frame frame;
    (void)state;
    assert_int_equal(gn_seed_take_frame(&image, &frame), 0);
    for (int i = 0; i < GN_SEED_SETTINGS; i++) {
        const struct gn_seed_setting *s = &gn_seed_settings[i];
        struct gn_light_options options = gn_seed_make_options(s);
        struct gn_lighting_state *lights;
        assert_int_equal(gn_lighting_state_create(&frame, NULL, &options, NULL, &lights, NULL), 0);
        assert_int_equal(s->n_lights, paper[i]);
        assert_int_equal(lights->n_lights, paper[i]);
        assert_true(paper[i] != 178 || s->max_ls == 64);
        gn_lighting_state_unref(&lights);
    }
    gn_image_finish(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_counts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
