/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The lights of a state: energy kept, the paper's readings, wanted numbers. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/partition_internal.h"
#include "server/light/sh.h"
#include "server/light/state.h"
#include "tests/light_states.h"

static const double pi = 3.14159265358979323846;

static int count_lights(const struct light_fixture *f, const struct gn_light_options *options)
{
    struct gn_lighting_state *state = make_state(f, options, NULL);
    int n = state->n_lights;
    gn_lighting_state_unref(&state);
    return n;
}

static void check_energy(const struct gn_lighting_state *state, double tolerance)
{
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int i = 0; i < state->n_lights; i++)
            sum += (double)state->lights[i].irradiance[c];
        assert_near(sum / state->total_irradiance[c], 1, tolerance);
    }
    for (int i = 0; i < state->n_lights; i++) {
        const struct gn_light *light = &state->lights[i];
        double n = hypot(hypot((double)light->dir_world[0], (double)light->dir_world[1]),
                         (double)light->dir_world[2]);
        assert_near(n, 1, 1e-6);
        assert_true(light->angular_radius >= 0 && (double)light->angular_radius <= pi);
        if (i > 0)
            assert_true(gn_luminance(light->irradiance) <=
                        gn_luminance(state->lights[i - 1].irradiance));
    }
}

static void energy_is_kept_and_the_number_met(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
    } maps[4] = {{GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200},
                 {GN_PROJECTION_MIRRORBALL, 200, 200},
                 {GN_PROJECTION_ANGULAR, 251, 303},
                 {GN_PROJECTION_LATLONG, 256, 128}};
    static const int wanted[6] = {8, 24, 64, 128, 300, 1000};
    for (int m = 0; m < 4; m++) {
        struct light_fixture f;
        make_room(&f, maps[m].type, maps[m].width, maps[m].height);
        for (int i = 0; i < 12; i++) {
            struct gn_light_options options = {.n_lights = wanted[i % 6],
                                               .method = i < 6 ? GN_LIGHT_PARTITION_ENERGY
                                                               : GN_LIGHT_PENROSE};
            struct gn_lighting_state *state = make_state(&f, &options, NULL);
            check_energy(state, 1e-5);
            assert_near(state->n_lights, wanted[i % 6], 3 + 0.15 * wanted[i % 6]);
            gn_lighting_state_unref(&state);
        }
        light_fixture_finish(&f);
    }
}

static void lights_and_harmonics_agree(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300);
    struct gn_lighting_state *state = make_state(&f, NULL, NULL);
    const struct gn_radiance_map *map = state->map;
    static const double normals[6][3] = {{0, 0, 1},  {0, 0, -1},    {1, 0, 0},
                                         {0, -1, 0}, {0.6, 0, 0.8}, {0, 0.6, -0.8}};
    for (int i = 0; i < 6; i++) {
        const double *n = normals[i];
        double exact = 0, lit = 0, e[3];
        for (int t = 0; t < 300 * 300; t++) {
            const float *d = map->direction_world + 3 * t;
            double dot = n[0] * (double)d[0] + n[1] * (double)d[1] + n[2] * (double)d[2];
            exact +=
                fmax(dot, 0) * (double)map->solid_angle[t] * (double)map->radiance.data[3 * t + 1];
        }
        exact += 0.5 * pi * (1 - n[2]) * (double)map->fill[1]; // the lower half, seen by n
        for (int k = 0; k < state->n_lights; k++) {
            const float *d = state->lights[k].dir_world;
            double dot = n[0] * (double)d[0] + n[1] * (double)d[1] + n[2] * (double)d[2];
            lit += fmax(dot, 0) * (double)state->lights[k].irradiance[1];
        }
        gn_sh_get_irradiance(2, (const double(*)[3])state->sh, n, e);
        /* Full power from the centroid of a cell of 60 by up to 60 degrees (the fill's) gives too
         * much on a plane that faces it: by up to 5.6 %. */
        assert_near(lit / exact, 1, 0.056);
        assert_near(e[1], exact, 0.1 * state->total_irradiance[1]);
    }
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

