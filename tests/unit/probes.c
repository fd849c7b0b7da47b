/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The slots of a room's probes: the newest frame of each, in turn, and who stays. */
#include "server/room/probes.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <stdlib.h>

#include "server/room/same_frame.h"
#include "tests/light_fixture.h"

static struct gn_lighting_state *make_light(void)
{
    struct light_fixture f;
    struct gn_error error = {0};
    struct gn_lighting_state *state = NULL;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 16, 8), 0);
    light_fixture_fill(&f, light_fixture_constant);
    assert_int_equal(gn_lighting_state_create(&f.frame, NULL, NULL, NULL, &state, &error), 0);
    light_fixture_finish(&f);
    return state;
}

static int put_frame(struct gn_probes *probes, uint64_t session_id, uint64_t sequence, bool is_new)
{
    const struct gn_environment_job job = {.session_id = session_id, .frame.sequence = sequence};
    struct gn_probe old;
    int rc = gn_probes_put(probes, &job, is_new, &old);
    gn_probe_finish(&old);
    return rc;
}

static int put(struct gn_probes *probes, uint64_t session_id, uint64_t sequence)
{
    return put_frame(probes, session_id, sequence, sequence == 1);
}

static uint64_t take(struct gn_probes *probes, bool all)
{
    struct gn_probe_work work;
    if (!gn_probes_take(probes, all, &work))
        return 0;
    gn_lighting_state_unref(&work.light);
    assert_null(work.worked);
    return 100 * work.job.session_id + work.job.frame.sequence;
}

static void set_light(struct gn_probes *probes, uint64_t session_id, bool is_there_expected,
                      int n_lights_gone_expected)
{
    struct gn_probe old[GN_PROBES_MAX];
    int n_old, n_gone = 0;
    bool is_there = gn_probes_set_light(probes, session_id, make_light(), NULL, 5, old, &n_old);
    assert_int_equal(is_there, is_there_expected);
    for (int i = 0; i < n_old; i++) {
        n_gone += old[i].light != NULL;
        gn_probe_finish(&old[i]);
    }
    assert_int_equal(n_gone, n_lights_gone_expected);
}

static void refuse(struct gn_probes *probes, uint64_t session_id)
{
    struct gn_probe old;
    gn_probes_refuse(probes, session_id, NULL, &old);
    gn_probe_finish(&old);
}

static bool leave(struct gn_probes *probes, uint64_t session_id)
{
    struct gn_probe old;
    gn_probes_leave(probes, session_id, &old);
    bool had_light = old.light != NULL;
    gn_probe_finish(&old);
    return had_light;
}

static int count_lights(const struct gn_probes *probes)
{
    struct gn_lighting_state *lights[GN_PROBES_MAX];
    int newest, n = gn_probes_get_lights(probes, lights, &newest);
    for (int i = 0; i < n; i++)
        gn_lighting_state_unref(&lights[i]);
    return n;
}

static void test_in_turn(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    assert_int_equal(take(&probes, true), 0);
    assert_int_equal(put(&probes, 1, 1), 0);
    assert_int_equal(put(&probes, 2, 1), 0);
    assert_int_equal(put(&probes, 1, 2), 1); // the newest frame wins
    assert_int_equal(take(&probes, true), 102);
    assert_int_equal(put(&probes, 1, 3), 0); // and the other probe's comes before its next
    assert_int_equal(take(&probes, true), 201);
    assert_int_equal(take(&probes, true), 103);
    assert_int_equal(take(&probes, true), 0);
    // While nobody needs light only those that have lit nothing are taken.
    set_light(&probes, 1, true, 0);
    assert_int_equal(put(&probes, 1, 4), 0);
    assert_int_equal(take(&probes, false), 0);
    assert_true(gn_probes_has_frame(&probes));
    assert_int_equal(put(&probes, 2, 2), 0);
    assert_int_equal(take(&probes, false), 202);
    assert_int_equal(take(&probes, true), 104);
    gn_probes_finish(&probes);
}

static void test_who_stays(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    for (uint64_t id = 1; id <= GN_PROBES_MAX; id++)
        assert_int_equal(put(&probes, id, 1), 0);
    assert_int_equal(put(&probes, 99, 1), -EUSERS);
    set_light(&probes, 1, true, 0);
    set_light(&probes, 2, true, 0);
    assert_int_equal(count_lights(&probes), 2);
    assert_true(leave(&probes, 1)); // another has lit the room: at once
    assert_int_equal(count_lights(&probes), 1);
    assert_false(leave(&probes, 2)); // the last one's stays
    assert_int_equal(count_lights(&probes), 1);
    set_light(&probes, 1, false, 1); // made late, of one that has left: it goes
    assert_int_equal(count_lights(&probes), 1);
    set_light(&probes, 3, true, 1); // until another lights the room
    assert_int_equal(count_lights(&probes), 1);
    struct gn_probe_figures figures[GN_PROBES_MAX];
    struct gn_time_window intervals[GN_PROBES_MAX];
    assert_int_equal(gn_probes_get_figures(&probes, figures, intervals), 1);
    assert_int_equal(figures[0].session_id, 3);
    assert_false(figures[0].has_left);
    assert_int_equal(put(&probes, 99, 1), 0); // there is room again
    assert_false(leave(&probes, 77));         // never sent anything
    gn_probes_finish(&probes);
    assert_int_equal(count_lights(&probes), 0);
}

