/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Spherical harmonics against published coefficients, closed forms and full sums. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/light/irradiance.h"
#include "server/light/sh.h"
#include "tests/light_fixture.h"

/* C17 does not add the const to an array of arrays by itself. */
#define CONST_SH(sh) ((const double(*)[3])(sh))

static const double pi = 3.14159265358979323846;

/* Ramamoorthi and Hanrahan's lights, order 00 1-1 10 11 2-2 2-1 20 21 22. */
static const double grace[9][3] = {
    {.78908, .43710, .54161},    {.39499, .34989, .60488},    {-.33974, -.18236, -.26940},
    {-.29213, -.05562, .00944},  {-.11141, -.05090, -.12231}, {-.26240, -.22401, -.47479},
    {-.15570, -.09471, -.14733}, {.56014, .21444, .13915},    {.21205, -.05432, -.30374}};
static const double eucalyptus[9][3] = {
    {.3783264, .4260425, .4504587},    {.2887813, .3586803, .4147053},
    {.0379030, .0295216, .0098567},    {-.1033028, -.1031690, -.0884924},
    {-.0621750, -.0554432, -.0396779}, {.0077820, -.0148312, -.0471301},
    {-.0935561, -.1254260, -.1525629}, {-.0572703, -.0502192, -.0363410},
    {.0203348, -.0044201, -.0452180}};
static const double st_peter[9][3] = {
    {.3623915, .2624130, .2326261},    {.1759131, .1436266, .1260569},
    {-.0247311, -.0101254, -.0010745}, {.0346500, .0223184, .0101350},
    {.0198140, .0144073, .0043987},    {-.0469596, -.0254485, -.0117786},
    {-.0898667, -.0760911, -.0740964}, {.0050194, .0038841, .0001374},
    {-.0818750, -.0321501, .0033399}};

/* The basis, written out apart from the code under test. */
static void get_basis(const double d[static 3], double out[static 9])
{
    double x = d[0], y = d[1], z = d[2];
    out[0] = 0.5 * sqrt(1 / pi);
    out[1] = sqrt(3 / (4 * pi)) * y;
    out[2] = sqrt(3 / (4 * pi)) * z;
    out[3] = sqrt(3 / (4 * pi)) * x;
    out[4] = 0.5 * sqrt(15 / pi) * x * y;
    out[5] = 0.5 * sqrt(15 / pi) * y * z;
    out[6] = 0.25 * sqrt(5 / pi) * (3 * z * z - 1);
    out[7] = 0.5 * sqrt(15 / pi) * x * z;
    out[8] = 0.25 * sqrt(15 / pi) * (x * x - y * y);
}

static void get_sphere_point(int i, int n, double out[static 3])
{
    double z = 1 - 2 * (i + 0.5) / n, phi = i * pi * (3 - sqrt(5)), s = sqrt(1 - z * z);
    out[0] = s * cos(phi);
    out[1] = s * sin(phi);
    out[2] = z;
}

static struct gn_radiance_map *make_map(struct light_fixture *f)
{
    struct gn_radiance_map *map = NULL;
    struct gn_error error = {0};
    if (gn_radiance_map_create(&f->frame, NULL, NULL, &map, &error) < 0)
        fail_msg("%s", error.text);
    return map;
}

static void irradiance_is_band_factor_times_basis(void **unused)
{
    (void)unused;
    const double a[9] = {pi,        2 * pi / 3, 2 * pi / 3, 2 * pi / 3, 0.25 * pi,
                         0.25 * pi, 0.25 * pi,  0.25 * pi,  0.25 * pi};
    for (int i = 0; i < 50; i++) {
        double n[3], basis[9], e[3];
        get_sphere_point(i, 50, n);
        get_basis(n, basis);
        for (int k = 0; k < 9; k++) {
            double sh[GN_SH_MAX][3] = {{0}};
            sh[k][1] = 1;
            gn_sh_get_irradiance(2, CONST_SH(sh), n, e);
            assert_near(e[1], a[k] * basis[k], 1e-12);
            assert_true(e[0] == 0 && e[2] == 0);
        }
    }
}

