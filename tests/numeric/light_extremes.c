/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Traps of light: each test is named by what goes wrong where its remedy is missing. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/pool.h"
#include "server/light/luminance.h"
#include "server/light/map_samples.h"
#include "server/light/map_table.h"
#include "server/light/sh.h"
#include "server/light/state.h"
#include "tests/light_states.h"

static const double pi = 3.14159265358979323846;

/* All methods, then all without discs for small suns, then other ways of theirs. */
static const struct gn_light_options methods[] = {
    {.method = GN_LIGHT_PARTITION_ENERGY},
    {.method = GN_LIGHT_PARTITION_SEED},
    {.method = GN_LIGHT_PENROSE},
    {.method = GN_LIGHT_MEDIAN_CUT},
    {.method = GN_LIGHT_VARIANCE},
    {.method = GN_LIGHT_INVERSION},
    {.method = GN_LIGHT_QUADTREE},
    {.method = GN_LIGHT_PARTITION_ENERGY, .no_discs = true},
    {.method = GN_LIGHT_PENROSE, .no_discs = true},
    {.method = GN_LIGHT_MEDIAN_CUT, .no_discs = true},
    {.method = GN_LIGHT_VARIANCE, .no_discs = true},
    {.method = GN_LIGHT_INVERSION, .no_discs = true},
    {.method = GN_LIGHT_QUADTREE, .no_discs = true},
    {.method = GN_LIGHT_PARTITION_ENERGY, .n_lights = 500},
    {.method = GN_LIGHT_PARTITION_ENERGY, .metric = GN_METRIC_TWICE},
    {.method = GN_LIGHT_PARTITION_SEED, .max_ls = 4096},
    {.method = GN_LIGHT_PARTITION_SEED, .metric = GN_METRIC_TWICE, .max_ls = 4096},
    {.method = GN_LIGHT_PENROSE, .n_lights = 4096},
    {.method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_DENSITY, .relaxed = true},
    {.method = GN_LIGHT_PENROSE, .weights = GN_WEIGHTS_PARTITION, .no_discs = true},
};
enum { N_METHODS = sizeof(methods) / sizeof(methods[0]) };
static_assert(GN_LIGHT_METHOD_COUNT == 7, "a method is missing from the list");

static double worst_balance; // of all states of a test

static const char *get_name(int m)
{
    return gn_light_method_get_name(methods[m].method);
}

/* Not as the paper reads, nor where samples are weighted by their density: an estimate. */
static bool keeps_energy(const struct gn_light_options *options)
{
    return options->method != GN_LIGHT_PARTITION_SEED && options->weights != GN_WEIGHTS_DENSITY;
}

static void check_finite(const struct gn_lighting_state *s, const struct gn_light_options *options)
{
    double sum[3] = {0};
    assert_true(s->n_lights >= 0 && s->n_lights <= GN_LIGHTS_MAX);
    for (int i = 0; i < s->n_lights; i++) {
        const struct gn_light *l = &s->lights[i];
        double n = 0;
        for (int c = 0; c < 3; c++) {
            n += (double)l->dir_world[c] * (double)l->dir_world[c];
            sum[c] += (double)l->irradiance[c];
            assert_true(l->irradiance[c] >= 0 && isfinite(l->irradiance[c]));
        }
        assert_near(n, 1, 1e-5);
        assert_true(l->angular_radius >= 0 && (double)l->angular_radius <= pi + 1e-6);
    }
    for (int k = 0; k < 9; k++)
        for (int c = 0; c < 3; c++)
            assert_true(isfinite(s->sh[k][c]));
    for (int c = 0; c < 3; c++)
        assert_true(isfinite(s->map->fill[c]) && isfinite(s->total_irradiance[c]));
    for (int c = 0; c < 3 && keeps_energy(options) && s->figures.n_dropped == 0; c++) {
        double off = fabs(sum[c] - s->total_irradiance[c]);
        if (!(off <= 1e-5 * s->total_irradiance[c]))
            fail_msg("%s: lights %.9g, map %.9g", gn_light_method_get_name(options->method), sum[c],
                     s->total_irradiance[c]);
        if (off > 0)
            worst_balance = fmax(worst_balance, off / s->total_irradiance[c]);
    }
}

static void check_all_methods(const struct light_fixture *f)
{
    worst_balance = 0;
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *state = make_state(f, &methods[m], NULL);
        check_finite(state, &methods[m]);
        gn_lighting_state_unref(&state);
    }
}

static void print_balance(const char *what)
{
    print_message("# %s: lights add up to the map within %.1e\n", what, worst_balance);
}