/* What a probe sent last lights the room though it has gone: it takes the place of what one left
 * that went before. */
static void test_who_sends_and_goes(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    assert_int_equal(put(&probes, 1, 1), 0);
    assert_int_equal(take(&probes, true), 101);
    set_light(&probes, 1, true, 0);
    assert_false(leave(&probes, 1));
    assert_int_equal(put(&probes, 2, 1), 0);
    assert_false(leave(&probes, 2)); // its frame waits
    assert_int_equal(gn_probes_get_newest(&probes), 2);
    assert_int_equal(take(&probes, false), 201);
    assert_int_equal(gn_probes_get_newest(&probes), 2);
    set_light(&probes, 2, true, 1); // the first one's goes
    assert_int_equal(count_lights(&probes), 1);
    assert_int_equal(put(&probes, 3, 1), 0);
    assert_int_equal(take(&probes, true), 301);
    assert_false(leave(&probes, 3)); // it is worked on
    set_light(&probes, 3, true, 1);
    assert_int_equal(put(&probes, 4, 1), 0);
    assert_int_equal(take(&probes, true), 401);
    assert_false(leave(&probes, 4));
    refuse(&probes, 4); // of no use: the light that is there stays
    assert_int_equal(gn_probes_get_newest(&probes), 3);
    assert_int_equal(count_lights(&probes), 1);
    for (uint64_t id = 11; id < 11 + GN_PROBES_MAX - 1; id++)
        assert_int_equal(put(&probes, id, 1), 0);
    gn_probes_finish(&probes);
}

/* Frames that rested when a viewer came are waited for, later ones are not. */
static void test_what_is_owed(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    gn_probes_owe(&probes);
    assert_false(gn_probes_is_owing(&probes));
    for (uint64_t id = 1; id <= 3; id++)
        assert_int_equal(put(&probes, id, 1), 0);
    gn_probes_owe(&probes);
    assert_int_equal(put(&probes, 4, 1), 0);
    for (uint64_t id = 1; id <= 3; id++) {
        assert_true(gn_probes_is_owing(&probes));
        assert_int_equal(take(&probes, true), 100 * id + 1);
        if (id == 1) {
            set_light(&probes, id, true, 0);
            assert_true(gn_probes_is_owing(&probes)); // not shown yet
            gn_probes_settle(&probes, id);
        } else if (id == 2) {
            refuse(&probes, id);
        } else {
            assert_false(leave(&probes, id)); // one that is still there lights the room
        }
    }
    assert_false(gn_probes_is_owing(&probes));
    gn_probes_finish(&probes);
}

/* Slots are for who lights the room, or may: not for who was only ever refused. */
static void test_who_makes_room(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    for (uint64_t id = 1; id <= GN_PROBES_MAX; id++)
        assert_int_equal(put(&probes, id, 1), 0);
    for (uint64_t id = 1; id <= GN_PROBES_MAX; id++) {
        if (id <= 3)
            assert_int_equal(put(&probes, 99, id), -EUSERS); // all may light the room yet
        assert_int_equal(take(&probes, true), 100 * id + 1);
        if (id == 3)
            refuse(&probes, id);
        else
            set_light(&probes, id, true, 0);
    }
    assert_int_equal(put(&probes, 3, 2), 0);
    assert_int_equal(take(&probes, true), 302);
    assert_int_equal(put(&probes, 99, 1), -EUSERS); // not while it is worked on
    refuse(&probes, 3);
    assert_int_equal(put(&probes, 3, 3), 0);
    assert_int_equal(put(&probes, 99, 7), 1); // in place of that frame
    assert_int_equal(put(&probes, 3, 4), -EUSERS);
    refuse(&probes, 1); // has lit the room before: it stays
    assert_int_equal(put(&probes, 3, 5), -EUSERS);
    gn_probes_finish(&probes);
}

/* The probe whose sequence frames wait for. */
static void test_who_is_newest(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    assert_int_equal(gn_probes_get_newest(&probes), 0);
    assert_int_equal(put(&probes, 1, 1), 0);
    assert_int_equal(take(&probes, true), 101);
    set_light(&probes, 1, true, 0);
    assert_int_equal(put(&probes, 2, 1), 0);
    assert_int_equal(gn_probes_get_newest(&probes), 2); // its light is on its way
    assert_int_equal(take(&probes, true), 201);
    assert_int_equal(gn_probes_get_newest(&probes), 2);
    refuse(&probes, 2);
    assert_int_equal(gn_probes_get_newest(&probes), 1);
    assert_int_equal(put(&probes, 2, 2), 0); // nor with the next, which may be as bad
    assert_int_equal(gn_probes_get_newest(&probes), 1);
    assert_int_equal(put_frame(&probes, 3, 9, false), 0); // its first one was refused before
    assert_int_equal(gn_probes_get_newest(&probes), 1);
    assert_int_equal(take(&probes, true), 309);
    set_light(&probes, 3, true, 0);
    assert_int_equal(gn_probes_get_newest(&probes), 3);
    assert_int_equal(take(&probes, true), 202);
    set_light(&probes, 2, true, 0);
    assert_int_equal(gn_probes_get_newest(&probes), 2);
    assert_int_equal(put(&probes, 1, 2), 0); // has begun long ago
    refuse(&probes, 2);                      // has lit the room
    assert_int_equal(gn_probes_get_newest(&probes), 2);
    assert_true(leave(&probes, 2));
    assert_int_equal(gn_probes_get_newest(&probes), 3);
    gn_probes_finish(&probes);
}

