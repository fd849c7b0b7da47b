/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where a probe looks, found from the rig's fisheye frames of lamps with known directions, 12-bit
 * log codes, moved circles, tilted probes; lenses and balls of known truth; masks.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/fisheye.h"
#include "client/calibrate/solve.h"
#include "client/calibrate/spots.h"
#include "common/pool.h"
#include "common/probe_mask.h"
#include "proto/attr.h"
#include "tests/rig/environment.h"
#include "tests/rig/sensor.h"
#include "tests/rig/view.h"
#include "tests/unit/cmocka_setup.h"

#define PI 3.14159265358979323846
#define SIZE 300

/* Azimuth and elevation of the lamp room's lamps, deg (tests/rig/lamp_room.c). */
static const double lamps_deg[GN_RIG_LAMPS][2] = {{152, 47}, {18, 38}, {262, 62}, {66, 26}};

static void get_lamp(int i, double out[3])
{
    double a = lamps_deg[i][0] * PI / 180, e = lamps_deg[i][1] * PI / 180;
    out[0] = cos(e) * cos(a);
    out[1] = cos(e) * sin(a);
    out[2] = sin(e);
}

static struct gn_projection make_projection(void)
{
    struct gn_projection p = {
        .type = GN_PROJECTION_FISHEYE_EQUIDISTANT, .width = SIZE, .height = SIZE};
    assert_int_equal(gn_projection_init(&p, NULL), 0);
    return p;
}

static double get_difference_deg(const struct gn_pose *a, const double b[4])
{
    double dot = 0;
    for (int i = 0; i < 4; i++)
        dot += a->rotation[i] * b[i];
    return 2 * acos(fmin(fabs(dot), 1)) * 180 / PI;
}

/* The light of the codes that the rig's log sensor gives of the lamp room with n lamps. */
static void take_frame(struct gn_pool *pool, int n_lamps, const double world_from_probe[9],
                       struct gn_image *out_light)
{
    struct gn_image map, frame;
    struct gn_rig_environment env;
    assert_int_equal(gn_rig_paint_lamp_room(360, 180, n_lamps, pool, &map), 0);
    assert_int_equal(gn_rig_environment_init(&map, 0, &env, NULL), 0);
    assert_int_equal(gn_rig_take_probe(&env, GN_RIG_FISHEYE, SIZE, world_from_probe,
                                       gn_rig_probe_position, pool, &frame),
                     0);
    struct gn_rig_log_sensor sensor = gn_rig_make_log_sensor(2, 250);
    assert_int_equal(gn_image_init(out_light, SIZE, SIZE, 1), 0);
    for (int i = 0; i < SIZE * SIZE; i++)
        out_light->data[i] = (float)gn_rig_decode_log12(
            &sensor, gn_rig_encode_log12(&sensor, (double)frame.data[3 * i + 1]));
    gn_image_finish(&frame);
    gn_rig_environment_finish(&env);
}

/* Turns the rig's own orientation by `turn` about a slanted axis. */
static void tilt(double turn, double out[9])
{
    const double *m = gn_rig_world_from_probe[GN_RIG_FISHEYE];
    struct gn_pose base,
        slanted = {
            {cos(turn / 2), 0.6 * sin(turn / 2), -0.64 * sin(turn / 2), 0.48 * sin(turn / 2)}, {0}};
    double full[16] = {m[0], m[1], m[2], 0, m[3], m[4], m[5], 0, m[6], m[7], m[8], 0, 0, 0, 0, 1};
    assert_int_equal(gn_pose_from_matrix(full, &base, NULL), 0);
    gn_pose_multiply(&slanted, &base, &slanted);
    gn_pose_to_matrix(&slanted, full);
    for (int i = 0; i < 9; i++)
        out[i] = full[4 * (i / 3) + i % 3];
}

