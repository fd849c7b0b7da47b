/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a room leaves out of its light, and that nobody sees it; which light a frame waits for. */
#include "tests/unit/cmocka_setup.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "tests/unit/house.h"

static int get_difference(const uint8_t *a, const uint8_t *b)
{
    int most = 0;
    for (int i = 0; i < HOUSE_PICTURE_BYTES; i++)
        most = abs(a[i] - b[i]) > most ? abs(a[i] - b[i]) : most;
    return most;
}

static void leaves_equal_frames_alone(void **test)
{
    (void)test;
    static uint8_t before[HOUSE_PICTURE_BYTES], after[HOUSE_PICTURE_BYTES], worked[sizeof(after)];
    struct house lazy, busy;
    house_build(&lazy, HOUSE_DIFFUSE, 0.004, NULL);
    house_build(&busy, HOUSE_DIFFUSE, 0, NULL);
    house_light_up(&lazy, 0, 1);
    house_light_up(&busy, 0, 1);
    house_draw(&lazy, before);
    house_light_up(&lazy, 0, 1); // the same bytes in other memory
    house_draw(&lazy, after);
    assert_memory_equal(before, after, sizeof(after));
    struct gn_room_figures f = house_get_figures(&lazy);
    assert_int_equal(f.environment_same, 1);
    assert_int_equal(f.light_published, 2);
    assert_true(f.light_capture_ns == lazy.time_ns);
    for (unsigned i = 2; i < 12; i++) { // noise below the bound, in half floats of 0.05 %
        house_light_up(&lazy, 0.003, i);
        house_light_up(&busy, 0.003, i);
    }
    house_draw(&lazy, after);
    house_draw(&busy, worked);
    assert_int_equal(house_get_figures(&lazy).environment_same, 11);
    assert_int_equal(house_get_figures(&busy).environment_same, 0);
    assert_true(get_difference(after, worked) <= 1);
    house_light_up(&lazy, 0.03, 99);
    assert_int_equal(house_get_figures(&lazy).environment_same, 11);
    house_raze(&lazy);
    house_raze(&busy);
}

static void makes_harmonics_only_for_who_uses_them(void **test)
{
    (void)test;
    static uint8_t without[HOUSE_PICTURE_BYTES], with[sizeof(without)];
    struct house h;
    house_build(&h, HOUSE_DIFFUSE, 0.004, NULL);
    house_light_up(&h, 0, 1);
    house_draw(&h, without);
    struct gn_lighting_state *light = gn_room_get_light(h.room);
    assert_false(light->has_sh);
    assert_true(light->has_lights && light->n_lights > 0);
    gn_lighting_state_unref(&light);
    assert_int_equal(house_get_figures(&h).light_without_sh, 1);
    assert_int_equal(house_get_figures(&h).light_without_lights, 0);

    h.subscriber = house_join(&h, GN_MSG_ROLE_VIEWER, true); // gets the state there is, completed
    bool has_sh = false;
    for (int i = 0; !has_sh && i < 200; i++) {
        struct pollfd wait = {.fd = gn_mailbox_get_fd(h.mailbox), .events = POLLIN};
        assert_int_equal(poll(&wait, 1, 20000), 1);
        for (struct gn_note *note = gn_mailbox_take_all(h.mailbox), *next; note; note = next) {
            next = note->next;
            if (note->type == GN_WIRE_LIGHTING_STATE) {
                assert_int_equal(note->body.lighting_state.sequence, h.sequence);
                assert_true(note->body.lighting_state.sh[0] > 0);
                has_sh = true;
            }
            gn_mailbox_recycle(h.mailbox, &note);
        }
    }
    assert_true(has_sh);
    house_draw(&h, with);
    assert_memory_equal(without, with, sizeof(with));
    house_raze(&h);
}

static void makes_lights_only_for_who_uses_them(void **test)
{
    (void)test;
    static uint8_t without[HOUSE_PICTURE_BYTES], with[sizeof(without)];
    struct house h;
    house_build(&h, HOUSE_MIRROR, 0.004, &(struct gn_render_options){.no_shadow = true});
    house_light_up(&h, 0, 1);
    house_draw(&h, without);
    assert_int_equal(house_get_figures(&h).light_without_lights, 1);
    assert_int_equal(house_get_figures(&h).n_lights, 0);
    struct gn_lighting_state *light = gn_room_get_light(h.room); // somebody looks
    for (int i = 0; !light->has_lights; i++) {
        assert_true(i < 20000);
        gn_lighting_state_unref(&light);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
        light = gn_room_get_light(h.room);
    }
    assert_true(light->n_lights > 0 && light->sequence == h.sequence);
    gn_lighting_state_unref(&light);
    house_draw(&h, with);
    assert_memory_equal(without, with, sizeof(with));
    house_raze(&h);
}

/* Who begins or ceases to want more of the light moves nothing of the picture, in the middle of a
 * step that is being followed. */
