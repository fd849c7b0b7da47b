/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a tracker says of bodies whose markers are where they are listed, elsewhere, or not there;
 * and pictures of all formats. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/grey.h"
#include "client/track/tracker.h"
#include "tests/unit/cmocka_setup.h"
#include "tests/unit/paper.h"

enum { WIDTH = GN_PAPER_WIDTH, HEIGHT = GN_PAPER_HEIGHT };

/** A marker of 48 mm whose middle is there, mm, y up. */
static void list_marker(int id, double x_mm, double y_mm, struct gn_body_marker *out)
{
    static const double signs[4][2] = {{-1, 1}, {1, 1}, {1, -1}, {-1, -1}};
    out->id = id;
    for (int k = 0; k < 4; k++) {
        out->corners_body[k][0] = (x_mm + 24 * signs[k][0]) * 1e-3;
        out->corners_body[k][1] = (y_mm + 24 * signs[k][1]) * 1e-3;
        out->corners_body[k][2] = 0;
    }
}

static struct gn_tracker *create(const struct gn_bodies *bodies, bool is_raw)
{
    struct gn_tracker *tracker = NULL;
    const struct gn_tracker_options options = {
        .camera = &gn_paper_camera, .bodies = bodies, .is_raw = is_raw};
    assert_int_equal(gn_tracker_create(&options, &tracker, NULL), 0);
    return tracker;
}

/** What is drawn, in grey of 12 bits. */
static int show(struct gn_tracker *tracker, int64_t time_ns)
{
    static uint8_t data[2 * WIDTH * HEIGHT];
    const struct gn_grey grey = gn_paper_get_grey();
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        unsigned code = grey.pixels[i] * 16u;
        data[2 * i] = (uint8_t)code;
        data[2 * i + 1] = (uint8_t)(code >> 8);
    }
    const struct gn_capture capture = {.name = "paper",
                                       .width = WIDTH,
                                       .height = HEIGHT,
                                       .format = GN_CAPTURE_MONO12,
                                       .data = data,
                                       .data_bytes = sizeof(data)};
    return gn_tracker_update(tracker, &capture, time_ns, NULL);
}

static void far_off_is_not_seen_and_a_little_off_is_told(void **state)
{
    (void)state;
    static const double off_mm[] = {0, 6, 40};
    double error_m[2] = {0};
    for (int i = 0; i < 3; i++) {
        struct gn_body_marker markers[2];
        list_marker(7, 0, 0, &markers[0]);
        list_marker(9, 100, off_mm[i], &markers[1]);
        const struct gn_bodies bodies = {
            .n_bodies = 1, .bodies = {{.name = "world", .n_markers = 2, .markers = markers}}};
        struct gn_tracker *tracker = create(&bodies, true);
        char why[256] = "";
        gn_paper_clear();
        gn_paper_put(7, 30, 56, 8);
        gn_paper_put(9, 130, 56, 8);
        assert_int_equal(show(tracker, 0), i < 2);
        const struct gn_tracked_body *b = gn_tracker_get_body(tracker, 0);
        assert_true(b->is_seen == (i < 2) && b->is_misfit == (i > 0) && b->n_markers == 2);
        assert_int_equal(gn_tracker_is_doubtful(tracker), i > 0);
        assert_int_equal(gn_tracker_explain(tracker, why, sizeof(why)), i > 0);
        assert_true(i == 0 || strstr(why, "(seen: 7, 9) are not where they are listed"));
        if (i == 0) {
            const double *t = b->camera_from_body.translation;
            assert_true(fabs(t[0] + 0.066) < 1e-4 && fabs(t[1]) < 1e-4 && fabs(t[2] - 0.4) < 5e-4);
        }
        if (i < 2)
            error_m[i] = b->fit.error_m;
        gn_tracker_destroy(&tracker);
    }
    // Corners off by some millimetres are some pixels off, a hundred times what is expected of
    // them.
    assert_true(error_m[1] > 20 * error_m[0]);
}

static void strangers_are_told_where_a_body_is_missing(void **state)
{
    (void)state;
    struct gn_body_marker markers[2];
    list_marker(7, 0, 0, &markers[0]);
    list_marker(9, 0, 0, &markers[1]);
    const struct gn_bodies bodies = {
        .n_bodies = 2,
        .bodies = {{.name = "world", .n_markers = 1, .markers = markers},
                   {.name = "box", .n_markers = 1, .markers = markers + 1}}};
    for (int is_there = 0; is_there < 2; is_there++) {
        struct gn_tracker *tracker = create(&bodies, true);
        char why[256] = "";
        gn_paper_clear();
        gn_paper_put(7, 10, 10, 8);
        gn_paper_put(3, 90, 90, 8);
        if (is_there)
            gn_paper_put(9, 170, 10, 8);
        assert_int_equal(show(tracker, 0), 1 + is_there);
        assert_int_equal(gn_tracker_is_doubtful(tracker), !is_there);
        assert_int_equal(gn_tracker_explain(tracker, why, sizeof(why)), !is_there);
        if (!is_there)
            assert_string_equal(why, "no marker of \"box\" is seen, but of 4x4_50 there is id 3, "
                                     "which no body has");
        gn_tracker_destroy(&tracker);
    }
}

