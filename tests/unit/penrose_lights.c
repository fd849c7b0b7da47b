/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Importance samples as lights: their weights, their identities, and what a stream keeps. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/luminance.h"
#include "server/light/state.h"
#include "tests/light_states.h"

static double get_sum(const struct gn_lighting_state *state, int channel)
{
    double sum = 0;
    for (int i = 0; i < state->n_lights; i++)
        sum += (double)state->lights[i].irradiance[channel];
    return sum;
}

static void weights_add_up_to_the_map(void **unused)
{
    (void)unused;
    static const double tolerance[GN_WEIGHTS_COUNT] = {1e-5, 1e-5, 0.06};
    for (int type = 0; type < 2; type++) {
        struct light_fixture f;
        make_room(&f, type ? GN_PROJECTION_LATLONG : GN_PROJECTION_FISHEYE_EQUIDISTANT,
                  type ? 200 : 120, type ? 100 : 120);
        for (int i = 0; i < 12; i++) {
            struct gn_light_options options = {.method = GN_LIGHT_PENROSE,
                                               .weights = (enum gn_light_weights)(i % 3),
                                               .relaxed = i >= 6,
                                               .n_lights = i % 6 < 3 ? 2000 : 300};
            struct gn_lighting_state *state = make_state(&f, &options, NULL);
            for (int c = 0; c < 3; c++)
                assert_near(get_sum(state, c) / state->total_irradiance[c], 1, tolerance[i % 3]);
            gn_lighting_state_unref(&state);
        }
        light_fixture_finish(&f);
    }
}

static bool is_same_way(const struct gn_light *a, const struct gn_light *b)
{
    return memcmp(a->dir_world, b->dir_world, sizeof(a->dir_world)) == 0;
}

/* Each texel's light goes to the nearest of all directions: against the search through all. */
static void the_partition_is_by_the_nearest_sample(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_ANGULAR, 90, 80);
    f.frame.projection.center[0] = 44.1319; // no two sites are equally near to a texel
    f.frame.projection.center[1] = 40.3171;
    f.frame.projection.radius = 39.217;
    f.frame.projection.focal = 0;
    light_fixture_fill(&f, light_fixture_room);
    struct gn_light_options options = {
        .method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_EQUAL, .n_lights = 90};
    struct gn_lighting_state *sites = make_state(&f, &options, NULL);
    options.weights = GN_WEIGHTS_PARTITION;
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_int_equal(sites->n_lights, state->n_lights);
    const struct gn_radiance_map *map = state->map;
    double *power = calloc((size_t)state->n_lights, sizeof(*power));
    assert_non_null(power);
    for (int t = 0; t < 90 * 80; t++) {
        const float *d = map->direction_world + 3 * t;
        double best = INFINITY;
        int nearest = 0, n_shared = 0;
        for (int i = 0; i < sites->n_lights; i++) {
            double squared = 0;
            for (int c = 0; c < 3; c++)
                squared += pow((double)sites->lights[i].dir_world[c] - (double)d[c], 2);
            nearest = squared < best ? i : nearest;
            best = fmin(best, squared);
        }
        for (int i = 0; i < sites->n_lights; i++)
            n_shared += is_same_way(&sites->lights[i], &sites->lights[nearest]);
        for (int i = 0; i < sites->n_lights; i++)
            if (is_same_way(&sites->lights[i], &sites->lights[nearest]))
                power[i] +=
                    (double)map->solid_angle[t] * (double)map->radiance.data[3 * t] / n_shared;
    }
    for (int i = 0; i < state->n_lights; i++) {
        int k = 0;
        while (k < sites->n_lights && sites->lights[k].id != state->lights[i].id)
            k++;
        assert_true(k < sites->n_lights);
        assert_near(state->lights[i].irradiance[0] / (float)power[k], 1, 1e-5);
        assert_true(state->lights[i].angular_radius > 0);
    }
    free(power);
    gn_lighting_state_unref(&sites);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

/* More samples than texels: those of one texel share its light. */
static void samples_without_texels_share(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 12, 12);
    struct gn_light_options options = {
        .method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_PARTITION, .n_lights = 1500};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_true(state->n_lights > 12 * 12);
    for (int c = 0; c < 3; c++)
        assert_near(get_sum(state, c) / state->total_irradiance[c], 1, 1e-5);
    for (int i = 0; i < state->n_lights; i++)
        assert_true(gn_luminance(state->lights[i].irradiance) > 0);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void threads_do_not_matter(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_pool *pool;
    make_room(&f, GN_PROJECTION_LATLONG, 300, 150);
    assert_int_equal(gn_pool_create(3, &pool), 0);
    struct gn_light_options options = {
        .method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_PARTITION, .n_lights = 200};
    struct gn_lighting_state *one = make_state(&f, &options, NULL);
    struct gn_lighting_state *many = make_state(&f, &options, pool);
    assert_same_lights(one, many);
    gn_lighting_state_unref(&one);
    gn_lighting_state_unref(&many);
    gn_pool_destroy(&pool);
    light_fixture_finish(&f);
}

static const double lamp_dir[3] = {1, 0, 0};

