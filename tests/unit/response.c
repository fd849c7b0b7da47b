/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Camera responses: known values, round trips, what is refused. */
#include "common/response.h"

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "proto/attr.h"

static const float table[5] = {0, 0.1f, 0.1f, 0.5f, 2};

/* One of each type; log: 12 bit over six decades, dark current 1e-4. */
static const struct gn_response responses[GN_RESPONSE_COUNT] = {
    {.type = GN_RESPONSE_LINEAR},
    {.type = GN_RESPONSE_SRGB},
    {.type = GN_RESPONSE_GAMMA, .gamma = 2.2},
    {.type = GN_RESPONSE_LOG, .log_a = 0.7, .log_b = 0.07, .log_c = 1e-4},
    {.type = GN_RESPONSE_TABLE, .table = table, .table_size = 5},
};

/* Half the light on sRGB code 188 is code 137, not 94. */
static void test_half_of_188(void **state)
{
    (void)state;
    const struct gn_response *srgb = &responses[GN_RESPONSE_SRGB];
    float half = 0.5f * gn_response_decode(srgb, 188 / 255.0f);
    assert_int_equal(lroundf(255 * gn_response_encode(srgb, half)), 137);
}

static void test_known_values(void **state)
{
    (void)state;
    const struct gn_response *srgb = &responses[GN_RESPONSE_SRGB];
    assert_true(fabsf(gn_response_decode(srgb, 10 / 255.0f) - 0.00303527f) < 1e-8f); // linear part
    assert_true(fabsf(gn_response_decode(srgb, 0.5f) - 0.21404114f) < 1e-7f);
    const struct gn_response *log_sensor = &responses[GN_RESPONSE_LOG];
    double x = exp((0.9 - 0.7) / 0.07) - 1e-4;
    assert_true(fabs((double)gn_response_decode(log_sensor, 0.9f) - x) < 1e-5 * x);
    assert_true(gn_response_decode(log_sensor, 0.01f) == 0); // below the dark current
    const struct gn_response *t = &responses[GN_RESPONSE_TABLE];
    assert_true(fabsf(gn_response_decode(t, 0.875f) - 1.25f) < 1e-6f);
    assert_true(fabsf(gn_response_encode(t, 1.25f) - 0.875f) < 1e-6f);
    assert_true(fabsf(gn_response_encode(t, 0.1f) - 0.25f) < 1e-6f); // lowest code of the flat part
    assert_true(gn_response_decode(t, 7) == 2);
}

/* All 4096 codes come back, except where several codes mean the same light. */
static void test_round_trip(void **state)
{
    (void)state;
    for (int t = 0; t < GN_RESPONSE_COUNT; t++) {
        float before = -1;
        for (int i = 0; i < 4096; i++) {
            float code = (float)i / 4095, linear = gn_response_decode(&responses[t], code);
            assert_true(linear >= before);
            bool is_flat = linear == 0 || (t == GN_RESPONSE_TABLE && code > 0.25f && code < 0.501f);
            before = linear;
            if (!is_flat)
                assert_int_equal(lroundf(4095 * gn_response_encode(&responses[t], linear)), i);
        }
    }
}

static void test_extremes(void **state)
{
    (void)state;
    for (int t = 0; t < GN_RESPONSE_COUNT; t++) {
        assert_true(gn_response_decode(&responses[t], NAN) == 0);
        assert_true(gn_response_decode(&responses[t], -1) == 0);
        float top = gn_response_encode(&responses[t], INFINITY);
        float bottom = gn_response_encode(&responses[t], NAN);
        assert_true(top == 1 && bottom >= 0 && bottom < 0.1f);
    }
}

static void test_matrix_and_scale(void **state)
{
    (void)state;
    struct gn_response r = {.type = GN_RESPONSE_SRGB,
                            .to_rec709 = {1.5, -0.4, -0.1, -0.2, 1.3, -0.1, 0, -0.3, 1.3},
                            .scale = 20};
    assert_int_equal(gn_response_check(&r, NULL), 0);
    float rgb[6] = {1, 1, 1, 0, 1, 0}, codes[3] = {0.7f, 0.6f, 0.5f};
    gn_response_to_radiance(&r, rgb, 2);
    assert_true(fabsf(rgb[0] - 20) < 1e-4f && fabsf(rgb[1] - 20) < 1e-4f);
    assert_true(rgb[3] == 0 && fabsf(rgb[4] - 26) < 1e-4f && rgb[5] == 0); // negatives clamped
    gn_response_to_radiance(&r, codes, 1);
    gn_response_from_radiance(&r, codes, 1);
    assert_true(fabsf(codes[0] - 0.7f) < 1e-6f && fabsf(codes[1] - 0.6f) < 1e-6f &&
                fabsf(codes[2] - 0.5f) < 1e-6f);
}

static void test_refusals(void **state)
{
    (void)state;
    static const float falling[3] = {0, 2, 1}, flat[2] = {1, 1}, bad[2] = {0, NAN};
    const struct {
        struct gn_response r;
        const char *word;
    } cases[] = {
        {{.type = GN_RESPONSE_COUNT}, "unknown"},
        {{.type = GN_RESPONSE_GAMMA}, "gamma"},
        {{.type = GN_RESPONSE_GAMMA, .gamma = NAN}, "gamma"},
        {{.type = GN_RESPONSE_LOG}, "log"},
        {{.type = GN_RESPONSE_LOG, .log_a = -INFINITY, .log_b = 1}, "log"},
        {{.type = GN_RESPONSE_LOG, .log_b = 1e-3}, "log"},
        {{.type = GN_RESPONSE_TABLE}, "table"},
        {{.type = GN_RESPONSE_TABLE, .table = falling, .table_size = 3}, "fall"},
        {{.type = GN_RESPONSE_TABLE, .table = flat, .table_size = 2}, "rise"},
        {{.type = GN_RESPONSE_TABLE, .table = bad, .table_size = 2}, "finite"},
        {{.scale = -1}, "scale"},
        {{.scale = INFINITY}, "scale"},
        {{.scale = 1.1e30}, "scale"},
        {{.to_rec709 = {1, 0, 0, 0, 1.1e30, 0, 0, 0, 1}}, "matrix times its scale"},
        {{.to_rec709 = {1e15, 0, 0, 0, 1, 0, 0, 0, 1}, .scale = 1e16}, "matrix times its scale"},
        {{.to_rec709 = {1, 1, 1, 1, 1, 1, 0, 0, 1}}, "matrix"},
        {{.to_rec709 = {1, 0, 0, 0, NAN, 0, 0, 0, 1}}, "matrix"},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        const char *reason = "";
        assert_int_equal(gn_response_check(&cases[i].r, &reason), -EINVAL);
        if (!strstr(reason, cases[i].word))
            fail_msg("case %zu: \"%s\" does not say \"%s\"", i, reason, cases[i].word);
    }
    for (int t = 0; t < GN_RESPONSE_COUNT; t++) {
        enum gn_response_type type = GN_RESPONSE_COUNT;
        assert_int_equal(gn_response_check(&responses[t], NULL), 0);
        assert_int_equal(
            gn_response_from_name(gn_response_get_name((enum gn_response_type)t), &type), 0);
        assert_int_equal(type, t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_half_of_188),      cmocka_unit_test(test_known_values),
        cmocka_unit_test(test_round_trip),       cmocka_unit_test(test_extremes),
        cmocka_unit_test(test_matrix_and_scale), cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
