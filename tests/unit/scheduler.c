/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Which frame goes next: turns, waits, the latest wins. Time is the test's own. */
#include "server/room/scheduler.h"

#include <errno.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <setjmp.h>

#include <cmocka.h>

#define MS INT64_C(1000000)

static const struct gn_scheduler_light dark = {.is_there = false};

static struct gn_scheduler_light lit(uint64_t sequence)
{
    return (struct gn_scheduler_light){.is_there = true, .sequence = sequence};
}

static struct gn_frame_job make_job(uint64_t id, int64_t received_ns, uint64_t min_sequence,
                                    uint32_t wait_ms)
{
    struct gn_frame_job job = {.received_ns = received_ns};
    job.frame.id = id;
    job.frame.lighting_min_sequence = min_sequence;
    job.frame.lighting_wait_ms = wait_ms;
    return job;
}

static int setup(void **state)
{
    struct gn_scheduler *s = NULL;
    int rc = gn_scheduler_create(&s);
    *state = s;
    return rc;
}

static int teardown(void **state)
{
    struct gn_scheduler *s = *state;
    gn_scheduler_destroy(&s);
    return 0;
}

static uint64_t take(struct gn_scheduler *s, int64_t now_ns, struct gn_scheduler_light light,
                     enum gn_scheduler_verdict expected)
{
    struct gn_frame_job job = {0};
    int64_t deadline_ns = 0;
    assert_int_equal(gn_scheduler_take(s, now_ns, light, &job, &deadline_ns), expected);
    return job.frame.id;
}

static void test_latest_wins(void **state)
{
    struct gn_scheduler *s = *state;
    int slot = gn_scheduler_add(s);
    struct gn_frame_job job = make_job(1, 0, 0, 0), old = {0};
    assert_false(gn_scheduler_put(s, slot, &job, &old));
    job = make_job(2, 0, 0, 0);
    assert_true(gn_scheduler_put(s, slot, &job, &old));
    assert_int_equal(old.frame.id, 1);
    assert_int_equal(take(s, 0, lit(1), GN_SCHEDULER_RENDER), 2);
    take(s, 0, lit(1), GN_SCHEDULER_NOTHING);
}

/** However fast one viewer sends, each of the others is served between two frames of his. */
static void test_turns(void **state)
{
    struct gn_scheduler *s = *state;
    struct gn_frame_job old;
    int slots[3], served[3] = {0};
    for (int i = 0; i < 3; i++)
        slots[i] = gn_scheduler_add(s);
    for (int round = 0; round < 30; round++) {
        for (int i = 0; i < 3; i++) {
            // The first sends before every take, the others only now and then.
            struct gn_frame_job job = make_job((uint64_t)i + 1, 0, 0, 0);
            if (i == 0 || round % 3 == 0)
                (void)gn_scheduler_put(s, slots[i], &job, &old);
        }
        served[take(s, 0, lit(1), GN_SCHEDULER_RENDER) - 1]++;
    }
    assert_int_equal(served[0], 10);
    assert_int_equal(served[1], 10);
    assert_int_equal(served[2], 10);
}

static void test_wait(void **state)
{
    struct gn_scheduler *s = *state;
    struct gn_frame_job old, out;
    int patient = gn_scheduler_add(s), other = gn_scheduler_add(s);
    struct gn_frame_job job = make_job(1, 100 * MS, 5, 50);
    (void)gn_scheduler_put(s, patient, &job, &old);
    job = make_job(2, 100 * MS, 4, 0);
    (void)gn_scheduler_put(s, other, &job, &old);
    // The one that waits holds nobody up.
    assert_int_equal(take(s, 110 * MS, lit(4), GN_SCHEDULER_RENDER), 2);
    int64_t deadline_ns = 0;
    assert_int_equal(gn_scheduler_take(s, 149 * MS, lit(4), &out, &deadline_ns),
                     GN_SCHEDULER_NOTHING);
    assert_int_equal(deadline_ns, 150 * MS);
    // The wait over, it is rendered in the light that is there.
    assert_int_equal(take(s, 150 * MS, lit(4), GN_SCHEDULER_RENDER), 1);
    job = make_job(3, 200 * MS, 5, 50);
    (void)gn_scheduler_put(s, patient, &job, &old);
    assert_int_equal(take(s, 201 * MS, lit(5), GN_SCHEDULER_RENDER), 3);
}

