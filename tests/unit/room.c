/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a frame costs a room in memory once the first ones are through. */
#include "tests/unit/cmocka_setup.h"

#include "tests/allocations.h"
#include "tests/unit/house.h"

static struct house house;
static struct gn_buf *lights[2]; // which differ: a frame like the last costs nothing

static int set_up(void **state)
{
    if (house_set_up(state) < 0)
        return -1;
    house_build(&house, HOUSE_DIFFUSE, 0, NULL);
    for (int k = 0; k < 2; k++)
        lights[k] = house_make_pixels(1 + 0.125 * k, 0, 1);
    return 0;
}

static int tear_down(void **state)
{
    house_raze(&house);
    gn_buf_unref(&lights[0]);
    gn_buf_unref(&lights[1]);
    return house_tear_down(state);
}

static void light_up(void)
{
    house_send_light(&house, lights[house.sequence % 2]);
    house_wait_for_light(&house);
}

static void draw(void)
{
    house_send_frame(&house, 0, 0);
    assert_true(house_take_result(&house, 20000, NULL) > 0);
}

static void test_frames_allocate_nothing(void **state)
{
    (void)state;
    light_up();
    static const enum gn_msg_picture_format formats[] = {GN_MSG_PICTURE_FORMAT_RGB8,
                                                         GN_MSG_PICTURE_FORMAT_JPEG};
    for (size_t f = 0; f < GN_ARRAY_LEN(formats); f++) {
        house.result_format = formats[f];
        // A busy machine may keep a thread of the pool from its first tile for some frames.
        long n = -1;
        for (int round = 0; round < 5 && n != 0; round++) {
            for (int i = 0; i < 3; i++)
                draw();
            long before = gn_test_n_allocations;
            for (int i = 0; i < 20; i++)
                draw();
            n = gn_test_n_allocations - before;
        }
        assert_int_equal(n, 0);
    }
}

/** An environment frame makes a new state: a number of blocks that does not grow. */
static void test_light_allocates_as_much(void **state)
{
    (void)state;
    long n[3];
    for (int i = 0; i < 4; i++)
        light_up();
    for (int k = 0; k < 3; k++) {
        long before = gn_test_n_allocations;
        for (int i = 0; i < 10; i++)
            light_up();
        n[k] = gn_test_n_allocations - before;
    }
    print_message("# %ld allocations an environment frame\n", n[0] / 10);
    assert_int_equal(n[1], n[0]);
    assert_int_equal(n[2], n[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_allocate_nothing),
        cmocka_unit_test(test_light_allocates_as_much),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