static void published_constants_come_out(void **unused)
{
    (void)unused;
    double sh[GN_SH_MAX][3] = {{0}}, e[3];
    sh[8][0] = 1; // c1 at +x; a known bug has c3 here
    sh[3][1] = 1; // 2 c2 at +x
    sh[0][2] = 1; // c4
    gn_sh_get_irradiance(2, CONST_SH(sh), (double[3]){1, 0, 0}, e);
    assert_near(e[0], 0.429043, 5e-7);
    assert_near(e[1], 2 * 0.511664, 2e-6); // published rounded up: 0.5116634
    assert_near(e[2], 0.886227, 5e-7);
    memset(sh, 0, sizeof(sh));
    sh[6][0] = 1; // c3 - c5 at +z, -c5 at +x
    gn_sh_get_irradiance(2, CONST_SH(sh), (double[3]){0, 0, 1}, e);
    assert_near(e[0], 0.743125 - 0.247708, 3e-6);
    gn_sh_get_irradiance(2, CONST_SH(sh), (double[3]){1, 0, 0}, e);
    assert_near(e[0], -0.247708, 5e-7);
}

static void published_lights_evaluate(void **unused)
{
    (void)unused;
    static const struct {
        const double (*sh)[3];
        double normal[3], irradiance[3];
    } cases[] = {
        {grace, {0, 1, 0}, {1.051098, .792188, 1.265792}},
        {grace, {0, -1, 0}, {.242689, .076084, .027811}},
        {grace, {0, 0, 1}, {.274502, .153835, .131315}},
        {grace, {1, 0, 0}, {.529906, .330607, .395827}},
        {eucalyptus, {0, 1, 0}, {.645251, .777583, .880780}},
        {eucalyptus, {0, -1, 0}, {.054215, .043488, .032021}},
        {st_peter, {0, 1, 0}, {.558567, .412177, .352078}},
        {st_peter, {0, -1, 0}, {.198533, .118223, .094083}},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        double e[3];
        gn_sh_get_irradiance(2, cases[i].sh, cases[i].normal, e);
        for (int c = 0; c < 3; c++)
            assert_near(e[c], cases[i].irradiance[c], 1e-6);
    }
    double min = 1, mean = 0;
    enum { N = 20000 };
    for (int i = 0; i < N; i++) { // real light that rings below zero
        double n[3], e[3];
        get_sphere_point(i, N, n);
        gn_sh_get_irradiance(2, grace, n, e);
        min = fmin(min, e[2]);
        mean += e[2] / N;
    }
    assert_near(min, -0.0096, 5e-5);
    assert_near(mean, pi * 0.282095 * grace[0][2], 1e-5);
}

/* A map with negative light cannot come from a frame: its pixels are written over. */
static void check_projects_back(enum gn_projection_type type, int width, int height,
                                const double sh[][3])
{
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, type, width, height), 0);
    light_fixture_fill(&f, light_fixture_constant);
    struct gn_radiance_map *map = make_map(&f);
    for (int i = 0; i < width * height; i++) {
        const float *d = map->direction_world + 3 * i;
        double basis[9];
        get_basis((double[3]){(double)d[0], (double)d[1], (double)d[2]}, basis);
        for (int c = 0; c < 3; c++) {
            double l = 0;
            for (int k = 0; k < 9; k++)
                l += sh[k][c] * basis[k];
            map->radiance.data[3 * i + c] = (float)l;
        }
    }
    double out[GN_SH_MAX][3];
    assert_int_equal(gn_sh_project_map(map, 2, NULL, out), 0);
    for (int k = 0; k < 9; k++)
        for (int c = 0; c < 3; c++)
            assert_near(out[k][c], sh[k][c], 1e-4);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void synthesised_maps_project_back(void **unused)
{
    (void)unused;
    check_projects_back(GN_PROJECTION_ANGULAR, 400, 400, grace);
    check_projects_back(GN_PROJECTION_ANGULAR, 400, 400, eucalyptus);
    check_projects_back(GN_PROJECTION_MIRRORBALL, 400, 400, st_peter);
    check_projects_back(GN_PROJECTION_LATLONG, 256, 128, grace);
    check_projects_back(GN_PROJECTION_LATLONG, 256, 128, st_peter);
}

