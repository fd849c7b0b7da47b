/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The response fitted to synthetic chart pictures of a sensor whose response is known: noise,
 * 12-bit codes, clipping, colours mixed by a known matrix; and the sets that determine nothing.
 */
#include "client/calibrate/chart_response.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "proto/attr.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

#define PATCH_PX 14

static uint64_t random_state = 1;

/* Linear Rec.709 to the sensor's linear RGB: what the fitted matrix must undo. */
static const double device_from_rec709[9] = {0.8, 0.25, 0.05, 0.15, 0.9, 0.1, 0.03, 0.22, 0.6};

struct sensor {
    double a, b, c;
    bool is_linear;
    double noise; // codes
    double full;  // largest code
    bool is_mono;
};

static double expose(const struct sensor *s, double light)
{
    double y = s->is_linear ? s->a + s->b * light : s->a + s->b * log(s->c + light);
    double code = floor(y * s->full + s->noise * gn_test_random_normal(&random_state) + 0.5);
    return fmin(fmax(code, 0), s->full) / s->full;
}

static void get_device(int patch, double out[3])
{
    double rho[3];
    gn_chart_get_reflectance(patch, rho);
    for (int i = 0; i < 3; i++) {
        out[i] = 0;
        for (int k = 0; k < 3; k++)
            out[i] += device_from_rec709[3 * i + k] * rho[k];
    }
}

/* A picture of the chart, a border of half a patch around it. */
static struct gn_image photograph(const struct sensor *s, double time)
{
    struct gn_image image;
    assert_int_equal(gn_image_init(&image, 7 * PATCH_PX, 5 * PATCH_PX, s->is_mono ? 1 : 3), 0);
    for (int y = 0; y < image.height; y++) {
        for (int x = 0; x < image.width; x++) {
            int column = (x - PATCH_PX / 2) / PATCH_PX, row = (y - PATCH_PX / 2) / PATCH_PX;
            double rgb[3] = {0.05, 0.05, 0.05};
            if (x >= PATCH_PX / 2 && y >= PATCH_PX / 2 && column < 6 && row < 4)
                get_device(6 * row + column, rgb);
            for (int c = 0; c < image.channels; c++)
                gn_image_at(&image, x, y)[c] =
                    (float)expose(s, fmax(time * rgb[s->is_mono ? 1 : c], 0));
        }
    }
    return image;
}

static const struct gn_chart_place place = {{PATCH_PX, PATCH_PX, 6 * PATCH_PX, PATCH_PX,
                                             6 * PATCH_PX, 4 * PATCH_PX, PATCH_PX, 4 * PATCH_PX}};

static void shoot(const struct sensor *s, double time, bool is_known, struct gn_chart_shot *out)
{
    struct gn_image image = photograph(s, time);
    *out = (struct gn_chart_shot){.name = "shot", .time = is_known ? time : 0};
    assert_int_equal(gn_chart_measure(&image, &place, 0.01, out->patches, NULL), 0);
    gn_image_finish(&image);
}

static int fit(const struct sensor *s, const double *times, int n, bool is_known,
               struct gn_chart_response *out, struct gn_error *error)
{
    static struct gn_chart_shot shots[GN_CHART_MAX_SHOTS];
    for (int k = 0; k < n; k++)
        shoot(s, times[k], is_known, &shots[k]);
    struct gn_chart_response_options options = {.model =
                                                    s->is_linear ? GN_CURVE_LINEAR : GN_CURVE_LOG,
                                                .is_mono = s->is_mono,
                                                .keeps_white = true,
                                                .code_step = 1 / s->full};
    return gn_chart_response_fit(shots, n, &options, out, error);
}

/* The largest relative error of light decoded by the fitted curve from true codes of
 * [low, high]. unit: true light per light of the fit. */
static double get_worst(const struct sensor *s, const struct gn_curve *curve, double unit,
                        double low, double high)
{
    double worst = 0;
    for (double x = low; x <= high * 1.0001; x *= 1.07) {
        double y = s->is_linear ? s->a + s->b * x : s->a + s->b * log(s->c + x);
        worst = fmax(worst, fabs(unit * gn_curve_decode(curve, y) / x - 1));
    }
    return worst;
}

/* Six decades in exposures of a factor of 4, noise of two codes of 12 bits. */
static const struct sensor hdrc = {.a = 0.6, .b = 0.07, .c = 2e-4, .noise = 2, .full = 4095};

static int list_times(double first, double last, double factor, double *out)
{
    int n = 0;
    for (double t = first; factor > 1 ? t <= last : t >= last; t *= factor)
        out[n++] = t;
    return n;
}

