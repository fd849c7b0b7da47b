/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The partition of a stream of frames: lights keep their names, changes stay where they are. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/partition_plan.h"
#include "server/light/state.h"
#include "tests/light_states.h"

/* In the middle of a region of 4 x 12: theta 52 degrees is the second ring of equal height. */
static const double lamp_dir[3] = {0.7612, 0.2040, 0.6157};

static int find_region(const struct gn_partition_plan *plan, const float dir[static 3])
{
    double polar[2];
    const double d[3] = {(double)dir[0], (double)dir[1], (double)dir[2]};
    gn_partition_plan_get_world_polar(plan, d, polar);
    return polar[0] > plan->theta_max ? -1 : gn_partition_plan_find_region(plan, polar);
}

/* Blinks a lamp in one region; outside of it, and of the dark cell that it lies in, every light
 * stays, in number and to the bit in direction. */
static void a_blinking_lamp_stays_in_its_region(void **unused)
{
    (void)unused;
    static const enum gn_projection_type types[2] = {GN_PROJECTION_FISHEYE_EQUIDISTANT,
                                                     GN_PROJECTION_LATLONG};
    for (int t = 0; t < 2; t++) {
        struct light_fixture f;
        struct gn_light_options options = {.rings = 4, .sectors = 12};
        make_room(&f, types[t], 192, t ? 96 : 192);
        set_lamp(&f, lamp_dir, 0.2f);
        struct gn_lighting_state *state = make_state(&f, &options, NULL);
        struct gn_lighting_state *first = gn_lighting_state_ref(state);
        const float lamp[3] = {(float)lamp_dir[0], (float)lamp_dir[1], (float)lamp_dir[2]};
        int lamp_region = find_region(state->plan, lamp);
        int lamp_cell = gn_partition_plan_get_dark_cell(state->plan, lamp_region);
        int n_on = 0, n_off = 0;
        for (int i = 1; i < 100; i++) {
            bool is_on = i < 10 ? i % 2 == 1 : i < 50;
            set_lamp(&f, lamp_dir, is_on ? 30 : 0.2f);
            advance(&f, GN_NS_PER_S / 30, &options, &state);
            const struct gn_lighting_state *pair[2] = {first, state};
            for (int k = 0; k < 2; k++) { // those that were, and those that are
                for (int j = 0; j < pair[k]->n_lights; j++) {
                    const struct gn_light *light = &pair[k]->lights[j];
                    const struct gn_light *other = find_light(pair[1 - k], light->id);
                    int region = find_region(state->plan, light->dir_world);
                    bool is_near = region >= 0 && gn_partition_plan_get_dark_cell(
                                                      state->plan, region) == lamp_cell;
                    if (k == 1 && region == lamp_region)
                        *(is_on ? &n_on : &n_off) += 1;
                    if (is_near)
                        continue;
                    assert_non_null(other);
                    assert_memory_equal(light->dir_world, other->dir_world,
                                        sizeof(light->dir_world));
                }
            }
        }
        assert_true(n_on >= 4 * 45 && n_off <= 55);
        gn_lighting_state_unref(&first);
        gn_lighting_state_unref(&state);
        light_fixture_finish(&f);
    }
}

/* Even light lies on the limit between bright and dark, and twice of it on that of two lights. */
static void split_light(const double dir[static 3], float out[static 3])
{
    out[0] = out[1] = out[2] = dir[0] > 0 ? 1 : 2;
}

static void noise_turns_no_region(void **unused)
{
    (void)unused;
    static void (*const fill[3])(const double dir[static 3], float out[static 3]) = {
        light_fixture_room, light_fixture_constant, split_light};
    for (int k = 0; k < 6; k++) {
        struct light_fixture clean, f;
        struct gn_light_options options = {.n_lights = k < 3 ? 0 : GN_LIGHTS_NO_AIM};
        uint32_t random = 1;
        int n_changes = 0;
        make_room(&clean, GN_PROJECTION_FISHEYE_EQUIDISTANT, 100, 100);
        make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 100, 100);
        light_fixture_fill(&clean, fill[k % 3]);
        light_fixture_fill(&f, fill[k % 3]);
        struct gn_lighting_state *state = make_state(&f, &options, NULL);
        for (int i = 0; i < 30; i++) {
            add_noise(&clean, &f, &random);
            struct gn_lighting_state *before = gn_lighting_state_ref(state);
            advance(&f, GN_NS_PER_S / 30, &options, &state);
            n_changes += count_new(before, state) + count_new(state, before);
            gn_lighting_state_unref(&before);
        }
        print_message("# births and deaths in 30 frames: %d\n", n_changes);
        assert_true(n_changes < 3);
        gn_lighting_state_unref(&state);
        light_fixture_finish(&f);
        light_fixture_finish(&clean);
    }
}

static float lamp_radiance;

static void even_with_lamp(const double dir[static 3], float out[static 3])
{
    out[0] = out[1] = out[2] = is_on_lamp(lamp_dir, dir) ? lamp_radiance : 1;
}

static int count_in_lamps_region(const struct gn_lighting_state *state)
{
    const float lamp[3] = {(float)lamp_dir[0], (float)lamp_dir[1], (float)lamp_dir[2]};
    int region = find_region(state->plan, lamp), n = 0;
    for (int i = 0; i < state->n_lights; i++)
        n += find_region(state->plan, state->lights[i].dir_world) == region;
    return n;
}