/* The mean of the 5 x 5 texels about one, as the sphere goes on. */
static double get_mean_about(const struct gn_radiance_map *map, int x, int y)
{
    double sum = 0, weight = 0;
    for (int i = 0; i < 25; i++) {
        int at[2] = {x, y};
        if (!gn_projection_step(&map->projection, i % 5 - 2, i / 5 - 2, at))
            continue;
        size_t texel = (size_t)at[1] * (size_t)map->radiance.width + (size_t)at[0];
        sum += (double)map->solid_angle[texel] * gn_luminance(map->radiance.data + 3 * texel);
        weight += (double)map->solid_angle[texel];
    }
    return weight > 0 ? sum / weight : 0;
}

/* The smoothed maximum of a map that is black but for 3 x 3 texels of luminance 1 about one. */
static double smooth_lamp(enum gn_projection_type type, int width, int height, const int home[2])
{
    struct light_fixture f;
    gn_scratch_place place = NULL;
    struct gn_scratch *scratch = gn_scratch_borrow(&place);
    assert_int_equal(light_fixture_init(&f, type, width, height), 0);
    for (int i = 0; i < 9; i++) {
        int at[2] = {home[0], home[1]};
        assert_true(gn_projection_step(&f.frame.projection, i % 3 - 1, i / 3 - 1, at));
        for (int c = 0; c < 3; c++)
            gn_image_at(&f.image, at[0], at[1])[c] = 1;
    }
    f.frame.codes = &f.image;
    const struct gn_light_options options = {.method = GN_LIGHT_PARTITION_SEED};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    double max = 0, smoothed = 0;
    for (int i = 0; i < f.image.width * f.image.height; i++)
        max = fmax(max, get_mean_about(state->map, i % f.image.width, i / f.image.width));
    assert_int_equal(gn_partition_get_smoothed_max(state->map, scratch, &smoothed), 0);
    assert_near(smoothed, max, 1e-12);
    gn_lighting_state_unref(&state);
    gn_scratch_give_back(&place, &scratch);
    gn_scratch_finish(&place);
    light_fixture_finish(&f);
    return smoothed;
}

/* A lamp across a border of the picture is as bright as one in the middle. */
static void borders_change_no_smoothed_maximum(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height, middle[2], border[5][2];
        double tolerance; // for texels of a lamp that are not alike
    } maps[] = {
        {GN_PROJECTION_LATLONG, 128, 64, {64, 32}, {{0, 32}, {127, 32}}, 1e-6},
        {GN_PROJECTION_LATLONG, 128, 64, {64, 0}, {{0, 0}, {127, 0}}, 1e-6},
        {GN_PROJECTION_OCTAHEDRAL, 64, 64, {32, 32}, {{0, 9}, {63, 9}, {9, 0}, {9, 63}}, 1e-6},
        {GN_PROJECTION_CUBE,
         128,
         768,
         {64, 64},
         {{0, 64}, {127, 128 + 70}, {64, 0}, {70, 128}, {64, 383}},
         0.03},
    };
    for (size_t k = 0; k < sizeof(maps) / sizeof(maps[0]); k++) {
        double middle = smooth_lamp(maps[k].type, maps[k].width, maps[k].height, maps[k].middle);
        for (int i = 0; i < 5 && (i == 0 || maps[k].border[i][0] + maps[k].border[i][1] > 0); i++) {
            double border =
                smooth_lamp(maps[k].type, maps[k].width, maps[k].height, maps[k].border[i]);
            assert_near(border / middle, 1, maps[k].tolerance);
        }
    }
}