static void test_rig_frames(void **unused)
{
    (void)unused;
    struct gn_pool *pool = NULL;
    struct gn_projection projection = make_projection();
    assert_int_equal(gn_pool_create(2, &pool), 0);
    double worst = 0;
    for (int pose = 0; pose < 3; pose++) {
        struct gn_fisheye_puzzle candidates[256];
        struct gn_fisheye_sighting sightings[256];
        double world_from_probe[9], truth[4];
        int n = 0;
        tilt(0.12 * pose, world_from_probe);
        gn_rig_get_quaternion(world_from_probe, truth);
        for (int lamps = 2; lamps <= GN_RIG_LAMPS; lamps++) {
            struct gn_image light;
            struct gn_spot spots[GN_SPOTS_MAX];
            take_frame(pool, lamps, world_from_probe, &light);
            int n_spots = gn_spots_find(&light, 0.2, lamps + 2, spots);
            assert_true(n_spots >= 2);
            for (int s = 0; s < n_spots; s++)
                for (int l = 0; l < lamps; l++) {
                    candidates[n].picture = lamps;
                    memcpy(candidates[n].xy, spots[s].xy, sizeof(spots[s].xy));
                    get_lamp(l, candidates[n++].dir_world);
                }
            gn_image_finish(&light);
        }
        struct gn_error e = {0};
        struct gn_fisheye_fit fit;
        int stride = 0,
            seen = gn_fisheye_match(&projection, candidates, n, 4, sightings, &stride, &e);
        if (seen < 0 || gn_fisheye_fit(&projection, 0, sightings, seen, &fit, &e) < 0)
            fail_msg("%s", e.text);
        double error = get_difference_deg(&fit.world_from_probe, truth);
        printf("# pose %d: %d lamps seen, orientation off by %.4f deg, lamps by %.3f, condition "
               "%.1f\n",
               pose, seen, error, fit.rms_deg, fit.condition);
        assert_true(seen >= 8);
        worst = fmax(worst, error);
    }
    assert_true(worst < 0.08);
    gn_pool_destroy(&pool);
}

/* Synthetic sightings of a Kannala-Brandt lens off centre, spots off by some hundredths of a px. */
static int see(const struct gn_projection *truth, const struct gn_pose *world_from_probe, int n,
               double span, double noise, struct gn_fisheye_sighting *out)
{
    uint32_t random = 7;
    int seen = 0;
    for (int i = 0; i < n; i++) {
        double theta = span * sqrt((i + 0.5) / n), phi = 2.399963 * i, at[2];
        double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
        if (!gn_projection_get_position(truth, dir, at))
            continue;
        for (int k = 0; k < 2; k++) {
            random = random * 1664525u + 1013904223u;
            out[seen].xy[k] = at[k] + noise * ((random >> 8) / 8388608.0 - 1);
        }
        gn_pose_rotate(world_from_probe, dir, out[seen++].dir_world);
    }
    return seen;
}

