/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Frames to radiance maps: mending, addressing, the fill, looking up, what a stream shares. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "common/half.h"
#include "proto/attr.h"
#include "server/light/luminance.h"
#include "server/light/map_table.h"
#include "server/light/radiance_map.h"
#include "tests/light_fixture.h"

static const double pi = 3.14159265358979323846;

static struct gn_radiance_map *make_map(const struct light_fixture *f,
                                        const struct gn_radiance_map_options *options)
{
    struct gn_radiance_map *map = NULL;
    struct gn_error error = {0};
    if (gn_radiance_map_create(&f->frame, options, NULL, &map, &error) < 0)
        fail_msg("%s", error.text);
    return map;
}

static void make_fixture(struct light_fixture *f, enum gn_projection_type type, int width,
                         int height)
{
    assert_int_equal(light_fixture_init(f, type, width, height), 0);
    light_fixture_fill(f, light_fixture_constant);
}

static void bad_frames_are_refused(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 20, 20);
    struct gn_environment_frame bad[8];
    for (int i = 0; i < 8; i++)
        bad[i] = f.frame;
    bad[0].codes = NULL;
    bad[1].projection.width = 21;
    bad[2].world_from_probe[0] = NAN;
    bad[3].position[1] = INFINITY;
    bad[4].code_max = 65536;
    bad[5].response.scale = -1;
    bad[6].projection.theta_max = 7;
    struct gn_image two = f.image;
    two.channels = 2;
    bad[7].codes = &two;
    for (int i = 0; i < 8; i++) {
        struct gn_radiance_map *map = (struct gn_radiance_map *)&f;
        struct gn_error error = {0};
        assert_int_equal(gn_radiance_map_create(&bad[i], NULL, NULL, &map, &error), -EINVAL);
        assert_null(map);
        assert_non_null(strstr(error.text, "environment frame: "));
    }
    struct gn_radiance_map_options options = {.ground_albedo = 1.5f};
    struct gn_radiance_map *map;
    assert_int_equal(gn_radiance_map_create(&f.frame, &options, NULL, &map, NULL), -EINVAL);
    light_fixture_finish(&f);
}

static void what_is_no_light_is_mended_and_counted(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_LATLONG, 64, 32);
    gn_image_at(&f.image, 10, 9)[0] = NAN;
    gn_image_at(&f.image, 20, 9)[1] = -5;
    gn_image_at(&f.image, 0, 16)[2] = INFINITY; // its neighbours lie across the seam
    gn_image_at(&f.image, 63, 16)[2] = 3;
    gn_image_at(&f.image, 1, 15)[2] = INFINITY; // no help
    gn_image_at(&f.image, 40, 9)[0] = 3e38f;
    for (int i = 0; i < 6; i++) // of (51, 20) only the three above are left
        gn_image_at(&f.image, 50 + i % 3, 20 + i / 3)[0] = INFINITY;
    struct gn_radiance_map *map = make_map(&f, NULL);
    assert_true(gn_image_at(&map->radiance, 51, 20)[0] == 1);
    assert_int_equal(map->figures.n_nan, 1);
    assert_int_equal(map->figures.n_negative, 1);
    assert_int_equal(map->figures.n_inf, 8);
    assert_int_equal(map->figures.n_capped, 1);
    assert_int_equal(map->figures.n_clipped, 0);
    assert_true(gn_image_at(&map->radiance, 10, 9)[0] == 0);
    assert_true(gn_image_at(&map->radiance, 10, 9)[1] == 1);
    assert_true(gn_image_at(&map->radiance, 20, 9)[1] == 0);
    assert_true(gn_image_at(&map->radiance, 0, 16)[2] == 1); // the median of 1 x 6 and 3
    assert_true(gn_image_at(&map->radiance, 1, 15)[2] == 1);
    assert_true(gn_image_at(&map->radiance, 40, 9)[0] == GN_RADIANCE_MAX);
    double lost = gn_projection_get_solid_angle(&map->projection, 0, 9);
    assert_near(map->figures.shown_irradiance[1], 4 * pi - lost, 1e-5);
    gn_radiance_map_unref(&map);
    assert_null(map);
    light_fixture_finish(&f);
}

