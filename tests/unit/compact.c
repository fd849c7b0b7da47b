/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Compact lights: what is one, what it leaves, and that methods keep it whole. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/light/compact.h"
#include "server/light/state.h"
#include "tests/light_states.h"

static const double degree = 3.14159265358979323846 / 180;

/* Suns over a sky that is brighter towards the top: at the pole, and at 40 degrees. */
static const struct {
    double dir[3], radius;
    float rgb[3];
} suns[2] = {{{0.01, 0, 0.99995}, 0.005, {4e5f, 3e5f, 2e5f}},
             {{0.6, 0.48, 0.64}, 0.008, {4e4f, 6e4f, 8e4f}}};

static double get_angle(const double a[static 3], const double b[static 3])
{
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2],
           z = a[0] * b[1] - a[1] * b[0];
    return atan2(sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

static void paint_suns(const double dir[static 3], float out[static 3])
{
    out[0] = out[1] = (float)(2 + dir[2]);
    out[2] = 4;
    for (int i = 0; i < 2; i++)
        if (get_angle(dir, suns[i].dir) < suns[i].radius)
            memcpy(out, suns[i].rgb, sizeof(suns[i].rgb));
}

/* One of 4 degrees, with most of the light. */
static void paint_lamp(const double dir[static 3], float out[static 3])
{
    out[0] = out[1] = out[2] = get_angle(dir, suns[1].dir) < 4 * degree ? 1e4f : 0.1f;
}

/* A sun with a glow that falls by the square of the angle. */
static void paint_glow(const double dir[static 3], float out[static 3])
{
    double angle = fmax(get_angle(dir, suns[1].dir), 0.004);
    out[0] = out[1] = out[2] = angle < 0.008 ? 1e5f : (float)(0.1 + 0.02 / angle / angle);
}

static struct gn_radiance_map *
make_map(struct light_fixture *f, enum gn_projection_type type, int width, int height,
         void (*paint)(const double dir[static 3], float out[static 3]))
{
    struct gn_radiance_map *map = NULL;
    struct gn_error error = {0};
    assert_int_equal(light_fixture_init(f, type, width, height), 0);
    light_fixture_fill(f, paint);
    if (gn_radiance_map_create(&f->frame, NULL, NULL, &map, &error) < 0)
        fail_msg("%s", error.text);
    return map;
}

/* Solid angle of the texels with that green. */
static double get_painted(const struct gn_radiance_map *map, float green)
{
    double sum = 0;
    for (int i = 0; i < map->radiance.width * map->radiance.height; i++)
        sum += map->radiance.data[3 * i + 1] == green ? (double)map->solid_angle[i] : 0;
    return sum;
}

static void suns_are_found_wherever_they_are(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
    } maps[] = {{GN_PROJECTION_LATLONG, 1024, 512},
                {GN_PROJECTION_FISHEYE_EQUIDISTANT, 600, 600},
                {GN_PROJECTION_CUBE, 256, 1536},
                {GN_PROJECTION_OCTAHEDRAL, 512, 512}};
    for (size_t k = 0; k < sizeof(maps) / sizeof(maps[0]); k++) {
        struct light_fixture f;
        struct gn_compact_lights lights;
        struct gn_radiance_map *map = make_map(&f, maps[k].type, maps[k].width, maps[k].height,
                                               paint_suns),
                               *rest;
        assert_int_equal(gn_compact_find(map, NULL, &lights), 0);
        assert_int_equal(lights.n, 2);
        for (int i = 0; i < 2; i++) {
            const struct gn_compact_light *light = &lights.light[i];
            assert_true(get_angle(light->dir_world, suns[i].dir) < 0.1 * degree);
            for (int c = 0; c < 3; c++) // as many texels as there are
                assert_near(light->irradiance[c] / (double)suns[i].rgb[c], light->solid_angle,
                            1e-3 * light->solid_angle);
            assert_near(light->solid_angle, get_painted(map, suns[i].rgb[1]), 1e-9);
            // Of few texels no disc comes; and one beside a pole is taken for a square.
            double radius = sqrt(light->solid_angle / 3.14159265);
            assert_near(light->angular_radius, radius, 0.3 * radius);
            // The sky's, and nothing of the sun.
            assert_true(light->background[2] == 4);
        }
        assert_int_equal(gn_compact_get_rest(&lights, map, NULL, &rest), 0);
        for (int c = 0; c < 3; c++)
            assert_near(rest->figures.shown_irradiance[c] + lights.light[0].irradiance[c] +
                            lights.light[1].irradiance[c],
                        map->figures.shown_irradiance[c], 1e-7 * map->figures.shown_irradiance[c]);
        assert_true(rest->figures.max_luminance < 5);
        gn_radiance_map_unref(&rest);
        gn_radiance_map_unref(&map);
        gn_compact_finish(&lights);
        light_fixture_finish(&f);
    }
}

