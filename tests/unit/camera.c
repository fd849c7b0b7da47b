/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The camera: rays and positions are each other's inverse under strong distortion, nothing beyond
 * the fold is seen, and camera.json is read or refused in words.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/camera.h"
#include "tests/unit/cmocka_setup.h"

static const double lenses[][5] = {
    {0, 0, 0, 0, 0},
    {-0.28, 0.07, 0.0002, 0.00002, 0},   // OpenCV's own sample camera, about
    {-0.40, 0.20, 0.003, -0.002, -0.05}, // strong barrel
    {0.35, 0.15, -0.004, 0.003, 0.02},   // strong pincushion
    {-0.5, 0, 0, 0, 0},                  // folds at r = sqrt(2/3)
    {0, 0, 0.05, -0.05, 0},              // tilted sensor
};

static struct gn_camera make(int lens)
{
    struct gn_camera camera = {.width = 640,
                               .height = 480,
                               .fx = 520,
                               .fy = 530,
                               .cx = 322.5,
                               .cy = 238.25,
                               .response = {.type = GN_RESPONSE_SRGB},
                               .world_from_camera = {.rotation = {1, 0, 0, 0}}};
    memcpy(camera.distortion, lenses[lens], sizeof(camera.distortion));
    return camera;
}

static void test_round_trip(void **unused)
{
    (void)unused;
    for (int lens = 0; lens < 6; lens++) {
        struct gn_camera camera = make(lens);
        int n_seen = 0, n_all = 0;
        for (int iy = 0; iy <= 480; iy += 16)
            for (int ix = 0; ix <= 640; ix += 16) {
                double dir[3], xy[2];
                n_all++;
                if (!gn_camera_get_ray(&camera, ix, iy, dir))
                    continue;
                n_seen++;
                double norm = dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2];
                assert_true(fabs(norm - 1.0) < 1e-14);
                for (int i = 0; i < 3; i++)
                    dir[i] *= 3.7;
                assert_true(gn_camera_project(&camera, dir, xy));
                assert_true(hypot(xy[0] - ix, xy[1] - iy) < 1e-8);
            }
        /* Only the lens that folds inside the picture has corners that no ray reaches. */
        if (lens == 4)
            assert_true(n_seen > n_all / 2 && n_seen < n_all);
        else
            assert_int_equal(n_seen, n_all);
    }
}

/*
 * Near the fold a whole Newton step jumps over it, or away: only shorter ones arrive. Of 400000
 * random lenses and positions 159 needed them; these are five.
 */
static void test_near_the_fold(void **unused)
{
    (void)unused;
    static const double cases[][7] = {
        // k1, k2, p1, p2, k3, x, y
        {-0.365, -0.008, 0.0054, -0.0089, 0.048, 632.1, 86.1},
        {-0.376, 0.005, -0.0099, -0.0080, 0.028, 16.9, 406.1},
        {-0.469, 0.030, 0.0005, -0.0045, 0.053, 571.0, 0.7},
        {-0.481, 0.061, -0.0023, 0.0051, 0.053, 52.7, 458.1},
        {-0.468, 0.055, -0.0009, -0.0026, 0.036, 7.4, 430.8},
    };
    struct gn_camera camera = {
        .width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240};
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        double dir[3], xy[2];
        memcpy(camera.distortion, cases[i], sizeof(camera.distortion));
        assert_true(gn_camera_get_ray(&camera, cases[i][5], cases[i][6], dir));
        assert_true(gn_camera_project(&camera, dir, xy));
        assert_true(hypot(xy[0] - cases[i][5], xy[1] - cases[i][6]) < 1e-8);
    }
}

/* From the world's side: a point before the fold comes back along its own ray, never another's. */
static void test_points(void **unused)
{
    (void)unused;
    for (int lens = 0; lens < 6; lens++) {
        struct gn_camera camera = make(lens);
        int n = 0;
        for (double y = -0.55; y <= 0.55; y += 0.05)
            for (double x = -0.7; x <= 0.7; x += 0.05) {
                double p[3] = {2.0 * x, 2.0 * y, 2.0}, xy[2], dir[3];
                if (!gn_camera_project(&camera, p, xy))
                    continue;
                assert_true(gn_camera_get_ray(&camera, xy[0], xy[1], dir));
                /* Near the fold the inverse is ill-conditioned: the angle grows as the root. */
                assert_true(hypot(dir[0] / dir[2] - x, dir[1] / dir[2] - y) < 1e-6);
                n++;
            }
        assert_true(n > 500);
    }
}