static void the_papers_reading_is_literal(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300);
    struct gn_light_options options = {.method = GN_LIGHT_PARTITION_SEED, .max_ls = 1};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_int_equal(state->figures.rings, 8);
    assert_int_equal(state->figures.sectors, 24);
    assert_int_equal(state->n_lights, state->figures.n_bright); // maxLS 1: one light per region
    assert_int_equal(state->figures.n_fill_lights + state->figures.n_dark_lights, 0);
    for (int i = 0; i < state->n_lights; i++) {
        const struct gn_light *light = &state->lights[i];
        assert_true(light->dir_world[2] > -0.01f && light->angular_radius == 0);
        bool is_texel = false; // every light looks where some texel looks
        for (int t = 0; t < 300 * 300 && !is_texel; t++)
            is_texel = memcmp(state->map->direction_world + 3 * t, light->dir_world,
                              sizeof(light->dir_world)) == 0;
        assert_true(is_texel);
    }
    gn_lighting_state_unref(&state);
    int n_before = 0;
    for (int metric = GN_METRIC_POW2; metric <= GN_METRIC_TWICE; metric++) {
        n_before = 0;
        for (int max_ls = 1; max_ls <= 64; max_ls *= 2) {
            options.max_ls = max_ls;
            options.metric = (enum gn_partition_metric)metric;
            int n = count_lights(&f, &options);
            assert_true(n >= n_before);
            n_before = n;
        }
    }
    light_fixture_finish(&f);
}

static void each_reading_can_be_mended(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 150, 150);
    gn_image_at(&f.image, 60, 70)[1] = 600; // what a smoothed maximum leaves out
    struct gn_light_options options[2] = {
        {.method = GN_LIGHT_PARTITION_SEED, .max_ls = 16},
        {.method = GN_LIGHT_PARTITION_SEED, .max_ls = 2, .metric = GN_METRIC_LOG2}};
    for (unsigned reading = 1; reading < GN_READ_SEED; reading *= 2) {
        int n_different = 0;
        for (int i = 0; i < 2; i++) {
            unsigned base = i == 1 ? GN_READ_SAMPLE_MEAN : 0; // for ratios beyond max_ls
            options[i].mended = base;
            struct gn_lighting_state *literal = make_state(&f, &options[i], NULL);
            options[i].mended = base | reading;
            struct gn_lighting_state *mended = make_state(&f, &options[i], NULL);
            n_different += mended->n_lights != literal->n_lights;
            for (int k = 0; k < mended->n_lights && k < literal->n_lights; k++)
                n_different += !light_fixture_is_same(&mended->lights[k], &literal->lights[k]);
            gn_lighting_state_unref(&mended);
            gn_lighting_state_unref(&literal);
        }
        if (reading != GN_READ_STRICT) // tells only where a mean equals the whole's
            assert_true(n_different > 0);
    }
    /* Every reading mended, with the logarithm: the energy partition in the seed's division. */
    struct gn_light_options all = {
        .method = GN_LIGHT_PARTITION_SEED, .mended = GN_READ_ALL, .metric = GN_METRIC_LOG2};
    struct gn_lighting_state *state = make_state(&f, &all, NULL);
    check_energy(state, 1e-5);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void constant_light_has_a_light_per_region(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 100, 100), 0);
    light_fixture_fill(&f, light_fixture_constant);
    struct gn_light_options options = {.n_lights = GN_LIGHTS_NO_AIM};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_int_equal(state->n_lights, 4 * 12 + 12); // and the fill
    assert_int_equal(state->figures.n_bright, 48);
    check_energy(state, 1e-5);
    gn_lighting_state_unref(&state);
    options.method = GN_LIGHT_PARTITION_SEED;
    options.mended = GN_READ_STRICT | GN_READ_RADIUS_RINGS; // of equal size: none without samples
    assert_int_equal(count_lights(&f, &options), 8 * 24);
    options.mended = 0; // "not greater": no light at all
    assert_int_equal(count_lights(&f, &options), 0);
    light_fixture_finish(&f);
}

static void one_lamp(const double dir[static 3], float out[static 3])
{
    bool is_lamp = 0.5 * dir[0] + 0.3 * dir[1] + 0.8124 * dir[2] > 0.998;
    out[0] = out[1] = out[2] = is_lamp ? 100.0f : 0.01f;
}

