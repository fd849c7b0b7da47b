/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Projections: which way each one looks, both ways, and what they refuse. */
#include "common/projection.h"

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "proto/attr.h"

static const double pi = 3.14159265358979323846;

static struct gn_projection make(enum gn_projection_type type, int width, int height)
{
    struct gn_projection p = {.type = type, .width = width, .height = height};
    if (type == GN_PROJECTION_CUBE)
        p.height = 6 * width;
    if (type == GN_PROJECTION_FISHEYE_KANNALA_BRANDT)
        memcpy(p.k, (double[4]){0.05, -0.02, 0.004, -0.0005}, sizeof(p.k));
    const char *reason = NULL;
    if (gn_projection_init(&p, &reason))
        fail_msg("%s: %s", gn_projection_get_name(type), reason);
    return p;
}

static void assert_direction(const struct gn_projection *p, double x, double y, double dx,
                             double dy, double dz)
{
    double d[3], xy[2];
    assert_true(gn_projection_get_direction(p, x, y, d));
    double error = hypot(hypot(d[0] - dx, d[1] - dy), d[2] - dz);
    if (!(error < 1e-12))
        fail_msg("%s at %g, %g looks along %g %g %g, not %g %g %g", gn_projection_get_name(p->type),
                 x, y, d[0], d[1], d[2], dx, dy, dz);
    assert_true(gn_projection_get_position(p, d, xy));
    assert_true(hypot(xy[0] - x, xy[1] - y) < 1e-6);
}

/* Fisheyes and angular maps: x right, y down, z in the middle. */
static void test_radial_axes(void **state)
{
    (void)state;
    for (int t = GN_PROJECTION_ANGULAR; t < GN_PROJECTION_COUNT; t++) {
        if (t == GN_PROJECTION_MIRRORBALL || !gn_projection_is_radial((enum gn_projection_type)t))
            continue;
        struct gn_projection p = make((enum gn_projection_type)t, 300, 200);
        double side = t == GN_PROJECTION_ANGULAR ? 50 : 100; // px where theta is pi/2
        assert_direction(&p, 150, 100, 0, 0, 1);
        assert_direction(&p, 150 + side, 100, 1, 0, 0);
        assert_direction(&p, 150 - side, 100, -1, 0, 0);
        assert_direction(&p, 150, 100 + side, 0, 1, 0);
        assert_direction(&p, 150, 100 - side, 0, -1, 0);
    }
}

/* Mirror ball: x right, y up; the middle reflects +z, r = R sin(45 deg) the equator. */
static void test_mirrorball_axes(void **state)
{
    (void)state;
    struct gn_projection p = make(GN_PROJECTION_MIRRORBALL, 200, 200);
    double side = 100 * sqrt(0.5), d[3];
    assert_direction(&p, 100, 100, 0, 0, 1);
    assert_direction(&p, 100 + side, 100, 1, 0, 0);
    assert_direction(&p, 100, 100 - side, 0, 1, 0);
    assert_direction(&p, 100, 100 + side, 0, -1, 0);
    assert_true(gn_projection_get_direction(&p, 100, 200, d));
    assert_true(d[2] < -1 + 1e-12); // the rim shows -z
    /* The law of reflection: n is halfway between the direction to the camera, +z, and d. */
    double u = 0.3, v = -0.6, n[3] = {u, v, sqrt(1 - u * u - v * v)};
    assert_direction(&p, 100 + 100 * u, 100 - 100 * v, 2 * n[2] * n[0], 2 * n[2] * n[1],
                     2 * n[2] * n[2] - 1);
}

static void test_latlong_axes(void **state)
{
    (void)state;
    struct gn_projection p = make(GN_PROJECTION_LATLONG, 400, 200);
    double d[3], xy[2];
    assert_direction(&p, 200, 100, 1, 0, 0);
    assert_direction(&p, 300, 100, 0, -1, 0);
    assert_direction(&p, 100, 100, 0, 1, 0);
    assert_direction(&p, 0, 100, -1, 0, 0);
    assert_true(gn_projection_get_direction(&p, 17, 0, d));
    assert_true(d[2] == 1);
    assert_true(gn_projection_get_direction(&p, 17, 200, d));
    assert_true(d[2] == -1);
    /* phi = -pi and phi = pi are one direction, one position, inside the picture. */
    assert_true(gn_projection_get_position(&p, (double[3]){-1, -0.0, 0}, xy));
    assert_true(xy[0] == 0);
}

