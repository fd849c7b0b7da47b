/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Frames to radiance maps: mending, addressing, the fill, looking up, what a stream shares. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

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
        cmocka_unit_test(every_projection_covers_its_sphere),
        cmocka_unit_test(texel_centres_look_up_themselves),
        cmocka_unit_test(directions_look_up_without_black_or_seam),
        cmocka_unit_test(a_fisheye_is_filled_with_its_ground),
        cmocka_unit_test(a_stream_shares_tables_and_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