static void codes_become_radiance(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_image mono;
    make_fixture(&f, GN_PROJECTION_LATLONG, 16, 8);
    assert_int_equal(gn_image_init(&mono, 16, 8, 1), 0);
    for (int i = 0; i < 16 * 8; i++)
        mono.data[i] = (float)(i * 32) / 4095;
    mono.data[5] = 1;
    f.frame.codes = &mono;
    f.frame.response = (struct gn_response){
        .type = GN_RESPONSE_LOG, .log_a = 0.6, .log_b = 0.08, .log_c = 0.01, .scale = 2};
    struct gn_radiance_map *direct = make_map(&f, NULL);
    f.frame.code_max = 4095;
    struct gn_radiance_map *by_table = make_map(&f, NULL);
    assert_int_equal(by_table->figures.n_clipped, 1);
    assert_int_equal(direct->figures.n_clipped, 0);
    for (int i = 0; i < 16 * 8; i++) {
        double expected = 2 * fmax(exp(((double)mono.data[i] - 0.6) / 0.08) - 0.01, 0);
        for (int c = 0; c < 3; c++) {
            assert_near(direct->radiance.data[3 * i + c], expected, 1e-5 * expected + 1e-9);
            assert_true(direct->radiance.data[3 * i + c] == by_table->radiance.data[3 * i + c]);
        }
    }
    gn_radiance_map_unref(&direct);
    gn_radiance_map_unref(&by_table);
    gn_image_finish(&mono);
    light_fixture_finish(&f);
}

/* The fixture's picture, [0, 1] in thousandths, in that layout; the caller's. */
static uint8_t *make_raw(const struct light_fixture *f, enum gn_pixel_layout layout, int code_max)
{
    static const int value_bytes[GN_PIXELS_COUNT] = {0, 4, 2, 2, 2, 1};
    size_t n = (size_t)f->image.width * (size_t)f->image.height,
           bytes = (size_t)value_bytes[layout];
    size_t n_values = layout == GN_PIXELS_MONO_U16 ? n : 3 * n;
    uint8_t *raw = malloc(n_values * bytes);
    assert_non_null(raw);
    for (size_t i = 0; i < n_values; i++) {
        float v = f->image.data[n_values == n ? 3 * i : i];
        uint16_t half = gn_half_from_float(v);
        long code = lrintf(v * (float)code_max);
        uint32_t bits;
        memcpy(&bits, &v, sizeof(bits));
        bits = layout == GN_PIXELS_RGB_F32   ? bits
               : layout == GN_PIXELS_RGB_F16 ? half
                                             : (uint32_t)code;
        for (size_t b = 0; b < bytes; b++)
            raw[i * bytes + b] = (uint8_t)(bits >> 8 * b);
    }
    return raw;
}

static void raw_layouts_are_read_as_images_are(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_pixel_layout layout;
        int code_max;
    } cases[] = {{GN_PIXELS_RGB_F32, 0},      {GN_PIXELS_RGB_F16, 0},    {GN_PIXELS_MONO_U16, 4095},
                 {GN_PIXELS_MONO_U16, 65535}, {GN_PIXELS_RGB_U16, 1000}, {GN_PIXELS_RGB_U8, 255}};
    for (size_t k = 0; k < GN_ARRAY_LEN(cases); k++) {
        struct light_fixture f;
        make_fixture(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 41, 37);
        enum gn_pixel_layout layout = cases[k].layout;
        int code_max = cases[k].code_max;
        for (int i = 0; i < 3 * 41 * 37; i++) {
            int texel = layout == GN_PIXELS_MONO_U16 ? i / 3 : i;
            float v = (float)(texel * 7919 % 1001) / 1000;
            if (code_max > 0) // what the codes can say
                v = (float)lrintf(v * (float)code_max) / (float)code_max;
            if (layout == GN_PIXELS_RGB_F16)
                v = gn_half_to_float(gn_half_from_float(v));
            f.image.data[i] = v;
        }
        if (code_max == 0) { // what cannot be light
            f.image.data[3 * (20 * 41 + 20)] = NAN;
            f.image.data[3 * (20 * 41 + 22) + 1] = -1;
            f.image.data[3 * (18 * 41 + 20) + 2] = INFINITY;
        }
        f.frame.response = (struct gn_response){.type = GN_RESPONSE_GAMMA, .gamma = 2.2};
        f.frame.code_max = code_max;
        struct gn_radiance_map *image = make_map(&f, NULL);
        uint8_t *raw = make_raw(&f, layout, code_max);
        f.frame.codes = NULL;
        f.frame.layout = layout;
        f.frame.raw = raw;
        struct gn_radiance_map *map = make_map(&f, NULL);
        for (int i = 0; i < 3 * 41 * 37; i++)
            if (!(map->radiance.data[i] == image->radiance.data[i]))
                fail_msg("layout %d, value %d: %.9g, the image's %.9g", layout, i,
                         (double)map->radiance.data[i], (double)image->radiance.data[i]);
        assert_memory_equal(&map->figures, &image->figures, sizeof(map->figures));
        assert_int_equal(map->figures.n_nan + map->figures.n_negative + map->figures.n_inf,
                         code_max == 0 ? 3 : 0);
        gn_radiance_map_unref(&map);
        gn_radiance_map_unref(&image);
        free(raw);
        light_fixture_finish(&f);
    }
}

