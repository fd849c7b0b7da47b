/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* OpenCV behind its C header: markers found where they were drawn, poses of known points. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/vision/markers.h"
#include "tests/unit/cmocka_setup.h"

enum { WIDTH = 320, HEIGHT = 240 };

static int dictionary_of(const char *name)
{
    return gn_marker_find_dictionary(name, strlen(name));
}

/** A white picture with the marker upright, its top left at (x, y), cells of `cell` px. */
static void draw(uint8_t *grey, const char *dictionary, int id, int x, int y, int cell)
{
    uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    int side = gn_marker_get_cells(dictionary_of(dictionary), id, cells);
    assert_in_range(side, 5, GN_MARKER_MAX_CELLS);
    memset(grey, 230, WIDTH * HEIGHT);
    for (int row = 0; row < side * cell; row++)
        for (int column = 0; column < side * cell; column++)
            grey[(y + row) * WIDTH + x + column] =
                cells[row / cell * side + column / cell] ? 230 : 20;
}

static struct gn_marker_finder *create(const char *dictionary)
{
    struct gn_marker_finder *finder = NULL;
    const struct gn_marker_finder_options options = {.dictionary = dictionary_of(dictionary),
                                                     .refinement = GN_MARKER_REFINE_CONTOUR};
    assert_int_equal(gn_marker_finder_create(&options, &finder, NULL), 0);
    return finder;
}

static void absent_opencv_says_so(void **state)
{
    (void)state;
    struct gn_marker_finder *finder = NULL;
    struct gn_error error = {0};
    if (gn_vision_is_built()) {
        assert_non_null(strstr(gn_vision_get_version(), "OpenCV 4"));
        return;
    }
    assert_int_equal(gn_marker_finder_create(NULL, &finder, &error), -ENOSYS);
    assert_null(finder);
    assert_non_null(strstr(error.text, "libopencv-dev"));
    assert_int_equal(gn_marker_count_ids(0), 0);
}

static void dictionaries_are_opencvs(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int ids;
    } known[] = {{"4x4_50", 50},        {"5x5_250", 250},         {"6x6_1000", 1000},
                 {"7x7_1000", 1000},    {"apriltag_16h5", 30},    {"aruco_original", 1024},
                 {"apriltag_25h9", 35}, {"apriltag_36h10", 2320}, {"apriltag_36h11", 587}};
    assert_int_equal(dictionary_of("4x4_5"), -1);
    assert_int_equal(dictionary_of(""), -1);
    assert_int_equal(dictionary_of("apriltag_36h11x"), -1);
    for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
        int dictionary = dictionary_of(known[i].name);
        assert_in_range(dictionary, 0, 20);
        if (gn_vision_is_built())
            assert_int_equal(gn_marker_count_ids(dictionary), known[i].ids);
    }
    assert_int_equal(gn_marker_count_ids(21), 0);
    assert_int_equal(gn_marker_count_ids(-1), 0);
}

static void finds_a_marker_where_it_is(void **state)
{
    (void)state;
    static const char *const names[] = {"4x4_50", "6x6_250", "apriltag_36h11", "aruco_original"};
    if (!gn_vision_is_built())
        return;
    uint8_t *grey = malloc(WIDTH * HEIGHT);
    for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
        uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
        struct gn_marker_sighting seen[4];
        int n = -1;
        draw(grey, names[i], 7, 60, 40, 16);
        double side_px = 16 * gn_marker_get_cells(dictionary_of(names[i]), 7, cells);
        struct gn_marker_finder *finder = create(names[i]);
        assert_int_equal(
            gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, NULL, 4, seen, &n, NULL), 0);
        assert_int_equal(n, 1);
        assert_int_equal(seen[0].id, 7);
        // Clockwise from the top left; a whole pixel's doubt is OpenCV's, half a one would be ours.
        for (int k = 0; k < 4; k++) {
            double x = 60 + side_px * (k == 1 || k == 2), y = 40 + side_px * (k >= 2);
            assert_true(fabs(seen[0].corners[k][0] - x) < 0.75);
            assert_true(fabs(seen[0].corners[k][1] - y) < 0.75);
        }
        // Their middle has no such doubt: it tells whether the pixel centres are right.
        double sum[2] = {0};
        for (int k = 0; k < 8; k++)
            sum[k % 2] += seen[0].corners[k / 2][k % 2] / 4;
        assert_true(fabs(sum[0] - (60 + side_px / 2)) < 0.05);
        assert_true(fabs(sum[1] - (40 + side_px / 2)) < 0.05);
        gn_marker_finder_destroy(&finder);
        assert_null(finder);
    }
    free(grey);
}

