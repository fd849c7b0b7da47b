/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Boards drawn through cameras that are known exactly, by our own camera model: where OpenCV sees
 * their corners, half a pixel at stake, and what intrinsics it makes of them.
 */
#include "client/vision/boards.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/views.h"
#include "client/vision/markers.h"
#include "common/camera.h"
#include "common/image.h"
#include "tests/unit/cmocka_setup.h"

#define WIDTH 480
#define HEIGHT 360
#define VIEWS 8

static const struct gn_camera truth = {.width = WIDTH,
                                       .height = HEIGHT,
                                       .fx = 430,
                                       .fy = 433,
                                       .cx = 236.3,
                                       .cy = 183.9,
                                       .distortion = {-0.12, 0.05, 0.0008, -0.0005, 0},
                                       .world_from_camera = {.rotation = {1}}};

/* White 1, black 0 at (x, y) in m on the board, its top left square's corner at the origin, y
 * down. */
static double get_ink(const struct gn_board *b, double x, double y)
{
    double u = x / b->square_m, v = y / b->square_m;
    int column = (int)floor(u), row = (int)floor(v);
    if (column < 0 || row < 0 || column >= b->columns || row >= b->rows)
        return 1;
    if ((column + row) % 2 == 0)
        return 0;
    if (!b->is_charuco)
        return 1;
    // Markers count along the rows' white squares.
    int id = (row * b->columns + column) / 2;
    static uint8_t cells[64][GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    static int sides[64];
    if (sides[id] == 0)
        sides[id] = gn_marker_get_cells(b->dictionary, id, cells[id]);
    int side = sides[id];
    double share = b->marker_m / b->square_m;
    double s = (u - column - (1 - share) / 2) / share, t = (v - row - (1 - share) / 2) / share;
    if (side < 1 || s < 0 || t < 0 || s >= 1 || t >= 1)
        return 1;
    return cells[id][(int)(t * side) * side + (int)(s * side)];
}

/* Camera from board, board's origin at its top left, x right, y down, z away from the camera. */
static struct gn_pose make_pose(const struct gn_board *b, int view)
{
    double a = 0.45 * sin(1 + 2.1 * view), c = 0.45 * cos(1.7 * view), h = sqrt(a * a + c * c);
    struct gn_pose pose = {{cos(h / 2), sin(h / 2) * a / h, sin(h / 2) * c / h, 0}, {0}};
    double middle[3] = {b->columns * b->square_m / 2, b->rows * b->square_m / 2, 0}, at[3];
    gn_pose_rotate(&pose, middle, at);
    pose.translation[0] = 0.05 * sin(3.0 * view) - at[0];
    pose.translation[1] = 0.035 * cos(2.0 * view) - at[1];
    pose.translation[2] = 0.36 - at[2];
    return pose;
}

/* Rays through the corners of all pixels; between them they are interpolated. */
static double rays[HEIGHT + 1][WIDTH + 1][3];

static int make_rays(void **unused)
{
    (void)unused;
    for (int y = 0; y <= HEIGHT; y++)
        for (int x = 0; x <= WIDTH; x++)
            if (!gn_camera_get_ray(&truth, x, y, rays[y][x]))
                return -1;
    return 0;
}

static void draw(const struct gn_board *b, const struct gn_pose *camera_from_board, uint8_t *out)
{
    struct gn_pose board_from_camera;
    gn_pose_invert(camera_from_board, &board_from_camera);
    const double *o = board_from_camera.translation;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            double sum = 0;
            for (int i = 0; i < 9; i++) {
                double s = (i % 3 + 0.5) / 3, t = (i / 3 + 0.5) / 3, d[3];
                for (int k = 0; k < 3; k++)
                    d[k] = (1 - t) * ((1 - s) * rays[y][x][k] + s * rays[y][x + 1][k]) +
                           t * ((1 - s) * rays[y + 1][x][k] + s * rays[y + 1][x + 1][k]);
                gn_pose_rotate(&board_from_camera, d, d);
                double z = -o[2] / d[2];
                sum += z > 0 ? get_ink(b, o[0] + z * d[0], o[1] + z * d[1]) : 1;
            }
            out[y * WIDTH + x] = (uint8_t)(30 + 200 * sum / 9);
        }
}

/* How far the corners seen are from where they are; the mean goes to out_bias. */
static double get_error(const struct gn_board *b, const struct gn_pose *pose,
                        const struct gn_board_corner *corners, int n, double out_bias[2])
{
    double sum = 0;
    for (int i = 0; i < n; i++) {
        double p[3] = {(corners[i].column + 1) * b->square_m, (corners[i].row + 1) * b->square_m,
                       0},
               xy[2];
        gn_pose_transform(pose, p, p);
        assert_true(gn_camera_project(&truth, p, xy));
        double e[2] = {corners[i].xy[0] - xy[0], corners[i].xy[1] - xy[1]};
        sum += (e[0] * e[0] + e[1] * e[1]) / n;
        out_bias[0] += e[0] / (VIEWS * n);
        out_bias[1] += e[1] / (VIEWS * n);
    }
    return sqrt(sum);
}

