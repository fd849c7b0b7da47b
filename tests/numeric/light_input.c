/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a badly measured camera makes of codes: responses and matrices next to singular, light of
 * denormal size. */
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "proto/attr.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"
#include "tests/unit/cmocka_setup.h"

static const double pi = 3.14159265358979323846;

static struct gn_radiance_map *make_map(const struct light_fixture *f)
{
    struct gn_radiance_map *map = NULL;
    struct gn_error error = {0};
    if (gn_radiance_map_create(&f->frame, NULL, NULL, &map, &error) < 0)
        fail_msg("%s", error.text);
    return map;
}

/* Lights of every method: sound, and they add up to the map within 1e-5 of it or, where floats have
 * no more digits, half a denormal for each texel. */
static void check_all_methods(const struct light_fixture *f)
{
    const double n_texels = (double)f->image.width * f->image.height;
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        const struct gn_light_options options = {.method = (enum gn_light_method)m};
        struct gn_lighting_state *s = NULL;
        struct gn_error error = {0};
        if (gn_lighting_state_create(&f->frame, NULL, &options, NULL, &s, &error) < 0)
            fail_msg("%s", error.text);
        for (int c = 0; c < 3; c++) {
            double sum = 0, total = s->total_irradiance[c];
            assert_true(total >= 0 && isfinite(total));
            for (int i = 0; i < s->n_lights; i++) {
                assert_true(s->lights[i].irradiance[c] >= 0);
                sum += (double)s->lights[i].irradiance[c];
            }
            double slack = 1e-5 * total + n_texels * 0.5 * (double)FLT_TRUE_MIN;
            if (m != GN_LIGHT_PARTITION_SEED && !(fabs(sum - total) <= slack))
                fail_msg("%s: lights %g, map %g", gn_light_method_get_name(options.method), sum,
                         total);
            for (int k = 0; k < 9; k++)
                assert_true(isfinite(s->sh[k][c]));
        }
        gn_lighting_state_unref(&s);
    }
}

/* The fixture's room as codes in [0, 1]. */
static void make_codes(struct light_fixture *f, const struct gn_response *response)
{
    assert_int_equal(light_fixture_init(f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 80, 80), 0);
    light_fixture_fill(f, light_fixture_room);
    for (int i = 0; i < 3 * 80 * 80; i++)
        f->image.data[i] = fminf(f->image.data[i] / 90, 1);
    f->frame.response = *response;
}

/* Singular values 1, 1e-3, 1e-6, between two rotations. */
static void make_ill_conditioned(double out_m[static 9])
{
    static const double u[3][3] = {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}};
    static const double v[3][3] = {
        {2 / 3.0, -1 / 3.0, 2 / 3.0}, {2 / 3.0, 2 / 3.0, -1 / 3.0}, {-1 / 3.0, 2 / 3.0, 2 / 3.0}};
    static const double s[3] = {1, 1e-3, 1e-6};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out_m[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                out_m[3 * i + j] += u[i][k] * s[k] * v[j][k];
        }
    }
}

static void an_ill_conditioned_matrix_gives_light(void **unused)
{
    (void)unused;
    struct gn_response r = {.scale = 3};
    const char *reason = "";
    make_ill_conditioned(r.to_rec709);
    if (gn_response_check(&r, &reason) < 0)
        fail_msg("%s", reason);
    double worst = 0;
    for (int i = 0; i < 1000; i++) {
        float codes[3] = {(float)(i % 10) / 9, (float)(i / 10 % 10) / 9, (float)(i / 100) / 9};
        float rgb[3] = {codes[0], codes[1], codes[2]}, back[3];
        gn_response_to_radiance(&r, rgb, 1);
        bool is_clamped = false;
        for (int c = 0; c < 3; c++) {
            assert_true(rgb[c] >= 0 && rgb[c] <= 9);
            is_clamped = is_clamped || rgb[c] == 0;
            back[c] = rgb[c];
        }
        gn_response_from_radiance(&r, back, 1);
        for (int c = 0; c < 3; c++) {
            assert_true(back[c] >= 0 && back[c] <= 1);
            if (!is_clamped)
                worst = fmax(worst, fabs((double)back[c] - (double)codes[c]));
        }
    }
    print_message("# a matrix of condition 1e6: codes come back within %.2g\n", worst);
    assert_true(worst < 1e6 * (double)FLT_EPSILON);
    struct light_fixture f;
    make_codes(&f, &r);
    check_all_methods(&f);
    light_fixture_finish(&f);
}