static void test_lens(void **unused)
{
    (void)unused;
    struct gn_projection truth = {.type = GN_PROJECTION_FISHEYE_KANNALA_BRANDT,
                                  .width = SIZE,
                                  .height = SIZE,
                                  .center = {154, 147},
                                  .focal = 88,
                                  .theta_max = PI / 2,
                                  .k = {-0.03, 0.004, -0.001, 0}};
    struct gn_projection guess = make_projection();
    struct gn_fisheye_sighting s[64];
    struct gn_fisheye_fit fit;
    struct gn_pose pose = {{0.8, 0.5, -0.3, 0.1}, {0}};
    assert_int_equal(gn_pose_normalize(&pose), 0);
    assert_int_equal(gn_projection_init(&truth, NULL), 0);
    int n = see(&truth, &pose, 48, 1.5, 0.1, s);
    struct gn_error e = {0};
    if (gn_fisheye_fit(&guess, GN_FISHEYE_CENTER | GN_FISHEYE_RADIUS | GN_FISHEYE_LENS, s, n, &fit,
                       &e) < 0)
        fail_msg("%s", e.text);
    double worst = 0;
    for (int i = 0; i < 200; i++) {
        double x = 60 + 0.9 * i, y = 240 - 0.9 * i, a[3], b[3];
        if (gn_projection_get_direction(&truth, x, y, a) &&
            gn_projection_get_direction(&fit.projection, x, y, b)) {
            gn_pose_rotate(&pose, a, a);
            gn_pose_rotate(&fit.world_from_probe, b, b);
            worst = fmax(worst, acos(fmin(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], 1)) * 180 / PI);
        }
    }
    printf("# lens: centre %.2f %.2f, worst direction %.3f deg, lamps %.3f, condition %.1f\n",
           fit.projection.center[0], fit.projection.center[1], worst, fit.rms_deg, fit.condition);
    assert_true(worst < 0.1 && worst > 0);
    assert_true(fabs(fit.projection.center[0] - 154) < 0.1);
    // The same lamps near the axis only: the lens is not determined.
    n = see(&truth, &pose, 48, 0.2, 0.1, s);
    assert_int_equal(gn_fisheye_fit(&guess, GN_FISHEYE_LENS | GN_FISHEYE_RADIUS, s, n, &fit, &e),
                     -EDOM);
    assert_non_null(strstr(e.text, "do not determine the lens"));
    // A ring of lamps: all that is known is one angle's distance from the centre.
    for (int i = 0; i < 16; i++) {
        const double dir[3] = {sin(1) * cos(i), sin(1) * sin(i), cos(1)};
        assert_true(gn_projection_get_position(&truth, dir, s[i].xy));
        gn_pose_rotate(&pose, dir, s[i].dir_world);
    }
    assert_int_equal(gn_fisheye_fit(&truth, GN_FISHEYE_LENS, s, 16, &fit, &e), -EDOM);
    assert_non_null(strstr(e.text, "condition number"));
    assert_int_equal(gn_fisheye_fit(&truth, GN_FISHEYE_RADIUS, s, 16, &fit, &e), 0);
}

static void test_refusals(void **unused)
{
    (void)unused;
    struct gn_projection p = make_projection();
    struct gn_pose pose = {{1, 0, 0, 0}, {0}};
    struct gn_fisheye_sighting s[64];
    struct gn_fisheye_fit fit;
    struct gn_error e = {0};
    int n = see(&p, &pose, 20, 1.5, 0, s);
    assert_int_equal(gn_fisheye_fit(&p, 0, s, 1, &fit, &e), -EDOM);
    assert_non_null(strstr(e.text, "do not determine an orientation"));
    s[1] = s[0]; // twice the same lamp
    assert_int_equal(gn_fisheye_fit(&p, 0, s, 2, &fit, &e), -EDOM);
    assert_non_null(strstr(e.text, "do not determine an orientation"));
    assert_int_equal(gn_fisheye_fit(&p, GN_FISHEYE_LENS | GN_FISHEYE_CENTER, s + 2, 4, &fit, &e),
                     -EDOM);
    assert_non_null(strstr(e.text, "too few"));
    int stride = 0;
    struct gn_fisheye_puzzle wrong[4] = {{{150, 150}, {0, 0, 1}}, {{250, 150}, {0, 0.1, 0.995}}};
    assert_int_equal(gn_fisheye_match(&p, wrong, 2, 3, s, &stride, &e), -EDOM);
    assert_non_null(strstr(e.text, "within 3.0 degrees"));
    assert_int_equal(n, 20);
}

/* Two lamps in one picture may be each other; in two pictures, or with a third, they are not. */
static void test_two_lamps(void **unused)
{
    (void)unused;
    struct gn_projection p = make_projection();
    const struct gn_pose truth = {{0.8, 0, 0.6, 0}, {0}};
    struct gn_fisheye_sighting lamps[3], s[9];
    struct gn_fisheye_puzzle candidates[9];
    struct gn_error e = {0};
    int stride = 0, n = 0;
    assert_int_equal(see(&p, &truth, 3, 1.2, 0, lamps), 3);
    for (int n_lamps = 2; n_lamps <= 3; n_lamps++) {
        n = 0;
        for (int i = 0; i < n_lamps * n_lamps; i++, n++) {
            memcpy(candidates[i].xy, lamps[i / n_lamps].xy, sizeof(lamps[0].xy));
            memcpy(candidates[i].dir_world, lamps[i % n_lamps].dir_world, 3 * sizeof(double));
            candidates[i].picture = 0;
        }
        int found = gn_fisheye_match(&p, candidates, n, 2, s, &stride, &e);
        assert_int_equal(found, n_lamps == 2 ? -EDOM : 3);
    }
    assert_non_null(strstr(e.text, "two orientations bring 2 spots to their lamps alike"));
    candidates[1] = candidates[4]; // each with its own spot, in a picture of its own
    candidates[1].picture = 1;
    assert_int_equal(gn_fisheye_match(&p, candidates, 2, 2, s, &stride, &e), 2);
}

