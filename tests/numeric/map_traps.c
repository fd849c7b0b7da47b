/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The radiance map at its extremes: what must be finite is, what is lost is known and counted. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/half.h"
#include "proto/attr.h"
#include "server/light/luminance.h"
#include "server/light/radiance_map.h"
#include "tests/light_fixture.h"

static const double pi = 3.14159265358979323846;

static struct gn_radiance_map *make_map(const struct gn_environment_frame *frame,
                                        struct gn_pool *pool)
{
    struct gn_radiance_map *map = NULL;
    struct gn_error error = {0};
    if (gn_radiance_map_create(frame, NULL, pool, &map, &error) < 0)
        fail_msg("%s", error.text);
    return map;
}

static struct gn_environment_frame make_frame(enum gn_projection_type type, int width, int height)
{
    return (struct gn_environment_frame){
        .projection = {.type = type, .width = width, .height = height},
        .world_from_probe = {1, 0, 0, 0},
    };
}

static double next_random(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) * 0x1p-53;
}

/* A sun of 1e9 in floats, and in halves with the scale that keeps it finite. */
static void trap_1_sun_in_float_and_in_half(void **unused)
{
    (void)unused;
    enum { W = 128, H = 64, SUN = 20 * W + 30 };
    static float values[3 * W * H];
    static uint16_t halves[3 * W * H];
    double scale = 0x1p15; // of the half frame
    for (int i = 0; i < 3 * W * H; i++) {
        values[i] = i / 3 == SUN ? 1e9f : 1000.0f;
        halves[i] = gn_half_from_float((float)((double)values[i] / scale));
    }
    struct gn_environment_frame frame = make_frame(GN_PROJECTION_LATLONG, W, H);
    frame.layout = GN_PIXELS_RGB_F32;
    frame.raw = (const uint8_t *)values;
    struct gn_radiance_map *exact = make_map(&frame, NULL);
    frame.layout = GN_PIXELS_RGB_F16;
    frame.raw = (const uint8_t *)halves;
    frame.response.scale = scale;
    struct gn_radiance_map *half = make_map(&frame, NULL);
    for (int i = 0; i < 3 * W * H; i++)
        assert_near(half->radiance.data[i], values[i], 1e-3 * (double)values[i]);
    for (int c = 0; c < 3; c++) {
        double e = exact->figures.shown_irradiance[c];
        assert_true(isfinite(e));
        assert_near(half->figures.shown_irradiance[c], e, 1e-3 * e);
    }
    assert_int_equal(half->figures.n_inf, 0);
    gn_radiance_map_unref(&half);
    /* Without the scale it is infinite: counted, and replaced by its neighbours. */
    halves[3 * SUN] = gn_half_from_float(1e9f);
    half = make_map(&frame, NULL);
    assert_int_equal(half->figures.n_inf, 1);
    assert_near(half->radiance.data[3 * SUN], 1000, 1);
    gn_radiance_map_unref(&half);
    gn_radiance_map_unref(&exact);
}

/* One texel of each kind: the energy changes by exactly the texels that were replaced. */
static void trap_2_only_the_bad_texels_change(void **unused)
{
    (void)unused;
    static const enum gn_projection_type types[] = {GN_PROJECTION_LATLONG, GN_PROJECTION_CUBE,
                                                    GN_PROJECTION_OCTAHEDRAL,
                                                    GN_PROJECTION_FISHEYE_EQUISOLID};
    static const float bad[] = {NAN, INFINITY, -INFINITY, -5.0f, -0.0f};
    for (size_t t = 0; t < GN_ARRAY_LEN(types); t++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, types[t], 60, 60), 0);
        light_fixture_fill(&f, light_fixture_room);
        struct gn_radiance_map *clean = make_map(&f.frame, NULL);
        for (size_t k = 0; k < GN_ARRAY_LEN(bad); k++) {
            size_t texel = 30 * 60 + 20 + 3 * k;
            float was = f.image.data[3 * texel + 1];
            f.image.data[3 * texel + 1] = bad[k];
            struct gn_radiance_map *map = make_map(&f.frame, NULL);
            double lost = 0;
            for (size_t i = 0; i < 60 * (size_t)f.image.height; i++) {
                const float *a = clean->radiance.data + 3 * i, *b = map->radiance.data + 3 * i;
                if (i != texel)
                    assert_memory_equal(a, b, 3 * sizeof(float));
                lost += ((double)a[1] - (double)b[1]) * (double)map->solid_angle[i];
            }
            assert_near(clean->figures.shown_irradiance[1] - map->figures.shown_irradiance[1], lost,
                        1e-12 * clean->figures.shown_irradiance[1]);
            const struct gn_radiance_map_figures *m = &map->figures;
            assert_int_equal(m->n_nan, k == 0);
            assert_int_equal(m->n_inf, k == 1);
            assert_int_equal(m->n_negative, k == 2 || k == 3);
            gn_radiance_map_unref(&map);
            f.image.data[3 * texel + 1] = was;
        }
        gn_radiance_map_unref(&clean);
        light_fixture_finish(&f);
    }
}