static void trap_1_a_sun_of_1e9(void **unused)
{
    (void)unused;
    static const double suns[3] = {1e9, 1e20, 3e38};
    for (int i = 0; i < 3; i++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 128, 64), 0);
        light_fixture_fill(&f, light_fixture_room);
        for (int c = 0; c < 3; c++)
            gn_image_at(&f.image, 33, 17)[c] = (float)suns[i];
        check_all_methods(&f);
        light_fixture_finish(&f);
        print_balance("a sun");
    }
}

/* What is lit in double but vanishes in the units of the brightest: 48 decades below. */
static void trap_7_light_below_the_range_of_floats(void **unused)
{
    (void)unused;
    const struct gn_light_options options = {.n_lights = 4096, .rings = 4, .sectors = 8};
    struct gn_pool *pool = NULL;
    struct light_fixture f;
    assert_int_equal(gn_pool_create(4, &pool), 0);
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 2048, 1024), 0);
    light_fixture_fill(&f, light_fixture_constant);
    for (int i = 0; i < 3 * 2048 * 1024; i++)
        f.image.data[i] = i / 3 % 547 == 0 ? 1e30f : 1e-18f;
    struct gn_lighting_state *one = make_state(&f, &options, NULL);
    struct gn_lighting_state *many = make_state(&f, &options, pool);
    check_finite(one, &options);
    assert_same_lights(many, one);
    gn_lighting_state_unref(&one);
    gn_lighting_state_unref(&many);
    light_fixture_finish(&f);
    gn_pool_destroy(&pool);
}

static void trap_2_nan_inf_negative(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, light_fixture_room);
    struct gn_lighting_state *clean = make_state(&f, NULL, NULL);
    double lost = 0;
    static const int at[2][2] = {{100, 50}, {300, 90}};
    for (int i = 0; i < 2; i++) {
        lost += (double)gn_image_at(&f.image, at[i][0], at[i][1])[1] *
                gn_projection_get_solid_angle(&f.frame.projection, at[i][0], at[i][1]);
        gn_image_at(&f.image, at[i][0], at[i][1])[1] = i ? -5.0f : NAN;
    }
    float before = gn_image_at(&f.image, 200, 30)[1];
    gn_image_at(&f.image, 200, 30)[1] = INFINITY;
    struct gn_lighting_state *mended = make_state(&f, NULL, NULL);
    float after = gn_image_at(&mended->map->radiance, 200, 30)[1];
    lost += (double)(before - after) * gn_projection_get_solid_angle(&f.frame.projection, 200, 30);
    assert_near(clean->total_irradiance[1] - mended->total_irradiance[1], lost,
                1e-6 * lost + 1e-12);
    check_finite(mended, &methods[0]);
    gn_lighting_state_unref(&clean);
    gn_lighting_state_unref(&mended);
    check_all_methods(&f);
    for (int i = 0; i < 3 * 512 * 256; i++)
        f.image.data[i] = i % 3 == 0 ? NAN : i % 3 == 1 ? INFINITY : -INFINITY;
    check_all_methods(&f);
    light_fixture_finish(&f);
}

static void trap_3_all_black(void **unused)
{
    (void)unused;
    static const enum gn_projection_type types[2] = {GN_PROJECTION_LATLONG,
                                                     GN_PROJECTION_FISHEYE_EQUIDISTANT};
    for (int t = 0; t < 2; t++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, types[t], 64, 64), 0);
        f.frame.codes = &f.image;
        for (int m = 0; m < N_METHODS; m++) {
            struct gn_lighting_state *state = make_state(&f, &methods[m], NULL);
            assert_int_equal(state->n_lights, 0);
            assert_int_equal(state->figures.n_samples, 0);
            for (int k = 0; k < 9; k++)
                assert_true(state->sh[k][0] == 0 && state->sh[k][2] == 0);
            gn_lighting_state_unref(&state);
        }
        light_fixture_finish(&f);
    }
}

/* The share of the lights' green that comes from within an angle of a direction. */
static double get_share(const struct gn_lighting_state *s, const double dir[static 3],
                        double cos_angle)
{
    double sum = 0, all = 0;
    for (int i = 0; i < s->n_lights; i++) {
        const struct gn_light *l = &s->lights[i];
        double dot = 0;
        for (int c = 0; c < 3; c++)
            dot += dir[c] * (double)l->dir_world[c];
        sum += dot > cos_angle ? (double)l->irradiance[1] : 0;
        all += (double)l->irradiance[1];
    }
    return all > 0 ? sum / all : 0;
}

