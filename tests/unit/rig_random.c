/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The rig's random numbers: the published answers, and nets that are nets. */
#include "tests/unit/cmocka_setup.h"

#include <string.h>

#include "proto/attr.h"
#include "tests/rig/random.h"

/* Known answers of Philox4x32-10 from the authors' Random123 (kat_vectors). */
static void test_philox(void **state)
{
    static const uint32_t cases[][10] = {
        {0, 0, 0, 0, 0, 0, 0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8},
        {0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0x408f276d,
         0x41c83b0e, 0xa20bc7c6, 0x6d5451fd},
        {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344, 0xa4093822, 0x299f31d0, 0xd16cfe09,
         0x94fdcceb, 0x5001e420, 0x24126ea1},
    };
    (void)state;
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        uint32_t out[4];
        gn_rig_philox(cases[i], cases[i] + 4, out);
        assert_memory_equal(out, cases[i] + 6, sizeof(out));
    }
}

/* The first 2^m points: one in each box of 2^-j by 2^(j-m), for every j. */
static void test_nets(void **state)
{
    (void)state;
    for (uint32_t set = 0; set < 20; set++) {
        uint32_t seeds[4];
        gn_rig_philox((const uint32_t[4]){set}, (const uint32_t[2]){7, 7}, seeds);
        for (int m = 0; m <= 8; m++)
            for (int j = 0; j <= m; j++) {
                unsigned char hits[256] = {0};
                for (uint32_t i = 0; i < 1u << m; i++) {
                    double p[2];
                    gn_rig_get_sobol2(i, seeds, p);
                    assert_true(p[0] >= 0 && p[0] < 1 && p[1] >= 0 && p[1] < 1);
                    int x = (int)(p[0] * (1 << j)), y = (int)(p[1] * (1 << (m - j)));
                    assert_int_equal(hits[(x << (m - j)) + y]++, 0);
                }
            }
    }
}

/* Two scramblings of the same points have nothing to do with each other. */
static void test_independence(void **state)
{
    double sum = 0;
    const int n = 256;
    (void)state;
    for (int i = 0; i < n; i++) {
        double a[2], b[2];
        gn_rig_get_sobol2((uint32_t)i, (const uint32_t[3]){1, 2, 3}, a);
        gn_rig_get_sobol2((uint32_t)i, (const uint32_t[3]){4, 5, 6}, b);
        sum += (a[0] - 0.5) * (b[0] - 0.5) * 12 / n;
    }
    assert_true(sum > -0.2 && sum < 0.2); // 3 standard deviations of unrelated numbers
}

static void test_normal(void **state)
{
    double sum = 0, squares = 0;
    const int n = 20000;
    (void)state;
    for (uint32_t i = 0; i < (uint32_t)n; i++) {
        uint32_t w[4];
        gn_rig_philox((const uint32_t[4]){i}, (const uint32_t[2]){1, 2}, w);
        double v = gn_rig_get_normal(w[0], w[1]);
        sum += v / n;
        squares += v * v / n;
    }
    assert_true(sum > -0.03 && sum < 0.03); // 4 standard deviations
    assert_true(squares > 0.96 && squares < 1.04);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_philox),
        cmocka_unit_test(test_nets),
        cmocka_unit_test(test_independence),
        cmocka_unit_test(test_normal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