static void test_known_values(void **unused)
{
    (void)unused;
    struct gn_camera camera = make(0);
    double xy[2], dir[3], p[3] = {0.5, -0.25, 2.0};
    assert_true(gn_camera_project(&camera, p, xy));
    assert_true(fabs(xy[0] - (322.5 + 520 * 0.25)) < 1e-12);
    assert_true(fabs(xy[1] - (238.25 - 530 * 0.125)) < 1e-12);
    assert_true(gn_camera_get_ray(&camera, camera.cx, camera.cy, dir));
    assert_true(dir[0] == 0.0 && dir[1] == 0.0 && dir[2] == 1.0);
    /* k1 .. k3 each alone at (0.25, -0.125), r^2 = 0.078125, worked out by hand. */
    double s = 0.078125,
           expected[5][2] = {{0.25 * (1 + 0.1 * s), -0.125 * (1 + 0.1 * s)},
                             {0.25 * (1 + 0.1 * s * s), -0.125 * (1 + 0.1 * s * s)},
                             {0.25 - 0.1 * 0.0625, -0.125 + 0.1 * 0.109375},
                             {0.25 + 0.1 * 0.203125, -0.125 - 0.1 * 0.0625},
                             {0.25 * (1 + 0.1 * s * s * s), -0.125 * (1 + 0.1 * s * s * s)}};
    for (int i = 0; i < 5; i++) {
        memset(camera.distortion, 0, sizeof(camera.distortion));
        camera.distortion[i] = 0.1;
        assert_true(gn_camera_project(&camera, p, xy));
        assert_true(fabs(xy[0] - (322.5 + 520 * expected[i][0])) < 1e-10);
        assert_true(fabs(xy[1] - (238.25 + 530 * expected[i][1])) < 1e-10);
    }
}

static void test_unseen(void **unused)
{
    (void)unused;
    struct gn_camera camera = make(4); // folds at r = 0.8165, returns to the middle at r = 1.414
    const double points[][3] = {{0, 0, 0},   {0, 0, -1},   {0, 0, NAN},
                                {1.4, 0, 1}, {0.82, 0, 1}, {1e300, 0, 1e-300}};
    double xy[2], dir[3];
    for (size_t i = 0; i < sizeof(points) / sizeof(points[0]); i++)
        assert_false(gn_camera_project(&camera, points[i], xy));
    assert_true(gn_camera_project(&camera, (const double[3]){0.81, 0, 1}, xy));
    assert_false(gn_camera_get_ray(&camera, NAN, 0, dir));
    assert_false(gn_camera_get_ray(&camera, INFINITY, 0, dir));
    assert_false(gn_camera_get_ray(&camera, 322.5 + 520 * 0.55, 238.25, dir)); // beyond 0.5443
    assert_true(gn_camera_get_ray(&camera, 322.5 + 520 * 0.54, 238.25, dir));
}

static void test_check(void **unused)
{
    (void)unused;
    const char *reason = NULL;
    struct gn_camera camera = make(1);
    assert_int_equal(gn_camera_check(&camera, &reason), 0);
    double *const numbers[] = {&camera.fx,
                               &camera.fy,
                               &camera.cx,
                               &camera.cy,
                               &camera.distortion[4],
                               &camera.match.noise_slope[0],
                               &camera.match.noise_offset[2],
                               &camera.match.blur_px,
                               &camera.world_from_camera.rotation[2],
                               &camera.world_from_camera.translation[1]};
    for (size_t i = 0; i < sizeof(numbers) / sizeof(numbers[0]); i++) {
        double before = *numbers[i];
        reason = NULL;
        *numbers[i] = NAN;
        assert_int_equal(gn_camera_check(&camera, &reason), -EINVAL);
        assert_non_null(reason);
        *numbers[i] = before;
    }
    camera.fx = 0.0;
    assert_int_equal(gn_camera_check(&camera, &reason), -EINVAL);
    camera = make(1);
    camera.width = 0;
    assert_int_equal(gn_camera_check(&camera, &reason), -EINVAL);
    camera.width = camera.height = 16384;
    assert_int_equal(gn_camera_check(&camera, &reason), -EINVAL);
    camera = make(1);
    camera.response.type = GN_RESPONSE_GAMMA; // gamma 0
    assert_int_equal(gn_camera_check(&camera, &reason), -EINVAL);
    assert_int_equal(gn_camera_check(&camera, NULL), -EINVAL);
    camera.width = 0;
    assert_int_equal(gn_camera_check(&camera, NULL), -EINVAL);
}

