/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pictures sent as half floats: a sun does not become infinite, and what fits stays to the bit. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "client/capture/halves.h"
#include "common/half.h"
#include "proto/attr.h"

static float unpack(const uint8_t *halves, size_t i, double scale)
{
    return (float)((double)gn_half_to_float((uint16_t)(halves[2 * i] | halves[2 * i + 1] << 8)) *
                   scale);
}

/* The relative error is at most half of 2^-10 down to 2^-14 of the scale. */
static void trap_1_a_sun_of_1e9_as_half(void **unused)
{
    (void)unused;
    static const float suns[] = {1.0f, 65504.0f, 65505.0f, 65520.0f, 1e6f, 1e9f, 1e30f, 3.4e38f};
    for (size_t k = 0; k < GN_ARRAY_LEN(suns); k++) {
        float values[200];
        uint8_t halves[400];
        for (int i = 0; i < 200; i++) // seven decades below the sun
            values[i] = suns[k] * (float)pow(10, -7.0 * i / 199);
        double scale = gn_halves_pack(values, 200, halves);
        int exponent;
        assert_true(frexp(scale, &exponent) == 0.5); // a power of two
        assert_true(scale >= 1 && (double)suns[k] / scale <= 65504);
        assert_true(scale == 1 || (double)suns[k] / scale > 32752);
        for (size_t i = 0; i < 200; i++) {
            double error = fabs((double)unpack(halves, i, scale) - (double)values[i]);
            assert_true(error <= fmax(0x1p-11 * (double)values[i], 0x1p-25 * scale));
        }
    }
}

static void what_fits_stays_to_the_bit(void **unused)
{
    (void)unused;
    static float values[65536];
    static uint8_t halves[2 * 65536];
    for (int i = 0; i < 65536; i++)
        values[i] = gn_half_to_float((uint16_t)i);
    assert_true(gn_halves_are_exact(values, 65536)); // infinities and NaN among them
    assert_true(gn_halves_pack(values, 65536, halves) == 1);
    for (size_t i = 0; i < 65536; i++) {
        float back = unpack(halves, i, 1);
        assert_true(back == values[i] || (isnan(back) && isnan(values[i])));
    }
    values[40000] = 0.1f;
    assert_false(gn_halves_are_exact(values, 65536));
    values[40000] = 65536.0f;
    assert_false(gn_halves_are_exact(values, 65536));
    values[40000] = 1e-10f;
    assert_false(gn_halves_are_exact(values, 65536));
}

/* What cannot be light is the reader's to mend: it must arrive as what it is. */
static void trap_2_nan_and_infinity_pass(void **unused)
{
    (void)unused;
    const float values[5] = {1e9f, NAN, INFINITY, -INFINITY, -5};
    uint8_t halves[10];
    double scale = gn_halves_pack(values, 5, halves);
    assert_true(isnan(unpack(halves, 1, scale)));
    assert_true(unpack(halves, 2, scale) == INFINITY && unpack(halves, 3, scale) == -INFINITY);
    assert_true(unpack(halves, 4, scale) < 0);
    assert_true(fabs((double)unpack(halves, 0, scale) / 1e9 - 1) < 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trap_1_a_sun_of_1e9_as_half),
        cmocka_unit_test(what_fits_stays_to_the_bit),
        cmocka_unit_test(trap_2_nan_and_infinity_pass),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