static struct gn_worked_frame *make_worked(struct gn_buf *payload)
{
    struct gn_worked_frame *worked = calloc(1, sizeof(*worked));
    assert_non_null(worked);
    gn_worked_frame_keep(worked, &(struct gn_environment_job){.payload = payload});
    return worked;
}

/* A probe's last frame is kept as long as the probe, whatever others send, and no longer. */
static void test_worked_frames(void **state)
{
    (void)state;
    struct gn_probes probes = {0};
    struct gn_probe_work work;
    struct gn_probe old[GN_PROBES_MAX];
    struct gn_buf *payload;
    int n_old;
    assert_int_equal(gn_buf_create(16, &payload), 0);
    for (uint64_t id = 1; id <= 2; id++) {
        assert_int_equal(put(&probes, id, 1), 0);
        assert_true(gn_probes_take(&probes, true, &work));
        assert_null(work.worked);
        assert_true(
            gn_probes_set_light(&probes, id, make_light(), make_worked(payload), 5, old, &n_old));
        gn_probe_finish(&old[0]);
        assert_int_equal(n_old, 1);
    }
    assert_int_equal(put(&probes, 1, 2), 0);
    assert_true(gn_probes_take(&probes, true, &work));
    struct gn_worked_frame *mine = work.worked;
    assert_non_null(mine);
    gn_lighting_state_unref(&work.light);
    gn_probes_refuse(&probes, 1, mine, &old[0]);
    assert_null(old[0].worked);
    assert_int_equal(put(&probes, 1, 3), 0);
    assert_true(gn_probes_take(&probes, true, &work));
    assert_ptr_equal(work.worked, mine); // a bad frame changes nothing
    gn_lighting_state_unref(&work.light);
    gn_probes_leave(&probes, 1, &old[0]);
    gn_probe_finish(&old[0]);
    assert_false(gn_probes_set_light(&probes, 1, make_light(), work.worked, 6, old, &n_old));
    assert_ptr_equal(old[0].worked, mine); // it has left meanwhile
    gn_probe_finish(&old[0]);
    gn_probes_leave(&probes, 2, &old[0]); // its light stays, but no frame follows
    assert_non_null(old[0].worked);
    assert_null(old[0].light);
    gn_probe_finish(&old[0]);
    assert_int_equal(atomic_load(&payload->refs), 1);
    gn_buf_unref(&payload);
    gn_probes_finish(&probes);
}

/* Within a centimetre of each other; not those without light, nor free slots. */
static void test_same_place(void **state)
{
    (void)state;
    static struct gn_probes probes;
    static const double x[4] = {0, 0.0099, 0.0201, 0.5};
    double *position[4];
    uint64_t ids[GN_PROBES_MAX];
    for (uint64_t id = 1; id <= 5; id++)
        assert_int_equal(put(&probes, id, 1), 0);
    for (uint64_t id = 1; id <= 4; id++) {
        take(&probes, true);
        set_light(&probes, id, true, 0);
        position[id - 1] = probes.slots[id - 1].light->map->world_from_probe.translation;
        position[id - 1][0] = x[id - 1];
    }
    assert_int_equal(gn_probes_find_same_place(&probes, 1, ids), 1);
    assert_int_equal(ids[0], 2);
    assert_int_equal(gn_probes_find_same_place(&probes, 2, ids), 1);
    assert_int_equal(ids[0], 1);
    assert_int_equal(gn_probes_find_same_place(&probes, 3, ids), 0);
    position[3][0] = 0;
    position[3][2] = -0.0099;
    assert_int_equal(gn_probes_find_same_place(&probes, 1, ids), 2);
    assert_true(ids[0] == 2 && ids[1] == 4);
    assert_int_equal(gn_probes_find_same_place(&probes, 2, ids), 1); // 4 is 1.4 cm off
    assert_int_equal(gn_probes_find_same_place(&probes, 5, ids), 0); // no light yet
    assert_int_equal(gn_probes_find_same_place(&probes, 0, ids), 0);
    gn_probes_finish(&probes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_in_turn),
        cmocka_unit_test(test_who_stays),
        cmocka_unit_test(test_who_sends_and_goes),
        cmocka_unit_test(test_what_is_owed),
        cmocka_unit_test(test_who_makes_room),
        cmocka_unit_test(test_who_is_newest),
        cmocka_unit_test(test_worked_frames),
        cmocka_unit_test(test_same_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