/* What OpenEXR's ImfEnvmap.h draws, its y turned up to our z, its z to our x: the middle of each
 * face, what lies right of it and above. */
static void test_cube_axes(void **state)
{
    (void)state;
    static const double middle[6][3] = {{0, 1, 0},  {0, -1, 0}, {0, 0, 1},
                                        {0, 0, -1}, {1, 0, 0},  {-1, 0, 0}};
    static const double right[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0},
                                       {0, 1, 0}, {0, -1, 0}, {0, 1, 0}};
    static const double up[6][3] = {{0, 0, 1},  {0, 0, 1}, {1, 0, 0},
                                    {-1, 0, 0}, {0, 0, 1}, {0, 0, 1}};
    struct gn_projection p = make(GN_PROJECTION_CUBE, 100, 0);
    for (int f = 0; f < 6; f++) {
        const double *m = middle[f], *r = right[f], *u = up[f];
        double y = 100 * f + 50, s = 0.6, l = sqrt(1 + s * s);
        assert_direction(&p, 50, y, m[0], m[1], m[2]);
        assert_direction(&p, 80, y, (m[0] + s * r[0]) / l, (m[1] + s * r[1]) / l,
                         (m[2] + s * r[2]) / l);
        assert_direction(&p, 50, y - 30, (m[0] + s * u[0]) / l, (m[1] + s * u[1]) / l,
                         (m[2] + s * u[2]) / l);
    }
}

/* The middle, the sides, a corner, the equator's diamond; every quadrant the mirror of the next. */
static void test_octahedral_axes(void **state)
{
    (void)state;
    struct gn_projection p = make(GN_PROJECTION_OCTAHEDRAL, 200, 200);
    double d[3], e[3], h = sqrt(0.5);
    assert_direction(&p, 100, 100, 0, 0, 1);
    assert_direction(&p, 200, 100, 1, 0, 0);
    assert_direction(&p, 0, 100, -1, 0, 0);
    assert_direction(&p, 100, 200, 0, 1, 0);
    assert_direction(&p, 100, 0, 0, -1, 0);
    assert_direction(&p, 150, 150, h, h, 0);
    assert_true(gn_projection_get_direction(&p, 200, 0, d));
    assert_true(d[2] == -1);
    for (int i = 0; i < 100; i++) { // the halves of each side show the same directions
        assert_true(gn_projection_get_direction(&p, 0, i, d));
        assert_true(gn_projection_get_direction(&p, 0, 200 - i, e));
        assert_true(hypot(hypot(d[0] - e[0], d[1] - e[1]), d[2] - e[2]) < 1e-12);
    }
    /* Near the poles the position keeps its digits, where 1 - z has none left. */
    double xy[2], tiny = 1e-12;
    assert_true(gn_projection_get_position(&p, (double[3]){tiny, 0, 1}, xy));
    assert_true(fabs((xy[0] - 100) / 100 - tiny * h) < 1e-15);
}