/* A flare 4 px (2.4 degrees) below two lamps in three, within the tolerance: it is no second
 * sighting. */
static void test_flares(void **unused)
{
    (void)unused;
    struct gn_projection p = make_projection();
    const struct gn_pose truth = {{1, 0, 0, 0}, {0}};
    struct gn_fisheye_puzzle candidates[24];
    struct gn_fisheye_sighting lamps[12], s[24];
    struct gn_fisheye_fit fit;
    struct gn_error e = {0};
    assert_int_equal(see(&p, &truth, 12, 1.2, 0, lamps), 12);
    for (int i = 0; i < 24; i++) {
        candidates[i] = (struct gn_fisheye_puzzle){.picture = i / 2};
        memcpy(candidates[i].xy, lamps[i / 2].xy, sizeof(lamps[i / 2].xy));
        memcpy(candidates[i].dir_world, lamps[i / 2].dir_world, sizeof(lamps[i / 2].dir_world));
        candidates[i].xy[1] += i % 2 && i % 3 ? 4 : 0;
    }
    int stride = 0, n = gn_fisheye_match(&p, candidates, 24, 4, s, &stride, &e);
    assert_int_equal(n, 12);
    assert_int_equal(gn_fisheye_fit(&p, 0, s, n, &fit, &e), 0);
    printf("# flares: %.4f degrees off\n", fit.worst_deg);
    assert_true(fit.worst_deg < 0.01);
}

/* More pairs than can all be tried: it says so, and finds the lamps among them. */
static void test_many_pairs(void **unused)
{
    (void)unused;
    enum { LAMPS = 45 };
    struct gn_projection p = make_projection();
    const struct gn_pose truth = {{0.8, 0, 0.6, 0}, {0}};
    struct gn_fisheye_sighting lamps[LAMPS];
    struct gn_fisheye_puzzle *candidates = calloc((size_t)LAMPS * LAMPS, sizeof(*candidates));
    struct gn_fisheye_sighting *found = calloc((size_t)LAMPS * LAMPS, sizeof(*found));
    struct gn_fisheye_fit fit;
    struct gn_error e = {0};
    int stride = 0;
    assert_true(candidates && found);
    assert_int_equal(see(&p, &truth, LAMPS, 1.5, 0.1, lamps), LAMPS);
    for (int i = 0; i < LAMPS * LAMPS; i++) {
        memcpy(candidates[i].xy, lamps[i / LAMPS].xy, sizeof(lamps[0].xy));
        memcpy(candidates[i].dir_world, lamps[i % LAMPS].dir_world, sizeof(lamps[0].dir_world));
    }
    int n = gn_fisheye_match(&p, candidates, LAMPS * LAMPS, 2, found, &stride, &e);
    printf("# %d pairs: %d found, one orientation in %d tried\n", LAMPS * LAMPS, n, stride);
    assert_true(n == LAMPS && stride > 1);
    assert_int_equal(gn_fisheye_fit(&p, 0, found, n, &fit, &e), 0);
    assert_true(get_difference_deg(&fit.world_from_probe, truth.rotation) < 0.05);
    free(candidates);
    free(found);
}