#define SIZES "\"width\":640,\"height\":480,\"fx\":520,\"fy\":521,\"cx\":320.5,\"cy\":240"
#define LENS ",\"distortion\":[-0.1,0.01,0.001,0.002,0.003]"
#define POSE ",\"world_from_camera\":[1,0,0,1, 0,-1,0,2, 0,0,-1,3, 0,0,0,1]"

static int read_text(const char *text, struct gn_camera *out_camera, struct gn_error *out_error)
{
    char path[] = "/tmp/gn-camera-XXXXXX";
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    int ret = gn_camera_read_file(path, out_camera, out_error);
    unlink(path);
    if (ret < 0)
        assert_memory_equal(out_error->text, path, strlen(path));
    return ret;
}

static void test_read(void **unused)
{
    (void)unused;
    struct gn_camera c;
    struct gn_error e = {0};
    assert_int_equal(read_text("{" SIZES LENS POSE "}", &c, &e), 0);
    assert_int_equal(c.width, 640);
    assert_int_equal(c.height, 480);
    assert_true(c.fx == 520 && c.fy == 521 && c.cx == 320.5 && c.cy == 240);
    assert_true(c.distortion[0] == -0.1 && c.distortion[4] == 0.003);
    assert_true(c.world_from_camera.translation[2] == 3.0);
    double y[3] = {0, 1, 0};
    gn_pose_rotate(&c.world_from_camera, y, y);
    assert_true(fabs(y[1] + 1.0) < 1e-15);
    assert_int_equal(c.response.type, GN_RESPONSE_SRGB);

    assert_int_equal(read_text("{" SIZES LENS POSE ",\"response\":{\"type\":\"log\",\"a\":0.5,"
                               "\"b\":0.1,\"c\":0.01},\"to_rec709\":[1,2,0,0,1,0,0,0,1],"
                               "\"scale\":2.5}",
                               &c, &e),
                     0);
    assert_int_equal(c.response.type, GN_RESPONSE_LOG);
    assert_true(c.response.log_a == 0.5 && c.response.log_b == 0.1 && c.response.log_c == 0.01);
    assert_true(c.response.to_rec709[1] == 2.0 && c.response.scale == 2.5);
    assert_int_equal(
        read_text("{" SIZES LENS POSE ",\"response\":{\"type\":\"gamma\",\"gamma\":2.2}}", &c, &e),
        0);
    assert_true(c.response.type == GN_RESPONSE_GAMMA && c.response.gamma == 2.2);
    assert_int_equal(read_text("{" SIZES LENS POSE ",\"response\":{\"type\":\"linear\"}}", &c, &e),
                     0);
    assert_int_equal(c.response.type, GN_RESPONSE_LINEAR);
    assert_true(!gn_match_has_noise(&c.match) && c.match.blur_px == 0);
    assert_int_equal(read_text("{" SIZES LENS POSE ",\"noise\":{\"slope\":[1e-3,2e-3,1],"
                               "\"offset\":[0,1e-5,1e-6]},\"blur\":0.75}",
                               &c, &e),
                     0);
    assert_true(c.match.noise_slope[1] == 2e-3 && c.match.noise_offset[2] == 1e-6);
    assert_true(c.match.blur_px == 0.75);
}

