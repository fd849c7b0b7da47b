/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Sets of board views that determine no camera, judged from their corners alone; and the files that
 * calibration writes, which their readers take back.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "client/calibrate/device_file.h"
#include "client/calibrate/views.h"
#include "common/camera.h"
#include "common/device_json.h"
#include "tests/folder.h"
#include "tests/unit/cmocka_setup.h"

#define COLUMNS 9
#define ROWS 6
#define MAX_VIEWS 12

static struct gn_board_corner corners[MAX_VIEWS][COLUMNS * ROWS];
static double residuals[2 * COLUMNS * ROWS];

/* A 0.025 m board seen by a 600 px camera of 640 x 480, turned about its x, then its y. */
static struct gn_board_view see(int v, double turn_x, double turn_y, double x, double y, double z)
{
    for (int i = 0; i < COLUMNS * ROWS; i++) {
        double u = 0.025 * (i % COLUMNS - 4), w = 0.025 * (i / COLUMNS - 2.5);
        double p[3] = {u * cos(turn_y), w * cos(turn_x), w * sin(turn_x) + u * sin(turn_y)};
        struct gn_board_corner *c = &corners[v][i];
        *c = (struct gn_board_corner){i % COLUMNS, i / COLUMNS, {0}};
        c->xy[0] = 320 + 600 * (p[0] + x) / (p[2] + z);
        c->xy[1] = 240 + 600 * (p[1] + y) / (p[2] + z);
    }
    return (struct gn_board_view){
        .corners = corners[v], .n = COLUMNS * ROWS, .residuals = residuals};
}

static void expect(const struct gn_board_view *views, int n, const char *words)
{
    struct gn_views_figures figures;
    struct gn_error e = {0};
    int err = gn_views_check(views, n, 640, 480, &figures, &e);
    if (words ? err != -EDOM || !strstr(e.text, words) : err != 0)
        fail_msg("%d \"%s\" where \"%s\" was to be", err, e.text, words ? words : "nothing");
}

static void test_degenerate_views(void **unused)
{
    (void)unused;
    struct gn_board_view views[MAX_VIEWS];
    for (int v = 0; v < 8; v++)
        views[v] =
            see(v, 0.5 * sin(v), 0.5 * cos(v), 0.08 * sin(3.0 * v), 0.06 * cos(2.0 * v), 0.3);
    expect(views, 8, NULL);
    expect(views, 4, "4 pictures show the board, at least 5");
    for (int v = 0; v < 8; v++) // tilted in one of them only
        views[v] = see(v, v == 3 ? 0.5 : 0.01, 0, 0.08 * sin(3.0 * v), 0.06 * cos(2.0 * v), 0.3);
    expect(views, 8, "in 7 of 8 pictures the board is parallel to the picture");
    for (int v = 0; v < 8; v++)
        views[v] = see(v, 0.01, 0, 0.08 * sin(3.0 * v), 0.06 * cos(2.0 * v), 0.3);
    expect(views, 8, "in 8 of 8 pictures the board is parallel to the picture");
    for (int v = 0; v < 8; v++)
        views[v] = see(v, 0.5 * sin(v), 0.5 * cos(v), 0, 0, 1.2);
    expect(views, 8, "% of the picture, at least 40 %");
}

static void test_boards(void **unused)
{
    (void)unused;
    const struct {
        struct gn_board board;
        const char *words;
    } cases[] = {
        {{false, 10, 7, 0.025, 0, 0}, NULL},
        {{true, 8, 6, 0.03, 0.02, 0}, NULL},
        {{false, 8, 6, 0.025, 0, 0}, "looks the same upside down"},
        {{false, 7, 7, 0.025, 0, 0}, "looks the same upside down"},
        {{false, 2, 7, 0.025, 0, 0}, "3 to 33 squares"},
        {{false, 34, 7, 0.025, 0, 0}, "3 to 33 squares"},
        {{true, 8, 6, 0.02, 0.02, 0}, "do not lie in squares"},
        {{false, 10, 7, NAN, 0, 0}, "squares of nan m"},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_error e = {0};
        int err = gn_board_check(&cases[i].board, &e);
        if (cases[i].words ? err != -EINVAL || !strstr(e.text, cases[i].words) : err != 0)
            fail_msg("case %zu: %d \"%s\"", i, err, e.text);
    }
}

static void test_judgement(void **unused)
{
    (void)unused;
    struct gn_error e = {0};
    struct gn_intrinsics in = {.fx = 600, .fy = 600, .deviation = {1, 1, 1, 1}, .rms_px = 0.3};
    assert_int_equal(gn_views_judge(&in, 640, 1, &e), 0);
    in.rms_px = 1.5;
    assert_int_equal(gn_views_judge(&in, 640, 1, &e), -EDOM);
    assert_non_null(strstr(e.text, "off by 1.50 px"));
    in.deviation[1] = 60;
    assert_int_equal(gn_views_judge(&in, 640, 1, &e), -EDOM);
    assert_non_null(strstr(e.text, "focal length uncertain by 10.0 %"));
    in.deviation[1] = 1;
    in.deviation[3] = 13;
    assert_int_equal(gn_views_judge(&in, 640, 2, &e), -EDOM);
    assert_non_null(strstr(e.text, "by 0.2 % and the centre by 2.0 % of the picture"));
}

/* Intrinsics, then a response: both are in the file, which is a camera; nonsense leaves it alone.
 */