static void a_lamp_is_no_sun(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_compact_lights lights;
    struct gn_radiance_map *map = make_map(&f, GN_PROJECTION_LATLONG, 512, 256, paint_lamp);
    assert_int_equal(gn_compact_find(map, NULL, &lights), 0);
    assert_int_equal(lights.n, 0);
    static const struct gn_compact_options wide = {.max_radius = 0.08};
    assert_int_equal(gn_compact_find(map, &wide, &lights), 0);
    assert_int_equal(lights.n, 1);
    assert_near(lights.light[0].angular_radius, 4 * degree, 0.1 * degree);
    gn_compact_finish(&lights);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void a_suns_glow_is_left(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_compact_lights lights;
    struct gn_radiance_map *map = make_map(&f, GN_PROJECTION_LATLONG, 2048, 1024, paint_glow);
    assert_int_equal(gn_compact_find(map, NULL, &lights), 0);
    assert_int_equal(lights.n, 1);
    assert_near(lights.light[0].angular_radius, 0.008, 0.001);
    assert_near(lights.light[0].background[0], 0.02 / 0.0085 / 0.0085, 80);
    gn_compact_finish(&lights);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void methods_keep_suns_whole(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_radiance_map *map = make_map(&f, GN_PROJECTION_LATLONG, 1024, 512, paint_suns);
    gn_radiance_map_unref(&map);
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        struct gn_light_options options = {.method = (enum gn_light_method)m, .no_sh = true};
        struct gn_lighting_state *state = make_state(&f, &options, NULL);
        bool is_seed = m == GN_LIGHT_PARTITION_SEED;
        assert_int_equal(state->figures.n_discs, is_seed ? 0 : 2);
        double sum[3] = {0};
        for (int i = 0; i < state->n_lights; i++) {
            assert_true(state->lights[i].is_disc == (!is_seed && i < 2));
            for (int c = 0; c < 3; c++)
                sum[c] += (double)state->lights[i].irradiance[c];
        }
        for (int c = 0; c < 3 && !is_seed; c++)
            assert_near(sum[c], state->total_irradiance[c], 1e-5 * state->total_irradiance[c]);
        // The next frame, in which the first sun has become the weaker one: each keeps its name.
        options.previous = state;
        for (int i = 0; i < 1024 * 512 * 3; i++)
            f.image.data[i] *= f.image.data[i] > 1.5e5f ? 0.2f : 1;
        struct gn_lighting_state *next = make_state(&f, &options, NULL);
        if (!is_seed) {
            assert_int_equal(next->figures.n_discs, 2);
            assert_true(next->lights[0].id == state->lights[1].id);
            assert_true(next->lights[1].id == state->lights[0].id);
        }
        light_fixture_fill(&f, paint_suns);
        options.previous = NULL;
        options.no_discs = true;
        struct gn_lighting_state *without = make_state(&f, &options, NULL);
        assert_int_equal(without->figures.n_discs, 0);
        for (int i = 0; i < without->n_lights; i++)
            assert_false(without->lights[i].is_disc);
        gn_lighting_state_unref(&state);
        gn_lighting_state_unref(&next);
        gn_lighting_state_unref(&without);
    }
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(suns_are_found_wherever_they_are),
        cmocka_unit_test(a_lamp_is_no_sun),
        cmocka_unit_test(a_suns_glow_is_left),
        cmocka_unit_test(methods_keep_suns_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
