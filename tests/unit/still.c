/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Which views are refined, by how much, and what they leave behind. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "server/room/still.h"
#include "tests/allocations.h"
#include "tests/meshes.h"
#include "tests/stage.h"

#define WIDTH 64
#define HEIGHT 48
#define FRAME_NS (10 * (int64_t)1000000)

static const char first_frame[] = "the view's first frame";
static const char moved[] = "the camera has moved since the last frame";
static const char taken[] = "two other views are being refined";
static const char no_time[] = "a pass takes longer than the frame's budget";
static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = dir[2] > 0.9 ? 5 : 0.5f;
}

struct room {
    struct gn_test_stage stage;
    struct gn_still *still;
    int64_t now_ns;
    double ordinary_ms;          // that each ordinary picture is said to take
    int n_passes;                // of the last refined picture, in all
    int n_added;                 // steps of the last refined picture that rendered something
    const char *why_none;        // its plan line, where nothing was
    struct gn_render_options as; // of all frames
};

static void set_up(struct room *r)
{
    const double eye[3] = {0.6, -3, 1.6}, target[3] = {0, 0, 0.3};
    *r = (struct room){.now_ns = 1000 * FRAME_NS, .ordinary_ms = 1e-6};
    gn_test_stage_add(&r->stage, GN_RT_REAL, gn_test_make_plane(6, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&r->stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.4f, 12), 0, 0, 0.6,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&r->stage, 0);
    gn_test_stage_set_map(&r->stage, 32, 16, paint, NULL);
    gn_test_stage_set_lights_from_map(&r->stage, 4);
    gn_test_stage_aim(&r->stage, WIDTH, HEIGHT, 54, eye, target);
    r->stage.state.references = 1;
    assert_int_equal(gn_still_create(r->stage.scene, NULL, &r->still, NULL), 0);
}

static void tear_down(struct room *r)
{
    gn_still_destroy(&r->still);
    assert_int_equal(r->stage.state.references, 1);
    gn_test_stage_finish(&r->stage);
}

static void tell(void *context, const struct gn_render_report *report)
{
    struct room *r = context;
    const struct gn_plan_entry *last = &report->plan[report->n_plan - 1];
    assert_string_equal(last->pass, "progressive");
    r->n_added += last->ran;
    r->why_none = last->ran ? NULL : last->why;
}

/** A frame of a viewer who stands x m aside. Why it was an ordinary one; NULL: it was refined. */
static const char *show(struct room *r, uint64_t session_id, size_t index, double x, double left_ms)
{
    struct gn_camera camera = r->stage.camera;
    camera.world_from_camera.translation[0] += x;
    const struct gn_still_view view = {session_id, index,     &camera, &r->stage.state,
                                       &r->as,     r->now_ns, left_ms};
    struct gn_still_picture picture;
    int place;
    const char *why = gn_still_look(r->still, &view, &place);
    r->now_ns += FRAME_NS;
    if (why) {
        const struct gn_render_report report = {.ms_total = r->ordinary_ms, .n_lights = 8};
        gn_still_note(r->still, place, &report);
        return why;
    }
    r->n_added = 0;
    assert_int_equal(gn_still_refine(r->still, place, tell, r, &picture, NULL), 0);
    assert_int_equal(picture.layers->width, WIDTH);
    r->n_passes = picture.figures.n_passes;
    return NULL;
}

static void test_a_moving_view_takes_no_place(void **state)
{
    (void)state;
    struct room r;
    set_up(&r);
    for (int i = 0; i < 20; i++) {
        for (size_t k = 0; k < 4; k++)
            assert_string_equal(show(&r, 1, k, 0.01 * i, INFINITY), i == 0 ? first_frame : moved);
        const char *why = show(&r, 2, 0, 0, INFINITY);
        if (i == 0)
            assert_string_equal(why, first_frame);
        else
            assert_null(why);
        assert_true(i == 0 || r.n_added == 1);
    }
    assert_int_equal(r.n_passes, 18);
    tear_down(&r);
}

static void test_a_third_view_is_told(void **state)
{
    (void)state;
    struct room r;
    set_up(&r);
    for (int i = 0; i < 4; i++) {
        for (uint64_t id = 1; id <= 3; id++) {
            const char *why = show(&r, id, 0, 0, INFINITY);
            if (i > 0 && id < 3)
                assert_null(why);
            else
                assert_string_equal(why, i == 0 ? first_frame : taken);
        }
    }
    assert_string_equal(show(&r, 1, 0, 1, INFINITY), moved);
    assert_null(show(&r, 3, 0, 0, INFINITY)); // has held still all the while
    assert_string_equal(show(&r, 1, 0, 1, INFINITY), taken);
    // Who leaves gives the place away.
    r.now_ns += GN_STILL_REST_NS / 2;
    assert_null(show(&r, 3, 0, 0, INFINITY));
    assert_string_equal(show(&r, 1, 0, 1, INFINITY), taken);
    r.now_ns += GN_STILL_REST_NS / 2;
    assert_null(show(&r, 1, 0, 1, INFINITY));
    tear_down(&r);
}

/** Bytes taken until a viewer who is new is refined. */
static long count_bytes(struct room *r, uint64_t session_id)
{
    long before = gn_test_allocated_bytes;
    assert_string_equal(show(r, session_id, 0, 0, INFINITY), first_frame);
    assert_null(show(r, session_id, 0, 0, INFINITY));
    assert_null(show(r, session_id, 0, 0, INFINITY));
    return gn_test_allocated_bytes - before;
}