/* White's green in the first picture, which is 1 in the fit's units. */
static double get_unit(double first_time)
{
    double sum = 0;
    for (int j = GN_CHART_WHITE; j < 24; j++) {
        double rho[3], device[3];
        gn_chart_get_reflectance(j, rho);
        get_device(j, device);
        sum += log(device[1] / rho[1]);
    }
    return first_time * exp(sum / 6);
}

static void test_log_sensor(void **unused)
{
    (void)unused;
    double times[64];
    for (int known = 1; known >= 0; known--) {
        int n = list_times(1e-3, 300, 4, times);
        struct gn_chart_response r;
        struct gn_error e = {0};
        if (fit(&hdrc, times, n, known, &r, &e))
            fail_msg("%s", e.text);
        double unit = get_unit(times[0]);
        double four = get_worst(&hdrc, &r.curve, unit, 1e-2, 1e2);
        double six = get_worst(&hdrc, &r.curve, unit, 2.5e-4, 2.5e2);
        double bound = known ? 0.001 : 0.02;
        printf("# times %s: 4 decades %.2f %%, 6 decades %.2f %%, condition %.1f, grey %.2f %%\n",
               known ? "known" : "unknown", 100 * four, 100 * six, r.curve.condition,
               100 * r.worst_grey);
        assert_true(four < bound && six < bound);
        assert_true(r.curve.is_c_seen);
        assert_true(fabs(r.curve.b - 0.07) < 0.0007);
        for (int k = 0; k < n && !known; k++)
            assert_true(fabs(r.time[k] * times[0] / times[k] - 1) < 0.03);
        gn_chart_response_finish(&r);
    }
}

static void test_matrix(void **unused)
{
    (void)unused;
    double times[64], product[9];
    int n = list_times(0.05, 40, 5, times);
    struct gn_chart_response r;
    assert_int_equal(fit(&hdrc, times, n, true, &r, NULL), 0);
    double worst = 0, scale = get_unit(1);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            product[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                product[3 * i + j] +=
                    r.matrix.to_rec709[3 * i + k] * device_from_rec709[3 * k + j] / scale;
            worst = fmax(worst, fabs(product[3 * i + j] - (i == j)));
        }
    printf("# matrix: worst entry of A M %.4f, rms %.4f, condition %.1f\n", worst, r.matrix.rms,
           r.matrix.condition);
    assert_true(worst < 0.003 && r.matrix.condition > 1 && r.matrix.condition < 30);
    assert_true(r.matrix.worst_grey < 0.02);
    gn_chart_response_finish(&r);
}

/* A dark current far below what is seen, and one that hides two decades. */
static void test_extreme_dark(void **unused)
{
    (void)unused;
    double times[64];
    int n = list_times(1e-3, 300, 4, times);
    struct gn_chart_response r;
    struct sensor s = hdrc;
    s.c = 1e-12;
    assert_int_equal(fit(&s, times, n, true, &r, NULL), 0);
    assert_true(!r.curve.is_c_seen && r.curve.c == 0);
    assert_true(get_worst(&s, &r.curve, get_unit(times[0]), 1e-3, 1e2) < 0.002);
    gn_chart_response_finish(&r);
    s.c = 3e-2;
    assert_int_equal(fit(&s, times, n, true, &r, NULL), 0);
    assert_true(fabs(r.curve.c * get_unit(times[0]) / 3e-2 - 1) < 0.002);
    assert_true(get_worst(&s, &r.curve, get_unit(times[0]), 3e-2, 1e2) < 0.002);
    gn_chart_response_finish(&r);
}

static void test_linear_sensor(void **unused)
{
    (void)unused;
    struct sensor s = {
        .is_linear = true, .a = 0.012, .b = 0.9, .noise = 1.5, .full = 255, .is_mono = true};
    double times[64];
    int n = list_times(2, 0.02, 0.5, times);
    struct gn_chart_response r;
    struct gn_error e = {0};
    if (fit(&s, times, n, true, &r, &e))
        fail_msg("%s", e.text);
    double worst = get_worst(&s, &r.curve, get_unit(times[0]), 0.03, 0.9);
    printf("# linear: dark %.5f, worst %.2f %%\n", r.curve.a, 100 * worst);
    assert_true(fabs(r.curve.a - 0.012) < 0.0005 && worst < 0.01);
    assert_true(r.n_clipped > 0 && !r.has_matrix);
    gn_chart_response_finish(&r);
}

