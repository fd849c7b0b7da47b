/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What waits for a slow peer: results become DROPPED, states keep the newest, all is bounded. */
#include "server/net/outbox.h"

#include <errno.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <setjmp.h>
#include <poll.h>

#include <cmocka.h>

#include "server/net/session.h"
#include "server/room/buf_pool.h"
#include "server/room/figures.h"

static struct gn_mailbox *mailbox;

static int setup(void **state)
{
    (void)state;
    return gn_mailbox_create(&mailbox);
}

static int teardown(void **state)
{
    (void)state;
    gn_mailbox_destroy(&mailbox);
    return 0;
}

static struct gn_note *make_note(uint16_t type, uint64_t id)
{
    struct gn_note *note = NULL;
    assert_int_equal(gn_mailbox_get_blank(mailbox, &note), 0);
    note->type = type;
    if (type == GN_WIRE_RESULT)
        note->body.result.id = id;
    if (type == GN_WIRE_LIGHTING_STATE)
        note->body.lighting_state.sequence = id;
    if (type == GN_WIRE_PONG)
        note->body.pong.t1_ns = (int64_t)id;
    return note;
}

static void test_results(void **state)
{
    (void)state;
    struct gn_outbox outbox = {0};
    for (uint64_t id = 1; id <= 5; id++) {
        struct gn_note *note = make_note(GN_WIRE_RESULT, id);
        assert_int_equal(gn_buf_create(10, &note->payload), 0);
        assert_int_equal(gn_outbox_put(&outbox, mailbox, note), 0);
    }
    assert_int_equal(outbox.n_results, GN_OUTBOX_MAX_RESULTS);
    assert_int_equal(outbox.n_dropped, 3);
    for (uint64_t id = 1; id <= 5; id++) { // each id once, in order, the newest as results
        struct gn_note *note = gn_outbox_take(&outbox);
        assert_non_null(note);
        if (id <= 3) {
            assert_int_equal(note->type, GN_WIRE_DROPPED);
            assert_int_equal(note->body.dropped.id, id);
            assert_int_equal(note->body.dropped.reason, GN_MSG_DROP_REASON_OVERLOAD);
            assert_null(note->payload);
        } else {
            assert_int_equal(note->type, GN_WIRE_RESULT);
            assert_int_equal(note->body.result.id, id);
        }
        gn_mailbox_recycle(mailbox, &note);
    }
    assert_null(gn_outbox_take(&outbox));
    assert_int_equal(outbox.n_results, 0);
}

static void test_newest_state(void **state)
{
    (void)state;
    struct gn_outbox outbox = {0};
    assert_int_equal(gn_outbox_put(&outbox, mailbox, make_note(GN_WIRE_PONG, 1)), 0);
    for (uint64_t id = 1; id <= 9; id++)
        assert_int_equal(gn_outbox_put(&outbox, mailbox, make_note(GN_WIRE_LIGHTING_STATE, id)), 0);
    assert_int_equal(gn_outbox_put(&outbox, mailbox, make_note(GN_WIRE_PONG, 2)), 0);
    assert_int_equal(gn_outbox_put(&outbox, mailbox, make_note(GN_WIRE_LIGHTING_STATE, 10)), 0);
    assert_int_equal(outbox.n_messages, 3);
    struct gn_note *note = make_note(GN_WIRE_LIGHTING_STATE, 11);
    note->body.lighting_state.probe = 5; // another probe's stands beside it
    assert_int_equal(gn_outbox_put(&outbox, mailbox, note), 0);
    assert_int_equal(outbox.n_messages, 4);
    note = gn_outbox_take(&outbox);
    assert_int_equal(note->body.pong.t1_ns, 1);
    gn_mailbox_recycle(mailbox, &note);
    note = gn_outbox_take(&outbox);
    assert_int_equal(note->body.lighting_state.sequence, 10);
    gn_mailbox_recycle(mailbox, &note);
    gn_outbox_clear(&outbox, mailbox);
    assert_null(gn_outbox_take(&outbox));
}

static void test_bound(void **state)
{
    (void)state;
    struct gn_outbox outbox = {0};
    for (int i = 0; i < GN_OUTBOX_MAX_MESSAGES; i++)
        assert_int_equal(gn_outbox_put(&outbox, mailbox, make_note(GN_WIRE_PONG, 1)), 0);
    struct gn_note *more = make_note(GN_WIRE_PONG, 1);
    assert_int_equal(gn_outbox_put(&outbox, mailbox, more), -ENOBUFS);
    gn_mailbox_recycle(mailbox, &more);
    gn_outbox_clear(&outbox, mailbox);
    assert_int_equal(outbox.n_messages, 0);
}

static bool is_readable(int fd)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    return poll(&p, 1, 0) == 1;
}

