/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The rig's light: sampling in proportion, densities, probes and log codes; the axes of its cameras
 * against common/, which it does not use. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "common/camera.h"
#include "common/pose.h"
#include "common/projection.h"
#include "tests/meshes.h"
#include "tests/rig/environment.h"
#include "tests/rig/sensor.h"
#include "tests/rig/vec.h"
#include "tests/rig/view.h"

static struct gn_rig_environment make_environment(int width, double distance, uint64_t seed)
{
    struct gn_rig_environment env;
    struct gn_image map;
    assert_int_equal(gn_image_init(&map, width, width / 2, 3), 0);
    for (int i = 0; i < 3 * width * width / 2; i++)
        map.data[i] = !seed   ? 1.0f
                      : i % 3 ? map.data[i - 1]
                              : (float)exp(8 * gn_test_random_unit(&seed));
    assert_int_equal(gn_rig_environment_init(&map, distance, &env, NULL), 0);
    return env;
}

/* How often each bright texel is chosen, against its density times its solid angle. */
static void test_chi_square(void **state)
{
    struct gn_rig_environment env = make_environment(32, 0, 11);
    const int n = 400000;
    const double middle[3] = {0};
    uint64_t seed = 5;
    int counts[512] = {0}, cells = 0;
    double chi2 = 0, total = 0;
    (void)state;
    for (int i = 0; i < n; i++) {
        struct gn_rig_light_sample s;
        double uv[2] = {gn_test_random_unit(&seed), gn_test_random_unit(&seed)};
        assert_true(gn_rig_environment_sample(&env, middle, uv, &s));
        double u = 0.5 - atan2(s.dir[1], s.dir[0]) / (2 * GN_RIG_PI);
        counts[(int)(acos(s.dir[2]) / GN_RIG_PI * 16) * 32 + (int)(u * 32)]++;
    }
    for (int i = 0; i < 512; i++) {
        double theta = GN_RIG_PI * (i / 32 + 0.5) / 16;
        double phi = GN_RIG_PI - 2 * GN_RIG_PI * (i % 32 + 0.5) / 32;
        const double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
        double expected = n * gn_rig_environment_get_pdf(&env, middle, dir) *
                          gn_rig_environment_get_texel_solid_angle(&env, i / 32);
        total += expected / n;
        if (expected == 0) {
            assert_true(counts[i] <= 2); // a sample on the texel's very edge
            continue;
        }
        cells++;
        chi2 += (counts[i] - expected) * (counts[i] - expected) / expected;
    }
    assert_true(fabs(total - 1) < 1e-9);
    print_message("# chi square %.1f in %d cells\n", chi2, cells);
    assert_true(cells > 40 && chi2 < cells + 5 * sqrt(2.0 * cells));
    gn_rig_environment_finish(&env);
}

/* Samples carry the density and the radiance that asking for their direction gives. */
static void test_samples(void **state)
{
    const double points[2][3] = {{0.3, -0.2, 0.1}, {0, 0, 0}};
    (void)state;
    for (int near = 0; near < 2; near++) {
        struct gn_rig_environment env = make_environment(64, near ? 0.8 : 0, 3);
        uint64_t seed = 9;
        int wrong = 0;
        for (int i = 0; i < 4000; i++) {
            struct gn_rig_light_sample s;
            double uv[2] = {gn_test_random_unit(&seed), gn_test_random_unit(&seed)}, rgb[3];
            assert_true(gn_rig_environment_sample(&env, points[i % 2], uv, &s));
            assert_true(gn_rig_environment_get_radiance(&env, points[i % 2], s.dir, rgb));
            double pdf = gn_rig_environment_get_pdf(&env, points[i % 2], s.dir);
            wrong += fabs(pdf / s.pdf_solid_angle - 1) > 1e-6 || rgb[0] != s.radiance[0];
            assert_true(fabs(vec_length(s.dir) - 1) < 1e-12);
            double distance = gn_rig_environment_get_distance(&env, points[i % 2], s.dir);
            assert_true(near ? fabs(distance - s.distance) < 1e-9 : isinf(distance));
        }
        assert_true(wrong <= 2);
        gn_rig_environment_finish(&env);
    }
}

