/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The slots of a room's probes: the newest frame of each, in turn, and who stays. */
#include "server/room/probes.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

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

static int put(struct gn_probes *probes, uint64_t session_id, uint64_t sequence)
{
    const struct gn_environment_job job = {.session_id = session_id, .frame.sequence = sequence};
    struct gn_environment_job superseded;
    return gn_probes_put(probes, &job, &superseded);
}

static uint64_t take(struct gn_probes *probes, bool all)
{
    struct gn_environment_job job;
    struct gn_lighting_state *light = NULL;
    bool has = gn_probes_take(probes, all, &job, &light);
    gn_lighting_state_unref(&light);
    return has ? 100 * job.session_id + job.frame.sequence : 0;
}

static void set_light(struct gn_probes *probes, uint64_t session_id, int n_old_expected)
{
    struct gn_lighting_state *old[GN_PROBES_MAX];
    int n_old;
    gn_probes_set_light(probes, session_id, make_light(), 5, old, &n_old);
    assert_int_equal(n_old, n_old_expected);
    for (int i = 0; i < n_old; i++)
        gn_lighting_state_unref(&old[i]);
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
    set_light(&probes, 1, 0);
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
    struct gn_lighting_state *light;
    for (uint64_t id = 1; id <= GN_PROBES_MAX; id++)
        assert_int_equal(put(&probes, id, 1), 0);
    assert_int_equal(put(&probes, 99, 1), -EUSERS);
    set_light(&probes, 1, 0);
    set_light(&probes, 2, 0);
    assert_int_equal(count_lights(&probes), 2);
    light = gn_probes_leave(&probes, 1); // another has lit the room: at once
    assert_non_null(light);
    gn_lighting_state_unref(&light);
    assert_int_equal(count_lights(&probes), 1);
    assert_null(gn_probes_leave(&probes, 2)); // the last one's stays
    assert_int_equal(count_lights(&probes), 1);
    set_light(&probes, 1, 1); // made late, of one that has left: it goes
    assert_int_equal(count_lights(&probes), 1);
    set_light(&probes, 3, 1); // until another lights the room
    assert_int_equal(count_lights(&probes), 1);
    struct gn_probe_figures figures[GN_PROBES_MAX];
    assert_int_equal(gn_probes_get_figures(&probes, figures), 1);
    assert_int_equal(figures[0].session_id, 3);
    assert_false(figures[0].has_left);
    assert_int_equal(put(&probes, 99, 1), 0);  // there is room again
    assert_null(gn_probes_leave(&probes, 77)); // never sent anything
    gn_probes_finish(&probes);
    assert_int_equal(count_lights(&probes), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_in_turn),
        cmocka_unit_test(test_who_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