static void constant_map_is_pi(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
        double tolerance;
    } cases[] = {{GN_PROJECTION_LATLONG, 64, 32, 1e-6},
                 {GN_PROJECTION_LATLONG, 1, 1, 1e-6},
                 {GN_PROJECTION_LATLONG, 7, 3, 1e-6},
                 {GN_PROJECTION_ANGULAR, 500, 500, 5e-5},
                 {GN_PROJECTION_MIRRORBALL, 500, 500, 5e-5}};
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, cases[i].type, cases[i].width, cases[i].height), 0);
        light_fixture_fill(&f, light_fixture_constant);
        struct gn_radiance_map *map = make_map(&f);
        double sh[GN_SH_MAX][3], e[3];
        assert_int_equal(gn_sh_project_map(map, 2, NULL, sh), 0);
        for (int k = 1; k < 9; k++)
            assert_near(sh[k][0], 0, cases[i].tolerance);
        gn_sh_get_irradiance(2, CONST_SH(sh), (double[3]){0.6, 0, 0.8}, e);
        assert_near(e[0], pi, 5 * cases[i].tolerance);
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
}

static void linear_light(const double dir[static 3], float out[static 3])
{
    out[0] = (float)fmax(0, dir[2]);
    out[1] = (float)(1 + dir[0]);
    out[2] = (float)(1 - dir[1] * dir[2]);
}

static void analytic_maps_have_their_coefficients(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, linear_light);
    struct gn_radiance_map *map = make_map(&f);
    double sh[GN_SH_MAX][3];
    assert_int_equal(gn_sh_project_map(map, 2, NULL, sh), 0);
    /* max(0, z): A_l / 2pi times the zonal basis at +z, the clamped cosine itself */
    assert_near(sh[0][0], sqrt(pi) / 2, 1e-4);
    assert_near(sh[2][0], sqrt(pi / 3), 1e-4);
    assert_near(sh[6][0], sqrt(5 * pi) / 8, 1e-4);
    assert_near(sh[3][1], sqrt(4 * pi / 3), 1e-4);
    assert_near(sh[5][2], -2 * sqrt(pi / 15), 1e-4);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void delta_light_errs_as_known(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 2048, 1024), 0);
    f.frame.codes = &f.image;
    double w = gn_projection_get_solid_angle(&f.frame.projection, 700, 400), l[3];
    gn_image_at(&f.image, 700, 400)[1] = (float)(1 / w);
    assert_true(gn_projection_get_direction(&f.frame.projection, 700.5, 400.5, l));
    struct gn_radiance_map *map = make_map(&f);
    double sh[GN_SH_MAX][3], worst = 0, mean = 0, low = 1, high = 0;
    assert_int_equal(gn_sh_project_map(map, 2, NULL, sh), 0);
    enum { N = 40000 };
    for (int i = 0; i < N; i++) {
        double n[3], e[3];
        get_sphere_point(i, N, n);
        gn_sh_get_irradiance(2, CONST_SH(sh), n, e);
        double error = fabs(e[1] - fmax(0, n[0] * l[0] + n[1] * l[1] + n[2] * l[2]));
        worst = fmax(worst, error);
        mean += error / N;
        low = fmin(low, e[1]);
        high = fmax(high, e[1]);
    }
    assert_near(worst, 0.09375, 2e-4);
    assert_near(mean, 0.0307, 2e-4);
    assert_near(low, -0.0396, 2e-4);
    assert_near(high, 1.0625, 2e-4);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void broad_light(const double dir[static 3], float out[static 3])
{
    out[0] = (float)exp(1.2 * dir[2] + 0.3 * dir[0]);
    out[1] = (float)(1.5 + sin(2 * dir[0]) * cos(dir[1]));
    out[2] = (float)(1 + pow(fmax(0, dir[1]), 4));
}

