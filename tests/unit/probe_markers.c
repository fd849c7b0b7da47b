/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where a fisheye is and how it looks, from the rig's photographs of markers through it: 12-bit log
 * codes with noise, a lens off centre, markers from the middle to the rim; what is refused.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/fisheye_markers.h"
#include "client/calibrate/probe_pose.h"
#include "client/calibrate/rectify.h"
#include "client/track/rotation.h"
#include "client/vision/markers.h"
#include "tests/rig/marker_picture.h"
#include "tests/rig/random.h"
#include "tests/rig/sensor.h"
#include "tests/unit/cmocka_setup.h"

#define PI 3.14159265358979323846
#define SIZE 480

enum { ID = 7, OTHER_ID = 12 };

/* 0.12 m on a side, in the world's origin; another one beside it, tilted by 40 degrees. */
static const double side = 0.12;
static const struct gn_pose other_place = {{0.9396926, 0.34202014, 0, 0}, {0.25, 0.05, 0.02}};

static const struct gn_rig_fisheye lens = {.width = SIZE,
                                           .height = SIZE,
                                           .center = {243.2, 237.7},
                                           .focal = 152,
                                           .k = {-0.02, 0.001},
                                           .theta_max = PI / 2,
                                           .blur_px = 0.5};
static struct gn_rig_marker_camera camera;

static struct gn_projection get_projection(void)
{
    struct gn_projection p = {.type = GN_PROJECTION_FISHEYE_KANNALA_BRANDT,
                              .width = SIZE,
                              .height = SIZE,
                              .center = {lens.center[0], lens.center[1]},
                              .focal = lens.focal,
                              .theta_max = lens.theta_max,
                              .k = {lens.k[0], lens.k[1]}};
    assert_int_equal(gn_projection_init(&p, NULL), 0);
    return p;
}

static void print_marker(int id, const struct gn_pose *place, struct gn_rig_sheet *out)
{
    *out = (struct gn_rig_sheet){.half_width = 0.7 * side, .half_height = 0.7 * side};
    gn_pose_to_matrix(place, out->world_from_sheet);
    out->n_printed = 1;
    out->printed[0].size = side;
    out->printed[0].cells = gn_marker_get_cells(0, id, out->printed[0].white);
}

/* The light that the codes of a log sensor stand for; a lamp of 200 beside the marker. */
static void take_picture(const struct gn_pose *world_from_probe, int n_sheets, int frame,
                         struct gn_image *out_light)
{
    static const struct gn_pose here = {{1, 0, 0, 0}, {0}};
    struct gn_rig_sheet sheets[2];
    struct gn_image linear;
    print_marker(ID, &here, &sheets[0]);
    print_marker(OTHER_ID, &other_place, &sheets[1]);
    gn_pose_to_matrix(world_from_probe, camera.view.world_from_camera);
    assert_int_equal(gn_rig_take_markers(&camera, sheets, n_sheets, &linear), 0);
    assert_int_equal(gn_image_init(out_light, SIZE, SIZE, 1), 0);
    const struct gn_rig_log_sensor sensor = gn_rig_make_log_sensor(0.3, 250);
    for (int i = 0; i < SIZE * SIZE; i++) {
        uint32_t words[4];
        gn_rig_philox((const uint32_t[4]){(uint32_t)i, (uint32_t)frame, 0, 0},
                      (const uint32_t[2]){3, 5}, words);
        double light = (double)linear.data[3 * i];
        bool is_lamp = hypot(i % SIZE - 250, i / SIZE - 80) < 9;
        double noise = 2 * (words[0] * 0x1p-32 + words[1] * 0x1p-32 + words[2] * 0x1p-32 - 1.5);
        int code = gn_rig_encode_log12(&sensor, is_lamp ? 200 : light) + (int)round(4 * noise);
        out_light->data[i] = (float)gn_rig_decode_log12(&sensor, code < 0 ? 0 : code);
    }
    gn_image_finish(&linear);
}

/* A probe `distance` from the first marker's middle, `tilt` off its normal; the marker appears
 * theta off the probe's axis. */
static struct gn_pose place_probe(double distance, double tilt, double azimuth, double theta,
                                  double phi)
{
    const double eye[3] = {distance * sin(tilt) * cos(azimuth), distance * sin(tilt) * sin(azimuth),
                           distance * cos(tilt)};
    double m[16];
    struct gn_pose look, turn = {0};
    gn_rig_look_at(eye, (const double[3]){0, 0, 0}, m);
    assert_int_equal(gn_pose_from_matrix(m, &look, NULL), 0);
    gn_rotation_exp((const double[3]){theta * cos(phi), theta * sin(phi), 0}, turn.rotation);
    gn_pose_multiply(&look, &turn, &look);
    return look;
}

