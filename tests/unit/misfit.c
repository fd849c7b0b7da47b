/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Markers that are not where they are listed: what is wrong is named, and what is right passes. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/track/misfit.h"
#include "tests/unit/cmocka_setup.h"

enum { COLUMNS = 3, ROWS = 2, N = COLUMNS * ROWS };

static const struct gn_camera camera = {.width = 640,
                                        .height = 480,
                                        .fx = 700,
                                        .fy = 700,
                                        .cx = 320,
                                        .cy = 240,
                                        .distortion = {-0.1, 0.02, 0.001, 0, 0},
                                        .world_from_camera = {.rotation = {1, 0, 0, 0}}};

/** A grid: markers of 40 mm, their middles `pitch` apart. */
static void make_body(double pitch, struct gn_body_marker *markers, struct gn_body *out)
{
    static const double signs[4][2] = {{-1, 1}, {1, 1}, {1, -1}, {-1, -1}};
    *out = (struct gn_body){.name = "board", .n_markers = N, .markers = markers};
    for (int i = 0; i < N; i++) {
        markers[i].id = 10 + i;
        for (int k = 0; k < 4; k++) {
            markers[i].corners_body[k][0] = (i % COLUMNS - 1) * pitch + 0.02 * signs[k][0];
            markers[i].corners_body[k][1] = (0.5 - i / COLUMNS) * pitch + 0.02 * signs[k][1];
            markers[i].corners_body[k][2] = 0;
        }
    }
}

/** Where the camera sees the corners, to a tenth of a pixel. */
static void shoot(const struct gn_body *body, struct gn_marker_sighting *out)
{
    struct gn_pose pose = {{cos(1.3), sin(1.3) * 0.9, sin(1.3) * 0.436, 0}, {0.01, -0.02, 0.5}};
    assert_int_equal(gn_pose_normalize(&pose), 0);
    for (int i = 0; i < body->n_markers; i++) {
        out[i].id = body->markers[i].id;
        for (int k = 0; k < 4; k++) {
            double p[3];
            gn_pose_transform(&pose, body->markers[i].corners_body[k], p);
            assert_true(gn_camera_project(&camera, p, out[i].corners[k]));
            out[i].corners[k][0] += 0.1 * sin(7.0 * i + 3 * k);
            out[i].corners[k][1] += 0.1 * cos(5.0 * i + 2 * k);
        }
    }
}

/** Asserts that the listed body, seen as the true one, is explained by these words; NULL: fits. */
static void expect(const struct gn_body *listed, const struct gn_body *true_body, int n_seen,
                   const char *words)
{
    struct gn_marker_sighting seen[N];
    char why[256] = "";
    shoot(true_body, seen);
    const struct gn_misfit_view view = {
        .camera = &camera, .body = listed, .seen = seen, .n_seen = n_seen};
    bool is_wrong = gn_misfit_explain(&view, why, sizeof(why));
    print_message("# %s\n", why);
    assert_int_equal(is_wrong, words != NULL);
    if (words && !strstr(why, words))
        fail_msg("\"%s\" is not in \"%s\"", words, why);
}

static void turn(struct gn_body_marker *m, int quarters)
{
    const struct gn_body_marker before = *m;
    for (int k = 0; k < 4; k++)
        memcpy(m->corners_body[k], before.corners_body[(k + quarters) % 4],
               sizeof(m->corners_body[k]));
}

static void each_fault_is_named(void **state)
{
    (void)state;
    struct gn_body_marker a[N], b[N];
    struct gn_body listed, real;
    make_body(0.05, a, &listed);
    make_body(0.05, b, &real);
    expect(&listed, &real, N, NULL);
    expect(&listed, &real, 1, NULL);
    make_body(0.06, a, &listed);
    expect(&listed, &real, N, "50.0 mm apart, not 60.0");
    expect(&listed, &real, 2, "50.");
    make_body(0.05, a, &listed);
    for (int i = 0; i < N; i++)
        turn(&a[i], 2);
    expect(&listed, &real, N, "180 degrees fits: AprilTags");
    for (int i = 0; i < N; i++)
        turn(&a[i], 3);
    expect(&listed, &real, N, "each turned by 270 degrees fits");
    make_body(0.05, a, &listed);
    turn(&a[4], 2);
    expect(&listed, &real, N, "marker 14 is turned by 180 degrees");
    turn(&a[1], 1);
    expect(&listed, &real, N, "marker 11 is turned by 270 degrees, marker 14 is turned by 180");
    make_body(0.05, a, &listed);
    for (int k = 0; k < 4; k++)
        a[5].corners_body[k][0] += 0.03;
    expect(&listed, &real, N, "marker 15 lies 30.");
    make_body(0.05, a, &listed);
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 2; i++)
            a[2].corners_body[k][i] =
                b[2].corners_body[k][i] * 1.25 -
                0.25 * (b[2].corners_body[0][i] + b[2].corners_body[2][i]) / 2;
    expect(&listed, &real, N, "marker 12 is 40.");
}

static void more_than_one_fault_is_said_to_be(void **state)
{
    (void)state;
    struct gn_body_marker a[N], b[N];
    struct gn_body listed, real;
    make_body(0.05, a, &listed);
    make_body(0.05, b, &real);
    for (int i = 0; i < N; i++) // numbered column by column
        a[i].id = 10 + i % COLUMNS * ROWS + i / COLUMNS;
    expect(&listed, &real, N, "more than one of them is elsewhere; by marker");
}

int main(void)
{
    if (!gn_vision_is_built()) {
        puts("1..0 # SKIP this build has no OpenCV");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_fault_is_named),
        cmocka_unit_test(more_than_one_fault_is_said_to_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