static void broad_light_is_within_one_and_a_half_percent(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 128, 64), 0);
    light_fixture_fill(&f, broad_light);
    struct gn_radiance_map *map = make_map(&f);
    double sh[GN_SH_MAX][3], squares[3] = {0}, total[3] = {0};
    assert_int_equal(gn_sh_project_map(map, 2, NULL, sh), 0);
    for (int i = 0; i < 200; i++) {
        double n[3], e[3], exact[3] = {0};
        get_sphere_point(i, 200, n);
        for (int t = 0; t < 128 * 64; t++) {
            const float *d = map->direction_world + 3 * t;
            double dot = n[0] * (double)d[0] + n[1] * (double)d[1] + n[2] * (double)d[2];
            for (int c = 0; c < 3; c++)
                exact[c] += fmax(dot, 0) * (double)map->solid_angle[t] *
                            (double)map->radiance.data[3 * t + c];
        }
        gn_sh_get_irradiance(2, CONST_SH(sh), n, e);
        for (int c = 0; c < 3; c++) {
            squares[c] += (e[c] - exact[c]) * (e[c] - exact[c]);
            total[c] += exact[c] * exact[c];
        }
    }
    for (int c = 0; c < 3; c++)
        assert_true(sqrt(squares[c] / total[c]) <= 0.015);
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

static void turning_the_probe_turns_the_light(void **unused)
{
    (void)unused;
    static const enum gn_projection_type types[2] = {GN_PROJECTION_LATLONG, GN_PROJECTION_ANGULAR};
    struct gn_pose turn = {.rotation = {0.5, -0.5, 0.1, 0.7}};
    assert_int_equal(gn_pose_normalize(&turn), 0);
    for (int t = 0; t < 2; t++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, types[t], t ? 200 : 256, t ? 200 : 128), 0);
        light_fixture_fill(&f, broad_light);
        struct gn_radiance_map *still = make_map(&f);
        memcpy(f.frame.world_from_probe, turn.rotation, sizeof(turn.rotation));
        struct gn_radiance_map *turned = make_map(&f);
        double sh[GN_SH_MAX][3], sh_turned[GN_SH_MAX][3];
        assert_int_equal(gn_sh_project_map(still, 2, NULL, sh), 0);
        assert_int_equal(gn_sh_project_map(turned, 2, NULL, sh_turned), 0);
        for (int i = 0; i < 50; i++) {
            double n[3], n_world[3], e[3], e_turned[3];
            get_sphere_point(i, 50, n);
            gn_pose_rotate(&turn, n, n_world);
            gn_sh_get_irradiance(2, CONST_SH(sh), n, e);
            gn_sh_get_irradiance(2, CONST_SH(sh_turned), n_world, e_turned);
            for (int c = 0; c < 3; c++)
                assert_near(e[c], e_turned[c], 1e-5);
        }
        gn_radiance_map_unref(&still);
        gn_radiance_map_unref(&turned);
        light_fixture_finish(&f);
    }
}

/* The basis by the associated Legendre recurrences, apart from the polynomials under test. */
static double get_harmonic(int l, int m, const double d[static 3])
{
    int k = m < 0 ? -m : m;
    double s = sqrt(fmax(0, 1 - d[2] * d[2])), p = 1, before = 0, norm = (2 * l + 1) / (4 * pi);
    for (int i = 1; i <= k; i++)
        p *= (2 * i - 1) * s;
    for (int i = k + 1; i <= l; i++) {
        double next = ((2 * i - 1) * d[2] * p - (i + k - 1) * before) / (i - k);
        before = p;
        p = next;
    }
    for (int i = l - k + 1; i <= l + k; i++)
        norm /= i;
    double phi = atan2(d[1], d[0]);
    double wave = m == 0 ? 1 : sqrt(2) * (m > 0 ? cos(k * phi) : sin(k * phi));
    return sqrt(norm) * p * wave;
}

static void basis_is_legendre_times_waves(void **unused)
{
    (void)unused;
    for (int i = 0; i < 200; i++) {
        double d[3], basis[GN_SH_MAX];
        get_sphere_point(i, 200, d);
        gn_sh_get_basis(4, d, basis);
        for (int l = 0; l <= 4; l++)
            for (int m = -l; m <= l; m++)
                assert_near(basis[l * (l + 1) + m], get_harmonic(l, m, d), 1e-13);
    }
}