/* A hand over three patches in two pictures is found, named, and changes nothing. */
static void test_outliers(void **unused)
{
    (void)unused;
    static struct gn_chart_shot shots[8];
    double times[64];
    int n = list_times(0.05, 700, 4, times);
    for (int k = 0; k < n; k++)
        shoot(&hdrc, times[k], true, &shots[k]);
    static const int covered[3] = {4, 14, 20};
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++) {
            shots[2].patches[covered[i]].code[c] -= 0.08;
            shots[3].patches[covered[i]].code[c] -= 0.05;
        }
    struct gn_chart_response_options options = {.code_step = 1.0 / 4095, .keeps_white = true};
    struct gn_chart_response r;
    assert_int_equal(gn_chart_response_fit(shots, n, &options, &r, NULL), 0);
    int found = 0;
    for (int i = 0; i < r.n_points; i++) {
        const struct gn_chart_point *p = &r.points[i];
        bool is_covered =
            (p->shot == 2 || p->shot == 3) && (p->patch == 4 || p->patch == 14 || p->patch == 20);
        found += is_covered && p->is_outlier;
    }
    assert_int_equal(found, 18);
    printf("# outliers: %d, of them 18 covered\n", r.curve.n_outliers);
    assert_true(r.curve.n_outliers < 18 + 6);
    assert_true(get_worst(&hdrc, &r.curve, get_unit(times[0]), 1e-2, 1e2) < 0.002);
    gn_chart_response_finish(&r);
}

static void test_refusals(void **unused)
{
    (void)unused;
    struct sensor dark = {.a = 0.6, .b = 0.07, .c = 1e-30, .full = 4095};
    struct sensor rough = {.a = 0.6, .b = 0.07, .c = 2e-4, .noise = 400, .full = 4095};
    struct sensor flat = {.is_linear = true, .a = 0.2, .b = 0.05, .noise = 1, .full = 4095};
    const struct {
        const struct sensor *sensor;
        double times[4];
        int n;
        bool as_log;
        const char *word;
    } cases[] = {
        {&hdrc, {1}, 1, true, "one exposure alone"},
        {&hdrc, {1, 1, 1, 1}, 4, true, "one exposure alone"},
        {&hdrc, {1, 1.002, 1.001, 1.003}, 4, true, "condition number"},
        {&rough, {1, 1.1, 1.2, 1.3}, 4, true, "gain of the log curve is uncertain by"},
        {&dark, {1e-12, 2e-12, 4e-12, 8e-12}, 4, true, "unclipped"},
        {&hdrc, {1e6, 2e6, 4e6, 8e6}, 4, true, "unclipped"},
        {&flat, {1, 2, 4, 8}, 4, true, "linear sensor"},
        {&hdrc, {8, 4, 2, -1}, 4, true, "above 0"},
        {&hdrc, {8, 4, 0, 1}, 4, true, "for none"},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        static struct gn_chart_shot shots[4];
        for (int k = 0; k < cases[i].n; k++) {
            shoot(cases[i].sensor, fmax(cases[i].times[k], 0), true, &shots[k]);
            shots[k].time = cases[i].times[k];
        }
        struct gn_chart_response_options options = {.model = GN_CURVE_LOG, .code_step = 1.0 / 4095};
        struct gn_chart_response r;
        struct gn_error e = {0};
        int ret = gn_chart_response_fit(shots, cases[i].n, &options, &r, &e);
        if (ret >= 0 || !strstr(e.text, cases[i].word))
            fail_msg("case %zu: %d \"%s\" does not say \"%s\" (condition %g, b %g, c %g)", i, ret,
                     e.text, cases[i].word, r.curve.condition, r.curve.b, r.curve.c);
        assert_null(r.points);
    }
}

/* A curve that its own pictures do not bear out, at each of the bounds and just beyond. */
static void test_check(void **unused)
{
    (void)unused;
    const struct {
        int n_off[3]; // outliers of 20 values
        double error; // of the second picture's other values
        const char *word;
    } cases[] = {
        {{10, 0, 0}, 0, NULL},
        {{0, 11, 0}, 0, "11 of the 20 values of b are off"},
        {{7, 7, 6}, 0, NULL},
        {{7, 6, 8}, 0, "21 of 60 values lie on no common curve, 8 of them of c"},
        {{0, 0, 0}, 0.0999, NULL},
        {{0, 0, 0}, -0.102, "b lies 10.2 % RMS off the curve, at most 10 % is right"},
    };
    const struct gn_chart_shot shots[3] = {{.name = "a"}, {.name = "b"}, {.name = "c"}};
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_chart_point points[60] = {{0}};
        struct gn_chart_response r = {.n_points = 60, .points = points};
        for (int k = 0; k < 60; k++) {
            bool is_off = k % 20 < cases[i].n_off[k / 20];
            points[k] = (struct gn_chart_point){.shot = k / 20,
                                                .is_fitted = true,
                                                .is_outlier = is_off,
                                                .error = is_off        ? 9
                                                         : k / 20 == 1 ? cases[i].error
                                                                       : 0};
            r.curve.n_outliers += is_off;
            r.curve.n_used += !is_off;
        }
        struct gn_error e = {0};
        assert_int_equal(gn_chart_response_check(shots, 3, &r, &e), cases[i].word ? -EDOM : 0);
        if (cases[i].word && !strstr(e.text, cases[i].word))
            fail_msg("case %zu: \"%s\" does not say \"%s\"", i, e.text, cases[i].word);
    }
}

