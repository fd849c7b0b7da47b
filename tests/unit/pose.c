/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Poses: the polar factor of disturbed matrices, refusal of what is no pose, closed forms.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "common/pose.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

static uint64_t seed = 20070601;

/* Uniform in [-1, 1). */
static double draw(void)
{
    return 2 * gn_test_random_unit(&seed) - 1;
}

static struct gn_pose draw_pose(void)
{
    struct gn_pose pose = {0};
    double norm = 0.0;
    while (norm < 0.1 || norm > 1.0) {
        norm = 0.0;
        for (int i = 0; i < 4; i++) {
            pose.rotation[i] = draw();
            norm += pose.rotation[i] * pose.rotation[i];
        }
    }
    for (int i = 0; i < 4; i++)
        pose.rotation[i] /= sqrt(norm);
    for (int i = 0; i < 3; i++)
        pose.translation[i] = 5.0 * draw();
    return pose;
}

/* Largest element of |R R^T - 1|. */
static double get_skew(const double m[static 16])
{
    double worst = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = i == j ? -1.0 : 0.0;
            for (int k = 0; k < 3; k++)
                sum += m[4 * i + k] * m[4 * j + k];
            worst = fmax(worst, fabs(sum));
        }
    return worst;
}

static double get_difference(const double a[static 16], const double b[static 16])
{
    double worst = 0.0;
    for (int i = 0; i < 16; i++)
        worst = fmax(worst, fabs(a[i] - b[i]));
    return worst;
}

static void test_matrix_round_trip(void **unused)
{
    (void)unused;
    for (int n = 0; n < 2000; n++) {
        struct gn_pose pose = draw_pose(), back;
        double m[16], again[16];
        gn_pose_to_matrix(&pose, m);
        assert_true(get_skew(m) < 1e-14);
        assert_int_equal(gn_pose_from_matrix(m, &back, NULL), 0);
        assert_true(back.rotation[0] >= 0.0);
        gn_pose_to_matrix(&back, again);
        assert_true(get_difference(m, again) < 1e-14);
    }
}

/* The half turns, where the quaternion's w vanishes. */
static void test_half_turns(void **unused)
{
    (void)unused;
    static const double diagonals[3][3] = {{1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
    for (int n = 0; n < 3; n++) {
        double m[16], again[16];
        struct gn_pose pose;
        gn_mat4_identity(m);
        for (int i = 0; i < 3; i++)
            m[5 * i] = diagonals[n][i];
        assert_int_equal(gn_pose_from_matrix(m, &pose, NULL), 0);
        gn_pose_to_matrix(&pose, again);
        assert_true(get_difference(m, again) < 1e-15);
    }
}

/*
 * The nearest rotation R to M is the one for which R^T M is symmetric with positive trace; a matrix
 * within the limits is accepted, one beyond them refused.
 */
static void test_disturbed_matrices(void **unused)
{
    (void)unused;
    static const double sizes[] = {1e-3, 1e-2, 0.03, 0.1, 0.2};
    int n_accepted = 0, n_refused = 0;
    for (int n = 0; n < 5000; n++) {
        struct gn_pose truth = draw_pose(), pose;
        double m[16], r[16];
        const char *reason = NULL;
        gn_pose_to_matrix(&truth, m);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                m[4 * i + j] += sizes[n % 5] * draw();
        if (gn_pose_from_matrix(m, &pose, &reason) < 0) {
            assert_non_null(reason);
            assert_true(sizes[n % 5] > 0.02);
            n_refused++;
            continue;
        }
        n_accepted++;
        gn_pose_to_matrix(&pose, r);
        assert_true(get_skew(r) < 1e-12);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < i; j++) {
                double ij = 0.0, ji = 0.0;
                for (int k = 0; k < 3; k++) {
                    ij += r[4 * k + i] * m[4 * k + j];
                    ji += r[4 * k + j] * m[4 * k + i];
                }
                assert_true(fabs(ij - ji) < 1e-12);
            }
    }
    assert_true(n_accepted > 2000 && n_refused > 1000);
}

static void expect_refused(const double m[static 16], const char *word)
{
    struct gn_pose pose = {.rotation = {9, 9, 9, 9}};
    const char *reason = NULL;
    assert_int_equal(gn_pose_from_matrix(m, &pose, &reason), -EDOM);
    assert_non_null(strstr(reason, word));
    assert_true(pose.rotation[3] == 9.0);
    assert_int_equal(gn_pose_from_matrix(m, &pose, NULL), -EDOM);
}

static void test_refusals(void **unused)
{
    (void)unused;
    static const struct {
        int at;
        double value;
        const char *word;
    } cases[] = {
        {0, NAN, "finite"},       {11, INFINITY, "finite"}, {15, 2.0, "last row"},
        {12, 1e-9, "last row"},   {5, -1.0, "mirrors"},     {10, 0.0, "singular"},
        {0, 0.85, "shears"},      {1, 0.5, "shears"},       {0, 1e200, "scales"},
        {10, 1e-200, "singular"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        double m[16];
        gn_mat4_identity(m);
        m[cases[i].at] = cases[i].value;
        expect_refused(m, cases[i].word);
    }
    double m[16];
    gn_mat4_identity(m);
    m[0] = m[5] = m[10] = 1.11;
    expect_refused(m, "scales");
    m[0] = m[5] = m[10] = 0.89;
    expect_refused(m, "scales");
    m[0] = m[5] = m[10] = 0.0;
    expect_refused(m, "singular");
    m[0] = m[5] = m[10] = -1.0;
    expect_refused(m, "mirrors");
    struct gn_pose pose;
    m[0] = m[5] = m[10] = 1.09;
    assert_int_equal(gn_pose_from_matrix(m, &pose, NULL), 0);
    assert_true(fabs(pose.rotation[0] - 1.0) < 1e-15);
}

static void test_normalize(void **unused)
{
    (void)unused;
    struct gn_pose pose = {.rotation = {1.05, 0, 0, 0}};
    assert_int_equal(gn_pose_normalize(&pose), 0);
    assert_true(pose.rotation[0] == 1.0);
    static const double bad[] = {0.0, 0.89, 1.11, 1e200, NAN, INFINITY};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        pose.rotation[0] = bad[i];
        assert_int_equal(gn_pose_normalize(&pose), -EDOM);
    }
    pose = (struct gn_pose){.rotation = {1, 0, 0, 0}, .translation = {0, NAN, 0}};
    assert_int_equal(gn_pose_normalize(&pose), -EDOM);
}

static void test_products(void **unused)
{
    (void)unused;
    double identity[16];
    gn_mat4_identity(identity);
    for (int n = 0; n < 500; n++) {
        struct gn_pose a = draw_pose(), b = draw_pose(), ab, inverse;
        double ma[16], mb[16], mab[16], m[16];
        double p[3] = {draw(), draw(), draw()}, by_pose[3], by_matrix[3];
        gn_pose_to_matrix(&a, ma);
        gn_pose_to_matrix(&b, mb);
        gn_mat4_multiply(ma, mb, mab);
        gn_pose_multiply(&a, &b, &ab);
        gn_pose_to_matrix(&ab, m);
        assert_true(get_difference(m, mab) < 1e-13);

        gn_pose_transform(&ab, p, by_pose);
        gn_mat4_transform_point(mab, p, by_matrix);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(by_pose[i] - by_matrix[i]) < 1e-13);

        gn_pose_invert(&a, &inverse);
        gn_pose_multiply(&inverse, &a, &inverse); // aliased on purpose
        gn_pose_to_matrix(&inverse, m);
        assert_true(get_difference(m, identity) < 1e-13);

        for (int i = 0; i < 12; i++)
            ma[i] += 0.2 * draw();
        assert_true(gn_mat4_invert(ma, m));
        gn_mat4_multiply(m, ma, m);
        assert_true(get_difference(m, identity) < 1e-9);
    }
    double singular[16] = {1, 2, 3, 0, 2, 4, 6, 0, 0, 0, 1, 0, 0, 0, 0, 1}, out[16];
    assert_false(gn_mat4_invert(singular, out));
    singular[0] = NAN;
    assert_false(gn_mat4_invert(singular, out));
}