static void cosine_factors_are_the_integrals(void **unused)
{
    (void)unused;
    enum { N = 20000 };
    for (int l = 0; l <= 4; l++) { // 2 pi times the integral of z P_l(z) over [0, 1]
        double sum = 0;
        for (int i = 0; i < N; i++) {
            double z = (i + 0.5) / N, d[3] = {sqrt(1 - z * z), 0, z};
            sum += z * get_harmonic(l, 0, d) * sqrt(4 * pi / (2 * l + 1)) / N;
        }
        assert_near(gn_sh_get_cosine_factor(l), 2 * pi * sum, 1e-8);
    }
}

/* L_lm of a disc of even radiance about +z, of unit irradiance at normal incidence; radius 0: of a
 * point. In closed form: the mean of P_l over the disc is (P_l-1(c) - P_l+1(c)) / ((2 l + 1) (1 -
 * c)). */
static void make_disc(double radius, double sh[GN_SH_MAX][3])
{
    double legendre[6] = {1, cos(radius)};
    for (int l = 2; l < 6; l++)
        legendre[l] = ((2 * l - 1) * legendre[1] * legendre[l - 1] - (l - 1) * legendre[l - 2]) / l;
    memset(sh, 0, GN_SH_MAX * sizeof(*sh));
    for (int l = 0; l <= 4; l++) {
        double mean = 1;
        if (radius > 0 && l > 0)
            mean = (legendre[l - 1] - legendre[l + 1]) / ((2 * l + 1) * (1 - legendre[1]));
        for (int c = 0; c < 3; c++)
            sh[l * (l + 1)][c] = sqrt((2 * l + 1) / (4 * pi)) * mean;
    }
}

/* The irradiance of that disc with the normal at angle theta, by rings of it. */
static double get_disc_irradiance(double radius, double theta)
{
    enum { N = 400 };
    double sum = 0;
    if (radius == 0)
        return fmax(0, cos(theta));
    for (int i = 0; i < N; i++) { // rings of equal solid angle, each in closed form
        double z = 1 - (1 - cos(radius)) * (i + 0.5) / N, a = z * cos(theta);
        double b = sqrt(1 - z * z) * sin(theta), half = b > 0 ? acos(fmax(-1, fmin(1, -a / b))) : 0;
        if (a >= b)
            half = pi;
        else if (a <= -b)
            half = 0;
        sum += (a * half + b * sin(half)) / pi / N;
    }
    return sum;
}

struct errors {
    double worst, mean, low, high;
};

static struct errors judge_disc(int order, double radius)
{
    enum { N = 2000 };
    double sh[GN_SH_MAX][3];
    struct errors out = {.low = 1};
    make_disc(radius, sh);
    for (int i = 0; i <= N; i++) {
        double theta = pi * i / N, n[3] = {sin(theta), 0, cos(theta)}, e[3];
        gn_sh_get_irradiance(order, CONST_SH(sh), n, e);
        double error = fabs(e[0] - get_disc_irradiance(radius, theta));
        out.worst = fmax(out.worst, error);
        out.mean += 0.5 * sin(theta) * error * pi / N;
        out.low = fmin(out.low, e[0]);
        out.high = fmax(out.high, e[0]);
    }
    return out;
}

static void points_and_discs_err_as_known(void **unused)
{
    (void)unused;
    struct errors two = judge_disc(2, 0), four = judge_disc(4, 0);
    assert_near(two.worst, 0.09375, 1e-5);
    assert_near(two.mean, 0.0307, 1e-4);
    assert_near(two.low, -0.0396, 1e-4);
    assert_near(two.high, 1.0625, 1e-5);
    assert_near(four.worst, 0.0586, 1e-4);
    assert_near(four.mean, 0.0148, 1e-4);
    assert_near(four.low, -0.031, 5e-4);
    assert_near(four.high, 0.969, 5e-4);
    static const struct {
        double radius_deg, worst;
    } discs[] = {{0.5, 0.092}, {8, 0.067}, {16, 0.055}, {32, 0.036}, {64, 0.015}};
    for (size_t i = 0; i < sizeof(discs) / sizeof(discs[0]); i++) { // of order 2, over the peak
        double radius = discs[i].radius_deg * pi / 180;
        double peak = 0.5 * (1 + cos(radius));
        struct errors e = judge_disc(2, radius);
        print_message("# disc %4.1f deg: order 2 off by %.4f of its peak, order 4 by %.4f\n",
                      discs[i].radius_deg, e.worst / peak, judge_disc(4, radius).worst / peak);
        assert_near(e.worst / peak, discs[i].worst, 1.5e-3);
    }
}