static void a_blinking_lamp_moves_no_other_sample(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_light_options options = {.method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_EQUAL};
    make_room(&f, GN_PROJECTION_LATLONG, 128, 64);
    set_lamp(&f, lamp_dir, 0.2f);
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    struct gn_lighting_state *first = gn_lighting_state_ref(state);
    for (int i = 1; i < 90; i++) {
        bool is_on = i / 30 % 2 == 0;
        set_lamp(&f, lamp_dir, is_on ? 40 : 0.2f);
        advance(&f, GN_NS_PER_S / 30, &options, &state);
        int n_on_lamp = 0, n_lost = 0;
        for (int k = 0; k < first->n_lights; k++)
            n_lost += first->lights[k].dir_world[0] <= 0.9962f &&
                      find_light(state, first->lights[k].id) == NULL;
        assert_int_equal(n_lost, 0);
        for (int k = 0; k < state->n_lights; k++) {
            const struct gn_light *light = &state->lights[k];
            const struct gn_light *before = find_light(first, light->id);
            if (light->dir_world[0] > 0.9962f) {
                n_on_lamp++;
                continue;
            }
            assert_non_null(before);
            assert_memory_equal(light->dir_world, before->dir_world, sizeof(light->dir_world));
        }
        assert_true(is_on ? n_on_lamp > 2 : n_on_lamp < 2);
    }
    gn_lighting_state_unref(&first);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void noise_bears_no_samples(void **unused)
{
    (void)unused;
    struct light_fixture clean, f;
    struct gn_light_options options = {.method = GN_LIGHT_PENROSE};
    make_room(&clean, GN_PROJECTION_FISHEYE_EQUIDISTANT, 150, 150);
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 150, 150);
    uint32_t random = 1;
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    int n_changes = 0;
    for (int i = 0; i < 40; i++) {
        add_noise(&clean, &f, &random);
        struct gn_lighting_state *before = gn_lighting_state_ref(state);
        advance(&f, GN_NS_PER_S / 30, &options, &state);
        n_changes += count_new(before, state) + count_new(state, before);
        gn_lighting_state_unref(&before);
    }
    print_message("# births and deaths in 40 frames: %d\n", n_changes);
    assert_true(n_changes < 4); // one in ten frames
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
    light_fixture_finish(&clean);
}

/* Twice the light everywhere: the number comes back in a few seconds, at any rate as fast. */
static void the_number_comes_back_in_time(void **unused)
{
    (void)unused;
    for (int rate = 16; rate <= 256; rate *= 4) {
        struct light_fixture f;
        struct gn_light_options options = {.method = GN_LIGHT_PENROSE};
        make_room(&f, GN_PROJECTION_LATLONG, 128, 64);
        struct gn_lighting_state *state = make_state(&f, &options, NULL);
        int n = state->n_lights;
        for (int i = 0; i < 3 * 128 * 64; i++)
            f.image.data[i] *= 2;
        for (int i = 0; i < rate / 2; i++) {
            advance(&f, GN_NS_PER_S / rate, &options, &state);
            if (i == 0)
                assert_true(state->n_lights > 1.7 * n);
        }
        double expected = n * pow(2, exp(-0.5)); // of the gap in the logarithm e^-0.5 is left
        assert_near(state->n_lights, expected, 0.05 * expected);
        for (int i = 0; i < 3 * 128 * 64; i++)
            f.image.data[i] *= 1000; // at once
        advance(&f, 0, &options, &state);
        assert_near(state->n_lights, n, 0.1 * n);
        gn_lighting_state_unref(&state);
        light_fixture_finish(&f);
    }
}

/* The rows are one below the other in the picture, and far apart on the sphere. */
static void equal_lights_keep_their_colours_across_a_cube_s_faces(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_CUBE, 64, 0), 0);
    f.frame.codes = &f.image;
    gn_image_at(&f.image, 20, 63)[0] = 1 / 0.2126f; // of equal luminance
    gn_image_at(&f.image, 20, 64)[2] = 1 / 0.0722f;
    struct gn_light_options options = {
        .method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_EQUAL, .n_lights = 64, .no_discs = true};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    int n_red = 0, n_blue = 0;
    for (int i = 0; i < state->n_lights; i++) {
        const float *e = state->lights[i].irradiance;
        n_red += e[0] > 0 && e[2] == 0;
        n_blue += e[2] > 0 && e[0] == 0;
    }
    assert_true(n_red > 0 && n_blue > 0);
    assert_int_equal(n_red + n_blue, state->n_lights);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

/* Either side of a lat-long's seam is beside the other. */
static void equal_lights_see_over_a_seam(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 128, 64), 0);
    f.frame.codes = &f.image;
    gn_image_at(&f.image, 0, 30)[0] = 1 / 0.2126f;
    gn_image_at(&f.image, 127, 30)[2] = 1 / 0.0722f;
    struct gn_light_options options = {
        .method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_EQUAL, .n_lights = 64, .no_discs = true};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_true(state->n_lights > 0);
    for (int i = 0; i < state->n_lights; i++) {
        const float *e = state->lights[i].irradiance;
        assert_true(e[0] > 0 && e[2] > 0);
    }
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_add_up_to_the_map),
        cmocka_unit_test(the_partition_is_by_the_nearest_sample),
        cmocka_unit_test(samples_without_texels_share),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(a_blinking_lamp_moves_no_other_sample),
        cmocka_unit_test(noise_bears_no_samples),
        cmocka_unit_test(the_number_comes_back_in_time),
        cmocka_unit_test(equal_lights_keep_their_colours_across_a_cube_s_faces),
        cmocka_unit_test(equal_lights_see_over_a_seam),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