/* Seen from anywhere inside a near sphere, the density integrates to 1. */
static void test_near_density(void **state)
{
    struct gn_rig_environment env = make_environment(16, 1, 21);
    const double point[3] = {0.4, 0.1, 0.3};
    const int n = 400000;
    uint64_t seed = 2;
    double sum = 0, squares = 0;
    (void)state;
    for (int i = 0; i < n; i++) {
        float d[3];
        gn_test_random_direction(&seed, d);
        const double dir[3] = {d[0], d[1], d[2]};
        double value = 4 * GN_RIG_PI * gn_rig_environment_get_pdf(&env, point, dir);
        sum += value / n;
        squares += value * value / n;
    }
    assert_true(fabs(sum - 1) < 4 * sqrt((squares - sum * sum) / n));
    gn_rig_environment_finish(&env);
}

static void test_constant(void **state)
{
    struct gn_rig_environment env = make_environment(256, 0, 0);
    const double normal[3] = {0.48, 0.6, 0.64}, uv[2] = {0.5, 0.5}, middle[3] = {0};
    struct gn_rig_light_sample s;
    double rgb[3], sum = 0;
    (void)state;
    gn_rig_environment_get_irradiance(&env, normal, rgb);
    assert_true(fabs(rgb[1] - GN_RIG_PI) < 1e-4);
    assert_false(gn_rig_environment_sample(&env, middle, uv, &s)); // nothing is bright
    for (int y = 0; y < 128; y++)
        sum += 256 * gn_rig_environment_get_texel_solid_angle(&env, y);
    assert_true(fabs(sum - 4 * GN_RIG_PI) < 1e-12);
    gn_rig_environment_finish(&env);
}

static void test_turn(void **state)
{
    struct gn_image map, turned;
    (void)state;
    assert_int_equal(gn_image_init(&map, 64, 32, 3), 0);
    gn_image_at(&map, 20, 9)[1] = 5; // phi = pi - 2 pi 20.5 / 64
    assert_int_equal(gn_rig_turn_map(&map, GN_RIG_PI / 4, &turned), 0);
    assert_true(gn_image_at(&turned, 12, 9)[1] == 5); // phi greater by an eighth turn
    gn_image_finish(&map);
    gn_image_finish(&turned);
}

static struct gn_rig_environment make_lamps(int n_lamps)
{
    struct gn_rig_environment env;
    struct gn_image map;
    assert_int_equal(gn_rig_paint_lamp_room(512, 256, n_lamps, NULL, &map), 0);
    assert_int_equal(gn_rig_environment_init(&map, 0, &env, NULL), 0);
    return env;
}

/* Light gathered from the probes' pixels by the textbook solid angle (2 theta_max / W)^2 sin(theta)
 * / theta, against sums over the map itself. */
static void test_probe_energy(void **state)
{
    static const double up[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const double position[3] = {0}, z[3] = {0, 0, 1};
    struct gn_rig_environment env = make_lamps(4);
    (void)state;
    for (int probe = 0; probe < 2; probe++) {
        struct gn_image image;
        double theta_max = probe == GN_RIG_FISHEYE ? GN_RIG_PI / 2 : GN_RIG_PI;
        double sum = 0, expected[3];
        assert_int_equal(
            gn_rig_take_probe(&env, (enum gn_rig_probe)probe, 300, up, position, NULL, &image), 0);
        for (int i = 0; i < 300 * 300; i++) {
            double theta = hypot(i % 300 - 149.5, i / 300 - 149.5) / 150 * theta_max;
            if (theta < theta_max)
                sum += pow(theta_max / 150, 2) * (theta > 0 ? sin(theta) / theta : 1) *
                       fmax(0, cos(theta)) * image.data[3 * i + 1];
        }
        gn_rig_environment_get_irradiance(&env, z, expected);
        assert_true(fabs(sum / expected[1] - 1) < 2e-3);
        gn_image_finish(&image);
    }
    gn_rig_environment_finish(&env);
}

/* The first lamp lies in the probe's picture where common/projection says, with the quaternion that
 * the sequence delivers. */
static void test_probe_axes(void **state)
{
    static const double turns[2][9] = {{0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1},
                                       {0, 0, 1, -1, 0, 0, 0, -1, 0}};
    const double azimuth = 152 * GN_RIG_PI / 180, elevation = 47 * GN_RIG_PI / 180;
    const double lamp[3] = {cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth),
                            sin(elevation)};
    const double position[3] = {0};
    struct gn_rig_environment env = make_lamps(1);
    (void)state;
    for (int probe = 0; probe < 2; probe++) {
        struct gn_projection projection = {.type = probe ? GN_PROJECTION_ANGULAR
                                                         : GN_PROJECTION_FISHEYE_EQUIDISTANT,
                                           .width = 300,
                                           .height = 300};
        struct gn_pose pose = {0}, probe_from_world;
        struct gn_image image;
        double seen[3], at[2], mean[2] = {0}, n = 0;
        assert_int_equal(gn_projection_init(&projection, NULL), 0);
        gn_rig_get_quaternion(turns[probe], pose.rotation);
        gn_pose_invert(&pose, &probe_from_world);
        gn_pose_rotate(&probe_from_world, lamp, seen);
        assert_true(gn_projection_get_position(&projection, seen, at));
        assert_int_equal(gn_rig_take_probe(&env, (enum gn_rig_probe)probe, 300, turns[probe],
                                           position, NULL, &image),
                         0);
        for (int i = 0; i < 300 * 300; i++)
            if (image.data[3 * i] > 84) { // half the lamp's red
                mean[0] += i % 300 + 0.5;
                mean[1] += i / 300 + 0.5;
                n++;
            }
        assert_true(n > 5);
        assert_true(hypot(mean[0] / n - at[0], mean[1] / n - at[1]) < 0.4);
        gn_image_finish(&image);
    }
    gn_rig_environment_finish(&env);
}

