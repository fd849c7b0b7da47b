/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Half floats: every one of the 65536, and every rounding boundary between two of them. */
#include "common/half.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

/* The value from the definition: (-1)^s 2^(e - 25) (1024 + m), denormals 2^-24 m. */
static double define(unsigned half)
{
    int exponent = half >> 10 & 31, mantissa = half & 1023;
    double value = exponent ? ldexp(1024 + mantissa, exponent - 25) : ldexp(mantissa, -24);
    if (exponent == 31)
        value = mantissa ? NAN : INFINITY;
    return half & 0x8000 ? -value : value;
}

static void test_every_half(void **state)
{
    (void)state;
    for (unsigned h = 0; h < 65536; h++) {
        float value = gn_half_to_float((uint16_t)h);
        double expected = define(h);
        if (isnan(expected)) {
            assert_true(isnan(value));
            assert_true(isnan(gn_half_to_float(gn_half_from_float(value))));
            continue;
        }
        assert_true((double)value == expected && !signbit(value) == !(h & 0x8000));
        assert_int_equal(gn_half_from_float(value), h);
    }
}

/* The middle of two neighbours goes to the even one, a float more or less to the nearer. */
static void test_every_boundary(void **state)
{
    (void)state;
    for (unsigned h = 0; h < 0x7c00; h++) {
        double next = h == 0x7bff ? 65536 : define(h + 1); // infinity rounds as 65536 would
        float middle = (float)(0.5 * (define(h) + next));
        assert_int_equal(gn_half_from_float(middle), h & 1 ? h + 1 : h);
        assert_int_equal(gn_half_from_float(nextafterf(middle, 0)), h);
        assert_int_equal(gn_half_from_float(nextafterf(middle, INFINITY)), h + 1);
        assert_int_equal(gn_half_from_float(-middle), 0x8000 | (h & 1 ? h + 1 : h));
    }
    assert_int_equal(gn_half_from_float(1e9f), 0x7c00);
    assert_int_equal(gn_half_from_float(-INFINITY), 0xfc00);
    assert_int_equal(gn_half_from_float(1e-40f), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_half),
        cmocka_unit_test(test_every_boundary),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
