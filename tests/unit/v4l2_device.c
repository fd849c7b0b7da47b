/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What is asked of V4L2 cameras: formats, sizes, rates, controls; refusals name what there is. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "client/capture/v4l2_device.h"
#include "tests/unit/cmocka_setup.h"
#include "tests/unit/v4l2_fake.h"

static const uint32_t many_formats[] = {V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_Y10,
                                        V4L2_PIX_FMT_YUYV,   V4L2_PIX_FMT_GREY,  0};

static struct gn_v4l2_device open_device(struct gn_fake *fake)
{
    struct gn_v4l2_device device;
    struct gn_error error = {0};
    if (gn_v4l2_device_open(&fake->io, "/dev/video3", &device, &error) != 0)
        fail_msg("%s", error.text);
    return device;
}

/* The pixel format that is set, or 0 and the sentence. */
static const char *set_format(struct gn_fake *fake, const struct gn_live_options *options,
                              struct gn_error *error)
{
    struct gn_v4l2_device device = open_device(fake);
    struct gn_v4l2_layout layout;
    int64_t frame_ns = 0;
    int err = gn_v4l2_device_set_format(&device, options, &layout, &frame_ns, error);
    gn_v4l2_device_close(&device);
    if (!err)
        assert_int_equal(frame_ns, fake->interval_ms * 1000000);
    return err ? NULL : layout.pixels->name;
}

static void test_the_format_that_tells_most(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    gn_fake_init(&fake);
    fake.formats = many_formats;
    assert_string_equal(set_format(&fake, &(struct gn_live_options){0}, &error), "Y10");
    assert_string_equal(set_format(&fake, &(struct gn_live_options){.is_8_bit = true}, &error),
                        "YUYV");
    assert_string_equal(
        set_format(&fake, &(struct gn_live_options){.pixel_format = "MJPG"}, &error), "MJPG");
    assert_string_equal(
        set_format(&fake, &(struct gn_live_options){.is_8_bit = true, .pixel_format = "Y10"},
                   &error),
        "Y10");
    gn_fake_finish(&fake);
}

static void test_sizes_and_rates(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    gn_fake_init(&fake);
    struct gn_live_options o = {.is_8_bit = true, .width = 320, .height = 240, .frame_rate_hz = 10};
    assert_non_null(set_format(&fake, &o, &error));
    assert_true(fake.pix.width == 320 && fake.pix.height == 240 && fake.interval_ms == 100);
    o.frame_rate_hz = 0; // as it is
    assert_non_null(set_format(&fake, &o, &error));
    assert_int_equal(fake.interval_ms, 100);
    o.frame_rate_hz = 25.1; // as cameras say 29.97 for 30
    assert_non_null(set_format(&fake, &o, &error));
    assert_int_equal(fake.interval_ms, 40);
    fake.is_silent = true; // the driver takes the nearest that it has
    assert_non_null(set_format(&fake, &o, &error));
    o.frame_rate_hz = 60;
    assert_null(set_format(&fake, &o, &error));
    assert_non_null(strstr(error.text, "no 60 pictures/s at 320x240 in YUYV; it has rates of its"));
    gn_fake_finish(&fake);
}