/* A step leads to the pixel that is beside it on the sphere. */
static void test_steps(void **state)
{
    (void)state;
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        struct gn_projection p = make((enum gn_projection_type)t, 64, 64);
        int n_refused = 0;
        for (int i = 0; i < p.width * p.height * 9; i++) {
            int home[2] = {i / 9 % p.width, i / 9 / p.width}, at[2] = {home[0], home[1]};
            double d[3], e[3];
            if (!gn_projection_step(&p, i % 3 - 1, i / 3 % 3 - 1, at)) {
                n_refused++;
                assert_true(at[0] == home[0] && at[1] == home[1]);
                continue;
            }
            assert_true(at[0] >= 0 && at[0] < p.width && at[1] >= 0 && at[1] < p.height);
            if (i % 9 % 2 == 1) // straight; a diagonal over a border's vertex may come back
                assert_true(at[0] != home[0] || at[1] != home[1]);
            if (!gn_projection_get_direction(&p, home[0] + 0.5, home[1] + 0.5, d) ||
                !gn_projection_get_direction(&p, at[0] + 0.5, at[1] + 0.5, e))
                continue;
            double apart = hypot(hypot(d[0] - e[0], d[1] - e[1]), d[2] - e[2]);
            if (!(apart < (t == GN_PROJECTION_MIRRORBALL ? 0.6 : 0.26))) // the widest, at a rim
                fail_msg("%s: %d %d and %d %d are %g apart", gn_projection_get_name(p.type),
                         home[0], home[1], at[0], at[1], apart);
        }
        int n_edge = 4 * 3 * 64 - 4; // steps over the border of a square, its corners' once
        assert_int_equal(n_refused, t == GN_PROJECTION_LATLONG      ? 0
                                    : t == GN_PROJECTION_OCTAHEDRAL ? 0
                                    : t == GN_PROJECTION_CUBE       ? 6 * 4 // its faces' corners
                                                                    : n_edge);
    }
}

/* Long steps over a border go on as they began: each ends beside where the shorter one does. */
static void test_long_steps(void **state)
{
    (void)state;
    static const enum gn_projection_type types[] = {GN_PROJECTION_LATLONG, GN_PROJECTION_CUBE,
                                                    GN_PROJECTION_OCTAHEDRAL};
    for (size_t t = 0; t < GN_ARRAY_LEN(types); t++) {
        struct gn_projection p = make(types[t], 64, 64);
        for (int i = 0; i < p.width * p.height * 4; i++) {
            int home[2] = {i / 4 % p.width, i / 4 / p.width}, last[2] = {home[0], home[1]};
            int dx = i % 4 == 0   ? 1
                     : i % 4 == 1 ? -1
                                  : 0,
                dy = i % 4 == 2   ? 1
                     : i % 4 == 3 ? -1
                                  : 0;
            for (int n = 1; n <= 4; n++) {
                int at[2] = {home[0], home[1]};
                double d[3], e[3];
                assert_true(gn_projection_step(&p, n * dx, n * dy, at));
                assert_true(gn_projection_get_direction(&p, last[0] + 0.5, last[1] + 0.5, d));
                assert_true(gn_projection_get_direction(&p, at[0] + 0.5, at[1] + 0.5, e));
                double apart = hypot(hypot(d[0] - e[0], d[1] - e[1]), d[2] - e[2]);
                if (!(apart > 0 && apart < 0.1))
                    fail_msg("%s: %d steps of %d %d from %d %d: %g apart",
                             gn_projection_get_name(p.type), n, dx, dy, home[0], home[1], apart);
                bool is_back = at[0] == home[0] && at[1] == home[1];
                assert_false(is_back);
                memcpy(last, at, sizeof(last));
            }
        }
    }
}

/* Every model's radius at 60 degrees, from its formula. */
static void test_radius_of_models(void **state)
{
    (void)state;
    static const struct {
        enum gn_projection_type type;
        double r; // px, where the radius at theta_max is 100
    } cases[] = {
        {GN_PROJECTION_ANGULAR, 33.333333333333333},
        {GN_PROJECTION_MIRRORBALL, 50},
        {GN_PROJECTION_FISHEYE_EQUIDISTANT, 66.666666666666667},
        {GN_PROJECTION_FISHEYE_EQUISOLID, 70.710678118654752},
        {GN_PROJECTION_FISHEYE_ORTHOGRAPHIC, 86.602540378443865},
        {GN_PROJECTION_FISHEYE_STEREOGRAPHIC, 57.735026918962576},
    };
    double d[3] = {sin(pi / 3), 0, cos(pi / 3)}, xy[2];
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_projection p = make(cases[i].type, 200, 200);
        assert_true(gn_projection_get_position(&p, d, xy));
        assert_true(fabs(xy[0] - 100 - cases[i].r) < 1e-9);
    }
    struct gn_projection p = {.type = GN_PROJECTION_FISHEYE_KANNALA_BRANDT,
                              .width = 200,
                              .height = 200,
                              .focal = 50,
                              .k = {0.05, -0.02, 0.004, -0.0005}};
    assert_int_equal(gn_projection_init(&p, NULL), 0);
    double t = pi / 3, r = 50 * (t + 0.05 * pow(t, 3) - 0.02 * pow(t, 5) + 0.004 * pow(t, 7) -
                                 0.0005 * pow(t, 9));
    assert_true(gn_projection_get_position(&p, d, xy));
    assert_true(fabs(xy[0] - 100 - r) < 1e-9);
}

