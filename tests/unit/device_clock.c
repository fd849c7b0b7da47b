/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A camera's clock mapped onto ours: jitter goes, drift is followed, nonsense is not believed. */
#include "client/capture/device_clock.h"
#include "common/clock.h"
#include "tests/unit/cmocka_setup.h"

#define FRAME_NS (33 * GN_NS_PER_MS)
#define LEAST_DELAY_NS (2 * GN_NS_PER_MS)

/** Delays of up to 10 ms, of which every tenth is the least; another zero; 100 ppm off. */
static void check_drift(double ppm)
{
    struct gn_device_clock clock = {0};
    uint32_t seed = 1;
    for (int i = 0; i < 2000; i++) {
        int64_t true_ns = 500 * GN_NS_PER_S + i * FRAME_NS;
        seed = seed * 1664525u + 1013904223u;
        int64_t delay_ns = LEAST_DELAY_NS + (i % 10 ? (int64_t)(seed >> 8) % 10000000 : 0);
        uint64_t device_ns = (uint64_t)(1e9 + (double)(i * FRAME_NS) * (1 + ppm * 1e-6));
        int64_t got_ns = gn_device_clock_map(&clock, device_ns, true_ns + delay_ns);
        assert_true(got_ns <= true_ns + delay_ns);
        // Within 4 s two clocks drift 0.4 ms apart.
        int64_t wrong_ns = got_ns - (true_ns + LEAST_DELAY_NS);
        assert_true(wrong_ns > -400 * GN_NS_PER_US && wrong_ns < 400 * GN_NS_PER_US);
    }
}

static void test_jitter_and_drift(void **state)
{
    (void)state;
    check_drift(0);
    check_drift(100);
    check_drift(-100);
}

static void test_nonsense(void **state)
{
    (void)state;
    struct gn_device_clock clock = {0};
    int64_t now_ns = 100 * GN_NS_PER_S;
    assert_true(gn_device_clock_map(&clock, 0, now_ns - 2) == now_ns - 2);
    assert_true(gn_device_clock_map(&clock, UINT64_MAX, now_ns - 1) == now_ns - 1);
    assert_true(gn_device_clock_map(&clock, 5 * GN_NS_PER_S, now_ns) == now_ns);
    // 10 ms later by the camera, 14 ms by the arrival.
    int64_t later_ns = now_ns + 14 * GN_NS_PER_MS;
    assert_true(gn_device_clock_map(&clock, 5 * GN_NS_PER_S + 10 * GN_NS_PER_MS, later_ns) ==
                now_ns + 10 * GN_NS_PER_MS);
    // Standing still, backwards, a jump: the arrival, and from then on the new clock.
    assert_true(gn_device_clock_map(&clock, 5 * GN_NS_PER_S + 10 * GN_NS_PER_MS, later_ns + 1) ==
                later_ns + 1);
    assert_true(gn_device_clock_map(&clock, 1, later_ns + 2) == later_ns + 2);
    assert_true(gn_device_clock_map(&clock, 9 * GN_NS_PER_S, later_ns + 3) == later_ns + 3);
    assert_true(gn_device_clock_map(&clock, 9 * GN_NS_PER_S + 5, later_ns + 9) == later_ns + 8);
    // Its clock stood still for two seconds: the arrival too.
    later_ns += 2 * GN_NS_PER_S;
    assert_true(gn_device_clock_map(&clock, 9 * GN_NS_PER_S + 9, later_ns) == later_ns);
    // Arrivals that do not go on, as where the wall clock is set: time does.
    assert_true(gn_device_clock_map(&clock, 0, later_ns) == later_ns + 1);
    assert_true(gn_device_clock_map(&clock, 0, later_ns - GN_NS_PER_MS) == later_ns + 2);
    later_ns += 10;
    for (uint64_t device_ns = 1; device_ns; device_ns = device_ns * 3) { // wraps in the end
        int64_t got_ns = gn_device_clock_map(&clock, device_ns, ++later_ns);
        assert_true(got_ns <= later_ns && got_ns >= later_ns - GN_NS_PER_S);
        if (device_ns > UINT64_MAX / 4)
            break;
    }
}

/** The first picture came 100 ms late, the next ones at once: time goes on, and then is right. */
static void test_late_first(void **state)
{
    (void)state;
    struct gn_device_clock clock = {0};
    int64_t begin_ns = 100 * GN_NS_PER_S, last_ns = 0;
    for (int i = 0; i < 8; i++) {
        int64_t true_ns = begin_ns + i * FRAME_NS;
        int64_t arrival_ns = true_ns + (i == 0  ? 100 * GN_NS_PER_MS
                                        : i < 4 ? (101 + i) * GN_NS_PER_MS - i * FRAME_NS
                                                : 0);
        int64_t got_ns = gn_device_clock_map(&clock, (uint64_t)(i + 1) * FRAME_NS, arrival_ns);
        assert_true(got_ns > last_ns);
        assert_true(got_ns <= arrival_ns);
        assert_true(i < 4 || got_ns == true_ns);
        last_ns = got_ns;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_jitter_and_drift),
        cmocka_unit_test(test_nonsense),
        cmocka_unit_test(test_late_first),
    };
    cmocka_set_message_output(CM_OUTPUT_TAP);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