static void test_log_codes(void **state)
{
    const struct gn_rig_log_sensor sensor = gn_rig_make_log_sensor(0.5, 63000);
    (void)state;
    assert_int_equal(gn_rig_encode_log12(&sensor, 0), 0);
    assert_int_equal(gn_rig_encode_log12(&sensor, 63000), 4095);
    assert_int_equal(gn_rig_encode_log12(&sensor, 1e30), 4095);
    for (int code = 0; code < 4096; code++)
        assert_int_equal(gn_rig_encode_log12(&sensor, gn_rig_decode_log12(&sensor, code)), code);
    for (double x = 1e-7; x < 63000; x *= 1.01) {
        double back = gn_rig_decode_log12(&sensor, gn_rig_encode_log12(&sensor, x));
        double codes = 4095 * sensor.b * log((sensor.c + back) / (sensor.c + x));
        assert_true(fabs(codes) < 0.5 + 1e-9);
    }
}

/* The rig's rays are those of common/camera, which was written apart. */
static void test_camera_rays(void **state)
{
    const double position[3] = {0.1, -0.4, 0.3}, target[3] = {0.01, 0.02, 0};
    struct gn_rig_view view = {.width = 320,
                               .height = 240,
                               .fx = 420,
                               .fy = 425,
                               .cx = 158,
                               .cy = 123,
                               .distortion = {-0.11, 0.04, 0.0006, -0.0004, 0.01}};
    struct gn_camera camera = {
        .width = 320, .height = 240, .fx = 420, .fy = 425, .cx = 158, .cy = 123};
    (void)state;
    gn_rig_look_at(position, target, view.world_from_camera);
    memcpy(camera.distortion, view.distortion, sizeof(camera.distortion));
    assert_int_equal(gn_pose_from_matrix(view.world_from_camera, &camera.world_from_camera, NULL),
                     0);
    for (int y = 0; y <= 240; y += 24)
        for (int x = 0; x <= 320; x += 32) {
            double ours[3], theirs[3];
            gn_rig_view_get_ray(&view, x, y, ours);
            assert_true(gn_camera_get_ray(&camera, x, y, theirs));
            gn_pose_rotate(&camera.world_from_camera, theirs, theirs);
            for (int k = 0; k < 3; k++)
                assert_true(fabs(ours[k] - theirs[k]) < 1e-9);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_chi_square),   cmocka_unit_test(test_samples),
        cmocka_unit_test(test_near_density), cmocka_unit_test(test_constant),
        cmocka_unit_test(test_turn),         cmocka_unit_test(test_probe_energy),
        cmocka_unit_test(test_probe_axes),   cmocka_unit_test(test_log_codes),
        cmocka_unit_test(test_camera_rays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
