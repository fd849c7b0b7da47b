/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Files and short texts that describe markers on bodies: what is read, what is refused and why. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/bodies.h"
#include "client/vision/markers.h"
#include "tests/unit/cmocka_setup.h"

static void write_file(const char *text)
{
    FILE *f = fopen("bodies-test.json", "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

static void assert_corner(const struct gn_body_marker *m, int corner, double x, double y, double z)
{
    const double *c = m->corners_body[corner];
    assert_true(fabs(c[0] - x) < 1e-12 && fabs(c[1] - y) < 1e-12 && fabs(c[2] - z) < 1e-12);
}

static void reads_markers_and_grids(void **state)
{
    (void)state;
    struct gn_bodies b;
    struct gn_error error = {0};
    write_file("{\"dictionary\": \"5x5_250\", \"bodies\": ["
               "{\"name\": \"world\", \"markers\": [{\"id\": 7, \"size\": 0.05}, {\"id\": 8, "
               "\"size\": 0.1, \"position\": [0.3, 0, 0.2], \"orientation\": [0.7071067811865476, "
               "0.7071067811865476, 0, 0]}]},"
               "{\"name\": \"box\", \"grids\": [{\"columns\": 3, \"rows\": 2, \"size\": 0.03, "
               "\"gap\": 0.01, \"first_id\": 20}]}]}");
    if (gn_bodies_read_file("bodies-test.json", &b, &error) != 0)
        fail_msg("%s", error.text);
    assert_int_equal(b.dictionary, gn_marker_find_dictionary("5x5_250", 7));
    assert_int_equal(b.n_bodies, 2);
    assert_int_equal(gn_bodies_find(&b, "box"), 1);
    assert_int_equal(gn_bodies_find(&b, "cup"), -1);
    // Clockwise from the top left, y up; the second stands up: its y is the body's z.
    assert_corner(&b.bodies[0].markers[0], 0, -0.025, 0.025, 0);
    assert_corner(&b.bodies[0].markers[0], 2, 0.025, -0.025, 0);
    assert_corner(&b.bodies[0].markers[1], 1, 0.35, 0, 0.25);
    assert_corner(&b.bodies[0].markers[1], 3, 0.25, 0, 0.15);
    assert_int_equal(b.bodies[1].n_markers, 6);
    int body = -1, marker = -1;
    assert_true(gn_bodies_find_marker(&b, 20, &body, &marker));
    assert_int_equal(body, 1);
    assert_corner(&b.bodies[1].markers[marker], 0, -0.055, 0.035, 0);
    assert_true(gn_bodies_find_marker(&b, 25, &body, &marker));
    assert_corner(&b.bodies[1].markers[marker], 2, 0.055, -0.035, 0);
    assert_false(gn_bodies_find_marker(&b, 26, &body, &marker));
    gn_bodies_finish(&b);
    assert_int_equal(b.n_bodies, 0);
}

static void reads_one_marker_from_a_text(void **state)
{
    (void)state;
    struct gn_bodies b;
    assert_int_equal(gn_bodies_read_text("apriltag_36h11:12:0.08", &b, NULL), 0);
    assert_int_equal(b.n_bodies, 1);
    assert_int_equal(gn_bodies_find(&b, GN_BODY_WORLD), 0);
    assert_int_equal(b.bodies[0].n_markers, 1);
    assert_int_equal(b.bodies[0].markers[0].id, 12);
    assert_corner(&b.bodies[0].markers[0], 1, 0.04, 0.04, 0);
    gn_bodies_finish(&b);
    static const char *const bad[] = {"",
                                      "4x4_50",
                                      "4x4_50:",
                                      "4x4_50:7",
                                      "4x4_50:7:",
                                      "4x4_50::1",
                                      "4x4_50:-1:1",
                                      "4x4_50: 7:1",
                                      "4x4_50:7:0",
                                      "4x4_50:7:nan",
                                      "4x4_50:7:inf",
                                      "4x4_50:7:1m",
                                      "4x4:7:0.05",
                                      ":7:0.05",
                                      "4x4_50:99999999999999999999:1",
                                      "4x4_50:7:-0.05"};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        struct gn_error error = {0};
        assert_int_equal(gn_bodies_read_text(bad[i], &b, &error), -EINVAL);
        assert_true(error.text[0] != 0);
        assert_int_equal(b.n_bodies, 0);
    }
    if (gn_vision_is_built())
        assert_int_equal(gn_bodies_read_text("4x4_50:50:0.05", &b, NULL), -EINVAL);
}

static void refuses_what_is_wrong_and_says_where(void **state)
{
    (void)state;
#define WORLD(inside)                                                                              \
    "{\"dictionary\": \"4x4_50\", \"bodies\": [{\"name\": \"world\", " inside "}]}"
    static const char *const bad[][2] = {
        {"", "bodies-test.json"},
        {"[]", "object"},
        {"{\"dictionary\": \"4x4_51\", \"bodies\": []}", "apriltag_36h11"},
        {"{\"dictionary\": \"4x4_50\"}", "bodies"},
        {"{\"dictionary\": \"4x4_50\", \"bodies\": [{\"name\": \"a\"}]}", "no marker"},
        {WORLD("\"markers\": []"), "markers"},
        {WORLD("\"markers\": [{\"id\": 1, \"size\": 0}]"), "size"},
        {WORLD("\"markers\": [{\"id\": -1, \"size\": 1}]"), "id"},
        {WORLD("\"markers\": [{\"id\": 1.5, \"size\": 1}]"), "id"},
        {WORLD("\"markers\": [{\"id\": 1, \"size\": 1}, {\"id\": 1, \"size\": 1}]"), "twice"},
        {WORLD("\"markers\": [{\"id\": 1, \"size\": 1, \"positon\": [0, 0, 0]}]"), "positon"},
        {WORLD("\"markers\": [{\"id\": 1, \"size\": 1, \"position\": [0, 0, 1e9]}]"), "1000 m"},
        {WORLD("\"markers\": [{\"id\": 1, \"size\": 1, \"orientation\": [0, 0, 0, 0]}]"),
         "unit quaternion"},
        {WORLD("\"grids\": [{\"columns\": 512, \"rows\": 512, \"size\": 1, \"gap\": 0}]"), "ids"},
        {WORLD("\"grids\": [{\"columns\": 100000, \"rows\": 100000, \"size\": 1, \"gap\": 0}]"),
         "columns"},
        {WORLD("\"grids\": [{\"columns\": 2, \"rows\": 1, \"size\": 1, \"gap\": -1}]"), "gap"},
        {"{\"dictionary\": \"4x4_50\", \"bodies\": [{\"name\": \"\", \"markers\": [{\"id\": 1, "
         "\"size\": 1}]}]}",
         "1 to 63"},
        {"{\"dictionary\": \"4x4_50\", \"bodies\": [{\"name\": \"a\", \"markers\": [{\"id\": 1, "
         "\"size\": 1}]}, {\"name\": \"a\", \"markers\": [{\"id\": 2, \"size\": 1}]}]}",
         "two bodies"},
    };
    struct gn_bodies b;
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        struct gn_error error = {0};
        if (!gn_vision_is_built() && strcmp(bad[i][1], "ids") == 0)
            continue; // the dictionary's size is OpenCV's to tell
        write_file(bad[i][0]);
        assert_true(gn_bodies_read_file("bodies-test.json", &b, &error) < 0);
        if (!strstr(error.text, bad[i][1]))
            fail_msg("'%s' does not say '%s'", error.text, bad[i][1]);
        assert_int_equal(b.n_bodies, 0);
    }
    assert_true(gn_bodies_read_file("there-is-none.json", &b, NULL) < 0);
    remove("bodies-test.json");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_markers_and_grids),
        cmocka_unit_test(reads_one_marker_from_a_text),
        cmocka_unit_test(refuses_what_is_wrong_and_says_where),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