static double get_off_deg(const struct gn_pose *a, const struct gn_pose *b)
{
    return gn_rotation_get_angle(a->rotation, b->rotation) * 180 / PI;
}

static double get_off_m(const struct gn_pose *a, const struct gn_pose *b)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += pow(a->translation[k] - b->translation[k], 2);
    return sqrt(sum);
}

static void set_corners(const struct gn_fisheye_marker *marker, struct gn_probe_sighting *out)
{
    static const struct gn_pose here = {{1, 0, 0, 0}, {0}};
    *out = (struct gn_probe_sighting){.error_rad = marker->error_rad, .marker = marker->id};
    memcpy(out->dirs_probe, marker->dirs, sizeof(out->dirs_probe));
    for (int k = 0; k < 4; k++) {
        const double corner[3] = {k == 0 || k == 3 ? -side / 2 : side / 2,
                                  k < 2 ? side / 2 : -side / 2, 0};
        gn_pose_transform(marker->id == ID ? &here : &other_place, corner, out->corners_world[k]);
    }
}

static int find(const struct gn_image *light, struct gn_probe_sighting *out)
{
    struct gn_projection projection = get_projection();
    static struct gn_fisheye_marker markers[GN_FISHEYE_MAX_MARKERS];
    struct gn_fisheye_finder *finder;
    struct gn_error e = {0};
    int n_twice;
    if (gn_fisheye_finder_create(&projection, 0, &finder, &e) < 0)
        fail_msg("%s", e.text);
    int n = gn_fisheye_finder_find(finder, light, markers, &n_twice, &e);
    gn_fisheye_finder_destroy(&finder);
    assert_true(n >= 0 && n_twice == 0);
    int n_out = 0;
    for (int i = 0; i < n; i++)
        if (markers[i].id == ID || markers[i].id == OTHER_ID) {
            assert_false(markers[i].is_coarse);
            set_corners(&markers[i], &out[n_out++]);
        }
    return n_out;
}

static void test_rig_pictures(void **unused)
{
    (void)unused;
    static const struct {
        double distance, tilt, azimuth, theta, phi; // m, deg
    } cases[] = {{0.5, 30, 20, 0, 0},
                 {0.4, 40, 140, 35, 70},
                 {0.45, 25, 260, 60, 200},
                 {0.35, 50, 330, 75, 300},
                 {0.6, 45, 80, 50, 120}};
    double worst = 0, worst_m = 0, chi2 = 0;
    int n_cases = sizeof(cases) / sizeof(*cases);
    for (int i = 0; i < n_cases; i++) {
        struct gn_pose truth =
            place_probe(cases[i].distance, cases[i].tilt * PI / 180, cases[i].azimuth * PI / 180,
                        cases[i].theta * PI / 180, cases[i].phi * PI / 180);
        struct gn_image light;
        struct gn_probe_sighting s[8];
        struct gn_probe_pose found;
        struct gn_error e = {0};
        take_picture(&truth, 1, i, &light);
        int n = find(&light, s);
        gn_image_finish(&light);
        if (n != 1 || gn_probe_pose_fit(s, n, &found, &e) < 0)
            fail_msg("case %d: %d markers: %s", i, n, e.text);
        double deg = get_off_deg(&found.world_from_probe, &truth);
        double m = get_off_m(&found.world_from_probe, &truth);
        printf("# one marker, %g m, %g deg off the axis: %.3f deg (said: %.3f), %.2f mm (%.2f), "
               "corners %.3f deg, margin %.0f\n",
               cases[i].distance, cases[i].theta, deg, found.error_rad * 180 / PI, 1e3 * m,
               1e3 * found.error_m, found.rms_rad * 180 / PI, found.margin);
        worst = fmax(worst, deg);
        worst_m = fmax(worst_m, m);
        chi2 += pow(deg / (found.error_rad * 180 / PI), 2) / n_cases;
    }
    assert_true(worst < 0.15 && worst_m < 0.0016);
    // The errors said are neither empty nor idle: three axes, each no worse than the worst.
    assert_true(chi2 < 3 && chi2 > 0.05);
}

/* Edges blurred wider than their profiles in the finest view: a coarser one has them. */
static void test_blurred(void **unused)
{
    (void)unused;
    struct gn_pose truth = place_probe(0.2, 0.6, 1, 0.5, 2);
    struct gn_image light;
    struct gn_probe_sighting s[8];
    struct gn_probe_pose found;
    struct gn_error e = {0};
    camera.view.blur_px = 2.5;
    take_picture(&truth, 1, 9, &light);
    camera.view.blur_px = lens.blur_px;
    int n = find(&light, s);
    gn_image_finish(&light);
    if (n != 1 || gn_probe_pose_fit(s, n, &found, &e) < 0)
        fail_msg("%d markers: %s", n, e.text);
    double deg = get_off_deg(&found.world_from_probe, &truth);
    printf("# blurred: %.3f deg (said: %.3f), corners good to %.2f px\n", deg,
           found.error_rad * 180 / PI, s[0].error_rad * lens.focal);
    assert_true(deg < 0.1);
}