static void test_refusals_name_what_there_is(void **state)
{
    (void)state;
    static const uint32_t none[] = {V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_Y16_BE, 0};
    static const uint32_t empty[] = {0};
    static const struct {
        const uint32_t *formats;
        struct gn_live_options options;
        const char *says;
    } cases[] = {
        {many_formats,
         {.pixel_format = "NV12"},
         "no pixel format 'NV12' that we read; it has "
         "Y10, YUYV, MJPG, GREY"},
        {many_formats, {.pixel_format = "YU12"}, "it has Y10, YUYV, MJPG, GREY"},
        {none, {0}, "no pixel format that we read; it has YU12, Y16-BE"},
        {empty, {0}, "no pixel format at all"},
        {many_formats,
         {.width = 800, .height = 600, .pixel_format = "YUYV"},
         "no 800x600 in YUYV; it has 320x240@25, 640x480@25"},
        {many_formats,
         {.width = 160, .height = 240},
         "no 160x240 in Y10; it has 320x240@25, 640x480@25"},
        {many_formats,
         {.width = 640, .height = 480, .frame_rate_hz = 60, .pixel_format = "GREY"},
         "no 60 pictures/s at 640x480 in GREY; it has 25, 10"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct gn_fake fake;
        struct gn_error error = {0};
        gn_fake_init(&fake);
        fake.formats = cases[i].formats;
        assert_null(set_format(&fake, &cases[i].options, &error));
        if (!strstr(error.text, cases[i].says) || !strstr(error.text, "/dev/video3 (Fake): "))
            fail_msg("'%s' does not say '%s'", error.text, cases[i].says);
        gn_fake_finish(&fake);
    }
}

static int set_controls(struct gn_fake *fake, const struct gn_live_options *options,
                        struct gn_error *error)
{
    struct gn_v4l2_device device = open_device(fake);
    int err = gn_v4l2_device_set_controls(&device, options, error);
    gn_v4l2_device_close(&device);
    return err;
}

static void test_controls(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    gn_fake_init(&fake);
    gn_fake_add_control(&fake, V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic", 0, 1, 1);
    assert_int_equal(set_controls(&fake, &(struct gn_live_options){0}, &error), 0);
    const struct gn_live_options exposure = {.exposure_us = 8040};
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_AUTO)->value,
                     V4L2_EXPOSURE_APERTURE_PRIORITY); // left as it is
    assert_int_equal(set_controls(&fake, &exposure, &error), 0);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_AUTO_PRIORITY)->value, 0);
    const struct gn_live_options o = {.exposure_us = 8040,
                                      .has_gain = true,
                                      .gain = 12,
                                      .controls = "exposure_dynamic=1,gain=13"};
    if (set_controls(&fake, &o, &error) != 0)
        fail_msg("%s", error.text);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_AUTO)->value,
                     V4L2_EXPOSURE_MANUAL);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE)->value, 80);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_AUTO_PRIORITY)->value, 1);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_GAIN)->value, 13); // the last word
    gn_fake_add_control(&fake, V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1);
    gn_fake_add_control(&fake, V4L2_CID_AUTOGAIN, "Gain, Automatic", 0, 1, 1);
    const struct gn_live_options lock = {.is_white_balance_locked = true};
    assert_int_equal(set_controls(&fake, &lock, &error), 0);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_AUTO_WHITE_BALANCE)->value, 0);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_AUTOGAIN)->value, 1);
    const struct gn_live_options gain = {.has_gain = true};
    assert_int_equal(set_controls(&fake, &gain, &error), 0);
    assert_int_equal(gn_fake_get_control(&fake, V4L2_CID_AUTOGAIN)->value, 0);
    gn_fake_finish(&fake);
}

static void test_controls_that_are_refused(void **state)
{
    (void)state;
    static const struct {
        struct gn_live_options options;
        const char *says;
    } cases[] = {
        {{.exposure_us = 1e6}, "exposure 1e+06 us is not in [300, 204700] us"},
        {{.exposure_us = 100}, "is not in [300, 204700] us"},
        {{.has_gain = true, .gain = 256}, "gain 256 is no whole number in [0, 255]"},
        {{.has_gain = true, .gain = 1.5}, "gain 1.5 is no whole number"},
        {{.is_white_balance_locked = true},
         "no automatic white balance that could be locked; it has gain, exposure_auto, "
         "exposure_absolute"},
        {{.controls = "zoom=3"}, "no control 'zoom'; it has gain, "},
        {{.controls = "gain"}, "right would be NAME=NUMBER"},
        {{.controls = "gain=3x"}, "right would be NAME=NUMBER"},
        {{.controls = "gain=1e99"}, "is no whole number in [0, 255]"},
        {{.controls = "gain=nan"}, "is no whole number in [0, 255]"},
        {{.controls = "gain=3,,"}, "right would be NAME=NUMBER"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct gn_fake fake;
        struct gn_error error = {0};
        gn_fake_init(&fake);
        assert_int_equal(set_controls(&fake, &cases[i].options, &error), -EINVAL);
        if (!strstr(error.text, cases[i].says))
            fail_msg("'%s' does not say '%s'", error.text, cases[i].says);
        gn_fake_finish(&fake);
    }
}

/* Counts of 100 us up to what a number holds, and a time half a step above the last. */
static void test_exposures_at_the_end_of_all_numbers(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    gn_fake_init(&fake);
    struct gn_fake_control *c = gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE);
    const struct gn_live_options last = {.exposure_us = 204749};
    assert_int_equal(set_controls(&fake, &last, &error), 0);
    assert_int_equal(c->value, 2047);
    const struct gn_live_options more = {.exposure_us = 204750};
    assert_int_equal(set_controls(&fake, &more, &error), 0);
    assert_int_equal(c->value, 2047);
    c->query.maximum = INT32_MAX;
    const struct gn_live_options least = {.exposure_us = 1};
    assert_int_equal(set_controls(&fake, &least, &error), -EINVAL);
    assert_non_null(strstr(error.text, "is not in [300, 2.14748e+11] us"));
    gn_fake_finish(&fake);
}