static void each_picture_has_its_own_pose_whatever_its_time(void **state)
{
    (void)state;
    struct gn_body_marker marker;
    list_marker(7, 0, 0, &marker);
    const struct gn_bodies bodies = {
        .n_bodies = 1, .bodies = {{.name = "world", .n_markers = 1, .markers = &marker}}};
    static const int64_t times_ns[] = {1000000000, 1000000000, 999999999, 1016000000};
    struct gn_tracker *tracker = create(&bodies, false);
    for (int i = 0; i < 4; i++) {
        double x = i < 3 ? 30 + 20 * i : 72; // face on, to the pixel
        gn_paper_clear();
        gn_paper_put(7, x, 56, 8);
        assert_int_equal(show(tracker, times_ns[i]), 1);
        const struct gn_tracked_body *b = gn_tracker_get_body(tracker, 0);
        double off = b->camera_from_body.translation[0] - (x + 24 - 120) * 1e-3;
        // The last one is made steady with the first one, from 42 mm away.
        assert_true(i < 3 ? fabs(off) < 5e-4 : off < -2e-3);
    }
    gn_tracker_destroy(&tracker);
}

/** Writes one channel of a pixel. */
static void put_code(uint8_t *data, int n_bytes, unsigned code)
{
    data[0] = (uint8_t)code;
    if (n_bytes == 2)
        data[1] = (uint8_t)(code >> 8);
}

static void grey_of_all_formats(void **state)
{
    (void)state;
    static const struct {
        enum gn_capture_format format;
        int channels, bytes;
        unsigned full;
    } formats[] = {{GN_CAPTURE_RGB8, 3, 1, 255},
                   {GN_CAPTURE_MONO12, 1, 2, 4095},
                   {GN_CAPTURE_MONO16, 1, 2, 65535},
                   {GN_CAPTURE_RGB12, 3, 2, 4095},
                   {GN_CAPTURE_RGB16, 3, 2, 65535}};
    // Of full scale; luma of Rec.601.
    static const double colours[][3] = {
        {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {0.2, 0.5, 0.9}};
    enum { N = GN_ARRAY_LEN(colours) };
    for (size_t i = 0; i < GN_ARRAY_LEN(formats); i++) {
        int channels = formats[i].channels, bytes = formats[i].bytes;
        uint8_t data[N * 6] = {0};
        struct gn_image8 grey = {0};
        struct gn_capture capture = {.name = "five",
                                     .width = N,
                                     .height = 1,
                                     .format = formats[i].format,
                                     .data = data,
                                     .data_bytes = (size_t)(N * channels * bytes)};
        assert_int_equal(gn_image8_init(&grey, N, 1, 1), 0);
        for (int k = 0; k < N * channels; k++)
            put_code(data + k * bytes, bytes,
                     (unsigned)lround(colours[k / channels][k % channels] * formats[i].full));
        assert_int_equal(gn_grey_from_capture(&capture, NULL, &grey, NULL), 0);
        for (int k = 0; k < N; k++) {
            const double *c = colours[k];
            double right = channels == 1 ? c[0] : 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2];
            assert_true(fabs(grey.data[k] - 255 * right) <= 1.1);
        }
        capture.data_bytes--;
        assert_int_equal(gn_grey_from_capture(&capture, NULL, &grey, NULL), -EINVAL);
        // A camera that sends codes above its format's has white, not what is left of them.
        memset(data, 0x10, sizeof(data));
        capture.data_bytes++;
        assert_int_equal(gn_grey_from_capture(&capture, NULL, &grey, NULL), 0);
        assert_int_equal(grey.data[0], formats[i].full == 4095 ? 255 : 16);
        capture.format = GN_CAPTURE_RGB_F32;
        assert_int_equal(gn_grey_from_capture(&capture, NULL, &grey, NULL), -EINVAL);
        gn_image8_finish(&grey);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(grey_of_all_formats),
        cmocka_unit_test(far_off_is_not_seen_and_a_little_off_is_told),
        cmocka_unit_test(strangers_are_told_where_a_body_is_missing),
        cmocka_unit_test(each_picture_has_its_own_pose_whatever_its_time),
    };
    const struct CMUnitTest without_opencv[] = {cmocka_unit_test(grey_of_all_formats)};
    return gn_vision_is_built() ? cmocka_run_group_tests(tests, NULL, NULL)
                                : cmocka_run_group_tests(without_opencv, NULL, NULL);
}