/* A code that the format does not have is no light, wherever it stands in the circle. */
static void a_code_above_the_format_is_refused(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 16, 16);
    uint8_t *raw = make_raw(&f, GN_PIXELS_RGB_U16, 4095);
    f.frame.codes = NULL;
    f.frame.layout = GN_PIXELS_RGB_U16;
    f.frame.raw = raw;
    f.frame.code_max = 4095;
    struct gn_radiance_map *map = make_map(&f, NULL);
    assert_int_equal(map->figures.n_clipped, 16 * 16 - 4 * 12); // centres in the circle
    gn_radiance_map_unref(&map);
    raw[6 * (8 * 16 + 15) + 5] = 0x10; // 4096 and more, blue, at the right border
    struct gn_error error = {0};
    assert_int_equal(gn_radiance_map_create(&f.frame, NULL, NULL, &map, &error), -EINVAL);
    assert_null(map);
    assert_non_null(strstr(error.text, "a code of 4351 in a format of codes 0 to 4095"));
    free(raw);
    light_fixture_finish(&f);
}

/* The sums know which inner texel a rim's texel takes its light from; nothing outside is lit. */
static void figures_are_sums_over_the_map(void **unused)
{
    (void)unused;
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        for (int k = 0; k < 3; k++) {
            struct light_fixture f;
            make_fixture(&f, (enum gn_projection_type)type, k == 2 ? 3 : 37, k == 2 ? 5 : 29);
            if (k == 1 && gn_projection_is_radial((enum gn_projection_type)type))
                f.frame.projection = (struct gn_projection){.type = (enum gn_projection_type)type,
                                                            .width = 37,
                                                            .height = 29,
                                                            .center = {12, 20},
                                                            .radius = 15};
            int n = f.image.width * f.image.height;
            for (int i = 0; i < 3 * n; i++)
                f.image.data[i] = 1 + (float)(i * 7919 % 1009);
            struct gn_radiance_map *map = make_map(&f, NULL);
            double sum[3] = {0}, up = 0, max = 0;
            for (int i = 0; i < n; i++) {
                const float *l = map->radiance.data + 3 * i;
                double w = (double)map->solid_angle[i];
                assert_int_equal(l[0] == 0, w == 0);
                max = fmax(max, gn_luminance(l));
                up += fmax((double)map->direction_world[3 * i + 2], 0) * (double)l[0] * w;
                for (int c = 0; c < 3; c++)
                    sum[c] += (double)l[c] * w;
            }
            for (int c = 0; c < 3; c++)
                assert_near(map->figures.shown_irradiance[c], sum[c], 1e-6 * sum[c]);
            assert_true(map->figures.max_luminance == max);
            if (map->fill_solid_angle > 0)
                assert_near(map->fill[0], 0.2 * up / pi, 1e-6 * up);
            gn_radiance_map_unref(&map);
            light_fixture_finish(&f);
        }
    }
}