static void test_memory_is_given_back(void **state)
{
    (void)state;
    const long least = 100L * WIDTH * HEIGHT;
    struct gn_camera large = {.width = 2048, .height = 1025};
    struct room r;
    set_up(&r);
    assert_true(count_bytes(&r, 1) > least);
    // Moving on keeps it, for a while.
    long before = gn_test_allocated_bytes;
    assert_string_equal(show(&r, 1, 0, 1, INFINITY), moved);
    assert_null(show(&r, 1, 0, 1, INFINITY));
    assert_true(gn_test_allocated_bytes - before < least);
    // Of who has left nothing stays, not even the light; any view's frame sees to it.
    assert_true(r.stage.state.references > 1);
    r.now_ns += GN_STILL_REST_NS + FRAME_NS;
    const struct gn_still_view other = {9, 0, &large, &r.stage.state, &r.as, r.now_ns, INFINITY};
    int place;
    assert_non_null(gn_still_look(r.still, &other, &place));
    assert_int_equal(place, -1);
    assert_int_equal(r.stage.state.references, 1);
    assert_true(count_bytes(&r, 2) > least);
    // Nor of who has been moving for so long.
    for (int i = 0; i <= 2 + (int)(GN_STILL_REST_NS / FRAME_NS); i++)
        assert_string_equal(show(&r, 2, 0, 1 + i, INFINITY), moved);
    assert_true(count_bytes(&r, 3) > least);
    tear_down(&r);
}

static void test_a_budget_smaller_than_a_pass(void **state)
{
    (void)state;
    const double short_ms = 1e-5;
    struct room r;
    set_up(&r);
    // Shorter than an ordinary picture: not even tried.
    assert_string_equal(show(&r, 1, 0, 0, 1e-7), first_frame);
    for (int i = 0; i < 20; i++)
        assert_string_equal(show(&r, 1, 0, 0, 1e-7), no_time);
    assert_string_equal(show(&r, 1, 0, 0, -3), no_time);
    // One pass tells that there is no time for any; that is known while the view moves, too.
    assert_string_equal(show(&r, 2, 0, 0, short_ms), first_frame);
    assert_null(show(&r, 2, 0, 0, short_ms));
    assert_null(show(&r, 2, 0, 0, short_ms));
    assert_int_equal(r.n_passes, 1);
    for (int i = 0; i < 20; i++)
        assert_string_equal(show(&r, 2, 0, 0, short_ms), no_time);
    assert_string_equal(show(&r, 2, 0, 1, short_ms), moved);
    assert_string_equal(show(&r, 2, 0, 1, short_ms), no_time);
    // It takes no place meanwhile; with more time it gets one; and it is tried again later.
    for (uint64_t id = 3; id <= 4; id++) {
        assert_string_equal(show(&r, id, 0, 0, INFINITY), first_frame);
        assert_null(show(&r, id, 0, 0, INFINITY));
    }
    r.now_ns += GN_STILL_REST_NS / 2;
    assert_string_equal(show(&r, 2, 0, 1, 1e6), taken);
    r.now_ns += GN_STILL_REST_NS / 2 + FRAME_NS;
    assert_null(show(&r, 2, 0, 1, 1e6));
    assert_string_equal(show(&r, 2, 0, 0, short_ms), moved);
    int n = 0;
    while (show(&r, 2, 0, 0, short_ms))
        n++;
    assert_in_range(n, GN_STILL_PASS_NS / FRAME_NS / 2, GN_STILL_PASS_NS / FRAME_NS);
    tear_down(&r);
}

/** Passes take what the frame has, no more; what they have made better stays to be seen. */
static void test_what_is_left(void **state)
{
    (void)state;
    struct room r;
    set_up(&r);
    r.ordinary_ms = 1e6;
    assert_string_equal(show(&r, 1, 0, 0, 1e7), first_frame);
    assert_null(show(&r, 1, 0, 0, 1e7));
    assert_int_equal(r.n_passes, 0);
    assert_string_equal(show(&r, 1, 0, 0, 1e-6), no_time); // and nothing to be seen yet
    r.ordinary_ms = 1e-6;
    assert_string_equal(show(&r, 1, 0, 0, -1), no_time);
    while (r.n_passes < 8) {
        int before = r.n_passes;
        assert_null(show(&r, 1, 0, 0, 1e6));
        assert_int_equal(r.n_passes, before + 1);
    }
    for (int i = 0; i < 20; i++) {
        assert_null(show(&r, 1, 0, 0, 1e-6));
        assert_int_equal(r.n_passes, 8);
        assert_int_equal(r.n_added, 0);
        assert_string_equal(r.why_none, no_time);
    }
    int64_t start_ns = gn_clock_get_monotonic_ns();
    assert_null(show(&r, 1, 0, 0, 1e6));
    assert_int_equal(r.n_passes, 9);
    // Time for a few, far less than an ordinary picture takes.
    double pass_ms = gn_clock_get_ms_between(start_ns, gn_clock_get_monotonic_ns());
    r.ordinary_ms = 1e9;
    assert_string_equal(show(&r, 1, 0, 1, 4 * pass_ms), moved);
    assert_null(show(&r, 1, 0, 1, 4 * pass_ms));
    assert_null(show(&r, 1, 0, 1, 4 * pass_ms));
    assert_in_range(r.n_passes, 1, 40);
    tear_down(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_moving_view_takes_no_place),
        cmocka_unit_test(test_a_third_view_is_told),
        cmocka_unit_test(test_memory_is_given_back),
        cmocka_unit_test(test_a_budget_smaller_than_a_pass),
        cmocka_unit_test(test_what_is_left),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