static void looks_only_into_the_window(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    uint8_t *grey = malloc(WIDTH * HEIGHT);
    struct gn_marker_sighting whole, part;
    int n = -1;
    draw(grey, "4x4_50", 3, 60, 40, 16);
    struct gn_marker_finder *finder = create("4x4_50");
    assert_int_equal(gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, NULL, 1, &whole, &n, NULL),
                     0);
    assert_int_equal(n, 1);
    const struct gn_marker_window around = {40, 20, 140, 140}, beside = {200, 0, 120, 240},
                                  outside = {1000, 1000, 10, 10};
    assert_int_equal(
        gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, &around, 1, &part, &n, NULL), 0);
    assert_int_equal(n, 1);
    for (int k = 0; k < 8; k++)
        assert_true(fabs(part.corners[k / 2][k % 2] - whole.corners[k / 2][k % 2]) < 0.1);
    assert_int_equal(
        gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, &beside, 1, &part, &n, NULL), 0);
    assert_int_equal(n, 0);
    assert_int_equal(
        gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, &outside, 1, &part, &n, NULL), 0);
    assert_int_equal(n, 0);
    assert_int_equal(gn_marker_finder_find(finder, grey, 0, HEIGHT, NULL, 1, &part, &n, NULL),
                     -EINVAL);
    gn_marker_finder_destroy(&finder);
    free(grey);
}

static void solves_the_pose_of_known_points(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    // A square seen from 0.5 m, turned by 40 degrees about its x axis: z towards the camera.
    static const double points[12] = {-.04, .04, 0, .04, .04, 0, .04, -.04, 0, -.04, -.04, 0};
    double c = cos(0.7), s = sin(0.7), rays[8];
    const double rotation[9] = {1, 0, 0, 0, -c, s, 0, -s, -c}, shift[3] = {0.02, -0.01, 0.5};
    for (int i = 0; i < 4; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = rotation[3 * k] * points[3 * i] + rotation[3 * k + 1] * points[3 * i + 1] +
                   shift[k];
        rays[2 * i] = p[0] / p[2];
        rays[2 * i + 1] = p[1] / p[2];
    }
    struct gn_vision_pose poses[2];
    assert_int_equal(gn_vision_solve_pose(points, rays, 4, true, poses, NULL), 2);
    for (int k = 0; k < 9; k++)
        assert_true(fabs(poses[0].rotation[k] - rotation[k]) < 1e-6);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(poses[0].translation[k] - shift[k]) < 1e-6);
    assert_int_equal(gn_vision_solve_pose(points, rays, 3, true, poses, NULL), -EINVAL);
    const double nonsense[8] = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
    assert_true(gn_vision_solve_pose(points, nonsense, 4, true, poses, NULL) <= 0);
    assert_true(gn_vision_solve_pose(points, nonsense, 4, false, poses, NULL) <= 0);
}

static void solves_what_is_seen_face_on(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    static const double points[12] = {-.04, .04, 0, .04, .04, 0, .04, -.04, 0, -.04, -.04, 0};
    static const double places[][2] = {{0, 0}, {-0.066, 0}, {0, 0.03}, {0.01, -0.02}};
    for (int i = 0; i < 4 * 8; i++) { // exactly, turned by eighths
        double c = cos(i % 8 * atan(1)), s = sin(i % 8 * atan(1)), rays[8];
        const double rotation[9] = {c, s, 0, s, -c, 0, 0, 0, -1}, *at = places[i / 8];
        for (int k = 0; k < 8; k++) {
            const double *p = points + 3 * (k / 2), *r = rotation + 3 * (k % 2);
            rays[k] = (r[0] * p[0] + r[1] * p[1] + at[k % 2]) / 0.4;
        }
        struct gn_vision_pose poses[2];
        bool is_right = false;
        int n = gn_vision_solve_pose(points, rays, 4, true, poses, NULL);
        for (int j = 0; j < n && !is_right; j++) {
            is_right = true;
            for (int k = 0; k < 9; k++)
                is_right = is_right && fabs(poses[j].rotation[k] - rotation[k]) < 1e-6;
            for (int k = 0; k < 3; k++)
                is_right = is_right && fabs(poses[j].translation[k] - (k < 2 ? at[k] : 0.4)) < 1e-6;
        }
        assert_true(is_right);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(absent_opencv_says_so),
        cmocka_unit_test(dictionaries_are_opencvs),
        cmocka_unit_test(finds_a_marker_where_it_is),
        cmocka_unit_test(looks_only_into_the_window),
        cmocka_unit_test(solves_the_pose_of_known_points),
        cmocka_unit_test(solves_what_is_seen_face_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
