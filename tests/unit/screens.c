/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The slots of a room's streams: the newest picture of each, in turn. */
#include "server/room/screens.h"

#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static struct gn_screens make_screens(int n)
{
    static const char *const names[] = {"tv", "wall", "lamp"};
    struct gn_screens screens = {.n = n, .slots = calloc((size_t)n, sizeof(struct gn_screen))};
    assert_non_null(screens.slots);
    for (int i = 0; i < n; i++)
        screens.slots[i].name = names[i];
    return screens;
}

static struct gn_buf *make_payload(void)
{
    struct gn_buf *payload;
    assert_int_equal(gn_buf_create(3, &payload), 0);
    return payload;
}

/* Whether a picture was superseded. */
static bool put(struct gn_screens *screens, int stream, uint64_t sequence)
{
    const struct gn_emitter_job job = {
        .stream = stream, .frame.sequence = sequence, .payload = make_payload()};
    struct gn_buf *superseded;
    gn_screens_put(screens, &job, &superseded);
    bool was_there = superseded != NULL;
    gn_buf_unref(&superseded);
    return was_there;
}

/* 100 stream + sequence; -1: none. */
static int take(struct gn_screens *screens, bool all)
{
    struct gn_emitter_job job;
    if (!gn_screens_take(screens, all, &job))
        return -1;
    gn_buf_unref(&job.payload);
    return 100 * job.stream + (int)job.frame.sequence;
}

static void test_latest_wins(void **state)
{
    (void)state;
    struct gn_screens screens = make_screens(2);
    assert_int_equal(take(&screens, true), -1);
    assert_false(put(&screens, 1, 1));
    assert_true(put(&screens, 1, 2));
    assert_true(put(&screens, 1, 3));
    assert_false(put(&screens, 0, 9)); // another stream's stays
    assert_int_equal(take(&screens, true), 9);
    assert_int_equal(take(&screens, true), 103);
    assert_int_equal(take(&screens, true), -1);
    assert_false(put(&screens, 1, 4)); // what was taken is not superseded
    gn_screens_finish(&screens);       // with a picture that waits
}

static void test_in_turn(void **state)
{
    (void)state;
    struct gn_screens screens = make_screens(3);
    for (int i = 0; i < 3; i++)
        put(&screens, i, 1);
    assert_int_equal(take(&screens, true), 1);
    assert_true(put(&screens, 1, 50)); // one that hurries
    put(&screens, 0, 50);
    assert_int_equal(take(&screens, true), 150);
    put(&screens, 1, 51);
    assert_int_equal(take(&screens, true), 201); // keeps nobody waiting
    assert_int_equal(take(&screens, true), 50);
    assert_int_equal(take(&screens, true), 151);
    assert_int_equal(take(&screens, true), -1);
    gn_screens_finish(&screens);
}

/* While nobody looks only the first of a stream is taken: its sender learns what is wrong. */
static void test_rest(void **state)
{
    (void)state;
    struct gn_screens screens = make_screens(2);
    put(&screens, 0, 1);
    assert_int_equal(take(&screens, false), 1);
    put(&screens, 0, 2);
    assert_int_equal(take(&screens, false), -1);
    put(&screens, 1, 7);
    assert_int_equal(take(&screens, false), 107);
    assert_int_equal(take(&screens, true), 2);
    gn_screens_finish(&screens);
}

static void test_find(void **state)
{
    (void)state;
    struct gn_screens screens = make_screens(2);
    struct gn_error error = {0};
    assert_int_equal(gn_screens_find(&screens, "wall", &error), 1);
    assert_int_equal(gn_screens_find(&screens, "radio", &error), -ENOENT);
    assert_non_null(strstr(error.text, "'radio'"));
    assert_non_null(strstr(error.text, "tv, wall"));
    gn_screens_finish(&screens);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_latest_wins),
        cmocka_unit_test(test_in_turn),
        cmocka_unit_test(test_rest),
        cmocka_unit_test(test_find),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
