/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What all methods that keep the map's energy have in common, then what each promises itself. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "common/pool.h"
#include "server/light/luminance.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"

static const double pi = 3.14159265358979323846;

static const struct {
    enum gn_light_method method;
    double miss; // of the wanted number, at most this share and one
} methods[] = {
    {GN_LIGHT_MEDIAN_CUT, 0},
    {GN_LIGHT_VARIANCE, 0},
    {GN_LIGHT_INVERSION, 0.45}, // points with nothing nearest to them
    {GN_LIGHT_QUADTREE, 0.07},  // three lights more for each split
};
enum { N_METHODS = sizeof(methods) / sizeof(methods[0]) };

static struct gn_lighting_state *make_state(const struct light_fixture *f,
                                            enum gn_light_method method, int n_lights,
                                            struct gn_lighting_state *previous,
                                            struct gn_pool *pool)
{
    struct gn_lighting_state *state = NULL;
    struct gn_error error = {0};
    const struct gn_light_options options = {
        .method = method, .n_lights = n_lights, .previous = previous, .no_sh = true};
    if (gn_lighting_state_create(&f->frame, NULL, &options, pool, &state, &error) < 0)
        fail_msg("%s", error.text);
    return state;
}

static double get_angle(const float a[static 3], const float b[static 3])
{
    double x = (double)a[1] * (double)b[2] - (double)a[2] * (double)b[1];
    double y = (double)a[2] * (double)b[0] - (double)a[0] * (double)b[2];
    double z = (double)a[0] * (double)b[1] - (double)a[1] * (double)b[0];
    return atan2(sqrt(x * x + y * y + z * z), (double)a[0] * (double)b[0] +
                                                  (double)a[1] * (double)b[1] +
                                                  (double)a[2] * (double)b[2]);
}

static const struct gn_light *find_id(const struct gn_lighting_state *state, uint64_t id)
{
    for (int i = 0; i < state->n_lights; i++)
        if (state->lights[i].id == id)
            return &state->lights[i];
    return NULL;
}

/* Sound lights, each with an identity of its own, that add up to the map. */
static void check_lights(const struct gn_lighting_state *state)
{
    double sum[3] = {0};
    for (int i = 0; i < state->n_lights; i++) {
        const struct gn_light *light = &state->lights[i];
        double length = 0;
        for (int c = 0; c < 3; c++) {
            sum[c] += (double)light->irradiance[c];
            length += (double)light->dir_world[c] * (double)light->dir_world[c];
            assert_true(light->irradiance[c] >= 0);
        }
        assert_near(length, 1, 1e-6);
        assert_true(light->angular_radius > 0 && (double)light->angular_radius <= pi + 1e-6);
        assert_true(light->id != 0 && find_id(state, light->id) == light);
    }
    for (int c = 0; c < 3; c++)
        assert_near(sum[c], state->total_irradiance[c], 1e-5 * state->total_irradiance[c]);
}

/* Both states hold the same lights, to the bit. */
static bool are_same(const struct gn_lighting_state *a, const struct gn_lighting_state *b)
{
    bool is_same = a->n_lights == b->n_lights;
    for (int i = 0; i < a->n_lights && is_same; i++) {
        const struct gn_light *x = &a->lights[i], *y = &b->lights[i];
        is_same = x->id == y->id && x->angular_radius == y->angular_radius &&
                  memcmp(x->dir_world, y->dir_world, sizeof(x->dir_world)) == 0 &&
                  memcmp(x->irradiance, y->irradiance, sizeof(x->irradiance)) == 0;
    }
    return is_same;
}

static void every_method_keeps_energy_and_number(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
    } maps[] = {{GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300},
                {GN_PROJECTION_FISHEYE_EQUISOLID, 151, 120},
                {GN_PROJECTION_MIRRORBALL, 200, 200},
                {GN_PROJECTION_LATLONG, 256, 128},
                {GN_PROJECTION_CUBE, 64, 384},
                {GN_PROJECTION_OCTAHEDRAL, 100, 100}};
    static const int wanted[] = {1, 2, 7, 64, 300, 1000};
    for (size_t k = 0; k < sizeof(maps) / sizeof(maps[0]); k++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, maps[k].type, maps[k].width, maps[k].height), 0);
        light_fixture_fill(&f, light_fixture_room);
        for (int m = 0; m < N_METHODS; m++) {
            for (size_t i = 0; i < sizeof(wanted) / sizeof(wanted[0]); i++) {
                struct gn_lighting_state *state =
                    make_state(&f, methods[m].method, wanted[i], NULL, NULL);
                check_lights(state);
                assert_near(state->n_lights, wanted[i],
                            methods[m].miss * wanted[i] + (methods[m].miss > 0));
                gn_lighting_state_unref(&state);
            }
        }
        light_fixture_finish(&f);
    }
}

