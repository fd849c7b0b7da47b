/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * V4L2 cameras against a driver in memory: which picture is given and when it was taken, what is
 * counted, unplugged and plugged in again, drivers that lie.
 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/jpeg.h"
#include "tests/unit/cmocka_setup.h"
#include "tests/unit/v4l2_fake.h"

static struct gn_source *open_camera(struct gn_fake *fake, const struct gn_live_options *wanted)
{
    struct gn_live_options options = wanted ? *wanted : (struct gn_live_options){.is_8_bit = true};
    struct gn_source *source = NULL;
    struct gn_error error = {0};
    options.id = "/dev/video3";
    if (gn_v4l2_open_through(&fake->io, &options, &source, &error) != 0)
        fail_msg("%s", error.text);
    assert_true(source->is_live && source->fd >= 0);
    return source;
}

/* The sentence with which opening is refused. */
static int refuse(struct gn_fake *fake, const char *says)
{
    const struct gn_live_options options = {.id = "/dev/video3", .is_8_bit = true};
    struct gn_source *source = NULL;
    struct gn_error error = {0};
    int err = gn_v4l2_open_through(&fake->io, &options, &source, &error);
    assert_null(source);
    if (err >= 0 || !strstr(error.text, says))
        fail_msg("%d '%s' does not say '%s'", err, error.text, says);
    return err;
}

static struct gn_capture read_picture(struct gn_source *source)
{
    struct gn_capture capture = {0};
    struct gn_error error = {0};
    int got = gn_source_read(source, &capture, &error);
    if (got != 1)
        fail_msg("no picture: %d %s", got, error.text);
    return capture;
}

/* No picture; the news, "" where there are none. */
static void expect_news(struct gn_source *source, const char *says)
{
    struct gn_capture capture;
    struct gn_error error = {0};
    assert_int_equal(gn_source_read(source, &capture, &error), -EAGAIN);
    if (*says ? !strstr(error.text, says) : error.text[0])
        fail_msg("'%s' does not say '%s'", error.text, says);
}

static struct gn_source_counts get_counts(const struct gn_source *source)
{
    struct gn_source_counts counts;
    gn_source_get_counts(source, &counts);
    return counts;
}