/* The chart turned by 180 degrees is recognised by its patches' order. */
static void test_orientation(void **unused)
{
    (void)unused;
    struct gn_image image = photograph(&hdrc, 1), grey;
    struct gn_chart_place turned = {{6 * PATCH_PX, 4 * PATCH_PX, PATCH_PX, 4 * PATCH_PX, PATCH_PX,
                                     PATCH_PX, 6 * PATCH_PX, PATCH_PX}};
    assert_true(gn_chart_orient(&image, &turned) > 0.9);
    assert_memory_equal(&turned, &place, sizeof(place));
    assert_int_equal(gn_image_init(&grey, image.width, image.height, 1), 0);
    for (int i = 0; i < grey.width * grey.height; i++)
        grey.data[i] = (float)gn_test_random_unit(&random_state);
    assert_true(gn_chart_orient(&grey, &turned) < 0.8); // noise is no chart
    struct gn_chart_patch patches[24];
    struct gn_error e = {0};
    struct gn_chart_place outside = {{0, 0, 90, 0, 90, 60, 0, 60}};
    struct gn_chart_place line = {{10, 10, 20, 20, 30, 30, 40, 40}};
    struct gn_chart_place small = {{10, 10, 13, 10, 13, 12, 10, 12}};
    assert_int_equal(gn_chart_measure(&image, &outside, 0.01, patches, &e), -EINVAL);
    assert_non_null(strstr(e.text, "patch 1 (dark skin) of the chart lies outside the 98 x 70"));
    assert_int_equal(gn_chart_measure(&image, &line, 0.01, patches, &e), -EINVAL);
    assert_non_null(strstr(e.text, "on a line"));
    assert_int_equal(gn_chart_measure(&image, &small, 0.01, patches, &e), -EINVAL);
    assert_non_null(strstr(e.text, "show the chart larger"));
    gn_image_finish(&image);
    gn_image_finish(&grey);
}

/* Against linear Rec.709 from ArgyllCMS's ColorChecker.cie, converted by other code (Bradford's
 * matrix and the primaries of Rec.709 themselves, numpy), to four digits. */
static void test_reflectances(void **unused)
{
    (void)unused;
    static const double expected[24][3] = {
        {0.1731, 0.0821, 0.0567}, {0.5683, 0.2927, 0.2183}, {0.1037, 0.1959, 0.3315},
        {0.1016, 0.1489, 0.0519}, {0.2216, 0.2158, 0.4346}, {0.1081, 0.5144, 0.4127},
        {0.7473, 0.2006, 0.0281}, {0.0576, 0.1052, 0.4029}, {0.5667, 0.0842, 0.1197},
        {0.1110, 0.0423, 0.1430}, {0.3454, 0.5087, 0.0494}, {0.7945, 0.3594, 0.0205},
        {0.0171, 0.0502, 0.2923}, {0.0560, 0.3002, 0.0687}, {0.4558, 0.0303, 0.0409},
        {0.8572, 0.5675, 0.0068}, {0.5336, 0.0886, 0.3075}, {-0.0374, 0.2470, 0.4005},
        {0.9126, 0.9150, 0.8936}, {0.5798, 0.5921, 0.5934}, {0.3550, 0.3655, 0.3676},
        {0.1901, 0.1919, 0.1931}, {0.0853, 0.0889, 0.0926}, {0.0303, 0.0311, 0.0327},
    };
    for (int j = 0; j < 24; j++) {
        double rho[3];
        gn_chart_get_reflectance(j, rho);
        for (int c = 0; c < 3; c++)
            if (fabs(rho[c] - expected[j][c]) > 6e-4)
                fail_msg("%s, channel %d: %.4f, expected %.4f", gn_chart_get_name(j), c, rho[c],
                         expected[j][c]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_log_sensor),   cmocka_unit_test(test_matrix),
        cmocka_unit_test(test_extreme_dark), cmocka_unit_test(test_linear_sensor),
        cmocka_unit_test(test_outliers),     cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_check),        cmocka_unit_test(test_orientation),
        cmocka_unit_test(test_reflectances),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