/* Codes of a log sensor rise far outside a blurred rim; the light does not. */
static void test_rim_of_codes(void **unused)
{
    (void)unused;
    struct gn_image light, codes;
    struct gn_circle circle;
    const struct gn_rig_log_sensor sensor = gn_rig_make_log_sensor(0.3, 30);
    assert_int_equal(gn_image_init(&light, SIZE, SIZE, 1), 0);
    assert_int_equal(gn_image_init(&codes, SIZE, SIZE, 1), 0);
    for (int i = 0; i < SIZE * SIZE; i++) {
        double r = hypot(i % SIZE + 0.5 - 151.2, i / SIZE + 0.5 - 148.6);
        light.data[i] = (float)(0.5 * 0.2 * (1 + erf((130 - r) / (sqrt(2) * 0.9))));
        codes.data[i] = (float)(gn_rig_encode_log12(&sensor, (double)light.data[i]) / 4095.0);
    }
    assert_int_equal(gn_circle_find_disc(&codes, &light, &circle, NULL), 0);
    printf("# rim of codes: radius %.2f, in truth 130\n", circle.radius);
    assert_true(fabs(circle.radius - 130) < 0.15 && fabs(circle.center[0] - 151.2) < 0.1);
    assert_int_equal(gn_circle_find_disc(&codes, &codes, &circle, NULL), 0);
    assert_true(circle.radius > 130.5); // by the codes alone
    gn_image_finish(&light);
    gn_image_finish(&codes);
}

/* A disc of uneven light in the dark, its outline cut by the picture's edge. */
static void test_image_circle(void **unused)
{
    (void)unused;
    struct gn_image image;
    struct gn_circle circle;
    struct gn_error e = {0};
    assert_int_equal(gn_image_init(&image, 400, 260, 1), 0);
    for (int y = 0; y < 260; y++)
        for (int x = 0; x < 400; x++) {
            double r = hypot(x + 0.5 - 203.3, y + 0.5 - 128.7);
            double edge = fmin(fmax(137.2 - r + 0.5, 0), 1);
            *gn_image_at(&image, x, y) =
                (float)(0.01 + edge * (0.3 + 0.2 * sin(0.03 * x) * cos(0.05 * y) +
                                       (hypot(x - 260, y - 90) < 9 ? 0.4 : 0)));
        }
    if (gn_circle_find_disc(&image, &image, &circle, &e) < 0)
        fail_msg("%s", e.text);
    printf("# disc: %.2f %.2f radius %.2f\n", circle.center[0], circle.center[1], circle.radius);
    assert_true(fabs(circle.center[0] - 203.3) < 0.3 && fabs(circle.center[1] - 128.7) < 0.3);
    assert_true(fabs(circle.radius - 137.2) < 0.6);
    for (int i = 0; i < 400 * 260; i++)
        image.data[i] = 0.3f;
    assert_int_equal(gn_circle_find_disc(&image, &image, &circle, &e), -EDOM);
    assert_non_null(strstr(e.text, "no image circle"));
    assert_non_null(strstr(e.text, "write \"center\" and \"radius\", in px, into probe.json"));
    gn_image_finish(&image);
}

/* A ball before a wall that hides a third of its outline, from a guess that is off by 8 %. */
static void test_ball(void **unused)
{
    (void)unused;
    struct gn_image image;
    struct gn_circle circle, guess = {{150, 121}, 74, 0, 0};
    struct gn_error e = {0};
    assert_int_equal(gn_image_init(&image, 320, 240, 1), 0);
    for (int y = 0; y < 240; y++)
        for (int x = 0; x < 320; x++) {
            double r = hypot(x + 0.5 - 155.4, y + 0.5 - 116.1);
            double edge = fmin(fmax(80.3 - r + 0.5, 0), 1);
            double wall = 0.5 + 0.1 * sin(0.2 * x), ball = 0.2 + 0.15 * sin(0.11 * x + 0.07 * y);
            ball = x > 200 ? wall : ball;
            *gn_image_at(&image, x, y) = (float)(edge * ball + (1 - edge) * wall);
        }
    if (gn_circle_find_ball(&image, &guess, &circle, &e) < 0)
        fail_msg("%s", e.text);
    printf("# ball: %.2f %.2f radius %.2f, %.2f px off\n", circle.center[0], circle.center[1],
           circle.radius, circle.rms);
    assert_true(fabs(circle.center[0] - 155.4) < 0.4 && fabs(circle.center[1] - 116.1) < 0.4);
    assert_true(fabs(circle.radius - 80.3) < 0.4);
    for (int i = 0; i < 320 * 240; i++)
        image.data[i] = 0.4f;
    assert_int_equal(gn_circle_find_ball(&image, &guess, &circle, &e), -EDOM);
    assert_non_null(strstr(e.text, "no ball is seen near (150, 121)"));
    gn_image_finish(&image);
}