static void test_pictures_come_with_their_time(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    int64_t start_ns = fake.now_ns;
    expect_news(source, "");
    assert_int_equal(fake.now_ns - start_ns, 50 * GN_NS_PER_MS);
    for (int i = 0; i < 20; i++) { // every buffer several times
        int64_t taken_ns = fake.now_ns;
        gn_fake_fill(&fake, (uint32_t)i, 128); // grey: (128 - 16) 255 / 219
        fake.now_ns += 7 * GN_NS_PER_MS;
        struct gn_capture c = read_picture(source);
        assert_int_equal(c.time_ns, taken_ns);
        assert_true(c.width == 640 && c.height == 480 && c.format == GN_CAPTURE_RGB8);
        assert_int_equal(c.data_bytes, 640 * 480 * 3);
        assert_int_equal(c.data[0], 130);
        assert_int_equal(c.data[c.data_bytes - 1], 130);
    }
    struct gn_source_counts n = get_counts(source);
    assert_true(n.n_complete == 20 && n.n_read == 20 && n.n_lost == 0 && n.n_skipped == 0);
    assert_int_equal(n.read_bytes, 20 * 640 * 480 * 3);
    assert_int_equal(n.copied_bytes, n.read_bytes); // the one conversion
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void test_newest_wins_and_gaps_are_counted(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    gn_fake_fill(&fake, UINT32_MAX - 1, 20);
    assert_int_equal(read_picture(source).data[0], 0); // V and U of 20, too: green only
    gn_fake_fill(&fake, UINT32_MAX, 30);
    gn_fake_fill(&fake, 2, 40); // 0 and 1 are lost
    gn_fake_fill(&fake, 3, 128);
    assert_int_equal(read_picture(source).data[0], 130);
    struct gn_source_counts n = get_counts(source);
    assert_true(n.n_complete == 4 && n.n_read == 2 && n.n_skipped == 2 && n.n_lost == 2);
    for (uint32_t i = 4; i < 40; i++) { // all that are replaced go back to the driver
        gn_fake_fill(&fake, i, 20);
        if (i % 3 == 0)
            read_picture(source);
    }
    assert_int_equal(get_counts(source).n_skipped, 2 + 24);
    gn_fake_fill(&fake, 1, 128); // a number that goes back is no gap of four thousand millions
    read_picture(source);
    gn_fake_fill(&fake, 3, 128);
    read_picture(source);
    assert_int_equal(get_counts(source).n_lost, 3);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void test_bad_buffers_are_counted_and_not_given(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    for (uint32_t i = 0; i < 20; i++) { // each is given back, or the driver would have none
        gn_fake_fill(&fake, i, 128)->flags |= V4L2_BUF_FLAG_ERROR;
        expect_news(source, "");
    }
    assert_int_equal(get_counts(source).n_incomplete, 20);
    gn_fake_fill(&fake, 20, 128);
    gn_fake_fill(&fake, 21, 20)->flags |= V4L2_BUF_FLAG_ERROR; // the newest, but bad
    assert_int_equal(read_picture(source).data[0], 130);
    gn_fake_fill(&fake, 22, 128)->bytesused = 640 * 480 * 2 - 1;
    expect_news(source, "holds less than a picture"); // told once
    gn_fake_fill(&fake, 23, 128)->bytesused = 640 * 480 * 2 + 1;
    expect_news(source, "");
    expect_news(source, "");
    gn_fake_fill(&fake, 24, 128)->bytesused = UINT32_MAX;
    expect_news(source, "");
    gn_fake_fill(&fake, 25, 128)->bytesused = 0;
    expect_news(source, "");
    struct gn_source_counts n = get_counts(source);
    assert_true(n.n_incomplete == 25 && n.n_complete == 1 && n.n_read == 1 && n.n_lost == 0);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* The exposure is 8 ms and is stamped at its beginning, or at its end. */
static void test_times_are_the_middle_of_the_exposure(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, &(struct gn_live_options){.exposure_us = 8000});
    int64_t taken_ns = fake.now_ns;
    gn_fake_fill(&fake, 0, 128)->flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    fake.now_ns += 20 * GN_NS_PER_MS;
    assert_int_equal(read_picture(source).time_ns, taken_ns + 4 * GN_NS_PER_MS);
    gn_fake_fill(&fake, 1, 128);
    assert_int_equal(read_picture(source).time_ns, fake.now_ns - 4 * GN_NS_PER_MS);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* What was just set holds from a later picture on: these are not half of it off, nor told of. */
static void test_times_of_an_exposure_to_come(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_exposure range;
    double took = 0;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, &(struct gn_live_options){.exposure_us = 8000});
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_US, &range, NULL), 0);
    gn_fake_fill(&fake, 0, 128);
    assert_int_equal(read_picture(source).time_ns, fake.now_ns - 4 * GN_NS_PER_MS);
    assert_int_equal(gn_source_set_exposure(source, 200e3, &took, NULL), 0);
    fake.now_ns += 40 * GN_NS_PER_MS;
    gn_fake_fill(&fake, 1, 128); // its end is stamped; 100 ms earlier is before the picture before
    assert_int_equal(read_picture(source).time_ns, fake.now_ns);
    fake.now_ns += 40 * GN_NS_PER_MS;
    gn_fake_fill(&fake, 2, 128)->flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    int64_t begin_ns = fake.now_ns;
    fake.now_ns += 20 * GN_NS_PER_MS; // 80 ms from now would be its middle
    assert_int_equal(read_picture(source).time_ns, begin_ns);
    fake.now_ns += 240 * GN_NS_PER_MS;
    gn_fake_fill(&fake, 3, 128);
    assert_int_equal(read_picture(source).time_ns, fake.now_ns - 100 * GN_NS_PER_MS);
    expect_news(source, "");
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* Some drivers compute their times, which run ahead a little. */
static void test_times_are_never_ahead(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    gn_fake_fill(&fake, 0, 128)->timestamp.tv_usec += 30000;
    assert_int_equal(read_picture(source).time_ns, fake.now_ns);
    expect_news(source, "");
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* Some go back, as uvcvideo's do where a camera's clock is corrected. */
static void test_times_never_go_back(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    const int64_t frame_ns = 40 * GN_NS_PER_MS;
    int64_t last_ns = 0;
    for (uint32_t i = 0; i < 30; i++) {
        fake.now_ns += frame_ns;
        struct v4l2_buffer *b = gn_fake_fill(&fake, i, 128);
        int64_t late_ns = i < 10 ? 0 : 5 * frame_ns; // from the tenth on it is behind
        b->timestamp.tv_sec = (fake.now_ns - late_ns) / GN_NS_PER_S;
        b->timestamp.tv_usec = (fake.now_ns - late_ns) % GN_NS_PER_S / 1000;
        int64_t got_ns = read_picture(source).time_ns;
        assert_true(got_ns > last_ns && got_ns <= fake.now_ns);
        last_ns = got_ns;
        if (i == 10)
            expect_news(source, "or one that goes back");
    }
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void test_times_that_are_none(void **state)
{
    (void)state;
    static const struct {
        uint32_t flags;
        int64_t sec, usec;
    } cases[] = {{V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN, 1000, 0},
                 {V4L2_BUF_FLAG_TIMESTAMP_COPY, 1000, 0},
                 {V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, 1001, 0}, // not yet
                 {V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, 989, 0},  // long ago
                 {V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, 999, 1000000},
                 {V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, INT64_MAX, 0},
                 {V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, INT64_MIN, INT64_MIN}};
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct gn_fake fake;
        gn_fake_init(&fake);
        struct gn_source *source = open_camera(&fake, NULL);
        for (uint32_t k = 0; k < 2; k++) {
            struct v4l2_buffer *b = gn_fake_fill(&fake, k, 128);
            b->flags = cases[i].flags;
            b->timestamp = (struct timeval){cases[i].sec, cases[i].usec};
            assert_int_equal(read_picture(source).time_ns, fake.now_ns);
            expect_news(source, k == 0 ? "no time of the monotonic clock" : "");
        }
        gn_source_close(&source);
        gn_fake_finish(&fake);
    }
}

/* Unplugged: told once, closed; plugged in again: found, set as before, told once, counted. */
static void replug(int way)
{
    struct gn_fake fake;
    gn_fake_init(&fake);
    const struct gn_live_options wanted = {
        .is_8_bit = true, .width = 320, .height = 240, .has_gain = true, .gain = 99};
    struct gn_source *source = open_camera(&fake, &wanted);
    gn_fake_fill(&fake, 5, 128);
    read_picture(source);
    if (way == 0)
        fake.is_gone = true; // ENODEV from every call
    else if (way == 1)
        fake.wait_events = POLLERR; // only poll() knows
    else
        fake.fail_dequeue = -EIO; // the driver failed
    expect_news(source, way == 2 ? "Input/output error" : "unplugged");
    assert_true(source->fd == -1 && fake.n_open == 0 && fake.n_mapped == 0);
    fake.is_gone = true;
    for (int i = 0; i < 40; i++) // two seconds without it
        expect_news(source, "");
    assert_in_range(fake.now_ns, 1001500 * GN_NS_PER_MS, 1002000 * GN_NS_PER_MS); // no spinning
    fake.is_gone = false;
    fake.wait_events = fake.fail_dequeue = 0;
    gn_fake_get_control(&fake, V4L2_CID_GAIN)->value = 7; // as after power on
    fake.pix.width = 640;
    fake.pix.height = 480;
    int64_t back_ns = fake.now_ns;
    while (get_counts(source).n_reopened == 0 && fake.now_ns < back_ns + GN_NS_PER_S) {
        struct gn_capture capture;
        struct gn_error error = {0};
        assert_int_equal(gn_source_read(source, &capture, &error), -EAGAIN);
        if (get_counts(source).n_reopened)
            assert_non_null(strstr(error.text, "is back"));
    }
    assert_true(fake.now_ns - back_ns <= 300 * GN_NS_PER_MS);
    assert_true(fake.n_streaming && source->fd >= 0);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_GAIN)->value, 99);
    gn_fake_fill(&fake, 0, 128); // its numbers begin anew
    struct gn_capture capture = read_picture(source);
    assert_true(capture.width == 320 && capture.height == 240);
    struct gn_source_counts n = get_counts(source);
    assert_true(n.n_reopened == 1 && n.n_lost == 0 && n.n_read == 2);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void test_unplugged_and_plugged_in_again(void **state)
{
    (void)state;
    for (int way = 0; way < 3; way++)
        replug(way);
}

/* What was left to the camera stays as it was at first, though it has forgotten. */
static void test_what_comes_back_gives_the_same_pictures(void **state)
{
    (void)state;
    static const uint32_t formats[] = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_Y16, 0};
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, &(struct gn_live_options){0});
    fake.is_gone = true;
    expect_news(source, "unplugged");
    fake.is_gone = false;
    fake.pix.width = 320;
    fake.pix.height = 240;
    fake.formats = formats; // and it has a better one
    expect_news(source, "is back");
    gn_fake_fill(&fake, 0, 128);
    struct gn_capture c = read_picture(source);
    assert_true(c.width == 640 && c.height == 480 && c.format == GN_CAPTURE_RGB8);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void test_what_comes_back_is_not_the_camera(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source =
        open_camera(&fake, &(struct gn_live_options){.width = 640, .height = 480});
    fake.is_gone = true;
    expect_news(source, "unplugged");
    fake.is_gone = false;
    fake.card = "Other\x1b[2J";
    expect_news(source, "another camera (Other?[2J) is there; waiting for Fake");
    for (int i = 0; i < 20; i++)
        expect_news(source, ""); // told once
    fake.card = "Fake";
    fake.max_width = 320; // behind a hub that is slower
    struct gn_capture capture;
    struct gn_error error = {0};
    int n_told = 0;
    for (int i = 0; i < 30; i++) {
        assert_int_equal(gn_source_read(source, &capture, &error), -EAGAIN);
        n_told += strstr(error.text, "no 640x480 in YUYV; it has 320x240@25") != NULL;
    }
    assert_true(n_told == 1 && fake.n_open == 0);
    fake.max_width = 640;
    for (int i = 0; i < 6; i++)
        (void)!gn_source_read(source, &capture, &error);
    assert_int_equal(get_counts(source).n_reopened, 1);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/** How long it is waited for a picture until the camera counts as lost. */
static int64_t wait_until_lost(struct gn_fake *fake, struct gn_source *source)
{
    int64_t last_ns = fake->now_ns;
    struct gn_capture capture;
    struct gn_error error = {0};
    while (!error.text[0] && fake->now_ns < last_ns + 20 * GN_NS_PER_S)
        assert_int_equal(gn_source_read(source, &capture, &error), -EAGAIN);
    assert_non_null(strstr(error.text, "no picture comes any more"));
    return fake->now_ns - last_ns;
}

static void test_a_camera_that_stalls_is_opened_again(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    gn_fake_fill(&fake, 0, 128);
    read_picture(source);
    assert_in_range(wait_until_lost(&fake, source), GN_NS_PER_S, GN_NS_PER_S + 100 * GN_NS_PER_MS);
    expect_news(source, "is back");
    assert_int_equal(fake.n_opened, 2);
    gn_fake_fill(&fake, 0, 128);
    read_picture(source);
    fake.has_event = true; // the driver says that what comes in has changed
    expect_news(source, "its pictures have changed");
    expect_news(source, "is back");
    assert_int_equal(get_counts(source).n_reopened, 2);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void test_first_pictures_and_long_exposures_have_time(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE)->query.maximum = 10000; // 1 s
    struct gn_source *source = open_camera(&fake, &(struct gn_live_options){.exposure_us = 600000});
    int64_t waited_ns = wait_until_lost(&fake, source);
    assert_in_range(waited_ns, 5 * GN_NS_PER_S, 5 * GN_NS_PER_S + 100 * GN_NS_PER_MS);
    expect_news(source, "is back");
    gn_fake_fill(&fake, 0, 128);
    read_picture(source);
    waited_ns = wait_until_lost(&fake, source); // five times 0.6 s
    assert_in_range(waited_ns, 3 * GN_NS_PER_S, 3 * GN_NS_PER_S + 100 * GN_NS_PER_MS);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* Where the machine stood still, and its cameras with it, nothing was looked for. */
static void test_time_not_looked_at_is_no_silence(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    struct gn_source *source = open_camera(&fake, NULL);
    fake.now_ns += GN_NS_PER_S * 30; // before the first picture, too
    expect_news(source, "");
    for (uint32_t i = 0; i < 20; i++) {
        gn_fake_fill(&fake, i, 128);
        read_picture(source);
        fake.now_ns += GN_NS_PER_S * 3;
        expect_news(source, "");
        expect_news(source, "");
    }
    assert_int_equal(fake.n_opened, 1);
    int64_t still_ns = fake.now_ns;
    struct gn_capture capture;
    struct gn_error error = {0};
    for (int i = 0; !error.text[0] && i < 100; i++) { // a reader that seldom looks finds out, too
        fake.now_ns += GN_NS_PER_S;
        assert_int_equal(gn_source_read(source, &capture, &error), -EAGAIN);
    }
    assert_non_null(strstr(error.text, "no picture comes any more"));
    assert_in_range(fake.now_ns - still_ns, 8 * GN_NS_PER_S, 12 * GN_NS_PER_S);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static void bend_width(struct v4l2_pix_format *pix)
{
    pix->width = 0;
}

static void bend_size(struct v4l2_pix_format *pix)
{
    pix->sizeimage = 640 * 480 * 2 - 1;
}

static void bend_format(struct v4l2_pix_format *pix)
{
    pix->pixelformat = V4L2_PIX_FMT_RGB24;
}

static void test_drivers_that_lie_at_the_start(void **state)
{
    (void)state;
    static const uint32_t counts[] = {0x10000, 1, 33, UINT32_MAX};
    static const uint32_t lengths[] = {1, 640 * 480 * 2 - 1, (1u << 29) + 1, UINT32_MAX};
    struct gn_fake fake;
    gn_fake_init(&fake);
    for (size_t i = 0; i < 4; i++) {
        fake.n_given = counts[i];
        assert_int_equal(refuse(&fake, "buffers; 2 to 32 are needed"), -EPROTO);
    }
    fake.n_given = 0;
    for (size_t i = 0; i < 4; i++) {
        fake.length = lengths[i];
        assert_int_equal(refuse(&fake, "a picture takes 614400"), -EPROTO);
    }
    fake.length = 0;
    fake.bend_format = bend_width;
    assert_int_equal(refuse(&fake, "sides are in [1, 16384]"), -EINVAL);
    fake.pix.width = 640;
    fake.bend_format = bend_size;
    assert_int_equal(refuse(&fake, "cannot hold YUYV pictures of 640x480"), -EINVAL);
    fake.bend_format = bend_format;
    assert_int_equal(refuse(&fake, "no 640x480 in YUYV; it has 320x240@25, 640x480@25"), -EINVAL);
    fake.bend_format = NULL;
    fake.fail_format = -EBUSY;
    assert_int_equal(refuse(&fake, "another program streams from it"), -EBUSY);
    fake.fail_format = 0;
    fake.fail_buffers = -EBUSY;
    assert_int_equal(refuse(&fake, "another program streams from it"), -EBUSY);
    fake.fail_buffers = 0;
    fake.fail_open = -EACCES;
    assert_int_equal(refuse(&fake, "group 'video'"), -EACCES);
    fake.fail_open = 0;
    fake.is_gone = true;
    assert_int_equal(refuse(&fake, "no camera there"), -ENODEV);
    gn_fake_finish(&fake);
}

static void test_drivers_that_lie_about_buffers(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        struct gn_fake fake;
        gn_fake_init(&fake);
        struct gn_source *source = open_camera(&fake, NULL);
        gn_fake_fill(&fake, 0, 128);
        struct v4l2_buffer *b = gn_fake_fill(&fake, 1, 128);
        b->index = i == 0 ? 5 : i == 1 ? UINT32_MAX : fake.filled[0].index; // it has 0 to 4
        struct gn_capture capture;
        struct gn_error error = {0};
        assert_int_equal(gn_source_read(source, &capture, &error), -EPROTO);
        assert_non_null(strstr(error.text, "a buffer that it does not have"));
        assert_int_equal(fake.n_open, 0);
        gn_source_close(&source);
        gn_fake_finish(&fake);
    }
}

/* Lists without end and buffers that never run dry: every call returns. */
static void test_drivers_without_end(void **state)
{
    (void)state;
    struct gn_fake fake;
    gn_fake_init(&fake);
    fake.is_endless = true;
    const struct gn_live_options options = {.id = "/dev/video3", .width = 640, .height = 480};
    struct gn_source *source = NULL;
    struct gn_error error = {0};
    assert_int_equal(gn_v4l2_open_through(&fake.io, &options, &source, &error), -EINVAL);
    assert_non_null(strstr(error.text, "it has 320x240@25, 320x240@25"));
    fake.pix.width = 320;
    fake.pix.height = 240;
    source = open_camera(&fake, NULL);
    for (int i = 0; i < 5; i++)
        read_picture(source);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* Codes of 16 bits are given where the driver put them. */
static void test_nothing_is_copied_that_need_not_be(void **state)
{
    (void)state;
    static const uint32_t formats[] = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_Y12, 0};
    struct gn_fake fake;
    gn_fake_init(&fake);
    fake.formats = formats;
    struct gn_source *source = open_camera(&fake, &(struct gn_live_options){0});
    gn_fake_fill(&fake, 0, 0x0d);
    struct gn_capture c = read_picture(source);
    assert_int_equal(c.format, GN_CAPTURE_MONO12);
    assert_ptr_equal(c.data, fake.memory[0]);
    assert_int_equal(c.data_bytes, 640 * 480 * 2);
    assert_int_equal(c.data[1] << 8 | c.data[0], 0x0d0d);
    gn_fake_fill(&fake, 1, 0x0e); // never into the one that is lent
    assert_int_equal(c.data[0], 0x0d);
    assert_int_equal(read_picture(source).data[0], 0x0e);
    assert_int_equal(get_counts(source).copied_bytes, 0);
    gn_fake_fill(&fake, 2, 0x10); // 0x1010 has thirteen bits
    expect_news(source, "more bits than its format has");
    assert_int_equal(get_counts(source).n_incomplete, 1);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* Where the driver has only two buffers none is kept from it, and one that fills what it was not
 * given is not trusted with any: what would be lent is copied. */
static void test_what_cannot_be_lent_is_copied(void **state)
{
    (void)state;
    static const uint32_t formats[] = {V4L2_PIX_FMT_Y12, 0};
    for (int way = 0; way < 2; way++) {
        struct gn_fake fake;
        gn_fake_init(&fake);
        fake.formats = formats;
        if (way == 0)
            fake.n_given = 2;
        else
            fake.driver = "v4l2 loopback";
        struct gn_source *source = open_camera(&fake, &(struct gn_live_options){0});
        gn_fake_fill(&fake, 0, 0x0d);
        struct gn_capture c = read_picture(source);
        assert_true(fake.is_queued[0] && fake.is_queued[1]);
        gn_fake_fill(&fake, 1, 0x0e);
        gn_fake_fill(&fake, 2, 0x0f);
        assert_int_equal(c.data[0], 0x0d);
        assert_int_equal(c.data[c.data_bytes - 1], 0x0d);
        assert_int_equal(read_picture(source).data[0], 0x0f);
        struct gn_source_counts n = get_counts(source);
        assert_true(n.n_skipped == 1 && n.copied_bytes == n.read_bytes && n.n_read == 2);
        gn_source_close(&source);
        gn_fake_finish(&fake);
    }
}

static size_t make_jpeg(int width, int height, uint8_t *out, size_t capacity)
{
    struct gn_jpeg *jpeg = NULL;
    struct gn_image8 image;
    size_t n = 0;
    assert_int_equal(gn_jpeg_create(&jpeg), 0);
    assert_int_equal(gn_image8_init(&image, width, height, 3), 0);
    assert_int_equal(gn_jpeg_encode(jpeg, &image, NULL, out, capacity, &n, NULL), 0);
    gn_image8_finish(&image);
    gn_jpeg_destroy(&jpeg);
    return n;
}

static void test_mjpeg_passes_as_jpeg(void **state)
{
    (void)state;
    static const uint32_t formats[] = {V4L2_PIX_FMT_MJPEG, 0};
    static uint8_t file[640 * 480 * 8];
    struct gn_fake fake;
    gn_fake_init(&fake);
    fake.formats = formats;
    struct gn_source *source = open_camera(&fake, NULL);
    size_t n = make_jpeg(640, 480, file, sizeof(file));
    struct v4l2_buffer *b = gn_fake_fill(&fake, 0, 0);
    memcpy(fake.memory[b->index], file, n);
    b->bytesused = (uint32_t)n;
    struct gn_capture c = read_picture(source);
    assert_int_equal(c.format, GN_CAPTURE_JPEG);
    assert_true(c.data_bytes == n && memcmp(c.data, file, n) == 0);
    assert_int_equal(get_counts(source).copied_bytes, 0);
    b = gn_fake_fill(&fake, 1, 0); // zeros are no JPEG
    b->bytesused = 1000;
    expect_news(source, "no JPEG of the size that was set");
    for (int i = 0; i < 2; i++) {
        n = make_jpeg(i ? 640 : 320, i ? 240 : 480, file, sizeof(file));
        b = gn_fake_fill(&fake, (uint32_t)(2 + i), 0);
        memcpy(fake.memory[b->index], file, n);
        b->bytesused = (uint32_t)n;
        expect_news(source, "");
    }
    b = gn_fake_fill(&fake, 4, 0);
    b->bytesused = 0;
    expect_news(source, "");
    b = gn_fake_fill(&fake, 5, 0xff);
    b->bytesused = fake.pix.sizeimage + 1;
    expect_news(source, "");
    assert_int_equal(get_counts(source).n_incomplete, 5);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* By a cable, for example; what is left in the buffer behind a whole one is no matter. */
static void test_mjpeg_that_is_cut_is_incomplete(void **state)
{
    (void)state;
    static const uint32_t formats[] = {V4L2_PIX_FMT_MJPEG, 0};
    static uint8_t file[640 * 480 * 8];
    struct gn_fake fake;
    gn_fake_init(&fake);
    fake.formats = formats;
    struct gn_source *source = open_camera(&fake, NULL);
    size_t n = make_jpeg(640, 480, file, sizeof(file));
    uint64_t n_cut = 0;
    for (size_t cut = 1; cut < n / 2; cut = 2 * cut + 1, n_cut++) {
        struct v4l2_buffer *b = gn_fake_fill(&fake, 0, 0);
        memcpy(fake.memory[b->index], file, n - cut);
        b->bytesused = (uint32_t)(n - cut);
        expect_news(source, cut == 1 ? "holds a JPEG without its end" : "");
    }
    assert_true(n_cut > 5 && get_counts(source).n_incomplete == n_cut);
    struct v4l2_buffer *b = gn_fake_fill(&fake, 0, 0x77);
    memcpy(fake.memory[b->index], file, n);
    b->bytesused = (uint32_t)n + 999;
    assert_int_equal(read_picture(source).data_bytes, n + 999);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* A JPEG may be as long as its buffer; where none is lent that is the room it is copied into. */
static void test_jpegs_of_any_length_are_copied(void **state)
{
    (void)state;
    static const uint32_t formats[] = {V4L2_PIX_FMT_MJPEG, 0};
    static uint8_t file[640 * 480 * 8];
    struct gn_fake fake;
    gn_fake_init(&fake);
    fake.formats = formats;
    fake.n_given = 2;
    struct gn_source *source = open_camera(&fake, NULL);
    struct v4l2_buffer *b = gn_fake_fill(&fake, 0, 0xff); // what is behind a JPEG is no one's
    uint8_t *data = fake.memory[b->index];
    memcpy(data, file, make_jpeg(640, 480, file, sizeof(file)));
    b->bytesused = fake.pix.sizeimage;
    struct gn_capture c = read_picture(source);
    assert_int_equal(c.data_bytes, fake.pix.sizeimage);
    assert_ptr_not_equal(c.data, data);
    assert_memory_equal(c.data, data, c.data_bytes);
    assert_int_equal(get_counts(source).copied_bytes, c.data_bytes);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

static int get_value(struct gn_fake *fake, uint32_t id)
{
    return gn_fake_get_control(fake, id)->value;
}

/* Held by its time: all that is automatic is off meanwhile, and all is as before in the end. */
static void test_exposure_is_held_and_put_back(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    struct gn_exposure range;
    double took = 0;
    gn_fake_init(&fake);
    gn_fake_add_control(&fake, V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic", 0, 1, 1);
    gn_fake_add_control(&fake, V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1);
    gn_fake_add_control(&fake, V4L2_CID_AUTOGAIN, "Gain, Automatic", 0, 1, 1);
    gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE)->query.step = 5;
    struct gn_source *source = open_camera(&fake, NULL);
    assert_int_equal(gn_source_restore_exposure(source, &error), 0); // nothing is held
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_COUNTS, &range, &error), -ENOTSUP);
    assert_non_null(strstr(error.text, "its exposure is set by times, not by counts: give a unit"));
    assert_int_equal(get_value(&fake, V4L2_CID_AUTOGAIN), 1);
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_US, &range, &error), 0);
    assert_true(range.now == 25000 && range.least == 300 && range.most == 204700);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_AUTOGAIN), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_AUTO_WHITE_BALANCE), 0);
    assert_int_equal(gn_source_set_exposure(source, 8710, &took, &error), 0);
    assert_true(took == 8500); // steps of 500 us: what it took, not what was asked
    assert_int_equal(gn_source_set_exposure(source, 3e5, &took, &error), -ERANGE);
    assert_non_null(strstr(error.text, "exposure 300000 us is not in [300, 204700] us"));
    assert_int_equal(gn_source_restore_exposure(source, &error), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_ABSOLUTE), 250);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_APERTURE_PRIORITY);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_AUTO_PRIORITY), 1);
    assert_int_equal(get_value(&fake, V4L2_CID_AUTOGAIN), 1);
    assert_int_equal(get_value(&fake, V4L2_CID_AUTO_WHITE_BALANCE), 1);
    // An automatic had come to what cannot be set by hand.
    gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE)->value = 252;
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_US, &range, &error), 0);
    assert_int_equal(gn_source_restore_exposure(source, &error), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_ABSOLUTE), 250);
    // Plugged in again: its automatics are as they were made.
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_US, &range, &error), 0);
    gn_fake_get_control(&fake, V4L2_CID_AUTOGAIN)->value = 1;
    gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_AUTO)->value = V4L2_EXPOSURE_AUTO;
    assert_int_equal(gn_source_set_exposure(source, 5000, &took, &error), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_AUTOGAIN), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
    assert_int_equal(gn_source_restore_exposure(source, &error), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_AUTOGAIN), 1);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_APERTURE_PRIORITY);
    gn_fake_fill(&fake, 0, 128); // its exposure is its own matter again
    assert_int_equal(read_picture(source).time_ns, fake.now_ns);
    fake.is_gone = true;
    assert_true(gn_source_hold_exposure(source, GN_EXPOSURE_US, &range, &error) < 0);
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