static void one_lamp_is_divided_and_the_rest_merged(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300), 0);
    light_fixture_fill(&f, one_lamp);
    struct gn_light_options options = {.n_lights = GN_LIGHTS_NO_AIM};
    struct gn_lighting_state *state = make_state(&f, &options, NULL);
    assert_true(state->figures.n_bright <= 4); // the regions the lamp touches
    assert_int_equal(state->figures.n_dark_lights, 12);
    int n_on_lamp = 0;
    for (int i = 0; i < state->n_lights; i++) {
        const float *d = state->lights[i].dir_world;
        if (0.5f * d[0] + 0.3f * d[1] + 0.8124f * d[2] > 0.998f) {
            n_on_lamp++;
            assert_true(state->lights[i].angular_radius < 0.0633f); // the lamp's own
        }
    }
    assert_true(n_on_lamp >= 8);
    check_energy(state, 1e-5);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void a_disc_light_has_its_radius(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 400, 400), 0);
    for (int y = 0; y < 400; y++) // 8 degrees about a region's middle
        for (int x = 0; x < 400; x++) {
            double dir[3];
            if (gn_projection_get_direction(&f.frame.projection, x + 0.5, y + 0.5, dir) &&
                0.70711 * dir[0] + 0.70711 * dir[2] > cos(8 * pi / 180))
                gn_image_at(&f.image, x, y)[1] = 1;
        }
    f.frame.codes = &f.image;
    struct gn_light_options options = {
        .n_lights = GN_LIGHTS_NO_AIM, .rings = 1, .sectors = 1, .max_ls = 1};
    struct gn_radiance_map_options map_options = {.no_fill = true};
    struct gn_lighting_state *state;
    struct gn_error error = {0};
    assert_int_equal(
        gn_lighting_state_create(&f.frame, &map_options, &options, NULL, &state, &error), 0);
    assert_int_equal(state->n_lights, 1);
    assert_near(state->lights[0].angular_radius, 8 * pi / 180, 0.01 * 8 * pi / 180);
    assert_near(state->lights[0].dir_world[0], 0.70711, 1e-3);
    gn_lighting_state_unref(&state);

    for (int i = 0; i < 3 * 400 * 400; i++) // one texel: a disc of its solid angle
        f.image.data[i] = i == 3 * (150 * 400 + 170);
    double radius = sqrt(gn_projection_get_solid_angle(&f.frame.projection, 170, 150) / pi);
    assert_int_equal(
        gn_lighting_state_create(&f.frame, &map_options, &options, NULL, &state, &error), 0);
    assert_near(state->lights[0].angular_radius, radius, 0.02 * radius);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void turning_by_a_dark_sector_turns_the_lights(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_LATLONG, 240, 120);
    struct gn_light_options options = {.rings = 4, .sectors = 12};
    struct gn_lighting_state *still = make_state(&f, &options, NULL);
    struct gn_image turned_image;
    assert_int_equal(gn_image_init(&turned_image, 240, 120, 3), 0);
    for (int y = 0; y < 120; y++)
        for (int x = 0; x < 240; x++)
            memcpy(gn_image_at(&turned_image, (x + 40) % 240, y), gn_image_at(&f.image, x, y),
                   3 * sizeof(float));
    f.frame.codes = &turned_image;
    struct gn_lighting_state *turned = make_state(&f, &options, NULL);
    assert_int_equal(turned->n_lights, still->n_lights);
    double c = cos(-pi / 3), s = sin(-pi / 3); // to the right is towards falling phi
    for (int i = 0; i < still->n_lights; i++) {
        const float *d = still->lights[i].dir_world;
        float x = (float)(c * (double)d[0] - s * (double)d[1]);
        float y = (float)(s * (double)d[0] + c * (double)d[1]);
        float nearest = 9;
        for (int j = 0; j < turned->n_lights; j++) {
            const float *t = turned->lights[j].dir_world;
            nearest = fminf(nearest, fabsf(t[0] - x) + fabsf(t[1] - y) + fabsf(t[2] - d[2]));
        }
        assert_true(nearest < 1e-4f);
    }
    gn_lighting_state_unref(&still);
    gn_lighting_state_unref(&turned);
    gn_image_finish(&turned_image);
    light_fixture_finish(&f);
}