static void a_badly_fitted_response_gives_light(void **unused)
{
    (void)unused;
    static const float step[5] = {0, 0, 0, 0, 1}, flat[5] = {0, 1, 1, 1, 1},
                       huge[3] = {0, 1e-30f, 1e30f}, bright[2] = {1, 1.0000001f};
    const struct gn_response responses[] = {
        {.type = GN_RESPONSE_LOG, .log_a = 0.9, .log_b = 0.0115, .log_c = 1e-12}, // 38 decades
        {.type = GN_RESPONSE_LOG, .log_a = 0.5, .log_b = 0.05, .log_c = 1e9}, // nothing but dark
        {.type = GN_RESPONSE_LOG, .log_a = -1e3, .log_b = 1e3, .log_c = 2},
        {.type = GN_RESPONSE_LOG, .log_a = 0, .log_b = 1e9, .log_c = 0},
        {.type = GN_RESPONSE_GAMMA, .gamma = 10},
        {.type = GN_RESPONSE_GAMMA, .gamma = 0.1},
        {.type = GN_RESPONSE_TABLE, .table = step, .table_size = 5},
        {.type = GN_RESPONSE_TABLE, .table = flat, .table_size = 5},
        {.type = GN_RESPONSE_TABLE, .table = huge, .table_size = 3},
        {.type = GN_RESPONSE_TABLE, .table = bright, .table_size = 2},
        {.type = GN_RESPONSE_LINEAR, .scale = 1e30},
    };
    for (size_t k = 0; k < GN_ARRAY_LEN(responses); k++) {
        const struct gn_response *r = &responses[k];
        const char *reason = "";
        if (gn_response_check(r, &reason) < 0)
            fail_msg("response %zu: %s", k, reason);
        float last = 0;
        for (int i = 0; i <= 4095; i++) {
            float x = gn_response_decode(r, (float)i / 4095);
            float code = gn_response_encode(r, x);
            assert_true(isfinite(x) && x >= last && code >= 0 && code <= 1);
            last = x;
        }
        struct light_fixture f;
        make_codes(&f, r);
        check_all_methods(&f);
        f.frame.code_max = 4095; // by the table of codes
        check_all_methods(&f);
        light_fixture_finish(&f);
    }
}

static void trap_23_denormal_light_is_light(void **unused)
{
    (void)unused;
    static const float levels[] = {1e-37f, 1e-40f, 1e-44f};
    for (size_t k = 0; k < GN_ARRAY_LEN(levels); k++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 64, 32), 0);
        for (int i = 0; i < 3 * 64 * 32; i++)
            f.image.data[i] = levels[k];
        f.frame.codes = &f.image;
        struct gn_radiance_map *map = make_map(&f);
        double sum = map->figures.shown_irradiance[1];
        print_message("# radiance %g everywhere: irradiance off by %.1e\n", (double)levels[k],
                      sum / (4 * pi * (double)levels[k]) - 1);
        assert_near(sum, 4 * pi * (double)levels[k], 1e-6 * sum);
        assert_int_equal(map->figures.n_negative + map->figures.n_nan, 0);
        gn_radiance_map_unref(&map);
        check_all_methods(&f);
        light_fixture_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_ill_conditioned_matrix_gives_light),
        cmocka_unit_test(a_badly_fitted_response_gives_light),
        cmocka_unit_test(trap_23_denormal_light_is_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