static void trap_3_all_black(void **unused)
{
    (void)unused;
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, (enum gn_projection_type)type, 33, 31), 0);
        f.frame.codes = &f.image;
        struct gn_radiance_map *map = make_map(&f.frame, NULL);
        for (int c = 0; c < 3; c++)
            assert_true(map->figures.shown_irradiance[c] == 0 && map->fill[c] == 0);
        assert_true(map->figures.mean_luminance == 0 && map->figures.max_luminance == 0);
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
}

/* 8.4 million texels and more, a sun first: the rest is still there, to 1e-6 of itself. */
static void trap_7_sums_of_millions(void **unused)
{
    (void)unused;
    enum { W = 4096, H = 2048 };
    uint16_t *halves = malloc(sizeof(*halves) * 3 * W * H);
    assert_non_null(halves);
    for (size_t i = 0; i < (size_t)3 * W * H; i++)
        halves[i] = gn_half_from_float(0.001f);
    struct gn_environment_frame frame = make_frame(GN_PROJECTION_LATLONG, W, H);
    frame.layout = GN_PIXELS_RGB_F16;
    frame.raw = (const uint8_t *)halves;
    frame.response.scale = 0x1p16;
    size_t sun = (size_t)H / 2 * W + 5; // where a row weighs most
    for (size_t c = 0; c < 3; c++)
        halves[3 * sun + c] = gn_half_from_float(65504);
    struct gn_radiance_map *map = make_map(&frame, NULL);
    double w = (double)map->solid_angle[sun], value = (double)gn_half_to_float(halves[99]) * 0x1p16;
    double rest = value * (4 * pi - w);
    for (int c = 0; c < 3; c++)
        assert_near(map->figures.shown_irradiance[c] - 65504 * 0x1p16 * w, rest, 1e-6 * rest);
    gn_radiance_map_unref(&map);
    free(halves);
}

/* No direction, however near to a pole, an edge or the rim, gives NaN or leaves the picture. */
static void trap_24_domains(void **unused)
{
    (void)unused;
    uint64_t seed = 1;
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, (enum gn_projection_type)type, 24, 24), 0);
        for (int i = 0; i < 300000; i++) {
            float d[3]; // unit only to float's rounding, often with components of 0 and 1
            double v[3], length = 0, back[3], xy[2];
            for (int c = 0; c < 3; c++) {
                v[c] = i % 3 ? 2 * next_random(&seed) - 1 : (double)((i / 3 * 7 + c * 5) % 3 - 1);
                v[c] += i % 2 ? 0 : 1e-7 * next_random(&seed);
                length += v[c] * v[c];
            }
            if (!(length > 1e-20))
                continue;
            for (int c = 0; c < 3; c++)
                d[c] = (float)(v[c] / sqrt(length));
            double dir[3] = {(double)d[0], (double)d[1], (double)d[2]};
            if (!gn_projection_get_position(&f.frame.projection, dir, xy))
                continue;
            assert_true(xy[0] >= 0 && xy[0] <= f.image.width && xy[1] >= 0 &&
                        xy[1] <= f.image.height);
            assert_true(gn_projection_get_direction(&f.frame.projection, xy[0], xy[1], back));
            double apart = hypot(hypot(back[0] - dir[0], back[1] - dir[1]), back[2] - dir[2]);
            assert_true(apart < 1e-5); // a mirror ball's rim magnifies rounding
        }
        light_fixture_finish(&f);
    }
}