static void a_stream_shares_its_plan(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 100, 100);
    f.frame.sequence = 7;
    f.frame.capture_time_ns = 123;
    struct gn_lighting_state *first = make_state(&f, NULL, NULL);
    struct gn_light_options options = {.previous = first};
    struct gn_lighting_state *second = make_state(&f, &options, NULL);
    assert_ptr_equal(first->plan, second->plan);
    assert_ptr_equal(first->map->table, second->map->table);
    assert_same_lights(first, second);
    options.rings = 3;
    struct gn_lighting_state *other = make_state(&f, &options, NULL);
    assert_ptr_not_equal(first->plan, other->plan);
    assert_true(first->sequence == 7 && first->capture_time_ns == 123 && first->has_sh);
    assert_true(first->published_time_ns > 0 && first->ms_map > 0 && first->ms_lights > 0);
    assert_ptr_equal(gn_lighting_state_ref(first), first);
    struct gn_lighting_state *same = first;
    gn_lighting_state_unref(&same);
    gn_lighting_state_unref(&first);
    gn_lighting_state_unref(&second);
    gn_lighting_state_unref(&other);
    gn_lighting_state_unref(&other);
    light_fixture_finish(&f);
}

static void bad_options_are_refused(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_room(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 20, 20);
    const struct gn_light_options bad[] = {
        {.method = GN_LIGHT_METHOD_COUNT},
        {.n_lights = 4097},
        {.n_lights = -2},
        {.rings = 65},
        {.sectors = -1},
        {.rings = 64, .sectors = 64},
        {.max_ls = 4097},
        {.n_samples = 1 << 21},
        {.literal = 1u << 20},
        {.metric = (enum gn_partition_metric)9},
    };
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        struct gn_lighting_state *state = (struct gn_lighting_state *)&f;
        struct gn_error error = {0};
        assert_int_equal(gn_lighting_state_create(&f.frame, NULL, &bad[i], NULL, &state, &error),
                         -EINVAL);
        assert_null(state);
        assert_non_null(strstr(error.text, "light options: "));
    }
    char names[256] = ""; // in the order of the list of choices
    for (int i = 0; i < GN_LIGHT_METHOD_COUNT; i++) {
        enum gn_light_method method;
        const char *name = gn_light_method_get_name((enum gn_light_method)i);
        strcat(strcat(names, i > 0 ? "|" : ""), name);
        assert_int_equal(gn_light_method_from_name(name, &method), 0);
        assert_int_equal(method, i);
    }
    assert_string_equal(names, GN_LIGHT_METHOD_NAMES);
    enum gn_light_method method;
    assert_null(gn_light_method_get_name(GN_LIGHT_METHOD_COUNT));
    assert_int_equal(gn_light_method_from_name("lightgen", &method), -EINVAL);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(energy_is_kept_and_the_number_met),
        cmocka_unit_test(lights_and_harmonics_agree),
        cmocka_unit_test(borders_change_no_smoothed_maximum),
        cmocka_unit_test(the_papers_reading_is_literal),
        cmocka_unit_test(each_reading_can_be_mended),
        cmocka_unit_test(constant_light_has_a_light_per_region),
        cmocka_unit_test(one_lamp_is_divided_and_the_rest_merged),
        cmocka_unit_test(a_disc_light_has_its_radius),
        cmocka_unit_test(turning_by_a_dark_sector_turns_the_lights),
        cmocka_unit_test(a_stream_shares_its_plan),
        cmocka_unit_test(bad_options_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
