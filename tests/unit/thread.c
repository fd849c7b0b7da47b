/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Clocks, threads and waits with a deadline.
 */
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>

#include "common/clock.h"
#include "common/thread.h"
#include "tests/unit/cmocka_setup.h"

struct meeting {
    struct gn_mutex mu;
    struct gn_cond cond;
    bool is_done; // guarded by mu
    char name[16];
    bool is_interrupt_blocked;
};

static void set_up(struct meeting *meeting)
{
    memset(meeting, 0, sizeof(*meeting));
    assert_int_equal(gn_mutex_init(&meeting->mu), 0);
    assert_int_equal(gn_cond_init(&meeting->cond), 0);
}

static void tear_down(struct meeting *meeting)
{
    gn_cond_finish(&meeting->cond);
    gn_mutex_finish(&meeting->mu);
}

static void run(void *context)
{
    struct meeting *meeting = context;
    sigset_t blocked;
    prctl(PR_GET_NAME, meeting->name);
    pthread_sigmask(SIG_SETMASK, NULL, &blocked);
    meeting->is_interrupt_blocked = sigismember(&blocked, SIGINT) == 1;
    gn_mutex_lock(&meeting->mu);
    meeting->is_done = true;
    gn_cond_signal(&meeting->cond);
    gn_mutex_unlock(&meeting->mu);
}

static void test_start_and_join(void **unused)
{
    (void)unused;
    struct meeting meeting;
    struct gn_thread thread = {0};
    set_up(&meeting);
    gn_thread_join(&thread); // never started: fine
    assert_int_equal(gn_thread_start(&thread, "gn-a-name-that-is-too-long", run, &meeting), 0);
    gn_mutex_lock(&meeting.mu);
    while (!meeting.is_done)
        gn_cond_wait(&meeting.cond, &meeting.mu);
    gn_mutex_unlock(&meeting.mu);
    gn_thread_join(&thread);
    assert_string_equal(meeting.name, "gn-a-name-that-");
    assert_true(meeting.is_interrupt_blocked);
    sigset_t blocked;
    pthread_sigmask(SIG_SETMASK, NULL, &blocked);
    assert_int_equal(sigismember(&blocked, SIGINT), 0);
    tear_down(&meeting);
}

static void test_deadline(void **unused)
{
    (void)unused;
    struct meeting meeting;
    set_up(&meeting);
    int64_t begin_ns = gn_clock_get_monotonic_ns();
    int64_t deadline_ns = begin_ns + 30 * GN_NS_PER_MS;
    gn_mutex_lock(&meeting.mu);
    assert_false(gn_cond_wait_until(&meeting.cond, &meeting.mu, begin_ns - 1));
    while (gn_cond_wait_until(&meeting.cond, &meeting.mu, deadline_ns))
        ;
    gn_mutex_unlock(&meeting.mu);
    assert_true(gn_clock_get_monotonic_ns() >= deadline_ns);
    tear_down(&meeting);
}

static void test_clocks(void **unused)
{
    (void)unused;
    int64_t a_ns = gn_clock_get_monotonic_ns();
    int64_t b_ns = gn_clock_get_monotonic_ns();
    assert_true(a_ns > 0 && b_ns >= a_ns);
    assert_true(gn_clock_get_ms_between(3000000, 1500000) == -1.5);
    assert_true(gn_clock_get_ms_between(INT64_MAX - 2000000, INT64_MAX) == 2);
    assert_true(gn_clock_get_ms_between(INT64_MIN, INT64_MAX) == 0x1p64 * 1e-6);
    assert_true(gn_clock_get_ms_between(INT64_MAX, INT64_MIN) == -0x1p64 * 1e-6);
    assert_true(gn_clock_get_realtime_ns() > INT64_C(1700000000) * GN_NS_PER_S);
    assert_true(gn_thread_get_cpu_count() >= 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_start_and_join),
        cmocka_unit_test(test_deadline),
        cmocka_unit_test(test_clocks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
