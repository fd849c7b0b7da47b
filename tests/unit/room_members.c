/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Probes, screens and subscribers that come and go. */
#include "tests/unit/cmocka_setup.h"

#include <poll.h>
#include <string.h>
#include <time.h>

#include "tests/unit/house.h"

static void send_picture(struct gn_room_session *screen, uint64_t sequence)
{
    struct gn_buf *pixels;
    struct gn_error error = {0};
    const struct gn_msg_emitter_frame frame = {.stream = "tv",
                                               .sequence = sequence,
                                               .width = 2,
                                               .height = 2,
                                               .pixel_format = GN_MSG_PIXEL_FORMAT_RGB8,
                                               .scale = 1};
    assert_int_equal(gn_buf_create(12, &pixels), 0);
    memset(pixels->data, 200, pixels->len);
    if (gn_room_put_emitter(screen, &frame, pixels, &error) < 0)
        fail_msg("%s", error.text);
    gn_buf_unref(&pixels);
}

static void wait_for_shown(struct house *h, uint64_t n)
{
    for (int i = 0; house_get_figures(h).emitter_shown < n; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
}

/* A picture that waits outlives its screen. */
static void shows_the_last_picture_of_a_screen_that_left(void **test)
{
    (void)test;
    struct house h;
    house_build(&h, HOUSE_TV, 0, NULL);
    struct gn_room_session *screen = house_join(&h, GN_MSG_ROLE_SCREEN, false);
    send_picture(screen, 1);
    wait_for_shown(&h, 1);
    gn_room_leave(&h.viewer); // nobody looks any more
    send_picture(screen, 2);
    send_picture(screen, 3);
    struct gn_room_figures f = house_get_figures(&h);
    assert_int_equal(f.emitter_superseded, 1);
    assert_int_equal(f.emitter_shown, 1);
    gn_room_leave(&screen);
    h.viewer = house_join(&h, GN_MSG_ROLE_VIEWER, false);
    wait_for_shown(&h, 2);
    f = house_get_figures(&h);
    assert_int_equal(f.emitter_shown, 2);
    assert_true(f.n_near > 0);
    // The lamp alone has no age: no environment frame was captured.
    struct gn_msg_statistics statistics;
    gn_room_get_statistics(h.room, &statistics);
    assert_true(f.has_light && !f.has_capture);
    assert_true(statistics.lighting_age_ms < 0);
    assert_int_equal(statistics.sessions, 2);
    screen = house_join(&h, GN_MSG_ROLE_SCREEN, false);
    gn_room_get_statistics(h.room, &statistics);
    assert_int_equal(statistics.sessions, 3);
    gn_room_leave(&screen);
    house_raze(&h);
}

/* What subscribers got: the next note of that kind, its session; false: none within the time. */
static bool take_state(struct house *h, uint64_t session_id, struct gn_note *out)
{
    for (;;) {
        while (h->notes) {
            struct gn_note *note = h->notes;
            h->notes = note->next;
            bool is_it = note->type == GN_WIRE_LIGHTING_STATE && note->session_id == session_id;
            *out = *note;
            gn_mailbox_recycle(h->mailbox, &note);
            if (is_it)
                return true;
        }
        struct pollfd wait = {.fd = gn_mailbox_get_fd(h->mailbox), .events = POLLIN};
        if (poll(&wait, 1, 20000) != 1)
            return false;
        h->notes = gn_mailbox_take_all(h->mailbox);
    }
}

static void tells_subscribers_who_came_and_went(void **test)
{
    (void)test;
    struct house h;
    struct gn_note note;
    struct gn_error error = {0};
    struct gn_msg_environment_frame frame = house_make_header();
    struct gn_buf *pixels = house_make_pixels(1, 0, 1);
    house_build(&h, HOUSE_DIFFUSE, 0, NULL);
    uint64_t first = h.next_id - 1; // the probe of the house
    h.subscriber = house_join(&h, GN_MSG_ROLE_VIEWER, true);
    uint64_t listener = h.next_id;
    house_light_up(&h, 0, 1);
    assert_true(take_state(&h, listener, &note));
    assert_int_equal(note.body.lighting_state.probe, first);
    assert_false(note.body.lighting_state.gone);
    struct gn_room_session *other = house_join(&h, GN_MSG_ROLE_PROBE, false);
    uint64_t second = h.next_id;
    frame.sequence = 1;
    assert_int_equal(gn_room_put_environment(other, &frame, pixels, &error), 0);
    assert_true(take_state(&h, listener, &note));
    assert_int_equal(note.body.lighting_state.probe, second);
    gn_room_leave(&other);
    assert_true(take_state(&h, listener, &note));
    assert_int_equal(note.body.lighting_state.probe, second);
    assert_true(note.body.lighting_state.gone);
    assert_int_equal(note.body.lighting_state.light_count, 0);
    gn_room_leave(&h.probe); // the last one's light stays until another's is there
    h.probe = house_join(&h, GN_MSG_ROLE_PROBE, false);
    h.sequence = 0;
    house_light_up(&h, 0, 2);
    bool has_gone = false, has_come = false;
    for (int i = 0; i < 2; i++) {
        assert_true(take_state(&h, listener, &note));
        const struct gn_msg_lighting_state *m = &note.body.lighting_state;
        has_gone = has_gone || (m->gone && m->probe == first);
        has_come = has_come || (!m->gone && m->probe == h.next_id);
    }
    assert_true(has_gone && has_come);
    gn_buf_unref(&pixels);
    house_raze(&h);
}

/* Whoever joins while a probe's frames keep the light thread busy is told of the others, too. */
static void tells_newcomers_of_all_probes(void **test)
{
    (void)test;
    struct house h;
    struct gn_note note;
    struct gn_error error = {0};
    struct gn_msg_environment_frame frame = house_make_header();
    struct gn_buf *pixels = house_make_pixels(1, 0, 1);
    house_build(&h, HOUSE_DIFFUSE, 0, NULL);
    uint64_t quiet = h.next_id - 1;
    house_light_up(&h, 0, 1);
    struct gn_room_session *busy = house_join(&h, GN_MSG_ROLE_PROBE, false);
    for (int i = 0; i < 30; i++) {
        frame.sequence++;
        frame.scale = 1 + 0.1 * i;
        assert_int_equal(gn_room_put_environment(busy, &frame, pixels, &error), 0);
        nanosleep(&(struct timespec){.tv_nsec = 300000 * (i % 7)}, NULL); // taken, most times
        h.subscriber = house_join(&h, GN_MSG_ROLE_VIEWER, true);
        uint64_t newcomer = h.next_id;
        do {
            assert_true(take_state(&h, newcomer, &note));
        } while (note.body.lighting_state.probe != quiet);
        gn_room_leave(&h.subscriber);
    }
    gn_buf_unref(&pixels);
    gn_room_leave(&busy);
    house_raze(&h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shows_the_last_picture_of_a_screen_that_left),
        cmocka_unit_test(tells_subscribers_who_came_and_went),
        cmocka_unit_test(tells_newcomers_of_all_probes),
    };
    return cmocka_run_group_tests(tests, house_set_up, house_tear_down);
}