/* A linear ramp is harmonic: what a mask fills is the ramp again, in all three kinds of samples. */
static void test_mask(void **unused)
{
    (void)unused;
    enum { W = 60, H = 50 };
    static float f[H][W][3];
    static uint16_t u16[H][W];
    static uint8_t u8[H][W][3];
    for (int pass = 0; pass < 2; pass++)
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                bool is_hole = hypot(x + 0.5 - 30, y + 0.5 - 25) <= 12;
                double ramp = 20 + 2 * x + y;
                if (pass == 0) {
                    u16[y][x] = is_hole ? 4000 : (uint16_t)(10 * ramp);
                    for (int c = 0; c < 3; c++) {
                        f[y][x][c] = is_hole ? NAN : (float)(ramp * (c + 1));
                        u8[y][x][c] = is_hole ? 255 : (uint8_t)ramp;
                    }
                } else {
                    double slack = is_hole ? 2.5 : 0;
                    assert_true(fabs(u16[y][x] - 10 * ramp) <= 10 * slack);
                    for (int c = 0; c < 3; c++) {
                        assert_true(fabs((double)f[y][x][c] - ramp * (c + 1)) <= slack * (c + 1));
                        assert_true(fabs(u8[y][x][c] - ramp) <= slack);
                    }
                }
                struct gn_probe_mask mask = {{30, 25}, 12};
                if (pass == 0 && y == H - 1 && x == W - 1) {
                    gn_probe_mask_fill(&mask, 1, f, W, H, 3, GN_PROBE_MASK_F32);
                    gn_probe_mask_fill(&mask, 1, u16, W, H, 1, GN_PROBE_MASK_U16);
                    gn_probe_mask_fill(&mask, 1, u8, W, H, 3, GN_PROBE_MASK_U8);
                }
            }
    // Hanging over every edge, and far outside: nothing is touched out of bounds, dark at worst.
    struct gn_probe_mask wild[3] = {{{30, 25}, 500}, {{-1e6, 3}, 2}, {{59, 49}, 30}};
    gn_probe_mask_fill(wild, 3, f, W, H, 3, GN_PROBE_MASK_F32);
    for (int i = 0; i < W * H * 3; i++)
        assert_true((&f[0][0][0])[i] == 0);
}

/* The solver on what has closed forms: rotations, rank 2, reflections. */
static void test_wahba(void **unused)
{
    (void)unused;
    double r[9], s[3];
    const double turn[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    const double flat[9] = {0, -2, 0, 1, 0, 0, 0, 0, 0}; // two directions: rank 2
    const double mirror[9] = {1, 0, 0, 0, 1, 0, 0, 0, -1e-3};
    assert_int_equal(gn_solve_wahba(turn, r, s), 0);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(r[i] - turn[i]) < 1e-14);
    assert_int_equal(gn_solve_wahba(flat, r, s), 0);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(r[i] - turn[i]) < 1e-14);
    assert_int_equal(gn_solve_wahba(mirror, r, s), 0); // a rotation all the same
    assert_true(fabs(r[8] - 1) < 1e-14 && s[2] < 0);
    const double none[9] = {0};
    assert_int_equal(gn_solve_wahba(none, r, s), -EDOM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rig_frames),   cmocka_unit_test(test_lens),
        cmocka_unit_test(test_refusals),     cmocka_unit_test(test_image_circle),
        cmocka_unit_test(test_ball),         cmocka_unit_test(test_mask),
        cmocka_unit_test(test_wahba),        cmocka_unit_test(test_two_lamps),
        cmocka_unit_test(test_flares),       cmocka_unit_test(test_many_pairs),
        cmocka_unit_test(test_rim_of_codes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
