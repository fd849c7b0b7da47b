/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Solid angles of pixels: their sums, the light they carry, each one against brute force. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "common/projection.h"
#include "proto/attr.h"

static const double pi = 3.14159265358979323846;

static struct gn_projection make(enum gn_projection_type type, int side, double theta_max)
{
    struct gn_projection p = {.type = type,
                              .width = type == GN_PROJECTION_LATLONG ? 2 * side : side,
                              .height = side,
                              .theta_max = theta_max};
    if (type == GN_PROJECTION_CUBE) {
        p.width = (side + 1) / 2;
        p.height = 6 * p.width;
    }
    if (type == GN_PROJECTION_FISHEYE_KANNALA_BRANDT)
        memcpy(p.k, (double[4]){0.05, -0.02, 0.004, -0.0005}, sizeof(p.k));
    const char *reason = NULL;
    if (gn_projection_init(&p, &reason))
        fail_msg("%s: %s", gn_projection_get_name(type), reason);
    return p;
}

/* The sum over a picture is the shown solid angle, for tiny pictures too. */
static void test_sum(void **state)
{
    (void)state;
    static const int sides[] = {1, 2, 7, 300};
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        for (size_t i = 0; i < GN_ARRAY_LEN(sides); i++) {
            struct gn_projection p = make((enum gn_projection_type)t, sides[i], 0);
            double sum = 0, expected = 2 * pi * (1 - cos(p.theta_max));
            for (int y = 0; y < p.height; y++)
                for (int x = 0; x < p.width; x++)
                    sum += gn_projection_get_solid_angle(&p, x, y);
            double slack = sides[i] < 7 ? 1e-3 : 1e-9; // the quadrature sees edges inside only
            if (!(fabs(sum - expected) <= slack * expected))
                fail_msg("%s, %d px: sums to %.12g, not %.12g", gn_projection_get_name(p.type),
                         sides[i], sum, expected);
        }
    }
}

/* Inner pixels against 64 x 64 samples of sin(theta) / (f^2 rho rho') by finite differences. */
static void test_inner_pixels(void **state)
{
    (void)state;
    static const int n = 64;
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        if (!gn_projection_is_radial((enum gn_projection_type)t))
            continue;
        struct gn_projection p = make((enum gn_projection_type)t, 32, 0);
        for (int i = 0; i < 11 * 11; i++) {
            int ix = 5 + i % 11, iy = 5 + i / 11;
            double sum = 0, h = 1e-5;
            for (int s = 0; s < n * n; s++) {
                double r = hypot(ix + (s % n + 0.5) / n - 16, iy + (s / n + 0.5) / n - 16), d[3],
                       e[3];
                assert_true(gn_projection_get_direction(&p, 16 + r - h, 16, d));
                assert_true(gn_projection_get_direction(&p, 16 + r + h, 16, e));
                sum += (d[2] - e[2]) / (2 * h * r * n * n); // -d(cos theta) dpsi / (r dr dpsi)
            }
            double exact = gn_projection_get_solid_angle(&p, ix, iy);
            if (!(fabs(sum - exact) <= 2e-5 * exact))
                fail_msg("%s, pixel %d %d: %.9g, sampled %.9g", gn_projection_get_name(p.type), ix,
                         iy, exact, sum);
        }
    }
}

/* Every pixel, rims too, against the share of a Fibonacci lattice of directions that it shows,
 * within 20 of them (a pixel of 5000 has 280 along its border). */
static void test_all_pixels(void **state)
{
    (void)state;
    static const int n = 1000000;
    static int counts[16 * 96];
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        struct gn_projection p = make((enum gn_projection_type)t, 16, 0);
        memset(counts, 0, sizeof(counts));
        for (int i = 0; i < n; i++) {
            double z = 1 - (2 * i + 1.0) / n, phi = i * pi * (3 - sqrt(5)), s = sqrt(1 - z * z);
            double xy[2];
            if (gn_projection_get_position(&p, (double[3]){s * cos(phi), s * sin(phi), z}, xy))
                counts[(int)fmin(xy[1], p.height - 1) * p.width + (int)fmin(xy[0], p.width - 1)]++;
        }
        for (int i = 0; i < p.width * p.height; i++) {
            double exact = gn_projection_get_solid_angle(&p, i % p.width, i / p.width);
            if (!(fabs(counts[i] * 4 * pi / n - exact) <= 20 * 4 * pi / n))
                fail_msg("%s, pixel %d %d: %.9g, counted %.9g", gn_projection_get_name(p.type),
                         i % p.width, i / p.width, exact, counts[i] * 4 * pi / n);
        }
    }
}

/* Uniform radiance 1 over the hemisphere around +z gives irradiance pi within 0.1 %. */
static void test_uniform_hemisphere(void **state)
{
    (void)state;
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        struct gn_projection p = make((enum gn_projection_type)t, 300, 0);
        double sum = 0, d[3];
        for (int y = 0; y < p.height; y++)
            for (int x = 0; x < p.width; x++)
                if (gn_projection_get_direction(&p, x + 0.5, y + 0.5, d))
                    sum += fmax(d[2], 0) * gn_projection_get_solid_angle(&p, x, y);
        if (!(fabs(sum - pi) <= 1e-3 * pi))
            fail_msg("%s: E = %.6f", gn_projection_get_name(p.type), sum);
    }
}

/* The share of a pixel's 4 x 4 samples that lie in the disc of 1 sr around l. */
static double get_share(const struct gn_projection *p, int x, int y, const double l[static 3])
{
    static const double cos_disc = 1 - 1 / (2 * 3.14159265358979323846);
    int n_in = 0, n_shown = 0;
    double d[3];
    if (gn_projection_get_direction(p, x + 0.5, y + 0.5, d)) {
        double cos_light = d[0] * l[0] + d[1] * l[1] + d[2] * l[2];
        if (fabs(cos_light - cos_disc) > 0.1) // far from the disc's border
            return cos_light > cos_disc;
    }
    for (int s = 0; s < 16; s++) {
        if (!gn_projection_get_direction(p, x + (s % 4 + 0.5) / 4, y + (s / 4 + 0.5) / 4, d))
            continue;
        n_shown++;
        n_in += d[0] * l[0] + d[1] * l[1] + d[2] * l[2] >= cos_disc;
    }
    return n_shown ? (double)n_in / n_shown : 0;
}

/* A disc light of 1 sr carries the same wherever it stands, within 0.5 %. */
static void test_disc_anywhere(void **state)
{
    (void)state;
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        struct gn_projection p = make((enum gn_projection_type)t, 300, 0);
        bool is_full = gn_projection_is_full_sphere(&p);
        for (int i = 0; i < 5; i++) {
            double azimuth = 2 * pi * i / 5 + 0.3;
            double polar = (is_full ? 10 + 30 * i : 5 + 10 * i) * pi / 180;
            double l[3] = {sin(polar) * cos(azimuth), sin(polar) * sin(azimuth), cos(polar)};
            double sum = 0;
            for (int y = 0; y < p.height; y++)
                for (int x = 0; x < p.width; x++)
                    sum += get_share(&p, x, y, l) * gn_projection_get_solid_angle(&p, x, y);
            if (!(fabs(sum - 1) <= 5e-3))
                fail_msg("%s, disc %d: %.6f sr", gn_projection_get_name(p.type), i, sum);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sum),           cmocka_unit_test(test_inner_pixels),
        cmocka_unit_test(test_all_pixels),    cmocka_unit_test(test_uniform_hemisphere),
        cmocka_unit_test(test_disc_anywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