static double get_low(const struct gn_irradiance *irradiance)
{
    double low = INFINITY;
    enum { N = 50000 };
    for (int i = 0; i < N; i++) {
        double n[3], basis[GN_SH_MAX], y = 0;
        get_sphere_point(i, N, n);
        gn_sh_get_basis(irradiance->order, n, basis);
        for (int k = 0; k < gn_sh_get_count(irradiance->order); k++)
            y += basis[k] * (0.2126 * irradiance->sh[k][0] + 0.7152 * irradiance->sh[k][1] +
                             0.0722 * irradiance->sh[k][2]);
        low = fmin(low, y);
    }
    return low;
}

static void dering_is_the_smallest_window(void **unused)
{
    (void)unused;
    double sh[GN_SH_MAX][3] = {{0}};
    struct gn_irradiance irradiance;
    const double dir[3] = {0.36, 0.48, 0.8}, light[3] = {1, 1, 1};
    for (int order = 2; order <= 4; order += 2) {
        memset(sh, 0, sizeof(sh));
        gn_sh_add_light(order, dir, light, sh);
        gn_irradiance_init(&irradiance, order, CONST_SH(sh), NULL, 0, false);
        assert_true(irradiance.lambda == 0);
        assert_near(irradiance.min_luminance, order == 2 ? -0.0396 : -0.031, 5e-4);
        gn_irradiance_init(&irradiance, order, CONST_SH(sh), NULL, 0, true);
        if (order == 2) { // w_1 = 0.584, w_2 = 0.135
            assert_near(irradiance.lambda, 0.178, 1e-3);
            assert_near(1 / (1 + 4 * irradiance.lambda), 0.584, 1e-3);
            assert_near(1 / (1 + 36 * irradiance.lambda), 0.135, 1e-3);
        }
        double low = get_low(&irradiance), e[3];
        print_message("# order %d: lambda %.4f, lowest %.2g\n", order, irradiance.lambda, low);
        assert_true(low >= -1e-6 && low < 1e-3);
        gn_irradiance_get(&irradiance, dir, e);
        if (order == 2)
            assert_near(e[1], 0.58, 0.05);
    }
    /* Real light: its luminance decides, all channels get one window. */
    gn_irradiance_init(&irradiance, 2, grace, NULL, 0, true);
    assert_true(irradiance.min_luminance > 0 && irradiance.lambda == 0);
    double blue[GN_SH_MAX][3];
    memset(blue, 0, sizeof(blue));
    for (int k = 0; k < 9; k++)
        for (int c = 0; c < 3; c++)
            blue[k][c] = grace[k][2];
    gn_irradiance_init(&irradiance, 2, CONST_SH(blue), NULL, 0, true);
    assert_near(irradiance.min_luminance, -0.0096, 5e-5);
    assert_true(irradiance.lambda > 0 && get_low(&irradiance) >= -1e-6);
    memset(blue, 0, sizeof(blue));
    gn_irradiance_init(&irradiance, 4, CONST_SH(blue), NULL, 0, true); // black
    assert_true(irradiance.lambda == 0 && irradiance.min_luminance == 0);
}

