/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The two poses of a flat marker: fitted, and the true one kept through noise. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/pose_choice.h"
#include "client/track/pose_fit.h"
#include "client/track/rotation.h"
#include "client/vision/markers.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

static const double pi = 3.14159265358979323846;
static const double square[4][3] = {
    {-0.02, 0.02, 0}, {0.02, 0.02, 0}, {0.02, -0.02, 0}, {-0.02, -0.02, 0}};
static uint64_t random_state = 99;

static struct gn_camera get_camera(void)
{
    return (struct gn_camera){.width = 640,
                              .height = 480,
                              .fx = 700,
                              .fy = 690,
                              .cx = 322,
                              .cy = 238,
                              .distortion = {-0.2, 0.08, 0.001, -0.002, 0.01},
                              .world_from_camera = {.rotation = {1, 0, 0, 0}}};
}

/** z towards the camera, then tilted by `tilt` about an axis at `around` on the marker. */
static struct gn_pose get_pose(double tilt, double around, double distance)
{
    struct gn_pose pose = {.rotation = {0, 1, 0, 0}, .translation = {0.03, -0.02, distance}};
    gn_rotation_turn(pose.rotation, (const double[3]){tilt * cos(around), tilt * sin(around), 0});
    return pose;
}

static void see(const struct gn_camera *camera, const struct gn_pose *pose,
                const double (*points)[3], int n, double noise_px, double (*out)[2])
{
    for (int i = 0; i < n; i++) {
        double p[3];
        gn_pose_transform(pose, points[i], p);
        assert_true(gn_camera_project(camera, p, out[i]));
        out[i][0] += noise_px * gn_test_random_normal(&random_state);
        out[i][1] += noise_px * gn_test_random_normal(&random_state);
    }
}

static double get_distance(const struct gn_pose *a, const struct gn_pose *b)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += pow(a->translation[k] - b->translation[k], 2);
    return sqrt(sum);
}

static void fits_exact_points_exactly(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    struct gn_camera camera = get_camera();
    static const double corner[8][3] = {{0, 0, 0},   {.1, 0, 0},  {0, .1, 0},  {0, 0, .1},
                                        {.1, .1, 0}, {0, .1, .1}, {.1, 0, .1}, {.1, .1, .1}};
    for (int i = 0; i < 200; i++) {
        struct gn_pose pose = get_pose(0.1 + 1.1 * gn_test_random_unit(&random_state),
                                       2 * pi * gn_test_random_unit(&random_state),
                                       0.3 + gn_test_random_unit(&random_state));
        struct gn_pose_fit fits[2];
        double seen[8][2];
        see(&camera, &pose, square, 4, 0, seen);
        int n = gn_pose_fit_points(&camera, square, (const double(*)[2])seen, 4, 0.1, fits, NULL);
        assert_in_range(n, 1, 2);
        assert_true(get_distance(&fits[0].camera_from_body, &pose) < 1e-7);
        assert_true(gn_rotation_get_angle(fits[0].camera_from_body.rotation, pose.rotation) < 1e-6);
        assert_true(fits[0].rms_px < 1e-6);
        // A body that is not flat has one pose, be it a hundredth as high as it is wide.
        for (int height = 0; height < 2; height++) {
            double body[8][3];
            memcpy(body, corner, sizeof(body));
            for (int k = 0; k < 8; k++)
                body[k][2] *= height ? 0.01 : 1;
            see(&camera, &pose, (const double(*)[3])body, 8, 0, seen);
            n = gn_pose_fit_points(&camera, (const double(*)[3])body, (const double(*)[2])seen, 8,
                                   0.1, fits, NULL);
            assert_int_equal(n, 1);
            assert_true(get_distance(&fits[0].camera_from_body, &pose) < 1e-7);
        }
    }
}

