/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The colour chart found by its grid: as it lies in pictures drawn here, in colour, gray and one
 * band, dark and noisy; and pictures that show none, or one that may lie in two ways.
 */
#include "client/calibrate/chart_find.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "client/calibrate/solve.h"
#include "proto/attr.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

enum { WIDTH = 320, HEIGHT = 240 };

static uint64_t random_state = 7;
static double reflectance[GN_CHART_PATCHES][3];

/* How a picture is drawn. */
struct scene {
    double corners[8];      // centres of patches 1, 6, 24, 19
    double noise, exposure; // of codes in [0, 1]; of the light
    int band;               // 0 to 2: one channel of the reflectance of that band; 3: all three
    int n_charts;           // side by side, on one grid
    int order;              // patch at place j: j * order % 24: 1 is the chart
};

/* The chart's reflectance at chart position (u, v), patch centres at whole numbers; white paper
 * around it. */
static void look(const struct scene *s, double u, double v, double out[3])
{
    int column = (int)floor(u + 0.5), row = (int)floor(v + 0.5), columns = 6 * s->n_charts;
    double edge = fmax(fabs(u - column), fabs(v - row)) < 0.455 ? 1 : 0;
    bool is_board = u > -0.75 && v > -0.75 && u < columns - 0.25 && v < 3.75;
    bool is_patch = column >= 0 && row >= 0 && column < columns && row < 4;
    out[0] = out[1] = out[2] = is_board ? 0.035 : 0.7;
    if (is_patch && edge > 0)
        memcpy(out, reflectance[(row * 6 + column % 6) * s->order % 24], sizeof(reflectance[0]));
}

static struct gn_image draw(const struct scene *s)
{
    static const double chart[8] = {0, 0, 5, 0, 5, 3, 0, 3};
    struct gn_image image;
    double h[9];
    assert_int_equal(gn_image_init(&image, WIDTH, HEIGHT, s->band == 3 ? 3 : 1), 0);
    assert_int_equal(gn_solve_homography(s->corners, chart, h), 0);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            double mean[3] = {0};
            for (int i = 0; i < 4; i++) { // samples of a pixel
                double px = x + (2 * (i % 2) + 1) / 4.0, py = y + (2 * (i / 2) + 1) / 4.0, rgb[3];
                double w = h[6] * px + h[7] * py + h[8];
                look(s, (h[0] * px + h[1] * py + h[2]) / w, (h[3] * px + h[4] * py + h[5]) / w,
                     rgb);
                for (int c = 0; c < 3; c++)
                    mean[c] += rgb[c] / 4;
            }
            for (int c = 0; c < image.channels; c++) {
                double code = s->exposure * fmax(mean[s->band == 3 ? c : s->band], 0);
                code += s->noise * gn_test_random_normal(&random_state);
                gn_image_at(&image, x, y)[c] = (float)fmin(fmax(code, 0), 1);
            }
        }
    return image;
}

/* Largest distance of the found corners, in distances of patches; negative: what was returned. */
static double find(const struct scene *s, struct gn_error *error)
{
    struct gn_image image = draw(s);
    struct gn_chart_place place;
    int ret = gn_chart_find(&image, &place, error);
    double worst = 0,
           step = hypot(s->corners[2] - s->corners[0], s->corners[3] - s->corners[1]) / 5;
    gn_image_finish(&image);
    if (ret != 1)
        return ret == 0 ? -1 : ret;
    for (int i = 0; i < 4; i++)
        worst = fmax(worst, hypot(place.corners[2 * i] - s->corners[2 * i],
                                  place.corners[2 * i + 1] - s->corners[2 * i + 1]));
    return worst / step;
}

/* The chart turned by an angle about the picture's middle, its far side shorter. */
static struct scene turn(double degrees, double step, double perspective)
{
    static const double at[4][2] = {{-2.5, -1.5}, {2.5, -1.5}, {2.5, 1.5}, {-2.5, 1.5}};
    struct scene s = {.exposure = 1, .band = 3, .n_charts = 1, .order = 1};
    double c = cos(degrees * M_PI / 180), d = sin(degrees * M_PI / 180);
    for (int i = 0; i < 4; i++) {
        double x = step * (c * at[i][0] - d * at[i][1]), y = step * (d * at[i][0] + c * at[i][1]);
        double w = 1 + perspective * y / HEIGHT;
        s.corners[2 * i] = WIDTH / 2.0 + x / w;
        s.corners[2 * i + 1] = HEIGHT / 2.0 + y / w;
    }
    return s;
}

static void expect_found(const struct scene *s, double bound)
{
    struct gn_error error = {0};
    double off = find(s, &error);
    if (!(off >= 0 && off < bound))
        fail_msg("band %d, exposure %g, noise %g: %g %s", s->band, s->exposure, s->noise, off,
                 error.text);
}

static void test_found_as_it_lies(void **state)
{
    (void)state;
    for (int degrees = 0; degrees < 360; degrees += 40) {
        struct scene s = turn(degrees, 34, 0);
        expect_found(&s, 0.08);
        s = turn(degrees, 30, 0.3);
        expect_found(&s, 0.15);
    }
    struct scene small = turn(10, 14, 0);
    expect_found(&small, 0.15);
}

static void test_found_in_every_band_and_exposure(void **state)
{
    (void)state;
    for (int band = 0; band < 3; band++) {
        static const double exposures[] = {0.05, 0.3, 1, 2};
        for (size_t i = 0; i < GN_ARRAY_LEN(exposures); i++) {
            struct scene s = turn(5, 36, 0.2);
            s.band = band;
            s.exposure = exposures[i];
            s.noise = 0.004 * exposures[i];
            expect_found(&s, 0.15);
        }
    }
    struct scene noisy = turn(185, 40, 0.1);
    noisy.noise = 0.2; // found at half the size
    expect_found(&noisy, 0.15);
}

static void expect_none(const struct scene *s)
{
    struct gn_error error = {0};
    double off = find(s, &error);
    if (off != -1)
        fail_msg("%g: %s", off, error.text);
}

static void test_what_is_none(void **state)
{
    (void)state;
    struct scene s = turn(0, 34, 0);
    s.order = 5; // the same patches elsewhere
    expect_none(&s);
    s.order = 0; // all alike
    expect_none(&s);
    s = turn(0, 34, 0); // mirrored: no camera does that
    for (int i = 0; i < 2; i++) {
        double x = s.corners[i];
        s.corners[i] = s.corners[2 + i];
        s.corners[2 + i] = x;
        x = s.corners[4 + i];
        s.corners[4 + i] = s.corners[6 + i];
        s.corners[6 + i] = x;
    }
    expect_none(&s);
    s = turn(0, 3, 0); // far too small
    expect_none(&s);
    s = turn(0, 34, 0);
    s.exposure = 0;
    expect_none(&s); // black
    s.noise = 0.3;
    expect_none(&s); // nothing but noise
}

static void test_two_ways_are_refused(void **state)
{
    (void)state;
    struct scene s = turn(0, 24, 0);
    struct gn_error error = {0};
    s.n_charts = 2;
    for (int i = 0; i < 4; i++)
        s.corners[2 * i] -= 72;
    assert_true(find(&s, &error) == -EDOM);
    assert_non_null(strstr(error.text, "a chart may lie in two ways"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_found_as_it_lies),
        cmocka_unit_test(test_found_in_every_band_and_exposure),
        cmocka_unit_test(test_what_is_none),
        cmocka_unit_test(test_two_ways_are_refused),
    };
    for (int j = 0; j < GN_CHART_PATCHES; j++)
        gn_chart_get_reflectance(j, reflectance[j]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