static void test_read_errors(void **unused)
{
    (void)unused;
    static const char *const cases[][2] = {
        {"{" SIZES LENS POSE ",\"distorsion\":0}",
         ": unknown key 'distorsion'; did you mean 'distortion'?"},
        {"{" SIZES LENS POSE ",\"fov\":0}", ": unknown key 'fov'; known are width, height, fx, fy"},
        {"{" SIZES LENS "}", ": world_from_camera: missing: where the camera is, 16 numbers"},
        {"{" SIZES LENS ",\"world_from_camra\":0}",
         ": unknown key 'world_from_camra'; did you mean 'world_from_camera'?"},
        {"{" LENS "}", ": not JSON"},
        {"{\"width\":\"640\"}", ": width: expected a whole number, found a string"},
        {"{\"width\":640.5}", ": width: expected a whole number in [1, 16384], found 640.5"},
        {"{\"width\":16385}", ": width: expected a whole number in [1, 16384], found 16385"},
        {"{" SIZES POSE ",\"distortion\":[1,2,3,4]}", ": distortion: expected 5 elements, found 4"},
        {"{" SIZES POSE ",\"distortion\":[1,2,3,4,null]}",
         ": distortion: element 4: expected a number, found null"},
        {"{" SIZES POSE ",\"distortion\":[1,2,3,4,NaN]}", ": not JSON"},
        {"{" SIZES POSE ",\"distortion\":[0,0,0,0,1001]}",
         ": each distortion coefficient must lie in [-1000, 1000]"},
        {"{" SIZES LENS ",\"world_from_camera\":[1,0,0,0,0,1,0,0,0,0,0,0,0,0,0,1]}",
         ": world_from_camera: not a pose: the matrix is singular"},
        {"{" SIZES LENS ",\"world_from_camera\":[1,0,0,0,0,1,0,0,0,0,-1,0,0,0,0,1]}",
         ": world_from_camera: not a pose: the matrix mirrors"},
        {"{" SIZES LENS ",\"world_from_camera\":[1,0,0,0,0,1,0,0,0,0,1,0,5,0,0,1]}",
         ": world_from_camera: not a pose: the last row"},
        {"{" SIZES LENS POSE ",\"response\":\"srgb\"}",
         ": response: expected an object, found a string"},
        {"{" SIZES LENS POSE ",\"response\":{\"type\":\"sRGB\"}}",
         ": response.type: expected one of 'linear', 'srgb', 'gamma', 'log', 'table', found "
         "'sRGB'"},
        {"{" SIZES LENS POSE ",\"response\":{\"type\":\"srgb\",\"gamma\":2}}",
         ": response: unknown key 'gamma'; known are type"},
        {"{" SIZES LENS POSE ",\"response\":{\"type\":\"gamma\",\"gamma\":0}}",
         ": response.gamma: expected a number in [0.1, 10], found 0"},
        {"{" SIZES LENS POSE ",\"response\":{\"type\":\"log\",\"a\":0,\"b\":0,\"c\":0}}",
         ": response.b: expected a number in ["},
        {"{" SIZES LENS POSE ",\"scale\":0}",
         ": scale: expected a number in [1e-12, 1e+12], found 0"},
        {"{" SIZES LENS POSE ",\"to_rec709\":[1,0,0,0,1,0,0,0]}",
         ": to_rec709: expected 9 elements, found 8"},
        {"{" SIZES LENS POSE ",\"noise\":0.1}", ": noise: expected an object, found a number"},
        {"{" SIZES LENS POSE ",\"noise\":{\"sigma\":[1,1,1]}}",
         ": noise: unknown key 'sigma'; known are slope, offset"},
        {"{" SIZES LENS POSE ",\"noise\":{\"slope\":[0,0]}}",
         ": noise.slope: expected 3 elements, found 2"},
        {"{" SIZES LENS POSE ",\"noise\":{\"slope\":[0,-1e-9,0]}}",
         ": noise: slope and offset of a camera's noise must lie in [0, 1]"},
        {"{" SIZES LENS POSE ",\"noise\":{\"offset\":[0,0,1e300]}}",
         ": noise: slope and offset of a camera's noise must lie in [0, 1]"},
        {"{" SIZES LENS POSE ",\"blur\":8.1}", ": blur: expected a number in [0, 8], found 8.1"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct gn_camera c = {.width = 12345};
        struct gn_error e = {0};
        assert_int_equal(read_text(cases[i][0], &c, &e), -EINVAL);
        if (strstr(e.text, cases[i][1]) == NULL)
            assert_string_equal(e.text, cases[i][1]);
        assert_int_equal(c.width, 12345);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),   cmocka_unit_test(test_points),
        cmocka_unit_test(test_known_values), cmocka_unit_test(test_near_the_fold),
        cmocka_unit_test(test_unseen),       cmocka_unit_test(test_check),
        cmocka_unit_test(test_read),         cmocka_unit_test(test_read_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