static void test_device_files(void **unused)
{
    (void)unused;
    char path[512];
    struct gn_camera camera;
    struct gn_error e = {0};
    snprintf(path, sizeof(path), "%s", gn_test_folder_get_path("camera.json"));
    const double zero[5] = {0}, pose[16] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0.5, 0, 0, 0, 1};
    assert_int_equal(
        gn_device_file_update(path,
                              json_pack("{s:i, s:i, s:f, s:f, s:f, s:f, s:o, s:o}", "width", 640,
                                        "height", 480, "fx", 601.5, "fy", 602.25, "cx", 320.5, "cy",
                                        239.5, "distortion", gn_device_file_make_numbers(zero, 5),
                                        "world_from_camera", gn_device_file_make_numbers(pose, 16)),
                              &e),
        0);
    struct gn_curve curve = {.model = GN_CURVE_LOG, .a = 0.6, .b = 0.07, .c = 2e-4};
    assert_int_equal(
        gn_device_file_update(
            path, json_pack("{s:o}", "response", gn_device_file_make_curve(&curve)), &e),
        0);
    assert_int_equal(gn_camera_read_file(path, &camera, &e), 0);
    assert_true(camera.fx == 601.5 && camera.cy == 239.5);
    assert_int_equal(camera.response.type, GN_RESPONSE_LOG);
    assert_true(camera.response.log_b == 0.07 && camera.response.log_c == 2e-4);
    // What is null goes; what is not named stays.
    assert_int_equal(gn_device_file_update(path, json_pack("{s:n, s:f}", "scale", "cx", 321.0), &e),
                     0);
    assert_int_equal(gn_device_file_update(path, json_pack("{s:f}", "scale", 0.5), &e), 0);
    assert_int_equal(gn_device_file_update(path, json_pack("{s:n}", "scale"), &e), 0);
    assert_int_equal(gn_camera_read_file(path, &camera, &e), 0);
    assert_true(camera.cx == 321 && camera.cy == 239.5);
    assert_true(camera.response.scale != 0.5);
    curve.b = -1; // no response
    assert_true(gn_device_file_update(
                    path, json_pack("{s:o}", "response", gn_device_file_make_curve(&curve)), &e) <
                0);
    assert_int_equal(gn_camera_read_file(path, &camera, &e), 0);
    assert_true(camera.response.log_b == 0.07);
    char fresh[512]; // neither a camera's nor a probe's yet: refused all the same
    snprintf(fresh, sizeof(fresh), "%s", gn_test_folder_get_path("fresh.json"));
    assert_true(gn_device_file_update(
                    fresh, json_pack("{s:o}", "response", gn_device_file_make_curve(&curve)), &e) <
                0);
    assert_int_not_equal(access(fresh, F_OK), 0);
    curve = (struct gn_curve){.model = GN_CURVE_LINEAR, .a = 0.02, .b = 0.5};
    assert_int_equal(
        gn_device_file_update(
            path, json_pack("{s:o}", "response", gn_device_file_make_curve(&curve)), &e),
        0);
    assert_int_equal(gn_camera_read_file(path, &camera, &e), 0);
    for (float code = 0.01f; code <= 1; code += 0.01f) // codes are light, the dark taken off
        assert_true(fabs((double)gn_response_decode(&camera.response, code) -
                         fmax(((double)code - 0.02) / 0.5, 0)) < 2e-4);
}

static int remove_folder(void **unused)
{
    (void)unused;
    static const char *const names[] = {"camera.json"};
    return gn_test_folder_remove(names, GN_ARRAY_LEN(names));
}

static int create_folder(void **unused)
{
    (void)unused;
    return gn_test_folder_create();
}

/* What makes a view new: the board elsewhere, or tilted otherwise; not a hand's tremor. */
static void test_alike(void **unused)
{
    (void)unused;
    struct gn_board_view a = see(0, 0.5, 0, 0, 0, 0.5), b = see(1, 0.5, 0, 0.005, 0, 0.5);
    // Most where the board is nearest.
    double shift = 600 * 0.005 / (0.5 - 2.5 * 0.025 * sin(0.5));
    assert_true(fabs(gn_views_get_shift(&a, &b) - shift) < 1e-9);
    assert_true(gn_views_are_alike(&a, &b, 640, 480));
    b = see(1, 0.5, 0, 0.05, 0, 0.5);
    assert_false(gn_views_are_alike(&a, &b, 640, 480));
    b = see(1, 0.1, 0, 0, 0, 0.5);
    assert_true(gn_views_get_shift(&a, &b) < GN_VIEWS_ALIKE_SHIFT * 800);
    assert_false(gn_views_are_alike(&a, &b, 640, 480));
    b = see(1, 0.5, 0, 0, 0, 0.5);
    b.n = 3;
    assert_true(isinf(gn_views_get_shift(&a, &b)) && isinf(gn_views_get_shift(&b, &a)));
}

static void test_bare(void **unused)
{
    (void)unused;
    char text[GN_VIEWS_BARE_BYTES];
    assert_true(gn_views_describe_bare(NULL, 0, 640, 480, text) == 0);
    assert_string_equal(text, "top left, top, top right, left, middle, right, bottom left, bottom, "
                              "bottom right");
    // Corners from 80 to 560 px and from 90 to 390, 60 apart: columns 1 to 7 and rows 1 to 4.
    struct gn_board_view view = see(0, 0, 0, 0, 0, 0.25);
    assert_true(fabs(gn_views_describe_bare(&view, 1, 640, 480, text) - 28.0 / 48) < 1e-9);
    assert_string_equal(text, "top left, bottom left");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_degenerate_views),
        cmocka_unit_test(test_boards),
        cmocka_unit_test(test_alike),
        cmocka_unit_test(test_bare),
        cmocka_unit_test(test_judgement),
        cmocka_unit_test_setup_teardown(test_device_files, create_folder, remove_folder),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