/* Direction to position to direction within 1e-6 rad inside 0.999 R; both ways at random. */
static void test_round_trip(void **state)
{
    (void)state;
    uint64_t seed = 1;
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        struct gn_projection p = make((enum gn_projection_type)t, 512, 256);
        for (int i = 0; i < 20000; i++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            double x = (double)(seed >> 40) / (1 << 24) * 512;
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            double y = (double)(seed >> 40) / (1 << 24) * p.height, d[3], e[3], xy[2];
            if (gn_projection_is_radial(p.type) && hypot(x - 256, y - 128) >= 0.999 * p.radius)
                continue;
            assert_true(gn_projection_get_direction(&p, x, y, d));
            assert_true(fabs(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - 1) < 1e-12);
            assert_true(gn_projection_get_position(&p, d, xy));
            assert_true(gn_projection_get_direction(&p, xy[0], xy[1], e));
            assert_true(hypot(hypot(d[0] - e[0], d[1] - e[1]), d[2] - e[2]) < 1e-6);
        }
    }
}

static void test_outside(void **state)
{
    (void)state;
    double d[3] = {7, 7, 7}, xy[2] = {7, 7};
    struct gn_projection p = make(GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200);
    assert_false(gn_projection_get_direction(&p, 1, 1, d)); // a corner
    assert_false(gn_projection_get_direction(&p, NAN, 100, d));
    assert_false(gn_projection_get_direction(&p, 100, -0.1, d));
    assert_false(gn_projection_get_position(&p, (double[3]){0, 0, -1}, xy));
    assert_false(gn_projection_get_position(&p, (double[3]){NAN, 0, 1}, xy));
    assert_true(d[0] == 7 && xy[0] == 7);
    assert_true(gn_projection_get_solid_angle(&p, 0, 0) == 0);
    assert_false(gn_projection_is_full_sphere(&p));
    struct gn_projection angular = make(GN_PROJECTION_ANGULAR, 300, 200);
    assert_true(gn_projection_is_full_sphere(&angular));
    assert_true(gn_projection_get_position(&angular, (double[3]){0, 0, -1}, xy));
    assert_true(fabs(xy[0] - 250) < 1e-9 && fabs(xy[1] - 100) < 1e-9);
    angular = (struct gn_projection){
        .type = GN_PROJECTION_ANGULAR, .width = 300, .height = 200, .center = {50, 100}};
    assert_int_equal(gn_projection_init(&angular, NULL), 0);
    assert_false(gn_projection_is_full_sphere(&angular)); // cut at the left
}