static void test_mailbox(void **state)
{
    (void)state;
    assert_false(is_readable(gn_mailbox_get_fd(mailbox)));
    gn_mailbox_post(mailbox, make_note(GN_WIRE_PONG, 1));
    gn_mailbox_post(mailbox, make_note(GN_WIRE_PONG, 2));
    assert_true(is_readable(gn_mailbox_get_fd(mailbox)));
    struct gn_note *first = gn_mailbox_take_all(mailbox);
    assert_false(is_readable(gn_mailbox_get_fd(mailbox)));
    struct gn_note *second = first->next;
    assert_int_equal(first->body.pong.t1_ns, 1);
    assert_int_equal(second->body.pong.t1_ns, 2);
    assert_null(second->next);
    gn_mailbox_recycle(mailbox, &first);
    gn_mailbox_recycle(mailbox, &second);
    assert_null(gn_mailbox_take_all(mailbox));
    gn_mailbox_post(mailbox, make_note(GN_WIRE_PONG, 3));
    struct gn_note *third = gn_mailbox_take_all(mailbox);
    assert_non_null(third);
    assert_int_equal(third->body.pong.t1_ns, 3);
    gn_mailbox_recycle(mailbox, &third);
    gn_mailbox_post(mailbox, make_note(GN_WIRE_PONG, 4)); // freed with the mailbox
}

/** The table of session.h, written apart from the code. */
static void test_states(void **state)
{
    (void)state;
    static const uint16_t types[] = {1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 32, 33, 34, 35, 99};
    static const char hello[] = "O...L............", probe[] = "....LSSS.........",
                      viewer[] = "....LSS.SSS......", screen[] = "....LSS....S.....",
                      closing[] = ".................";
    static const char letters[] = ".OSL"; // by enum gn_session_action
    for (size_t i = 0; i < GN_ARRAY_LEN(types); i++) {
        const uint16_t type = types[i];
        const enum gn_msg_role p = GN_MSG_ROLE_PROBE, v = GN_MSG_ROLE_VIEWER;
        assert_int_equal(letters[gn_session_get_action(GN_SESSION_HELLO, 0, type)], hello[i]);
        assert_int_equal(letters[gn_session_get_action(GN_SESSION_OPEN, p, type)], probe[i]);
        assert_int_equal(letters[gn_session_get_action(GN_SESSION_OPEN, v, type)], viewer[i]);
        assert_int_equal(letters[gn_session_get_action(GN_SESSION_OPEN, GN_MSG_ROLE_SCREEN, type)],
                         screen[i]);
        assert_int_equal(letters[gn_session_get_action(GN_SESSION_CLOSING, v, type)], closing[i]);
        assert_int_equal(letters[gn_session_get_action(GN_SESSION_GONE, v, type)], closing[i]);
    }
}

static void test_buf_pool(void **state)
{
    (void)state;
    struct gn_buf_pool *pool = NULL;
    struct gn_buf *a = NULL, *b = NULL;
    assert_int_equal(gn_buf_pool_create(&pool), 0);
    assert_int_equal(gn_buf_pool_get(pool, 1000, &a), 0);
    const uint8_t *data = a->data;
    a->len = 10;
    gn_buf_unref(&a);
    assert_int_equal(gn_buf_pool_get(pool, 900, &a), 0); // the same block again, whole
    assert_ptr_equal(a->data, data);
    assert_int_equal(a->len, 900);
    assert_int_equal(gn_buf_pool_get(pool, 1000, &b), 0);
    assert_ptr_not_equal(b->data, data);
    data = b->data;
    gn_buf_unref(&b);
    assert_int_equal(gn_buf_pool_get(pool, 10, &b), 0); // far smaller: a large one is not held
    assert_ptr_not_equal(b->data, data);
    gn_buf_pool_destroy(&pool); // blocks that are out free themselves
    gn_buf_unref(&a);
    gn_buf_unref(&b);
}

static void test_window(void **state)
{
    (void)state;
    struct gn_time_window window = {0};
    assert_true(gn_time_window_get(&window, 0.5) == 0);
    for (int i = 1; i <= 250; i++)
        gn_time_window_add(&window, i); // 151 to 250 stay
    assert_true(gn_time_window_get(&window, 0.5) == 200);
    assert_true(gn_time_window_get(&window, 0.99) == 249);
    assert_true(gn_time_window_get(&window, 1) == 250);
    struct gn_time_histogram h = {0};
    gn_time_histogram_add(&h, 2);
    gn_time_histogram_add(&h, 2.1);
    gn_time_histogram_add(&h, 1e9);
    assert_int_equal(h.counts[0], 1);
    assert_int_equal(h.counts[1], 1);
    assert_int_equal(h.counts[GN_FIGURES_BUCKETS], 1);
    assert_int_equal(h.n, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_results), cmocka_unit_test(test_newest_state),
        cmocka_unit_test(test_bound),   cmocka_unit_test(test_mailbox),
        cmocka_unit_test(test_states),  cmocka_unit_test(test_buf_pool),
        cmocka_unit_test(test_window),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