/* A saturated blue patch through a matrix with negative coefficients. */
static void trap_27_out_of_gamut_keeps_its_luminance(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 64, 32), 0);
    light_fixture_fill(&f, light_fixture_constant);
    static const float blue[3] = {0.02f, 0.05f, 0.9f};
    memcpy(gn_image_at(&f.image, 10, 10), blue, sizeof(blue));
    static const float lost[3] = {0, 0.01f, 0.9f}; // below 0 in luminance, too
    memcpy(gn_image_at(&f.image, 20, 10), lost, sizeof(lost));
    static const double m[9] = {1.6, -0.4, -0.2, -0.3, 1.5, -0.2, 0.0, -0.5, 1.5};
    memcpy(f.frame.response.to_rec709, m, sizeof(m));
    f.frame.response.scale = 3;
    struct gn_radiance_map *map = make_map(&f.frame, NULL);
    double raw[3];
    for (int c = 0; c < 3; c++) {
        raw[c] = 0;
        for (int k = 0; k < 3; k++)
            raw[c] += 3 * m[3 * c + k] * (double)blue[k];
    }
    double y = 0.2126 * raw[0] + 0.7152 * raw[1] + 0.0722 * raw[2];
    const float *got = gn_image_at(&map->radiance, 10, 10);
    assert_true(raw[0] < 0 && raw[1] < 0 && y < 0); // as strong a blue as that: all clamped
    assert_true(got[0] == 0 && got[1] == 0 && got[2] == 0);
    assert_int_equal(map->figures.n_out_of_gamut, 2);
    assert_near(gn_image_at(&map->radiance, 0, 0)[0], 3, 1e-6); // the rows sum to 1
    gn_radiance_map_unref(&map);

    static const float teal[3] = {0.05f, 0.5f, 0.6f};
    memcpy(gn_image_at(&f.image, 10, 10), teal, sizeof(teal));
    map = make_map(&f.frame, NULL);
    got = gn_image_at(&map->radiance, 10, 10);
    double wanted = 0;
    static const double share[3] = {0.2126, 0.7152, 0.0722};
    for (int c = 0; c < 3; c++) {
        raw[c] = 0;
        for (int k = 0; k < 3; k++)
            raw[c] += 3 * m[3 * c + k] * (double)teal[k];
        wanted += share[c] * raw[c];
    }
    assert_true(raw[0] < 0 && wanted > 0);
    assert_true(got[0] == 0);
    assert_near(gn_luminance(got), wanted, 1e-6 * wanted);
    assert_near((double)got[1] / (double)got[2], raw[1] / raw[2], 1e-5); // and its hue
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

/* Codes at the rail are counted where the circle shows them, and only there. */
static void trap_28_rails_are_counted(void **unused)
{
    (void)unused;
    enum { SIDE = 64 };
    static uint16_t codes[SIDE * SIDE];
    struct gn_environment_frame frame = make_frame(GN_PROJECTION_FISHEYE_EQUIDISTANT, SIDE, SIDE);
    frame.layout = GN_PIXELS_MONO_U16;
    frame.code_max = 4095;
    frame.raw = (const uint8_t *)codes;
    frame.response =
        (struct gn_response){.type = GN_RESPONSE_LOG, .log_a = 0.6, .log_b = 0.08, .log_c = 0.01};
    for (int i = 0; i < SIDE * SIDE; i++)
        codes[i] = 2000;
    codes[0] = codes[SIDE - 1] = 4095; // corners: beyond the circle
    for (int k = 0; k < 3; k++) {
        int n = k == 0 ? 0 : k == 1 ? 7 : 40;
        for (int i = 0; i < n; i++)
            codes[(20 + i / 8) * SIDE + 28 + i % 8] = 4095;
        struct gn_radiance_map *map = make_map(&frame, NULL);
        assert_int_equal(map->figures.n_clipped, n);
        float top = gn_response_decode(&frame.response, 1);
        for (int i = 0; i < n; i++) // kept as bright as the sensor could say
            assert_true(gn_image_at(&map->radiance, 28 + i % 8, 20 + i / 8)[1] == top);
        gn_radiance_map_unref(&map);
    }
}