/* A tracker that flips the sign of its quaternion must not make the object jump. */
static void test_interpolate(void **unused)
{
    (void)unused;
    for (int n = 0; n < 500; n++) {
        struct gn_pose a = draw_pose(), b = draw_pose(), flipped = b, half, same, end;
        double m[16], again[16];
        for (int i = 0; i < 4; i++)
            flipped.rotation[i] = -b.rotation[i];
        gn_pose_interpolate(&a, &b, 0.3, &half);
        gn_pose_interpolate(&a, &flipped, 0.3, &same);
        gn_pose_to_matrix(&half, m);
        gn_pose_to_matrix(&same, again);
        assert_true(get_difference(m, again) < 1e-12);
        assert_true(get_skew(m) < 1e-12);
        gn_pose_interpolate(&a, &b, 1.0, &end);
        gn_pose_to_matrix(&end, m);
        gn_pose_to_matrix(&b, again);
        assert_true(get_difference(m, again) < 1e-12);
        gn_pose_interpolate(&a, &a, 0.5, &same);
        gn_pose_to_matrix(&same, m);
        gn_pose_to_matrix(&a, again);
        assert_true(get_difference(m, again) < 1e-14);
    }
    /* 90 degrees about z, a third of the way: 30 degrees. */
    struct gn_pose a = {.rotation = {1, 0, 0, 0}};
    struct gn_pose b = {.rotation = {-sqrt(0.5), 0, 0, -sqrt(0.5)}, .translation = {3, 0, 0}};
    double x[3] = {1, 0, 0};
    gn_pose_interpolate(&a, &b, 1.0 / 3.0, &b);
    gn_pose_rotate(&b, x, x);
    assert_true(fabs(x[0] - sqrt(0.75)) < 1e-14 && fabs(x[1] - 0.5) < 1e-14);
    assert_true(fabs(b.translation[0] - 1.0) < 1e-15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_matrix_round_trip),  cmocka_unit_test(test_half_turns),
        cmocka_unit_test(test_disturbed_matrices), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_normalize),          cmocka_unit_test(test_products),
        cmocka_unit_test(test_interpolate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