static void seen_face_on_both_poses_are_one(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    struct gn_camera camera = get_camera();
    struct gn_pose_fit fits[2];
    double seen[4][2];
    struct gn_pose pose = get_pose(0, 0, 0.5);
    pose.translation[0] = pose.translation[1] = 0;
    see(&camera, &pose, square, 4, 0, seen);
    assert_int_equal(
        gn_pose_fit_points(&camera, square, (const double(*)[2])seen, 4, 0.1, fits, NULL), 1);
    assert_true(get_distance(&fits[0].camera_from_body, &pose) < 1e-7);
}

/** The sum of squared distances in the picture, by the camera's own projection. */
static double sum_squares(const struct gn_camera *camera, const struct gn_pose *pose,
                          double seen[4][2])
{
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        double p[3], px[2];
        gn_pose_transform(pose, square[i], p);
        assert_true(gn_camera_project(camera, p, px));
        sum += pow(px[0] - seen[i][0], 2) + pow(px[1] - seen[i][1], 2);
    }
    return sum;
}

static void no_pose_near_the_answer_fits_better(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    struct gn_camera camera = get_camera();
    for (int i = 0; i < 100; i++) {
        struct gn_pose pose = get_pose(0.3 + 0.6 * gn_test_random_unit(&random_state),
                                       2 * pi * gn_test_random_unit(&random_state),
                                       0.3 + 0.2 * gn_test_random_unit(&random_state));
        struct gn_pose_fit fits[2];
        double seen[4][2];
        see(&camera, &pose, square, 4, 0.3, seen);
        int n = gn_pose_fit_points(&camera, square, (const double(*)[2])seen, 4, 0.3, fits, NULL);
        assert_in_range(n, 1, 2);
        double best = sum_squares(&camera, &fits[0].camera_from_body, seen);
        assert_true(fabs(best - fits[0].sum_px2) < 0.01 * best + 1e-6);
        for (int k = 0; k < 12; k++) {
            struct gn_pose near = fits[0].camera_from_body;
            double turn[3] = {0}, by = k % 2 ? 1 : -1;
            if (k < 6)
                near.translation[k / 2] += by * 2e-4;
            else
                turn[k / 2 - 3] = by * 5e-3;
            gn_rotation_turn(near.rotation, turn);
            assert_true(sum_squares(&camera, &near, seen) > best);
        }
    }
}

static void the_expected_error_is_the_one_that_comes(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    struct gn_camera camera = get_camera();
    struct gn_pose pose = get_pose(0.7, 1, 0.4);
    double sum_m2 = 0, sum_rad2 = 0, expected_m = 0, expected_rad = 0;
    enum { N = 2000 };
    for (int i = 0; i < N; i++) {
        struct gn_pose_fit fits[2];
        double seen[4][2];
        see(&camera, &pose, square, 4, 0.1, seen);
        int n = gn_pose_fit_points(&camera, square, (const double(*)[2])seen, 4, 0.1, fits, NULL);
        assert_in_range(n, 1, 2);
        sum_m2 += pow(get_distance(&fits[0].camera_from_body, &pose), 2);
        sum_rad2 += pow(gn_rotation_get_angle(fits[0].camera_from_body.rotation, pose.rotation), 2);
        expected_m = fits[0].error_m;
        expected_rad = fits[0].error_rad;
    }
    // 2000 draws: the ratio is known to 2 %; its curvature takes some more.
    assert_true(fabs(sqrt(sum_m2 / N) / expected_m - 1) < 0.1);
    assert_true(fabs(sqrt(sum_rad2 / N) / expected_rad - 1) < 0.1);
}