static void lights_taken_out_are_exact(void **unused)
{
    (void)unused;
    const struct gn_irradiance_light sun = {{0.6, 0, 0.8}, {50, 40, 30}};
    for (int order = 2; order <= 4; order += 2) {
        double sh[GN_SH_MAX][3] = {{0}}, mean = 0;
        const double up[3] = {0, 0, 1}, sky[3] = {0.1, 0.2, 0.3};
        for (int c = 0; c < 3; c++) // a sky of radiance 1, and a little from above
            sh[0][c] = sqrt(4 * pi);
        gn_sh_add_light(order, sun.dir_world, sun.irradiance, sh);
        struct gn_irradiance irradiance;
        gn_irradiance_init(&irradiance, order, CONST_SH(sh), &sun, 1, false);
        enum { N = 20000 };
        for (int i = 0; i < N; i++) {
            double n[3], e[3];
            get_sphere_point(i, N, n);
            gn_irradiance_get(&irradiance, n, e);
            double cosine = fmax(0, n[0] * sun.dir_world[0] + n[2] * sun.dir_world[2]);
            for (int c = 0; c < 3; c++)
                assert_near(e[c], pi + cosine * sun.irradiance[c], 1e-12 * 50);
            mean += e[0] / N;
        }
        assert_near(mean, sqrt(pi) / 2 * sh[0][0], 1e-5 * mean); // no energy comes or goes
        /* A light that the harmonics do not hold changes no band up to the order. */
        gn_sh_add_light(order, up, sky, sh);
        gn_irradiance_init(&irradiance, order, CONST_SH(sh), &sun, 1, false);
        assert_near(irradiance.sh[0][1], pi * (sqrt(4 * pi) + 0.2 * 0.5 / sqrt(pi)), 1e-12);
    }
}

static void lights_follow_the_frames(void **unused)
{
    (void)unused;
    const struct gn_irradiance_light lamp = {{0, 0, 1}, {8, 8, 8}};
    double dark[GN_SH_MAX][3] = {{0}}, lit[GN_SH_MAX][3] = {{0}}, now[GN_SH_MAX][3];
    for (int c = 0; c < 3; c++)
        dark[0][c] = lit[0][c] = sqrt(4 * pi);
    gn_sh_add_light(4, lamp.dir_world, lamp.irradiance, lit);
    struct gn_irradiance before, after;
    gn_irradiance_init(&before, 4, CONST_SH(lit), &lamp, 1, false);
    gn_irradiance_init(&after, 4, CONST_SH(dark), NULL, 0, false);
    for (int k = 0; k < GN_SH_MAX; k++)
        for (int c = 0; c < 3; c++)
            now[k][c] = 0.75 * lit[k][c] + 0.25 * dark[k][c];
    gn_irradiance_follow(&after, &before, 0.25, CONST_SH(now), false); // it fades
    assert_int_equal(after.n_lights, 1);
    for (int i = 0; i < 50; i++) {
        double n[3], e[3];
        get_sphere_point(i, 50, n);
        gn_irradiance_get(&after, n, e);
        assert_near(e[0], pi + 6 * fmax(0, n[2]), 1e-12);
    }
}

/* Sums over the texels, written apart: the same formula in double, and no blocks. */
static void check_rounding(struct light_fixture *f)
{
    struct gn_radiance_map *map = make_map(f);
    double sum[GN_SH_MAX][3] = {{0}}, sh[GN_SH_MAX][3];
    int width = map->radiance.width, height = map->radiance.height;
    memset(map->fill, 0, sizeof(map->fill));
    for (int t = 0; t < width * height; t++) {
        double d[3] = {(double)map->direction_world[3 * t], (double)map->direction_world[3 * t + 1],
                       (double)map->direction_world[3 * t + 2]};
        double w = (double)map->solid_angle[t];
        for (int l = 0; l <= 4; l++)
            for (int m = -l; m <= l; m++)
                for (int c = 0; c < 3; c++)
                    sum[l * (l + 1) + m][c] += get_harmonic(l, m, d) * w *
                                               (1 - w * l * (l + 1) / 24) *
                                               (double)map->radiance.data[3 * t + c];
    }
    assert_int_equal(gn_sh_project_map(map, 4, NULL, sh), 0);
    double worst = 0;
    for (int k = 0; k < GN_SH_MAX; k++)
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, fabs(sh[k][c] - sum[k][c]) / sum[0][c]);
    print_message("# %s %dx%d: off by %.2g of L00\n", gn_projection_get_name(map->projection.type),
                  width, height, worst);
    assert_true(worst < 1e-6);
    gn_radiance_map_unref(&map);
}

