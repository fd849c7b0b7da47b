/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* When a probe's frame is the last one again. */
#include "server/room/same_frame.h"

#include <math.h>
#include <string.h>

#include "tests/unit/cmocka_setup.h"

enum { MAP_WIDTH = 64, MAP_HEIGHT = 32 };

static struct gn_environment_job make_job(enum gn_msg_pixel_format format, size_t n_bytes)
{
    struct gn_environment_job job = {.session_id = 1,
                                     .frame = {
                                         .width = MAP_WIDTH,
                                         .height = MAP_HEIGHT,
                                         .scale = 1,
                                     }};
    job.frame.pixel_format = format;
    job.frame.response.type = GN_MSG_RESPONSE_TYPE_LOG; // five decades in 12 bits
    job.frame.response.log_a = 0.6;
    job.frame.response.log_b = 0.08;
    assert_int_equal(gn_buf_create(n_bytes, &job.payload), 0);
    memset(job.payload->data, 0, n_bytes);
    return job;
}

static void put_code(struct gn_environment_job *job, unsigned code)
{
    job->payload->data[100] = (uint8_t)code;
    job->payload->data[101] = (uint8_t)(code >> 8);
}

static void knows_how_far_a_code_may_be_off(void **test)
{
    (void)test;
    size_t n = (size_t)MAP_WIDTH * MAP_HEIGHT * 6;
    struct gn_worked_frame worked = {0};
    struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    assert_false(gn_worked_frame_is_same(&worked, &old, 0.004)); // nothing was worked on yet
    put_code(&old, 2000);
    gn_worked_frame_keep(&worked, &old);
    static const struct {
        unsigned code;
        double noise;
        bool is_same;
    } cases[] = {{2000, 0, true},     {2001, 0, false},     {2001, 0.004, true},
                 {1999, 0.004, true}, {2002, 0.004, false}, {1998, 0.004, false},
                 {2003, 0.01, true},  {2004, 0.01, false},  {4000, 0.01, false},
                 {2001, 0.002, false}}; // a code is exp(1 / (0.08 4095)): 0.31 %
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        put_code(&now, cases[i].code);
        assert_int_equal(gn_worked_frame_is_same(&worked, &now, cases[i].noise), cases[i].is_same);
    }
    put_code(&now, 2000);
    now.frame.sequence = 7;
    now.frame.capture_time_ns = 8;
    now.frame.exposure_s = 0.01;
    assert_true(gn_worked_frame_is_same(&worked, &now, 0.004));
    now.frame.scale = 1.001;
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.004));
    now.frame.scale = 1;
    now.session_id = 2;
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.004));
    gn_worked_frame_finish(&worked);
    gn_buf_unref(&old.payload);
    gn_buf_unref(&now.payload);
}

static void put_table(struct gn_environment_job *job, float a, float b, float c, unsigned code)
{
    const float table[3] = {a, b, c};
    memcpy(job->payload->data, table, sizeof(table));
    put_code(job, code);
}

/* The table lies in the payload: a header that stays says nothing of it. */
static void forgets_the_bounds_of_another_table(void **test)
{
    (void)test;
    size_t n = sizeof(float[3]) + (size_t)MAP_WIDTH * MAP_HEIGHT * 6;
    struct gn_worked_frame worked = {0};
    struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    old.frame.response = now.frame.response =
        (struct gn_msg_response){.type = GN_MSG_RESPONSE_TYPE_TABLE, .table_entries = 3};
    put_table(&old, 1, 1, 2, 100); // all codes up to the middle mean the same
    put_table(&now, 1, 1, 2, 1800);
    gn_worked_frame_keep(&worked, &old);
    assert_true(gn_worked_frame_is_same(&worked, &now, 0.004));
    put_table(&now, 0, 0.5f, 1, 100);
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.004));
    gn_worked_frame_keep(&worked, &now);
    put_table(&old, 0, 0.5f, 1, 1800);
    assert_false(gn_worked_frame_is_same(&worked, &old, 0.004));
    gn_worked_frame_finish(&worked);
    gn_buf_unref(&old.payload);
    gn_buf_unref(&now.payload);
}

static void compares_floats_by_share(void **test)
{
    (void)test;
    static const struct {
        float old, now;
        bool is_same;
    } cases[] = {{1, 1.0039f, true},  {1, 0.9961f, true}, {1, 1.0041f, false},
                 {0, 1e-30f, false},  {0, 0, true},       {-1, -1.001f, false},
                 {1, NAN, false},     {NAN, 1, false},    {INFINITY, INFINITY, true},
                 {INFINITY, 1, false}};
    size_t n = (size_t)MAP_WIDTH * MAP_HEIGHT * 12;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct gn_worked_frame worked = {0};
        struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB_F32, n);
        struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB_F32, n);
        memcpy(old.payload->data + 400, &cases[i].old, 4);
        memcpy(now.payload->data + 400, &cases[i].now, 4);
        gn_worked_frame_keep(&worked, &old);
        assert_int_equal(gn_worked_frame_is_same(&worked, &now, 0.004), cases[i].is_same);
        gn_worked_frame_finish(&worked);
        gn_buf_unref(&old.payload);
        gn_buf_unref(&now.payload);
    }
}

/* Its codes are too coarse for a share: one of them is 0.4 to 100 % of the light. */
static void compares_bytes_of_rgb8(void **test)
{
    (void)test;
    size_t n = (size_t)MAP_WIDTH * MAP_HEIGHT * 3;
    struct gn_worked_frame worked = {0};
    struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB8, n);
    struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB8, n);
    old.payload->data[100] = now.payload->data[100] = 254;
    gn_worked_frame_keep(&worked, &old);
    assert_true(gn_worked_frame_is_same(&worked, &now, 0));
    now.payload->data[100] = 255;
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.1));
    gn_worked_frame_finish(&worked);
    gn_buf_unref(&old.payload);
    gn_buf_unref(&now.payload);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(knows_how_far_a_code_may_be_off),
        cmocka_unit_test(forgets_the_bounds_of_another_table),
        cmocka_unit_test(compares_floats_by_share),
        cmocka_unit_test(compares_bytes_of_rgb8),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