/* Whoever may wait but need not has not waited. */
static void test_who_has_waited(void **state)
{
    struct gn_scheduler *s = *state;
    struct gn_frame_job old, out;
    int slot = gn_scheduler_add(s);
    int64_t deadline_ns;
    for (int i = 0; i < 2; i++) {
        struct gn_frame_job job = make_job(1, 100 * MS, 5, 50);
        (void)gn_scheduler_put(s, slot, &job, &old);
        if (i == 1)
            take(s, 101 * MS, lit(4), GN_SCHEDULER_NOTHING);
        assert_int_equal(gn_scheduler_take(s, 110 * MS, lit(5), &out, &deadline_ns),
                         GN_SCHEDULER_RENDER);
        assert_int_equal(out.has_waited, i == 1);
    }
}

/* Light that is about to be replaced is waited for as if there were none. */
static void test_light_behind(void **state)
{
    struct gn_scheduler *s = *state;
    struct gn_frame_job old;
    struct gn_scheduler_light behind = {.is_there = true, .sequence = 7, .is_behind = true};
    int slot = gn_scheduler_add(s);
    struct gn_frame_job job = make_job(1, 0, 0, 10);
    (void)gn_scheduler_put(s, slot, &job, &old);
    take(s, 9 * MS, behind, GN_SCHEDULER_NOTHING);
    assert_int_equal(take(s, 9 * MS, lit(7), GN_SCHEDULER_RENDER), 1);
    (void)gn_scheduler_put(s, slot, &job, &old);
    assert_int_equal(take(s, 10 * MS, behind, GN_SCHEDULER_RENDER), 1);
}

static void test_no_light(void **state)
{
    struct gn_scheduler *s = *state;
    struct gn_frame_job old;
    int slot = gn_scheduler_add(s);
    struct gn_frame_job job = make_job(1, 0, 0, 10);
    (void)gn_scheduler_put(s, slot, &job, &old);
    take(s, 9 * MS, dark, GN_SCHEDULER_NOTHING);
    assert_int_equal(take(s, 10 * MS, dark, GN_SCHEDULER_NO_LIGHT), 1);
    job = make_job(2, 20 * MS, 0, 0);
    (void)gn_scheduler_put(s, slot, &job, &old);
    assert_int_equal(take(s, 20 * MS, dark, GN_SCHEDULER_NO_LIGHT), 2);
}

static void test_slots(void **state)
{
    struct gn_scheduler *s = *state;
    struct gn_frame_job job = make_job(9, 0, 0, 0), out = {0};
    for (int i = 0; i < GN_ROOM_MAX_VIEWERS; i++)
        assert_int_equal(gn_scheduler_add(s), i);
    assert_int_equal(gn_scheduler_add(s), -EUSERS);
    assert_false(gn_scheduler_remove(s, 7, &out));
    assert_int_equal(gn_scheduler_add(s), 7);
    assert_false(gn_scheduler_put(s, 7, &job, &out));
    assert_true(gn_scheduler_remove(s, 7, &out));
    assert_int_equal(out.frame.id, 9);
    take(s, 0, lit(1), GN_SCHEDULER_NOTHING);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_latest_wins, setup, teardown),
        cmocka_unit_test_setup_teardown(test_turns, setup, teardown),
        cmocka_unit_test_setup_teardown(test_wait, setup, teardown),
        cmocka_unit_test_setup_teardown(test_who_has_waited, setup, teardown),
        cmocka_unit_test_setup_teardown(test_light_behind, setup, teardown),
        cmocka_unit_test_setup_teardown(test_no_light, setup, teardown),
        cmocka_unit_test_setup_teardown(test_slots, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
