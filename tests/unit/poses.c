/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Poses from pictures that come damaged. */
#include "client/poses.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "client/live.h"
#include "common/jpeg.h"
#include "tests/unit/cmocka_setup.h"
#include "tests/unit/paper.h"

enum { WIDTH = GN_PAPER_WIDTH, HEIGHT = GN_PAPER_HEIGHT };

static const struct gn_option option_table[] = {GN_LIVE_OPTIONS, GN_POSES_OPTIONS};
static const struct gn_program program = {.name = "poses",
                                          .usage = "",
                                          .summary = "",
                                          .options = option_table,
                                          .n_options =
                                              sizeof(option_table) / sizeof(*option_table)};

/* A marker on paper as a webcam gives it. The caller frees it. */
static uint8_t *make_jpeg(size_t *out_bytes)
{
    struct gn_jpeg *jpeg = NULL;
    struct gn_image8 picture = {0};
    size_t room = gn_jpeg_get_bound(WIDTH, HEIGHT);
    uint8_t *data = malloc(room);
    assert_non_null(data);
    gn_paper_clear();
    gn_paper_put(7, 96, 56, 8);
    assert_int_equal(gn_image8_init(&picture, WIDTH, HEIGHT, 1), 0);
    memcpy(picture.data, gn_paper_get_grey().pixels, (size_t)WIDTH * HEIGHT);
    assert_int_equal(gn_jpeg_create(&jpeg), 0);
    assert_int_equal(gn_jpeg_encode(jpeg, &picture, NULL, data, room, out_bytes, NULL), 0);
    gn_jpeg_destroy(&jpeg);
    gn_image8_finish(&picture);
    return data;
}

/* A camera goes on after a picture that a cable has damaged; a damaged file is its user's. */
static void a_damaged_picture_has_no_pose(void **state)
{
    (void)state;
    static char *const words[] = {"poses", "--marker", "4x4_50:7:0.048", NULL};
    struct gn_options *options = NULL;
    struct gn_poses *poses = NULL;
    struct gn_pose place;
    struct gn_error why = {0};
    struct gn_capture capture = {.name = "frame",
                                 .width = WIDTH,
                                 .height = HEIGHT,
                                 .format = GN_CAPTURE_JPEG,
                                 .time_ns = 1000000000};
    uint8_t *data = make_jpeg(&capture.data_bytes);
    capture.data = data;
    assert_int_equal(gn_options_create(&program, &options), 0);
    assert_int_equal(gn_options_read_arguments(options, 3, words, NULL), 0);
    assert_int_equal(gn_poses_open(options, &gn_paper_camera, NULL, &poses, NULL), 0);

    assert_int_equal(gn_poses_take(poses, &capture, &why), 1);
    uint8_t kept[16], *middle = data + capture.data_bytes / 2;
    memcpy(kept, middle, sizeof(kept));
    memset(middle, 0xff, sizeof(kept)); // no code of any block
    capture.time_ns += 40000000;
    assert_int_equal(gn_poses_take(poses, &capture, &why), 0);
    assert_string_equal(why.text, "");
    assert_false(gn_poses_get_camera(poses, &place));
    capture.time_ns = 0;
    assert_int_equal(gn_poses_take(poses, &capture, &why), -EBADMSG);
    assert_non_null(strstr(why.text, "JPEG"));
    memcpy(middle, kept, sizeof(kept));
    capture.time_ns = 1080000000;
    assert_int_equal(gn_poses_take(poses, &capture, &why), 1);
    assert_true(gn_poses_get_camera(poses, &place));

    gn_poses_close(&poses);
    gn_options_destroy(&options);
    free(data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_damaged_picture_has_no_pose)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