static void every_method_takes_maps_of_any_size(void **unused)
{
    (void)unused;
    static const int sizes[][2] = {{1, 1}, {1, 9}, {13, 1}, {3, 2}, {37, 19}};
    for (size_t k = 0; k < sizeof(sizes) / sizeof(sizes[0]); k++) {
        struct light_fixture f;
        int width = sizes[k][0], height = sizes[k][1];
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, width, height), 0);
        light_fixture_fill(&f, light_fixture_constant);
        for (int m = 0; m < N_METHODS; m++) {
            struct gn_lighting_state *state = make_state(&f, methods[m].method, 64, NULL, NULL);
            check_lights(state);
            assert_true(state->n_lights >= 1 && state->n_lights <= width * height);
            if (methods[m].miss == 0)
                assert_true(state->n_lights == (int)fmin(width * height, 64));
            gn_lighting_state_unref(&state);
        }
        light_fixture_finish(&f);
    }
}

static void every_method_leaves_black_black(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 64, 64), 0);
    f.frame.codes = &f.image;
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *state = make_state(&f, methods[m].method, 64, NULL, NULL);
        assert_int_equal(state->n_lights, 0);
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

static void every_method_gives_one_texel_its_share(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, light_fixture_constant);
    double w = gn_projection_get_solid_angle(&f.frame.projection, 200, 60), dir[3];
    assert_true(gn_projection_get_direction(&f.frame.projection, 200.5, 60.5, dir));
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 200, 60)[c] = (float)(99 * (4 * pi - w) / w);
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *state = make_state(&f, methods[m].method, 64, NULL, NULL);
        check_lights(state);
        const struct gn_light *hot = &state->lights[0];
        assert_near((double)hot->irradiance[1] / state->total_irradiance[1], 0.99, 1e-3);
        assert_near(
            get_angle(hot->dir_world, (float[3]){(float)dir[0], (float)dir[1], (float)dir[2]}), 0,
            1e-3);
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

static void every_method_has_the_same_bits_on_threads(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_pool *pool = NULL;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300), 0);
    light_fixture_fill(&f, light_fixture_room);
    assert_int_equal(gn_pool_create(3, &pool), 0);
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *one = make_state(&f, methods[m].method, 64, NULL, NULL);
        struct gn_lighting_state *three = make_state(&f, methods[m].method, 64, NULL, pool);
        struct gn_lighting_state *next = make_state(&f, methods[m].method, 64, one, pool);
        assert_true(are_same(one, three));
        assert_true(are_same(one, next)); // and the same frame has the same lights
        gn_lighting_state_unref(&one);
        gn_lighting_state_unref(&three);
        gn_lighting_state_unref(&next);
    }
    gn_pool_destroy(&pool);
    light_fixture_finish(&f);
}

static void median_cut_halves_energy(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300), 0);
    light_fixture_fill(&f, light_fixture_room);
    for (int n = 2; n <= 256; n *= 2) {
        struct gn_lighting_state *state = make_state(&f, GN_LIGHT_MEDIAN_CUT, n, NULL, NULL);
        double least = gn_luminance(state->lights[n - 1].irradiance);
        double most = gn_luminance(state->lights[0].irradiance);
        printf("# %d lights: the strongest is %.3f of the weakest\n", n, most / least);
        // A cut lies between cells, and a lamp here is 8 to 16 cells wide.
        assert_true(most / least < (n <= 8 ? 1.1 : 2.5));
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

static void two_lamps(const double dir[static 3], float out[static 3])
{
    float v = 0.01f;
    if (0.6 * dir[0] + 0.8 * dir[2] > 0.9986) // 3 degrees
        v = 200;
    if (0.48 * dir[0] - 0.64 * dir[1] + 0.6 * dir[2] > 0.9945) // 6 degrees
        v = 100;
    out[0] = out[1] = out[2] = v;
}

static void variance_keeps_a_lamp_whole(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, two_lamps);
    struct gn_lighting_state *state = make_state(&f, GN_LIGHT_VARIANCE, 4, NULL, NULL);
    double small = 200 * 2 * pi * (1 - 0.9986), large = 100 * 2 * pi * (1 - 0.9945);
    assert_near((double)state->lights[0].irradiance[1] / large, 1, 0.02);
    assert_near((double)state->lights[1].irradiance[1] / small, 1, 0.02);
    assert_near(get_angle(state->lights[0].dir_world, (float[3]){0.48f, -0.64f, 0.6f}), 0, 0.01);
    assert_near(get_angle(state->lights[1].dir_world, (float[3]){0.6f, 0, 0.8f}), 0, 0.01);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_method_keeps_energy_and_number),
        cmocka_unit_test(every_method_takes_maps_of_any_size),
        cmocka_unit_test(every_method_leaves_black_black),
        cmocka_unit_test(every_method_gives_one_texel_its_share),
        cmocka_unit_test(every_method_has_the_same_bits_on_threads),
        cmocka_unit_test(median_cut_halves_energy),
        cmocka_unit_test(variance_keeps_a_lamp_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