/* A sensor that counts lines; a camera without either. */
static void test_exposure_by_counts_or_not_at_all(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    struct gn_exposure range;
    double took = 0;
    gn_fake_init(&fake);
    struct v4l2_queryctrl *q = &gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE)->query;
    q->id = V4L2_CID_EXPOSURE;
    struct gn_source *source = open_camera(&fake, NULL);
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_US, &range, &error), -ENOTSUP);
    assert_non_null(strstr(error.text, "it counts its exposure: no times can be set"));
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_COUNTS, &range, &error), 0);
    assert_true(range.now == 250 && range.least == 3 && range.most == 2047);
    assert_int_equal(gn_source_set_exposure(source, 2047.5, &took, &error), 0);
    assert_true(took == 2047); // what lies between is rounded, but not to what it refuses
    assert_int_equal(gn_source_set_exposure(source, 100, &took, &error), 0);
    assert_true(took == 100);
    assert_int_equal(gn_source_restore_exposure(source, &error), 0);
    assert_int_equal(get_value(&fake, V4L2_CID_EXPOSURE), 250);
    q->flags = V4L2_CTRL_FLAG_READ_ONLY;
    assert_int_equal(gn_source_hold_exposure(source, GN_EXPOSURE_COUNTS, &range, &error), -ENOTSUP);
    assert_non_null(strstr(error.text, "no exposure can be set; it has gain"));
    gn_source_close(&source);
    gn_fake_finish(&fake);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pictures_come_with_their_time),
        cmocka_unit_test(test_newest_wins_and_gaps_are_counted),
        cmocka_unit_test(test_bad_buffers_are_counted_and_not_given),
        cmocka_unit_test(test_times_are_the_middle_of_the_exposure),
        cmocka_unit_test(test_times_of_an_exposure_to_come),
        cmocka_unit_test(test_times_are_never_ahead),
        cmocka_unit_test(test_times_never_go_back),
        cmocka_unit_test(test_times_that_are_none),
        cmocka_unit_test(test_unplugged_and_plugged_in_again),
        cmocka_unit_test(test_what_comes_back_gives_the_same_pictures),
        cmocka_unit_test(test_what_comes_back_is_not_the_camera),
        cmocka_unit_test(test_a_camera_that_stalls_is_opened_again),
        cmocka_unit_test(test_first_pictures_and_long_exposures_have_time),
        cmocka_unit_test(test_time_not_looked_at_is_no_silence),
        cmocka_unit_test(test_drivers_that_lie_at_the_start),
        cmocka_unit_test(test_drivers_that_lie_about_buffers),
        cmocka_unit_test(test_drivers_without_end),
        cmocka_unit_test(test_nothing_is_copied_that_need_not_be),
        cmocka_unit_test(test_what_cannot_be_lent_is_copied),
        cmocka_unit_test(test_mjpeg_passes_as_jpeg),
        cmocka_unit_test(test_mjpeg_that_is_cut_is_incomplete),
        cmocka_unit_test(test_jpegs_of_any_length_are_copied),
        cmocka_unit_test(test_exposure_is_held_and_put_back),
        cmocka_unit_test(test_exposure_by_counts_or_not_at_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