/* The same picture, 1e-12 to 1e12 times: by its values, and by the response's scale. */
static void scales_from_1e_12_to_1e12(void **unused)
{
    (void)unused;
    struct light_fixture f, scaled;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_STEREOGRAPHIC, 90, 80), 0);
    assert_int_equal(light_fixture_init(&scaled, GN_PROJECTION_FISHEYE_STEREOGRAPHIC, 90, 80), 0);
    light_fixture_fill(&f, light_fixture_room);
    scaled.frame.codes = &scaled.image;
    struct gn_radiance_map *unit = make_map(&f.frame, NULL);
    for (int e = -12; e <= 12; e += 3) {
        double s = pow(10, e);
        for (int i = 0; i < 3 * 90 * 80; i++)
            scaled.image.data[i] = (float)((double)f.image.data[i] * s);
        f.frame.response.scale = s;
        struct gn_radiance_map *maps[2] = {make_map(&scaled.frame, NULL), make_map(&f.frame, NULL)};
        for (int k = 0; k < 2; k++) {
            for (int c = 0; c < 3; c++) {
                double wanted = unit->figures.shown_irradiance[c] * s;
                assert_near(maps[k]->figures.shown_irradiance[c], wanted, 1e-7 * wanted);
                assert_near(maps[k]->fill[c], (double)unit->fill[c] * s,
                            2e-7 * (double)unit->fill[c] * s);
            }
            assert_int_equal(maps[k]->figures.n_capped, 0);
            gn_radiance_map_unref(&maps[k]);
        }
    }
    gn_radiance_map_unref(&unit);
    light_fixture_finish(&f);
    light_fixture_finish(&scaled);
}

/* From one pixel on, thin, odd and long: the sphere is whole, and threads change no bit. */
static void sizes_of_all_kinds(void **unused)
{
    (void)unused;
    static const int sizes[][2] = {{1, 1},   {1, 2},   {1, 999},  {999, 1},  {2, 3},   {3, 2},
                                   {7, 401}, {401, 7}, {255, 13}, {8192, 3}, {3, 8192}};
    struct gn_pool *pool = NULL;
    assert_int_equal(gn_pool_create(3, &pool), 0);
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        for (size_t k = 0; k < GN_ARRAY_LEN(sizes); k++) {
            struct light_fixture f;
            if (type == GN_PROJECTION_CUBE && sizes[k][0] > 1000)
                continue; // six times as high
            assert_int_equal(
                light_fixture_init(&f, (enum gn_projection_type)type, sizes[k][0], sizes[k][1]), 0);
            size_t n = 3 * (size_t)f.image.width * (size_t)f.image.height;
            for (size_t i = 0; i < n; i++)
                f.image.data[i] = (float)(1 + i * 7919 % 1009);
            f.frame.codes = &f.image;
            struct gn_radiance_map *one = make_map(&f.frame, NULL),
                                   *many = make_map(&f.frame, pool);
            assert_memory_equal(one->radiance.data, many->radiance.data, n * sizeof(float));
            assert_memory_equal(&one->figures, &many->figures, sizeof(one->figures));
            assert_memory_equal(one->fill, many->fill, sizeof(one->fill));
            double sum = one->figures.shown_solid_angle + one->fill_solid_angle;
            assert_near(sum, 4 * pi, 4 * pi * 1e-3); // a circle of a pixel: coarse quadrature
            assert_true(isfinite(one->figures.shown_irradiance[0]) &&
                        one->figures.shown_irradiance[0] >= 0 && isfinite((double)one->fill[0]));
            gn_radiance_map_unref(&one);
            gn_radiance_map_unref(&many);
            light_fixture_finish(&f);
        }
    }
    gn_pool_destroy(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trap_1_sun_in_float_and_in_half),
        cmocka_unit_test(trap_2_only_the_bad_texels_change),
        cmocka_unit_test(trap_3_all_black),
        cmocka_unit_test(trap_7_sums_of_millions),
        cmocka_unit_test(trap_24_domains),
        cmocka_unit_test(trap_27_out_of_gamut_keeps_its_luminance),
        cmocka_unit_test(trap_28_rails_are_counted),
        cmocka_unit_test(scales_from_1e_12_to_1e12),
        cmocka_unit_test(sizes_of_all_kinds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