/* A lens that darkens to its rim, before a log sensor: the hemisphere is even again. */
static void vignetting_is_divided_out(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200);
    double v[3] = {-0.4, 0.1, -0.15};
    memcpy(f.frame.projection.vignetting, v, sizeof(v));
    f.frame.response = (struct gn_response){
        .type = GN_RESPONSE_LOG, .log_a = 0.6, .log_b = 0.08, .log_c = 0.01, .scale = 3};
    for (int y = 0; y < 200; y++) {
        for (int x = 0; x < 200; x++) {
            double s = (pow(x + 0.5 - 100, 2) + pow(y + 0.5 - 100, 2)) / 1e4;
            for (int c = 0; c < 3; c++)
                gn_image_at(&f.image, x, y)[c] = (float)(1 + s * (v[0] + s * (v[1] + s * v[2])));
        }
    }
    gn_response_from_radiance(&f.frame.response, f.image.data, 200 * 200);
    struct gn_radiance_map *map = make_map(&f, NULL);
    for (size_t i = 0; i < 200 * 200; i++)
        if (map->solid_angle[i] > 0)
            assert_near(map->radiance.data[3 * i], 1, 2e-6);
    assert_near(map->fill[0], 0.2, 1e-4); // E = pi
    /* The table of another fall-off is another. */
    f.frame.projection.vignetting[0] = 0;
    struct gn_radiance_map_options options = {.previous = map};
    struct gn_radiance_map *other = make_map(&f, &options);
    assert_true(gn_image_at(&other->radiance, 100, 5)[0] < 0.7f);
    gn_radiance_map_unref(&other);
    gn_radiance_map_unref(&map);

    static const double bad[4][3] = {{-1, 0, 0}, {-4, 3.5, 0.6}, {0, 0, -1.0001}, {NAN, 0, 0}};
    for (int i = 0; i < 4; i++) {
        const char *reason = NULL;
        memcpy(f.frame.projection.vignetting, bad[i], sizeof(bad[i]));
        assert_int_equal(gn_projection_init(&f.frame.projection, &reason), -EINVAL);
        assert_non_null(strstr(reason, "vignetting"));
    }
    light_fixture_finish(&f);
}

/* The largest scale behind a lens that darkens leaves black black. */
static void black_stays_black_under_any_scale(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 32, 32), 0);
    f.frame.codes = &f.image;
    f.frame.projection.vignetting[0] = -0.9;
    f.frame.response.scale = 1e30;
    struct gn_radiance_map *map = make_map(&f, NULL);
    assert_true(map->figures.max_luminance == 0);
    gn_radiance_map_unref(&map);
    struct gn_error error = {0};
    f.frame.response.scale = 1.7e308;
    assert_int_equal(gn_radiance_map_create(&f.frame, NULL, NULL, &map, &error), -EINVAL);
    assert_non_null(strstr(error.text, "scale"));
    light_fixture_finish(&f);
}