static void points_that_tell_nothing_give_no_pose(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    struct gn_camera camera = get_camera();
    struct gn_pose_fit fits[2];
    const double same[4][2] = {{300, 200}, {300, 200}, {300, 200}, {300, 200}};
    const double far[4][2] = {{1e300, 0}, {0, 1e300}, {-1e300, 0}, {NAN, 0}};
    const double line[4][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
    const double seen[4][2] = {{300, 200}, {320, 200}, {340, 200}, {360, 200}};
    assert_true(gn_pose_fit_points(&camera, square, same, 4, 0.1, fits, NULL) <= 0);
    assert_true(gn_pose_fit_points(&camera, square, far, 4, 0.1, fits, NULL) <= 0);
    assert_true(gn_pose_fit_points(&camera, line, seen, 4, 0.1, fits, NULL) <= 0);
    assert_true(gn_pose_fit_points(&camera, square, seen, 3, 0.1, fits, NULL) < 0);
}

/** Follows a 40 mm marker at 0.8 m with noisy corners; returns how many answers are the flip. */
static int count_flips(bool is_chosen, int n_frames, double noise_px, int *out_n_better_flips)
{
    struct gn_camera camera = get_camera();
    struct gn_pose_choice choice = {0};
    int n_flips = 0;
    *out_n_better_flips = 0;
    for (int i = 0; i < n_frames; i++) {
        struct gn_pose pose = get_pose(0.45 + 0.1 * sin(i / 40.0), 0.5 + 0.3 * cos(i / 70.0), 0.8);
        struct gn_pose_fit fits[2];
        double seen[4][2];
        // The first pictures are good ones.
        see(&camera, &pose, square, 4, i < 10 ? 0.05 : noise_px, seen);
        int n = gn_pose_fit_points(&camera, square, (const double(*)[2])seen, 4, 0.1, fits, NULL);
        if (n < 1)
            continue;
        assert_true(n == 1 || fits[0].sum_px2 <= fits[1].sum_px2);
        int k = gn_pose_choice_update(&choice, i * INT64_C(33000000), fits, n, NULL);
        double best = gn_rotation_get_angle(fits[0].camera_from_body.rotation, pose.rotation);
        double mine =
            gn_rotation_get_angle(fits[is_chosen ? k : 0].camera_from_body.rotation, pose.rotation);
        *out_n_better_flips += best > 0.45;
        n_flips += mine > 0.45;
    }
    return n_flips;
}

static void flips_are_rejected(void **state)
{
    (void)state;
    if (!gn_vision_is_built())
        return;
    int n_better = 0;
    random_state = 99;
    int n_flips = count_flips(true, 900, 0.25, &n_better);
    print_message("# of 900 pictures %d fit the flip better, %d answers are it\n", n_better,
                  n_flips);
    assert_true(n_better > 20); // or this shows nothing
    assert_int_equal(n_flips, 0);
}

static struct gn_pose_fit make_fit(const struct gn_pose *pose, double sum_px2)
{
    return (struct gn_pose_fit){.camera_from_body = *pose, .sum_px2 = sum_px2};
}

static void a_wrong_beginning_is_corrected_by_evidence(void **state)
{
    (void)state;
    struct gn_pose_choice choice = {0};
    struct gn_pose truth = get_pose(0.4, 0, 0.5), flip = get_pose(-0.4, 0, 0.5);
    // One noisy picture prefers the flip; then the truth is plainly better.
    struct gn_pose_fit fits[2] = {make_fit(&flip, 0.01), make_fit(&truth, 0.02)};
    assert_int_equal(gn_pose_choice_update(&choice, 0, fits, 2, NULL), 0);
    int n_wrong = 0;
    for (int i = 1; i <= 30; i++) {
        fits[0] = make_fit(&truth, 0.02);
        fits[1] = make_fit(&flip, 0.3);
        n_wrong += gn_pose_choice_update(&choice, i * INT64_C(33000000), fits, 2, NULL) != 0;
    }
    assert_in_range(n_wrong, 1, 5);
    assert_int_equal(choice.n_changed, 1);
    assert_int_equal(choice.n_rejected, n_wrong);
    // And a single picture that says otherwise does not change it back.
    fits[0] = make_fit(&flip, 0.01);
    fits[1] = make_fit(&truth, 0.3);
    assert_int_equal(gn_pose_choice_update(&choice, 31 * INT64_C(33000000), fits, 2, NULL), 1);
    // After a gap the past is forgotten.
    assert_int_equal(gn_pose_choice_update(&choice, INT64_C(9000000000), fits, 2, NULL), 0);
    // Where the expected pose is known, a fit that is nearer to it goes on.
    assert_int_equal(gn_pose_choice_update(&choice, INT64_C(9033000000), fits, 2, &flip), 0);
}

/** Of how many pictures the other pose fits all but the first by so much better, in units of
 * 0.25 px squared, until it is chosen; n where it never is. */
static int wait_for_change(double by, int n)
{
    struct gn_pose_choice choice = {0};
    struct gn_pose mine = get_pose(0.4, 0, 0.5), other = get_pose(-0.4, 0, 0.5);
    struct gn_pose_fit fits[2] = {make_fit(&mine, 0), make_fit(&other, 0)};
    int i = 0;
    for (; i < n && gn_pose_choice_update(&choice, i * INT64_C(33000000), fits, 2, NULL) == 0; i++)
        fits[0].sum_px2 = by * 0.25 * 0.25;
    return i;
}

static void evidence_fades_with_half_a_second(void **state)
{
    (void)state;
    // A sum of s a picture comes to s / (1 - exp(-0.033 / 0.5)) = 15.66 s in the end, and 12 change
    // it: at 0.766 a picture.
    assert_int_equal(wait_for_change(0.7, 400), 400);
    assert_in_range(wait_for_change(0.8, 400), 45, 55); // 12.53 (1 - exp(-0.066 n)) = 12: 48
}

static void a_second_pose_begins_with_the_past_of_the_first(void **state)
{
    (void)state;
    struct gn_pose_choice choice = {0};
    struct gn_pose mine = get_pose(0.4, 0, 0.5), other = get_pose(-0.4, 0, 0.5);
    struct gn_pose_fit fits[2] = {make_fit(&mine, 2), make_fit(&other, 0)};
    assert_int_equal(gn_pose_choice_update(&choice, 0, fits, 1, NULL), 0);
    assert_int_equal(gn_pose_choice_update(&choice, INT64_C(33000000), fits, 1, NULL), 0);
    fits[0].sum_px2 = 0.02; // the bad pictures were as bad for both
    assert_int_equal(gn_pose_choice_update(&choice, INT64_C(66000000), fits, 2, NULL), 0);
    assert_int_equal(choice.n_changed, 0);
}

static void both_poses_are_matched_not_the_chosen_one_alone(void **state)
{
    (void)state;
    struct gn_pose_choice choice = {0};
    struct gn_pose a = get_pose(0, 0, 0.5), b = get_pose(0.8, 0, 0.5);
    struct gn_pose near_a = get_pose(0.24, pi / 2, 0.5), between = get_pose(0.226, -pi / 4, 0.5);
    struct gn_pose_fit before[2] = {make_fit(&a, 0), make_fit(&b, 0)};
    struct gn_pose_fit fits[2] = {make_fit(&near_a, 0), make_fit(&between, 0)};
    assert_int_equal(gn_pose_choice_update(&choice, 0, before, 2, NULL), 0);
    // `between` is nearer to a by 0.01 rad, and to b by 0.2.
    assert_int_equal(gn_pose_choice_update(&choice, INT64_C(33000000), fits, 2, NULL), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fits_exact_points_exactly),
        cmocka_unit_test(seen_face_on_both_poses_are_one),
        cmocka_unit_test(no_pose_near_the_answer_fits_better),
        cmocka_unit_test(the_expected_error_is_the_one_that_comes),
        cmocka_unit_test(points_that_tell_nothing_give_no_pose),
        cmocka_unit_test(flips_are_rejected),
        cmocka_unit_test(a_wrong_beginning_is_corrected_by_evidence),
        cmocka_unit_test(both_poses_are_matched_not_the_chosen_one_alone),
        cmocka_unit_test(evidence_fades_with_half_a_second),
        cmocka_unit_test(a_second_pose_begins_with_the_past_of_the_first),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