static void calibrate(const struct gn_board *b)
{
    static struct gn_board_corner corners[VIEWS][GN_BOARD_MAX_CORNERS];
    static double residuals[VIEWS][2 * GN_BOARD_MAX_CORNERS];
    static uint8_t picture[WIDTH * HEIGHT];
    struct gn_board_view views[VIEWS];
    struct gn_intrinsics in;
    struct gn_error e = {0};
    double bias[2] = {0}, worst = 0;
    for (int v = 0; v < VIEWS; v++) {
        struct gn_pose pose = make_pose(b, v);
        int n = 0;
        draw(b, &pose, picture);
        if (gn_board_find(b, picture, WIDTH, HEIGHT, corners[v], &n, &e) < 0)
            fail_msg("%s", e.text);
        if (n < (b->columns - 1) * (b->rows - 1) / 2)
            fail_msg("view %d: %d corners", v, n);
        worst = fmax(worst, get_error(b, &pose, corners[v], n, bias));
        views[v] = (struct gn_board_view){.corners = corners[v], .n = n, .residuals = residuals[v]};
    }
    if (gn_intrinsics_solve(b, views, VIEWS, WIDTH, HEIGHT, false, &in, &e) < 0)
        fail_msg("%s", e.text);
    printf("# %s: corners off by at most %.3f px RMS, on average by %.3f, %.3f; fx %.2f fy %.2f cx "
           "%.2f cy %.2f, %.3f px\n",
           b->is_charuco ? "ChArUco" : "chessboard", worst, bias[0], bias[1], in.fx, in.fy, in.cx,
           in.cy, in.rms_px);
    assert_true(worst < 0.2);
    assert_true(fabs(bias[0]) < 0.05 && fabs(bias[1]) < 0.05);
    const double found[4] = {in.fx, in.fy, in.cx, in.cy};
    const double right[4] = {truth.fx, truth.fy, truth.cx, truth.cy};
    for (int i = 0; i < 4; i++)
        assert_true(fabs(found[i] - right[i]) < fmax(4 * in.deviation[i], 0.3));
    assert_true(in.rms_px < 0.15 && in.deviation[0] < 2 && in.deviation[2] < 1.5);
    assert_int_equal(gn_views_judge(&in, WIDTH, 1, &e), 0);
}

static void test_chessboard(void **unused)
{
    (void)unused;
    calibrate(&(struct gn_board){.columns = 10, .rows = 7, .square_m = 0.025});
}

static void test_charuco(void **unused)
{
    (void)unused;
    calibrate(&(struct gn_board){
        .is_charuco = true, .columns = 8, .rows = 6, .square_m = 0.03, .marker_m = 0.022});
}

static void test_refusals(void **unused)
{
    (void)unused;
    static const uint8_t picture[64 * 48];
    struct gn_board_corner corners[GN_BOARD_MAX_CORNERS];
    struct gn_board board = {.columns = 10, .rows = 7, .square_m = 0.025}, huge = board;
    struct gn_error e = {0};
    int n = 7;
    double at[8];
    huge.columns = 40;
    if (!gn_vision_is_built()) {
        assert_int_equal(gn_board_find(&board, picture, 64, 48, corners, &n, &e), -ENOSYS);
        assert_int_equal(gn_vision_find_chart(picture, 4, 4, at, &e), -ENOSYS);
        return;
    }
    assert_int_equal(gn_board_find(&board, picture, 64, 48, corners, &n, &e), 0);
    assert_int_equal(n, 0);
    assert_int_equal(gn_board_find(&huge, picture, 64, 48, corners, &n, &e), -EINVAL);
    assert_int_equal(gn_board_find(&board, picture, 4, 48, corners, &n, &e), -EINVAL);
    assert_int_equal(gn_board_find(&board, NULL, 64, 48, corners, &n, &e), -EINVAL);
    assert_int_equal(gn_vision_find_chart(picture, 1 << 15, 1 << 15, at, &e), -EINVAL);
    assert_int_equal(gn_vision_find_chart(picture, 32, 32, at, &e), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_chessboard),
        cmocka_unit_test(test_charuco),
        cmocka_unit_test(test_refusals),
    };
    const struct CMUnitTest without_opencv[] = {cmocka_unit_test(test_refusals)};
    return gn_vision_is_built() ? cmocka_run_group_tests(tests, make_rays, NULL)
                                : cmocka_run_group_tests(without_opencv, NULL, NULL);
}