static void pictures_do_not_show_who_subscribes(void **test)
{
    (void)test;
    static uint8_t alone[HOUSE_PICTURE_BYTES], watched[sizeof(alone)], first[sizeof(alone)];
    for (int shading = 0; shading < 2; shading++) {
        struct house a, b;
        const struct gn_render_options render = {.no_shadow = shading == 1,
                                                 .shading = shading == 1 ? GN_SHADING_IRRADIANCE
                                                                         : GN_SHADING_LIGHTS};
        house_build(&a, HOUSE_DIFFUSE, 0, &render);
        house_build(&b, HOUSE_DIFFUSE, 0, &render);
        struct house *const houses[] = {&a, &b};
        for (unsigned i = 0; i < 8; i++) {
            for (int k = 0; k < 2; k++) {
                houses[k]->gain = i < 2 ? 0.3 : 0.45;
                house_light_up(houses[k], 0, 1);
            }
            if (i == 3)
                b.subscriber = house_join(&b, GN_MSG_ROLE_VIEWER, true);
            for (int j = 0; i == 3; j++) { // until all of it is made
                struct gn_lighting_state *light = gn_room_get_light(b.room);
                bool is_whole = light->has_sh && light->has_lights;
                gn_lighting_state_unref(&light);
                if (is_whole)
                    break;
                assert_true(j < 20000);
                nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
            }
            if (i == 5)
                gn_room_leave(&b.subscriber);
            house_draw(&a, alone);
            house_draw(&b, watched);
            assert_memory_equal(alone, watched, sizeof(alone));
            if (i == 2)
                memcpy(first, alone, sizeof(first));
        }
        assert_true(get_difference(first, alone) > 2); // a step it was
        house_raze(&a);
        house_raze(&b);
    }
}

/* A replay that starts again counts from 1: the light of its first run is not what is meant. */
static void waits_for_the_light_of_the_newest_probe(void **test)
{
    (void)test;
    static uint8_t picture[HOUSE_PICTURE_BYTES];
    struct house h;
    house_build(&h, HOUSE_DIFFUSE, 0, NULL);
    for (unsigned i = 0; i < 5; i++)
        house_light_up(&h, 0.1, i);
    gn_room_leave(&h.probe);
    h.probe = house_join(&h, GN_MSG_ROLE_PROBE, false);
    h.sequence = 0;
    house_light_up(&h, 0.1, 77);
    house_send_frame(&h, 3, 30000);
    assert_int_equal(house_take_result(&h, 150, picture), 0); // 5 was the other's
    house_light_up(&h, 0.1, 78);
    house_light_up(&h, 0.1, 79);
    assert_int_equal(house_take_result(&h, 20000, picture), 3);
    house_raze(&h);
}

/* One whose pixels are bad holds nobody up, and counts from its first good frame. */
static void waits_for_no_probe_that_was_refused(void **test)
{
    (void)test;
    static uint8_t picture[HOUSE_PICTURE_BYTES];
    struct house h;
    struct gn_error error = {0};
    struct gn_msg_environment_frame frame = house_make_header();
    struct gn_buf *pixels = house_make_pixels(1, 0, 1);
    house_build(&h, HOUSE_DIFFUSE, 0, NULL);
    house_light_up(&h, 0.1, 1);
    struct gn_room_session *bad = house_join(&h, GN_MSG_ROLE_PROBE, false);
    frame.sequence = 1;
    frame.pixel_format = GN_MSG_PIXEL_FORMAT_JPEG;
    assert_int_equal(gn_room_put_environment(bad, &frame, pixels, &error), 0);
    for (int i = 0; house_get_figures(&h).environment_refused == 0; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    house_light_up(&h, 0.1, 2);
    house_send_frame(&h, 2, 60000);
    assert_int_equal(house_take_result(&h, 20000, picture), 2);
    frame.sequence = 2;
    frame.pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F16;
    frame.scale = 2;
    assert_int_equal(gn_room_put_environment(bad, &frame, pixels, &error), 0);
    for (int i = 0; house_get_figures(&h).light_published < 3; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    house_light_up(&h, 0.1, 3);
    house_send_frame(&h, 3, 60000);
    assert_int_equal(house_take_result(&h, 150, picture), 0); // 3 is the other's now
    frame.sequence = 3;
    assert_int_equal(gn_room_put_environment(bad, &frame, pixels, &error), 0);
    assert_int_equal(house_take_result(&h, 20000, picture), 3);
    gn_buf_unref(&pixels);
    gn_room_leave(&bad);
    house_raze(&h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(leaves_equal_frames_alone),
        cmocka_unit_test(makes_harmonics_only_for_who_uses_them),
        cmocka_unit_test(makes_lights_only_for_who_uses_them),
        cmocka_unit_test(pictures_do_not_show_who_subscribes),
        cmocka_unit_test(waits_for_the_light_of_the_newest_probe),
        cmocka_unit_test(waits_for_no_probe_that_was_refused),
    };
    return cmocka_run_group_tests(tests, house_set_up, house_tear_down);
}