/* A lamp grows slowly and fades slowly: its region is cut later, and made whole later. */
static void a_region_is_cut_with_hysteresis(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_light_options options = {.n_lights = GN_LIGHTS_NO_AIM, .rings = 4, .sectors = 12};
    double cut_at = 0, whole_at = 0;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 150, 150);
    lamp_radiance = 1;
    light_fixture_fill(&f, even_with_lamp);
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_int_equal(count_in_lamps_region(state), 1);
    const double share = 0.0239 / (2 * acos(-1) / 48); // of the region that is lamp
    for (int i = 0; i <= 400; i++) {
        double mean = 1.9 + 0.3 * (i < 200 ? i : 400 - i) / 200; // of the region
        lamp_radiance = (float)(1 + (mean - 1) / share);
        light_fixture_fill(&f, even_with_lamp);
        advance(&f, GN_NS_PER_S / 30, &options, &state);
        if (cut_at == 0 && count_in_lamps_region(state) == 2)
            cut_at = mean;
        if (i > 200 && whole_at == 0 && count_in_lamps_region(state) == 1)
            whole_at = mean;
    }
    assert_near(cut_at, 2 * 1.05, 0.03); // the lamp's texels are counted whole
    assert_near(cut_at / whole_at, 1.05 / 0.95, 0.005);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

/* The lamps get darker: the number follows within seconds. All light a hundredth: at once,
 * as if there had been no frame before. */
static void the_number_follows_in_time(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_light_options options = {.n_lights = 400};
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 150, 150);
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    int n = state->n_lights, n_before = n;
    for (int i = 0; i < 3 * 150 * 150; i++)
        f.image.data[i] *= f.image.data[i] < 3 ? 1 : 0.3f;
    for (int i = 0; i < 90; i++) {
        advance(&f, GN_NS_PER_S / 30, &options, &state);
        if (i == 0) {
            n_before = state->n_lights;
            assert_true(n_before < 0.7 * n);
        }
        assert_true(state->n_lights >= n_before && state->n_lights <= n_before + 0.1 * n);
        n_before = state->n_lights;
    }
    print_message("# %d lights, with darker lamps %d\n", n, n_before);
    assert_true(n_before >= 0.75 * 400 && n_before < 0.85 * 400);
    for (int i = 0; i < 3 * 150 * 150; i++)
        f.image.data[i] *= 0.01f;
    advance(&f, GN_NS_PER_S / 30, &options, &state);
    options.previous = NULL;
    struct gn_lighting_state *fresh = make_state(&f, &options, NULL);
    assert_same_lights(state, fresh);
    gn_lighting_state_unref(&fresh);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

/* A stream's first light depends on no other stream's, by any method. */
static void another_stream_is_forgotten(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 150, 150);
    for (int method = 0; method < GN_LIGHT_METHOD_COUNT; method++) {
        struct gn_light_options options = {.method = (enum gn_light_method)method, .stream = 1};
        struct gn_lighting_state *other = make_state(&f, &options, NULL);
        set_lamp(&f, lamp_dir, 0.7f);
        options.stream = 2;
        struct gn_lighting_state *fresh = make_state(&f, &options, NULL);
        options.previous = other;
        struct gn_lighting_state *second = make_state(&f, &options, NULL);
        assert_same_lights(second, fresh);
        gn_lighting_state_unref(&other);
        gn_lighting_state_unref(&fresh);
        gn_lighting_state_unref(&second);
        set_lamp(&f, lamp_dir, 20);
    }
    light_fixture_finish(&f);
}

static void names_are_unique(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200);
    static const struct gn_light_options all[] = {
        {.n_lights = 64},
        {.n_lights = 1000},
        {.metric = GN_METRIC_TWICE, .max_ls = 64},
        {.method = GN_LIGHT_PARTITION_SEED, .max_ls = 64},
        {.method = GN_LIGHT_PARTITION_SEED, .metric = GN_METRIC_TWICE, .max_ls = 64},
        {.method = GN_LIGHT_PENROSE, .n_lights = 1000},
    };
    for (size_t k = 0; k < sizeof(all) / sizeof(all[0]); k++) {
        struct gn_lighting_state *state = make_state(&f, &all[k], NULL);
        assert_true(state->n_lights > 20);
        for (int i = 0; i < state->n_lights; i++) {
            assert_true(state->lights[i].id != 0);
            assert_ptr_equal(find_light(state, state->lights[i].id), &state->lights[i]);
        }
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

/* The same bits on one thread and on many, also where the last frame takes part. */
static void threads_do_not_matter(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_pool *pool;
    make_room(&f, GN_PROJECTION_LATLONG, 300, 150);
    assert_int_equal(gn_pool_create(3, &pool), 0);
    struct gn_light_options options = {.n_lights = 200};
    struct gn_lighting_state *first = make_state(&f, &options, NULL);
    set_lamp(&f, lamp_dir, 50);
    options.previous = first;
    struct gn_lighting_state *one = make_state(&f, &options, NULL);
    struct gn_lighting_state *many = make_state(&f, &options, pool);
    assert_same_lights(one, many);
    gn_lighting_state_unref(&first);
    gn_lighting_state_unref(&one);
    gn_lighting_state_unref(&many);
    gn_pool_destroy(&pool);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_blinking_lamp_stays_in_its_region),
        cmocka_unit_test(noise_turns_no_region),
        cmocka_unit_test(a_region_is_cut_with_hysteresis),
        cmocka_unit_test(the_number_follows_in_time),
        cmocka_unit_test(another_stream_is_forgotten),
        cmocka_unit_test(names_are_unique),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