static void test_controls_that_do_not_take(void **state)
{
    (void)state;
    struct gn_fake fake;
    struct gn_error error = {0};
    gn_fake_init(&fake);
    gn_fake_get_control(&fake, V4L2_CID_GAIN)->query.step = 16;
    const struct gn_live_options gain = {.has_gain = true, .gain = 20};
    assert_int_equal(set_controls(&fake, &gain, &error), -EINVAL);
    assert_non_null(strstr(error.text, "gain was set to 20 and is 16; it goes in steps"));
    gn_fake_get_control(&fake, V4L2_CID_GAIN)->query.flags = V4L2_CTRL_FLAG_READ_ONLY;
    assert_int_equal(set_controls(&fake, &gain, &error), -EINVAL);
    assert_non_null(strstr(error.text, "no gain can be set; it has exposure_auto, "));
    gn_fake_get_control(&fake, V4L2_CID_EXPOSURE_ABSOLUTE)->query.flags = V4L2_CTRL_FLAG_DISABLED;
    const struct gn_live_options exposure = {.exposure_us = 1000};
    assert_int_equal(set_controls(&fake, &exposure, &error), -EINVAL);
    assert_non_null(strstr(error.text, "no exposure time can be set; it has exposure_auto"));
    gn_fake_finish(&fake);
}

/* Lines into one text. */
static void say(void *context, int indent, const char *line)
{
    char *text = context;
    size_t n = strlen(text);
    snprintf(text + n, 1000 - n, "%s%s\n", indent ? "  " : "", line);
}

static void test_description(void **state)
{
    (void)state;
    struct gn_fake fake;
    char text[1000] = "";
    gn_fake_init(&fake);
    fake.formats = many_formats;
    fake.card = "Fa\x1bke\n"; // never to a terminal
    assert_int_equal(gn_v4l2_describe(&fake.io, "/dev/video3", say, text, NULL), 0);
    assert_string_equal(text, "/dev/video3: Fa?ke?\n"
                              "  Y10 320x240@25, 640x480@25\n"
                              "  YUYV 320x240@25, 640x480@25\n"
                              "  MJPG 320x240@25, 640x480@25\n"
                              "  GREY 320x240@25, 640x480@25\n"
                              "  controls: gain=7 (0 to 255), exposure_auto=3 (0 to 3), "
                              "exposure_absolute=250 (3 to 2047)\n"
                              "  not read: YU12\n");
    assert_int_equal(gn_v4l2_describe(&fake.io, "/dev/video4", say, text, NULL), -ENODEV);
    fake.is_endless = true;
    text[0] = '\0';
    assert_int_equal(gn_v4l2_describe(&fake.io, "/dev/video3", say, text, NULL), 0);
    gn_fake_finish(&fake);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_format_that_tells_most),
        cmocka_unit_test(test_sizes_and_rates),
        cmocka_unit_test(test_refusals_name_what_there_is),
        cmocka_unit_test(test_controls),
        cmocka_unit_test(test_controls_that_are_refused),
        cmocka_unit_test(test_exposures_at_the_end_of_all_numbers),
        cmocka_unit_test(test_controls_that_do_not_take),
        cmocka_unit_test(test_description),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