static void trap_4_one_texel_of_99_percent(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 256, 128), 0);
    light_fixture_fill(&f, light_fixture_constant);
    double w = gn_projection_get_solid_angle(&f.frame.projection, 77, 40), d[3];
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 77, 40)[c] = (float)(99 * (4 * pi - w) / w);
    assert_true(gn_projection_get_direction(&f.frame.projection, 77.5, 40.5, d));
    for (int m = 0; m < N_METHODS; m++) {
        if (methods[m].n_lights || methods[m].max_ls)
            continue;
        for (int n = 8; n <= 512; n *= 4) {
            struct gn_light_options options = methods[m];
            options.n_lights = n;
            struct gn_lighting_state *s = make_state(&f, &options, NULL);
            double share = get_share(s, d, 0.9998); // a texel is 1.4 degrees wide
            if (n == 128)
                print_message("# %-12s%s %.5f of the light from the texel\n", get_name(m),
                              options.no_discs ? ", no discs:" : ":", share);
            // Samples of equal power: to one of them. Shared by nearness: with what is nearest to
            // the texel's points. As the paper reads, the dark is dropped.
            bool is_equal = options.method == GN_LIGHT_PENROSE && options.no_discs &&
                            options.weights == GN_WEIGHTS_EQUAL;
            bool has_more = options.no_discs && (options.method == GN_LIGHT_INVERSION ||
                                                 options.weights == GN_WEIGHTS_PARTITION);
            if (has_more || !keeps_energy(&options))
                assert_true(share >= 0.985);
            else
                assert_near(share, 0.99, is_equal ? 0.01 + 1.0 / n : 0.001);
            gn_lighting_state_unref(&s);
        }
    }
    check_all_methods(&f);
    light_fixture_finish(&f);
    print_balance("a hot texel");
}

static void trap_5_poles_get_no_more_samples(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_radiance_map *map;
    struct gn_error error = {0};
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, light_fixture_constant);
    assert_int_equal(gn_radiance_map_create(&f.frame, NULL, NULL, &map, &error), 0);
    struct gn_scratch *scratch = gn_scratch_borrow(&map->table->scratch);
    struct gn_map_samples samples = {0};
    const struct gn_map_sampling sampling = {.n_wanted = 4000};
    assert_int_equal(gn_map_samples_draw(map, &sampling, scratch, &samples), 0);
    enum { N_BINS = 20 }; // of equal height: of equal solid angle
    int bins[N_BINS] = {0};
    for (int i = 0; i < samples.n; i++) {
        double z = (double)map->direction_world[3 * (size_t)samples.texel[i] + 2];
        int b = (int)(0.5 * (1 - z) * N_BINS);
        bins[b < N_BINS ? b : N_BINS - 1]++;
    }
    double mean = (double)samples.n / N_BINS;
    for (int i = 0; i < N_BINS; i++) // both pole caps among them
        assert_true(fabs(bins[i] - mean) < 3 * sqrt(mean));
    gn_scratch_give_back(&map->table->scratch, &scratch);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void trap_7_sums_lose_nothing_beside_a_sun(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 2048, 1024), 0);
    light_fixture_fill(&f, light_fixture_constant);
    double w = gn_projection_get_solid_angle(&f.frame.projection, 5, 2);
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 5, 2)[c] = 1e9f;
    struct gn_lighting_state *s = make_state(&f, NULL, NULL);
    double rest = s->total_irradiance[0] - (double)1e9f * (double)(float)w;
    assert_near(rest, 4 * pi - w, 1e-4);
    gn_lighting_state_unref(&s);
    light_fixture_finish(&f);
}

static void trap_22_threads_change_no_bit(void **unused)
{
    (void)unused;
    struct gn_pool *pool = NULL;
    assert_int_equal(gn_pool_create(4, &pool), 0);
    static const enum gn_projection_type types[2] = {GN_PROJECTION_LATLONG,
                                                     GN_PROJECTION_FISHEYE_EQUIDISTANT};
    for (int t = 0; t < 2; t++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, types[t], 211, 107), 0);
        light_fixture_fill(&f, light_fixture_room);
        for (int m = 0; m < N_METHODS; m++) {
            struct gn_lighting_state *one = make_state(&f, &methods[m], NULL);
            struct gn_lighting_state *many = make_state(&f, &methods[m], pool);
            assert_int_equal(one->n_lights, many->n_lights);
            for (int i = 0; i < one->n_lights; i++) { // not as bytes: there is padding
                const struct gn_light *a = &one->lights[i], *b = &many->lights[i];
                assert_memory_equal(a->dir_world, b->dir_world, sizeof(a->dir_world));
                assert_memory_equal(&a->angular_radius, &b->angular_radius, sizeof(float));
                assert_memory_equal(a->irradiance, b->irradiance, sizeof(a->irradiance));
                assert_int_equal(a->id, b->id);
            }
            assert_memory_equal(one->sh, many->sh, sizeof(one->sh));
            assert_memory_equal(one->total_irradiance, many->total_irradiance,
                                sizeof(one->total_irradiance));
            gn_lighting_state_unref(&one);
            gn_lighting_state_unref(&many);
        }
        light_fixture_finish(&f);
    }
    gn_pool_destroy(&pool);
}