static void test_refusals(void **state)
{
    (void)state;
    enum gn_projection_type fisheye = GN_PROJECTION_FISHEYE_EQUIDISTANT;
    enum gn_projection_type kb = GN_PROJECTION_FISHEYE_KANNALA_BRANDT;
    const struct {
        struct gn_projection p;
        const char *word; // of the reason
    } cases[] = {
        {{.type = GN_PROJECTION_COUNT, .width = 8, .height = 8}, "unknown"},
        {{.type = fisheye, .width = 0, .height = 8}, "sides"},
        {{.type = fisheye, .width = 16384, .height = 16384}, "pixels"},
        {{.type = fisheye, .width = 8, .height = 8, .theta_max = 3.2}, "theta_max"},
        {{.type = fisheye, .width = 8, .height = 8, .theta_max = NAN}, "theta_max"},
        {{.type = fisheye, .width = 8, .height = 8, .radius = -1}, "radius"},
        {{.type = fisheye, .width = 8, .height = 8, .radius = NAN}, "radius"},
        {{.type = fisheye, .width = 8, .height = 8, .radius = 1e9}, "radius"},
        {{.type = fisheye, .width = 8, .height = 8, .radius = 4, .focal = 4}, "contradict"},
        {{.type = fisheye, .width = 8, .height = 8, .center = {-9, 4}}, "outside"},
        {{.type = fisheye, .width = 8, .height = 8, .center = {NAN, 4}}, "outside"},
        {{.type = GN_PROJECTION_FISHEYE_ORTHOGRAPHIC, .width = 8, .height = 8, .theta_max = 1.6},
         "orthographic"},
        {{.type = GN_PROJECTION_FISHEYE_STEREOGRAPHIC,
          .width = 8,
          .height = 8,
          .theta_max = 3.1415},
         "stereographic"},
        {{.type = GN_PROJECTION_CUBE, .width = 8, .height = 8}, "six"},
        {{.type = kb, .width = 8, .height = 8, .k = {-0.2}}, "rise"},
        {{.type = kb, .width = 8, .height = 8, .k = {0, 0, 0, INFINITY}}, "rise"},
        /* Falls only in the middle: slope 1 - 3 s + 2.2 s^2 < 0 around s = 0.68. */
        {{.type = kb, .width = 8, .height = 8, .k = {-1, 0.44}}, "rise"},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_projection p = cases[i].p;
        const char *reason = "";
        assert_int_equal(gn_projection_init(&p, &reason), -EINVAL);
        if (!strstr(reason, cases[i].word))
            fail_msg("case %zu: \"%s\" does not say \"%s\"", i, reason, cases[i].word);
        assert_memory_equal(&p, &cases[i].p, sizeof(p));
    }
    /* Slope 1 - 3 s + 2.3 s^2 stays above 0.02: accepted. Twice is as once. */
    struct gn_projection p = {.type = kb, .width = 8, .height = 8, .k = {-1, 0.46}};
    assert_int_equal(gn_projection_init(&p, NULL), 0);
    struct gn_projection q = p;
    assert_int_equal(gn_projection_init(&q, NULL), 0);
    assert_memory_equal(&p, &q, sizeof(p));
}

static void test_names(void **state)
{
    (void)state;
    for (int t = 0; t < GN_PROJECTION_COUNT; t++) {
        enum gn_projection_type type = GN_PROJECTION_COUNT;
        const char *name = gn_projection_get_name((enum gn_projection_type)t);
        assert_int_equal(gn_projection_from_name(name, &type), 0);
        assert_int_equal(type, t);
    }
    enum gn_projection_type type;
    assert_int_equal(gn_projection_from_name("fisheye", &type), -EINVAL);
    assert_null(gn_projection_get_name(GN_PROJECTION_COUNT));
}

/* A direction on the edge of two faces is on the edge of its own square, not the next one's. */
static void test_cube_edges(void **state)
{
    (void)state;
    for (int side = 1; side <= 1024; side = 3 * side + 1) {
        struct gn_projection p = {
            .type = GN_PROJECTION_CUBE, .width = side, .height = 6 * side, .theta_max = 0};
        assert_int_equal(gn_projection_init(&p, NULL), 0);
        for (int i = 0; i < 27; i++) {
            double dir[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1}, at[2], middle[3], dot = 0;
            double length = sqrt(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2]);
            if (!(length > 0))
                continue;
            assert_true(gn_projection_get_position(&p, dir, at));
            int x = (int)fmin(at[0], p.width - 1), y = (int)fmin(at[1], p.height - 1);
            assert_true(gn_projection_get_direction(&p, x + 0.5, y + 0.5, middle));
            for (int c = 0; c < 3; c++)
                dot += dir[c] / length * middle[c];
            if (!(dot > cos(1.5 / side))) // a little over half of a texel's diagonal
                fail_msg("side %d: (%g, %g, %g) is in texel %d %d", side, dir[0], dir[1], dir[2], x,
                         y);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_radial_axes),
        cmocka_unit_test(test_mirrorball_axes),
        cmocka_unit_test(test_latlong_axes),
        cmocka_unit_test(test_cube_axes),
        cmocka_unit_test(test_octahedral_axes),
        cmocka_unit_test(test_cube_edges),
        cmocka_unit_test(test_steps),
        cmocka_unit_test(test_long_steps),
        cmocka_unit_test(test_radius_of_models),
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_outside),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