/* A sighting without any picture: exact directions but for noise of so many px. */
static void see(const struct gn_pose *world_from_probe, int id, double noise_px, int seed,
                struct gn_probe_sighting *out)
{
    struct gn_fisheye_marker marker = {.id = id, .error_rad = 0.03 / lens.focal};
    struct gn_pose probe_from_world;
    set_corners(&marker, out);
    gn_pose_invert(world_from_probe, &probe_from_world);
    for (int k = 0; k < 4; k++) {
        uint32_t w[4];
        double length = 0, *d = out->dirs_probe[k];
        gn_rig_philox((const uint32_t[4]){(uint32_t)k, (uint32_t)seed, (uint32_t)id, 0},
                      (const uint32_t[2]){1, 2}, w);
        gn_pose_transform(&probe_from_world, out->corners_world[k], d);
        for (int a = 0; a < 3; a++)
            length = hypot(length, d[a]);
        for (int a = 0; a < 3; a++)
            d[a] = d[a] / length + noise_px / lens.focal * 1.7 * (2 * (w[a] * 0x1p-32) - 1);
        length = hypot(hypot(d[0], d[1]), d[2]);
        for (int a = 0; a < 3; a++)
            d[a] /= length;
    }
}

/* Several pictures of two markers, in one of which the other marker is misread. */
static void test_pictures_agree(void **unused)
{
    (void)unused;
    struct gn_pose truth = place_probe(0.5, 0.6, 1, 0.9, 2), found;
    struct gn_probe_sighting s[12];
    struct gn_probe_pose pose, single;
    struct gn_error e = {0};
    for (int i = 0; i < 12; i++)
        see(&truth, i % 2 ? OTHER_ID : ID, 0.03, i, &s[i]);
    memcpy(s[5].dirs_probe[0], s[5].dirs_probe[1], sizeof(s[5].dirs_probe[0]));
    if (gn_probe_pose_fit(s, 12, &pose, &e) < 0)
        fail_msg("%s", e.text);
    found = pose.world_from_probe;
    printf("# 12 sightings, %d used: %.3f deg (said: %.3f)\n", pose.n_used,
           get_off_deg(&found, &truth), pose.error_rad * 180 / PI);
    assert_true(pose.n_used == 11 && !s[5].is_used && s[5].rms_rad > 0.01);
    assert_true(get_off_deg(&found, &truth) < 0.05 && get_off_m(&found, &truth) < 5e-4);
    // More pictures of the same markers do not make the answer surer than one of each does.
    assert_int_equal(gn_probe_pose_fit(s, 2, &single, &e), 0);
    assert_true(pose.error_rad > 0.7 * single.error_rad && pose.error_rad < 1.3 * single.error_rad);
    // Nor where corners are off by more than their edges, each time the same.
    for (int i = 0; i < 12; i++)
        see(&truth, i % 2 ? OTHER_ID : ID, 0.12, 3, &s[i]);
    assert_int_equal(gn_probe_pose_fit(s, 12, &pose, &e), 0);
    assert_int_equal(gn_probe_pose_fit(s, 2, &single, &e), 0);
    assert_true(pose.error_rad > 0.7 * single.error_rad && pose.error_rad < 1.3 * single.error_rad);
}

static void refuse(struct gn_probe_sighting *s, int n, const char *words)
{
    struct gn_probe_pose pose;
    struct gn_error e = {0};
    assert_int_equal(gn_probe_pose_fit(s, n, &pose, &e), -EDOM);
    if (!strstr(e.text, words))
        fail_msg("'%s' is not in '%s'", words, e.text);
}

static void test_refusals(void **unused)
{
    (void)unused;
    struct gn_probe_sighting s[12];
    struct gn_pose far = place_probe(3, 0.2, 1, 0.5, 2), near = place_probe(0.5, 0.6, 1, 0.9, 2);
    see(&far, ID, 0.02, 1, &s[0]); // 2.3 degrees wide
    refuse(s, 1, "two poses fit the markers nearly alike");
    see(&near, ID, 0.02, 1, &s[0]);
    s[0].error_rad = 0.5 / lens.focal; // of corners that could not be measured
    refuse(s, 1, "the orientation is uncertain by");
    see(&near, ID, 0.02, 1, &s[0]);
    see(&near, OTHER_ID, 0.02, 1, &s[1]);
    for (int k = 0; k < 4; k++)
        s[1].corners_world[k][0] += 0.03; // the other one is not where it is said to be
    refuse(s, 2, "degrees off their places");
    for (int k = 0; k < 4; k++)
        s[1].corners_world[k][0] += 0.27; // so far from there that either marker fits without it
    refuse(s, 2, "only 1 of 2 sightings");
    for (int i = 0; i < 12; i++) { // it moves after half of the pictures, again and again
        struct gn_pose moved = place_probe(0.5, 0.6, 1 + 0.6 * fmax(i - 5, 0), 0.9, 2);
        see(&moved, ID, 0.02, i, &s[i]);
    }
    refuse(s, 12, "fit one place of the probe");
    refuse(s, 0, "0 sightings");
    for (int k = 0; k < 12; k++)
        s[0].dirs_probe[k / 3][k % 3] = s[0].dirs_probe[0][k % 3]; // all in one
    struct gn_probe_pose pose;
    assert_int_equal(gn_probe_pose_fit(s, 1, &pose, NULL), -EDOM);
}