static void trap_26_more_lights_than_texels(void **unused)
{
    (void)unused;
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        static const int sizes[6][2] = {{1, 1}, {2, 1}, {1, 5}, {3, 3}, {7, 2}, {17, 13}};
        for (int i = 0; i < 6; i++) {
            struct light_fixture f;
            assert_int_equal(
                light_fixture_init(&f, (enum gn_projection_type)type, sizes[i][0], sizes[i][1]), 0);
            light_fixture_fill(&f, light_fixture_constant);
            check_all_methods(&f);
            gn_image_at(&f.image, sizes[i][0] / 2, sizes[i][1] / 2)[0] = 1e6f;
            check_all_methods(&f);
            light_fixture_finish(&f);
        }
    }
}

static void trap_29_the_fill_leaves_the_upper_side_alone(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 100, 100), 0);
    light_fixture_fill(&f, light_fixture_room);
    double e[2][3], below[2][3];
    for (int i = 0; i < 2; i++) {
        struct gn_radiance_map_options options = {.ground_albedo = 0.9f, .no_fill = i == 1};
        struct gn_lighting_state *s;
        struct gn_error error = {0};
        assert_int_equal(gn_lighting_state_create(&f.frame, &options, NULL, NULL, &s, &error), 0);
        const struct gn_lighting_state *state = s;
        gn_sh_get_irradiance(4, state->sh, (double[3]){0, 0, 1}, e[i]);
        gn_sh_get_irradiance(4, state->sh, (double[3]){0, 0, -1}, below[i]);
        gn_lighting_state_unref(&s);
    }
    for (int c = 0; c < 3; c++) {
        assert_near(e[0][c], e[1][c], 1e-6);
        assert_true(below[0][c] > below[1][c] + 0.1);
    }
    light_fixture_finish(&f);
}

static void scales_from_1e_12_to_1e12(void **unused)
{
    (void)unused;
    struct light_fixture f, scaled;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 120, 120), 0);
    assert_int_equal(light_fixture_init(&scaled, GN_PROJECTION_FISHEYE_EQUIDISTANT, 120, 120), 0);
    light_fixture_fill(&f, light_fixture_room);
    scaled.frame.codes = &scaled.image;
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *unit = make_state(&f, &methods[m], NULL);
        for (int exponent = -12; exponent <= 12; exponent += 6) {
            double scale = pow(10, exponent);
            for (int i = 0; i < 3 * 120 * 120; i++)
                scaled.image.data[i] = (float)((double)f.image.data[i] * scale);
            struct gn_lighting_state *s = make_state(&scaled, &methods[m], NULL);
            check_finite(s, &methods[m]);
            assert_int_equal(s->n_lights, unit->n_lights);
            double got[3] = {0}, wanted[3] = {0}; // equals may change places: compare moments
            for (int i = 0; i < s->n_lights; i++)
                for (int c = 0; c < 3; c++) {
                    got[c] += (double)s->lights[i].irradiance[1] / scale *
                              (double)s->lights[i].dir_world[c];
                    wanted[c] += (double)unit->lights[i].irradiance[1] *
                                 (double)unit->lights[i].dir_world[c];
                }
            for (int c = 0; c < 3; c++)
                assert_near(got[c], wanted[c], 1e-5 * unit->total_irradiance[1]);
            gn_lighting_state_unref(&s);
        }
        gn_lighting_state_unref(&unit);
    }
    light_fixture_finish(&f);
    light_fixture_finish(&scaled);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trap_1_a_sun_of_1e9),
        cmocka_unit_test(trap_7_light_below_the_range_of_floats),
        cmocka_unit_test(trap_2_nan_inf_negative),
        cmocka_unit_test(trap_3_all_black),
        cmocka_unit_test(trap_4_one_texel_of_99_percent),
        cmocka_unit_test(trap_5_poles_get_no_more_samples),
        cmocka_unit_test(trap_7_sums_lose_nothing_beside_a_sun),
        cmocka_unit_test(trap_22_threads_change_no_bit),
        cmocka_unit_test(trap_26_more_lights_than_texels),
        cmocka_unit_test(trap_29_the_fill_leaves_the_upper_side_alone),
        cmocka_unit_test(scales_from_1e_12_to_1e12),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