/* A code whose value leaves float's range, behind a matrix: only its own channel is bright. */
static void a_red_texel_stays_red_beyond_float(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 32, 16), 0);
    f.frame.response = (struct gn_response){
        .type = GN_RESPONSE_GAMMA, .gamma = 10, .to_rec709 = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    f.frame.codes = &f.image;
    gn_image_at(&f.image, 7, 5)[0] = 1e5f; // ^10
    struct gn_radiance_map *map = make_map(&f, NULL);
    const float *texel = gn_image_at(&map->radiance, 7, 5);
    assert_true(texel[0] == GN_RADIANCE_MAX && texel[1] == 0 && texel[2] == 0);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void every_projection_covers_its_sphere(void **unused)
{
    (void)unused;
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        struct light_fixture f;
        make_fixture(&f, (enum gn_projection_type)type, 121, 101);
        struct gn_radiance_map *map = make_map(&f, NULL);
        double sum = map->figures.shown_solid_angle + map->fill_solid_angle;
        assert_near(sum, 4 * pi, 4 * pi * 2e-5);
        assert_near(map->figures.mean_luminance, 1, 1e-6);
        assert_int_equal(map->is_full_sphere, map->fill_solid_angle == 0);
        for (int i = 0; i < 121 * 101; i++) {
            const float *d = map->direction_world + 3 * i;
            double n = (double)d[0] * (double)d[0] + (double)d[1] * (double)d[1] +
                       (double)d[2] * (double)d[2];
            if (map->solid_angle[i] > 0)
                assert_near(n, 1, 1e-6);
        }
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
}

static void texel_centres_look_up_themselves(void **unused)
{
    (void)unused;
    for (int type = 0; type < GN_PROJECTION_COUNT; type++) {
        struct light_fixture f;
        make_fixture(&f, (enum gn_projection_type)type, 32, 24);
        for (int i = 0; i < 3 * 32 * 24; i++)
            f.image.data[i] = (float)(i % 101);
        double turn[4] = {0.5, 0.5, -0.5, 0.5};
        memcpy(f.frame.world_from_probe, turn, sizeof(turn));
        struct gn_radiance_map *map = make_map(&f, NULL);
        for (int y = 0; y < 24; y++) {
            for (int x = 0; x < 32; x++) {
                size_t i = (size_t)y * 32 + (size_t)x;
                double dir[3];
                float rgb[3];
                if (!gn_projection_get_direction(&map->projection, x + 0.5, y + 0.5, dir))
                    continue;
                gn_radiance_map_get_radiance(map, map->direction_world + 3 * i, rgb);
                for (int c = 0; c < 3; c++)
                    assert_near(rgb[c], f.image.data[3 * i + (size_t)c], 2e-2);
            }
        }
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
}

static void directions_look_up_without_black_or_seam(void **unused)
{
    (void)unused;
    static const enum gn_projection_type types[4] = {GN_PROJECTION_LATLONG, GN_PROJECTION_ANGULAR,
                                                     GN_PROJECTION_MIRRORBALL,
                                                     GN_PROJECTION_FISHEYE_EQUIDISTANT};
    for (int t = 0; t < 4; t++) {
        struct light_fixture f;
        make_fixture(&f, types[t], t == 0 ? 33 : 30, t == 0 ? 17 : 30);
        struct gn_radiance_map_options options = {.no_fill = true};
        struct gn_radiance_map *map = make_map(&f, &options);
        double theta_max = map->projection.theta_max;
        for (int i = 0; i <= 200; i++) {
            for (int j = 0; j < 50; j++) {
                double theta = theta_max * i / 200, phi = 2 * pi * j / 50 - pi;
                float d[3] = {(float)(sin(theta) * cos(phi)), (float)(sin(theta) * sin(phi)),
                              (float)cos(theta)};
                float rgb[3];
                gn_radiance_map_get_radiance(map, d, rgb);
                if (i < 200 || theta_max > 3) // on the rim itself rounding decides
                    assert_near(rgb[1], 1, 1e-6);
            }
        }
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
    /* Across the seam and over a pole light is interpolated, not repeated or dropped. */
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_LATLONG, 8, 4);
    gn_image_at(&f.image, 0, 1)[0] = 3;
    gn_image_at(&f.image, 2, 0)[1] = 3;
    struct gn_radiance_map *map = make_map(&f, NULL);
    double seam[3], pole[3] = {0, 0, 1};
    float rgb[3];
    assert_true(gn_projection_get_direction(&map->projection, 0, 1.5, seam));
    gn_radiance_map_get_radiance(map, (float[3]){(float)seam[0], (float)seam[1], (float)seam[2]},
                                 rgb);
    assert_near(rgb[0], 2, 1e-5);
    assert_true(gn_projection_get_direction(&map->projection, 6.5, 0.0, pole));
    pole[1] += 1e-7 * sin(pi - 2 * pi * 6.5 / 8);
    pole[0] += 1e-7 * cos(pi - 2 * pi * 6.5 / 8);
    gn_radiance_map_get_radiance(map, (float[3]){(float)pole[0], (float)pole[1], (float)pole[2]},
                                 rgb);
    assert_near(rgb[1], 2, 1e-3); // half of texel 6, half of texel 2 beyond the pole
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void a_fisheye_is_filled_with_its_ground(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_FISHEYE_EQUISOLID, 100, 100);
    struct gn_radiance_map_options options = {.ground_albedo = 0.5f};
    struct gn_radiance_map *map = make_map(&f, &options);
    float rgb[3];
    assert_false(map->is_full_sphere);
    assert_near(map->fill_solid_angle, 2 * pi, 1e-9);
    assert_near(map->fill[0], 0.5, 1e-4); // E_up = pi
    gn_radiance_map_get_radiance(map, (float[3]){0, 0.6f, -0.8f}, rgb);
    assert_true(rgb[2] == map->fill[2]);
    gn_radiance_map_unref(&map);

    map = make_map(&f, NULL);
    assert_near(map->fill[1], 0.2, 1e-4);
    gn_radiance_map_unref(&map);
    options.no_fill = true;
    map = make_map(&f, &options);
    assert_true(map->fill[1] == 0);
    gn_radiance_map_unref(&map);

    /* A circle that the picture cuts: what it loses is the fill's. */
    f.frame.projection = (struct gn_projection){
        .type = GN_PROJECTION_FISHEYE_EQUISOLID, .width = 100, .height = 100, .radius = 60};
    map = make_map(&f, NULL);
    assert_true(map->fill_solid_angle > 2 * pi + 0.1);
    assert_near(map->fill_solid_angle + map->figures.shown_solid_angle, 4 * pi, 1e-6);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void a_stream_shares_tables_and_pixels(void **unused)
{
    (void)unused;
    struct light_fixture f;
    make_fixture(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 60, 60);
    struct gn_radiance_map *first = make_map(&f, NULL);
    struct gn_radiance_map_options options = {.previous = first};
    struct gn_radiance_map *second = make_map(&f, &options);
    assert_ptr_equal(first->solid_angle, second->solid_angle);
    const float *pixels = first->radiance.data;
    gn_radiance_map_unref(&first);
    options.previous = second;
    gn_image_at(&f.image, 30, 30)[0] = 7;
    struct gn_radiance_map *third = make_map(&f, &options);
    assert_ptr_equal(third->radiance.data, pixels);
    assert_true(gn_image_at(&second->radiance, 30, 30)[0] == 1);
    assert_true(gn_image_at(&third->radiance, 30, 30)[0] == 7);
    assert_true(third->radiance.data[0] == 0); // outside the circle

    /* Another orientation keeps the solid angles, and turns the directions. */
    double turn[4] = {sqrt(0.5), sqrt(0.5), 0, 0}; // z to -y
    memcpy(f.frame.world_from_probe, turn, sizeof(turn));
    options.previous = third;
    struct gn_radiance_map *turned = make_map(&f, &options);
    assert_ptr_not_equal(turned->direction_world, third->direction_world);
    size_t middle = 30 * 60 + 30;
    assert_true(turned->solid_angle[middle] == third->solid_angle[middle]);
    assert_near(turned->direction_world[3 * middle + 1], -1, 0.1);
    assert_ptr_equal(gn_radiance_map_ref(turned), turned);
    struct gn_radiance_map *same = turned;
    gn_radiance_map_unref(&same);
    gn_radiance_map_unref(&turned);
    gn_radiance_map_unref(&third);
    gn_radiance_map_unref(&second);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bad_frames_are_refused),
        cmocka_unit_test(what_is_no_light_is_mended_and_counted),
        cmocka_unit_test(codes_become_radiance),
        cmocka_unit_test(raw_layouts_are_read_as_images_are),
        cmocka_unit_test(a_code_above_the_format_is_refused),
        cmocka_unit_test(figures_are_sums_over_the_map),
        cmocka_unit_test(vignetting_is_divided_out),
        cmocka_unit_test(black_stays_black_under_any_scale),
        cmocka_unit_test(a_red_texel_stays_red_beyond_float),
        cmocka_unit_test(every_projection_covers_its_sphere),
        cmocka_unit_test(texel_centres_look_up_themselves),
        cmocka_unit_test(directions_look_up_without_black_or_seam),
        cmocka_unit_test(a_fisheye_is_filled_with_its_ground),
        cmocka_unit_test(a_stream_shares_tables_and_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