/* Two prints of one marker: neither is taken. */
static void test_seen_twice(void **unused)
{
    (void)unused;
    static struct gn_fisheye_marker markers[GN_FISHEYE_MAX_MARKERS];
    struct gn_projection projection = get_projection();
    struct gn_pose place = {{1, 0, 0, 0}, {0.2, 0, 0}}, probe = place_probe(0.4, 0.3, 1, 0.4, 2);
    struct gn_rig_sheet sheets[2];
    struct gn_image linear, light;
    struct gn_fisheye_finder *finder;
    int n_twice;
    print_marker(ID, &place, &sheets[0]);
    place.translation[0] = 0;
    print_marker(ID, &place, &sheets[1]);
    gn_pose_to_matrix(&probe, camera.view.world_from_camera);
    assert_int_equal(gn_rig_take_markers(&camera, sheets, 2, &linear), 0);
    assert_int_equal(gn_image_init(&light, SIZE, SIZE, 1), 0);
    for (int i = 0; i < SIZE * SIZE; i++)
        light.data[i] = linear.data[3 * i];
    assert_int_equal(gn_fisheye_finder_create(&projection, 0, &finder, NULL), 0);
    assert_int_equal(gn_fisheye_finder_find(finder, &light, markers, &n_twice, NULL), 0);
    assert_int_equal(n_twice, 1);
    // Nothing at all to see, and pixels that are no numbers.
    for (int i = 0; i < SIZE * SIZE; i++)
        light.data[i] = i % 3 ? NAN : i % 2 ? -INFINITY : 0;
    assert_int_equal(gn_fisheye_finder_find(finder, &light, markers, &n_twice, NULL), 0);
    gn_fisheye_finder_destroy(&finder);
    gn_image_finish(&linear);
    gn_image_finish(&light);
}

/* What is up to 40 degrees wide and within the picture lies within a view, 45 degrees to each side;
 * directions come back. */
static void test_views(void **unused)
{
    (void)unused;
    struct gn_rectified_view views[GN_RECTIFY_MAX_VIEWS];
    for (double theta_max = 0.5; theta_max < 3.2; theta_max += 0.4) {
        struct gn_projection p = {.type = GN_PROJECTION_FISHEYE_EQUIDISTANT,
                                  .width = 600,
                                  .height = 600,
                                  .theta_max = fmin(theta_max, PI)};
        assert_int_equal(gn_projection_init(&p, NULL), 0);
        int n = gn_rectify_tile(&p, views);
        assert_true(n > 0 && n <= GN_RECTIFY_MAX_VIEWS);
        for (int i = 0; i < 2000; i++) {
            double theta = p.theta_max * sqrt(i / 2000.0), phi = 2.399963 * i, nearest = -1;
            const double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            int view = 0;
            for (int k = 0; k < n; k++) {
                const double *m = views[k].probe_from_view;
                double cosine = m[2] * dir[0] + m[5] * dir[1] + m[8] * dir[2];
                view = cosine > nearest ? k : view;
                nearest = fmax(nearest, cosine);
            }
            double xy[2], back[3];
            double reach = fmin(20 * PI / 180, p.theta_max - theta);
            assert_true(nearest > cos(PI / 4 - reach));
            assert_true(gn_rectify_get_position(&views[view], dir, xy));
            gn_rectify_get_direction(&views[view], xy, back);
            for (int k = 0; k < 3; k++)
                assert_true(fabs(back[k] - dir[k]) < 1e-12);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rig_pictures), cmocka_unit_test(test_pictures_agree),
        cmocka_unit_test(test_refusals),     cmocka_unit_test(test_seen_twice),
        cmocka_unit_test(test_views),        cmocka_unit_test(test_blurred),
    };
    if (!gn_vision_is_built()) {
        printf("1..0 # SKIP no OpenCV in this build\n");
        return 0;
    }
    if (gn_rig_marker_fisheye_init(&camera, &lens) < 0)
        return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    gn_rig_marker_camera_finish(&camera);
    return failed;
}