static void floats_round_away_less_than_a_millionth(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
    } cases[] = {{GN_PROJECTION_ANGULAR, 301, 301},
                 {GN_PROJECTION_MIRRORBALL, 128, 128},
                 {GN_PROJECTION_CUBE, 100, 600},
                 {GN_PROJECTION_FISHEYE_EQUIDISTANT, 203, 203}};
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, cases[i].type, cases[i].width, cases[i].height), 0);
        light_fixture_fill(&f, light_fixture_room);
        check_rounding(&f);
        gn_image_at(&f.image, cases[i].width / 3, cases[i].height / 3)[1] = 1e9f; // a sun
        check_rounding(&f);
        light_fixture_finish(&f);
    }
}

/* Texels are exact boxes: cutting each in four changes nothing but the way they are summed. */
static void folded_rows_equal_plain_ones(void **unused)
{
    (void)unused;
    double sh[2][GN_SH_MAX][3];
    for (int i = 0; i < 2; i++) {
        int parts = i == 0 ? 1 : 4; // 36 columns are summed one by one, 144 four at a time
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 36 * parts, 18), 0);
        for (int y = 0; y < 18; y++)
            for (int x = 0; x < 36 * parts; x++)
                for (int c = 0; c < 3; c++)
                    gn_image_at(&f.image, x, y)[c] = (float)((x / parts * 7 + y * 5 + c * 3) % 11);
        for (int x = 0; x < parts; x++) // a sun
            gn_image_at(&f.image, 20 * parts + x, 7)[1] = 1e9f;
        f.frame.codes = &f.image;
        struct gn_radiance_map *map = make_map(&f);
        assert_int_equal(gn_sh_project_map(map, 4, NULL, sh[i]), 0);
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
    for (int k = 0; k < GN_SH_MAX; k++)
        for (int c = 0; c < 3; c++)
            assert_near(sh[0][k][c], sh[1][k][c], 5e-7 * sh[0][0][c]);
}

static void irradiance_map_holds_clamped_irradiance(void **unused)
{
    (void)unused;
    struct gn_irradiance irradiance;
    struct gn_image map;
    int n_clamped = 0;
    gn_irradiance_init(&irradiance, 2, grace, NULL, 0, false);
    assert_int_equal(gn_irradiance_make_map(&irradiance, 64, 32, &map), 0);
    for (int y = 0; y < 32; y++) {
        for (int x = 0; x < 64; x++) {
            double theta = pi * (y + 0.5) / 32, phi = pi - 2 * pi * (x + 0.5) / 64, e[3];
            double n[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            gn_sh_get_irradiance(2, grace, n, e);
            n_clamped += e[2] < 0;
            for (int c = 0; c < 3; c++)
                assert_near(gn_image_at(&map, x, y)[c], fmax(e[c], 0), 1e-6);
        }
    }
    assert_true(n_clamped > 0);
    gn_image_finish(&map);
    assert_true(gn_irradiance_make_map(&irradiance, 0, 32, &map) < 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(irradiance_is_band_factor_times_basis),
        cmocka_unit_test(published_constants_come_out),
        cmocka_unit_test(published_lights_evaluate),
        cmocka_unit_test(synthesised_maps_project_back),
        cmocka_unit_test(constant_map_is_pi),
        cmocka_unit_test(analytic_maps_have_their_coefficients),
        cmocka_unit_test(delta_light_errs_as_known),
        cmocka_unit_test(broad_light_is_within_one_and_a_half_percent),
        cmocka_unit_test(turning_the_probe_turns_the_light),
        cmocka_unit_test(basis_is_legendre_times_waves),
        cmocka_unit_test(cosine_factors_are_the_integrals),
        cmocka_unit_test(points_and_discs_err_as_known),
        cmocka_unit_test(dering_is_the_smallest_window),
        cmocka_unit_test(lights_taken_out_are_exact),
        cmocka_unit_test(lights_follow_the_frames),
        cmocka_unit_test(folded_rows_equal_plain_ones),
        cmocka_unit_test(floats_round_away_less_than_a_millionth),
        cmocka_unit_test(irradiance_map_holds_clamped_irradiance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
