/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pixels of V4L2: every format against formulas written apart, padded rows, what is refused.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/v4l2_pixels.h"
#include "tests/unit/cmocka_setup.h"

static struct v4l2_pix_format make_format(uint32_t fourcc, uint32_t width, uint32_t height,
                                          uint32_t stride, uint32_t rows)
{
    return (struct v4l2_pix_format){.width = width,
                                    .height = height,
                                    .pixelformat = fourcc,
                                    .field = V4L2_FIELD_NONE,
                                    .bytesperline = stride,
                                    .sizeimage = stride * rows,
                                    .colorspace = V4L2_COLORSPACE_SRGB};
}

static struct gn_v4l2_layout make_layout(const struct v4l2_pix_format *pix, bool is_8_bit)
{
    struct gn_v4l2_layout layout;
    struct gn_error error = {0};
    if (gn_v4l2_layout_init(pix, is_8_bit, &layout, &error) != 0)
        fail_msg("%s", error.text);
    return layout;
}

/* Written from the standards: undo quantisation, solve Y = Kr R + (1 - Kr - Kb) G + Kb B with
 * Pb = (B - Y) / (2 (1 - Kb)), Pr = (R - Y) / (2 (1 - Kr)), quantise to full range. */
static void expect_rgb(double kr, double kb, bool is_full, int y, int u, int v, double out[3])
{
    double luma = is_full ? y / 255.0 : (y - 16) / 219.0;
    double pb = (u - 128) / (is_full ? 255.0 : 224.0), pr = (v - 128) / (is_full ? 255.0 : 224.0);
    double r = luma + pr * 2 * (1 - kr), b = luma + pb * 2 * (1 - kb);
    double g = (luma - kr * r - kb * b) / (1 - kr - kb);
    out[0] = fmin(fmax(r, 0), 1) * 255;
    out[1] = fmin(fmax(g, 0), 1) * 255;
    out[2] = fmin(fmax(b, 0), 1) * 255;
}

static void check_pixel(const uint8_t *rgb, const double expected[3], int y, int u, int v)
{
    for (int c = 0; c < 3; c++) {
        if (fabs(rgb[c] - expected[c]) > 0.501)
            fail_msg("Y %d U %d V %d channel %d: %d, expected %g", y, u, v, c, rgb[c], expected[c]);
    }
}

static const struct {
    uint32_t colorspace, encoding, range;
    double kr, kb;
    bool is_full;
} encodings[] = {
    {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_601, V4L2_QUANTIZATION_LIM_RANGE, 0.299, 0.114, false},
    {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_601, V4L2_QUANTIZATION_FULL_RANGE, 0.299, 0.114, true},
    {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_709, V4L2_QUANTIZATION_LIM_RANGE, 0.2126, 0.0722, false},
    {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_709, V4L2_QUANTIZATION_FULL_RANGE, 0.2126, 0.0722, true},
    {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_BT2020, V4L2_QUANTIZATION_LIM_RANGE, 0.2627, 0.0593,
     false},
    /* What V4L2 lays down where the driver names nothing. */
    {V4L2_COLORSPACE_SRGB, 0, 0, 0.299, 0.114, false},
    {V4L2_COLORSPACE_SMPTE170M, 0, 0, 0.299, 0.114, false},
    {V4L2_COLORSPACE_REC709, 0, 0, 0.2126, 0.0722, false},
    {V4L2_COLORSPACE_JPEG, 0, 0, 0.299, 0.114, true},
};
enum { N_ENCODINGS = sizeof(encodings) / sizeof(encodings[0]) };

/* Every Y with a grid of U and V that has the ends, as one row of pairs for each U, V. */
static void test_yuyv_follows_the_standards(void **state)
{
    (void)state;
    enum { WIDTH = 256 };
    uint8_t row[2 * WIDTH], rgb[3 * WIDTH];
    for (int e = 0; e < N_ENCODINGS; e++) {
        struct v4l2_pix_format pix = make_format(V4L2_PIX_FMT_YUYV, WIDTH, 1, 2 * WIDTH, 1);
        pix.colorspace = encodings[e].colorspace;
        pix.ycbcr_enc = encodings[e].encoding;
        pix.quantization = encodings[e].range;
        struct gn_v4l2_layout layout = make_layout(&pix, true);
        assert_int_equal(layout.format, GN_CAPTURE_RGB8);
        for (int u = 0; u <= 255; u += 15) {
            for (int v = 0; v <= 255; v += 15) {
                for (int x = 0; x < WIDTH; x++) {
                    row[2 * x] = (uint8_t)x;
                    row[2 * x + 1] = (uint8_t)(x % 2 ? v : u);
                }
                gn_v4l2_convert(&layout, row, rgb);
                for (int x = 0; x < WIDTH; x++) {
                    double expected[3];
                    expect_rgb(encodings[e].kr, encodings[e].kb, encodings[e].is_full, x, u, v,
                               expected);
                    check_pixel(rgb + 3 * x, expected, x, u, v);
                }
            }
        }
    }
}

/* A picture's memory, of its exact size, each byte a number of its own. */
static uint8_t *make_bytes(size_t n)
{
    uint8_t *bytes = malloc(n);
    assert_non_null(bytes);
    uint32_t x = 12345;
    for (size_t i = 0; i < n; i++) {
        x = x * 1664525u + 1013904223u;
        bytes[i] = (uint8_t)(x >> 24);
    }
    return bytes;
}

/* Chroma is that of the pair, or of the square of four; rows may be padded. */
static void test_chroma_belongs_to_its_pixels(void **state)
{
    (void)state;
    enum { WIDTH = 10, HEIGHT = 6, STRIDE = 32 };
    static uint8_t rgb[3 * WIDTH * HEIGHT];
    for (int is_nv12 = 0; is_nv12 < 2; is_nv12++) {
        uint32_t rows = is_nv12 ? HEIGHT * 3 / 2 : HEIGHT;
        struct v4l2_pix_format pix = make_format(is_nv12 ? V4L2_PIX_FMT_NV12 : V4L2_PIX_FMT_YUYV,
                                                 WIDTH, HEIGHT, STRIDE, rows);
        struct gn_v4l2_layout layout = make_layout(&pix, false);
        assert_int_equal(layout.n_bytes, STRIDE * (rows - 1) + (is_nv12 ? WIDTH : 2 * WIDTH));
        uint8_t *data = make_bytes(layout.n_bytes);
        gn_v4l2_convert(&layout, data, rgb);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                const uint8_t *uv = is_nv12 ? data + STRIDE * (HEIGHT + y / 2) + x / 2 * 2
                                            : data + STRIDE * y + x / 2 * 4 + 1;
                int luma = is_nv12 ? data[STRIDE * y + x] : data[STRIDE * y + 2 * x];
                double expected[3];
                expect_rgb(0.299, 0.114, false, luma, uv[0], uv[is_nv12 ? 1 : 2], expected);
                check_pixel(rgb + 3 * (WIDTH * y + x), expected, luma, uv[0], uv[is_nv12 ? 1 : 2]);
            }
        }
        free(data);
    }
}

static void test_rgb_and_gray(void **state)
{
    (void)state;
    enum { WIDTH = 7, HEIGHT = 3 };
    static const struct {
        uint32_t fourcc;
        int n_bytes, at[3]; // of a pixel, and where its R, G, B are
    } cases[] = {{V4L2_PIX_FMT_RGB24, 3, {0, 1, 2}},
                 {V4L2_PIX_FMT_BGR24, 3, {2, 1, 0}},
                 {V4L2_PIX_FMT_GREY, 1, {0, 0, 0}}};
    static uint8_t rgb[3 * WIDTH * HEIGHT];
    for (int i = 0; i < 6; i++) {
        int n = cases[i / 2].n_bytes, stride = n * WIDTH + i % 2 * 5;
        struct v4l2_pix_format pix =
            make_format(cases[i / 2].fourcc, WIDTH, HEIGHT, (uint32_t)stride, HEIGHT);
        struct gn_v4l2_layout layout = make_layout(&pix, true);
        assert_int_equal(layout.is_borrowed, i == 0); // RGB3 without padding needs no copy
        assert_int_equal(layout.format, GN_CAPTURE_RGB8);
        assert_int_equal(layout.n_out_bytes, sizeof(rgb));
        uint8_t *data = make_bytes(layout.n_bytes);
        memset(rgb, 0, sizeof(rgb));
        gn_v4l2_convert(&layout, data, rgb);
        for (int k = 0; k < 3 * WIDTH * HEIGHT; k++) {
            int x = k / 3 % WIDTH, y = k / 3 / WIDTH;
            assert_int_equal(rgb[k], data[stride * y + n * x + cases[i / 2].at[k % 3]]);
        }
        free(data);
    }
}

/* Codes of 8 bits, and of 10, 12 and 16 in the low bits of two bytes: all values. */
static void test_wide_codes(void **state)
{
    (void)state;
    static const struct {
        uint32_t fourcc;
        int bits;
        enum gn_capture_format format;
        int max_out;
    } cases[] = {{V4L2_PIX_FMT_GREY, 8, GN_CAPTURE_MONO16, 65535},
                 {V4L2_PIX_FMT_Y10, 10, GN_CAPTURE_MONO16, 65535},
                 {V4L2_PIX_FMT_Y12, 12, GN_CAPTURE_MONO12, 4095},
                 {V4L2_PIX_FMT_Y16, 16, GN_CAPTURE_MONO16, 65535}};
    enum { WIDTH = 64 };
    for (int i = 0; i < 8; i++) {
        int bits = cases[i / 2].bits, height = (1 << bits) / WIDTH;
        int size = bits == 8 ? 1 : 2, stride = size * WIDTH + i % 2 * 6;
        struct v4l2_pix_format pix = make_format(cases[i / 2].fourcc, WIDTH, (uint32_t)height,
                                                 (uint32_t)stride, (uint32_t)height);
        struct gn_v4l2_layout wide = make_layout(&pix, false), narrow = make_layout(&pix, true);
        assert_int_equal(wide.format, cases[i / 2].format);
        assert_int_equal(wide.is_borrowed, bits >= 12 && i % 2 == 0);
        assert_int_equal(narrow.format, GN_CAPTURE_RGB8);
        uint8_t *data = make_bytes(wide.n_bytes);
        for (int k = 0; k < 1 << bits; k++) {
            uint8_t *code = data + stride * (k / WIDTH) + size * (k % WIDTH);
            code[0] = (uint8_t)k;
            if (size == 2)
                code[1] = (uint8_t)(k >> 8);
        }
        assert_true(gn_v4l2_has_sound_codes(&wide, data));
        uint8_t *out = malloc(wide.n_out_bytes), *rgb = malloc(narrow.n_out_bytes);
        assert_true(out && rgb);
        gn_v4l2_convert(&wide, data, out);
        gn_v4l2_convert(&narrow, data, rgb);
        for (int k = 0; k < 1 << bits; k++) {
            double share = k / (double)((1 << bits) - 1);
            int code = out[2 * k] | out[2 * k + 1] << 8;
            if (fabs(code - share * cases[i / 2].max_out) > 1)
                fail_msg("code %d of %d bits becomes %d", k, bits, code);
            for (int c = 0; c < 3; c++)
                assert_int_equal(rgb[3 * k + c], k / (1 << (bits - 8)));
        }
        data[wide.n_bytes - 1] = (uint8_t)(1 << (bits - 8)); // one bit too high, in the last code
        assert_int_equal(gn_v4l2_has_sound_codes(&wide, data), bits == 16 || bits == 8);
        free(rgb);
        free(out);
        free(data);
    }
}

static void test_mjpeg_is_given_as_it_is(void **state)
{
    (void)state;
    struct v4l2_pix_format pix = make_format(V4L2_PIX_FMT_MJPEG, 640, 480, 0, 0);
    struct gn_v4l2_layout layout = make_layout(&pix, true);
    assert_int_equal(layout.format, GN_CAPTURE_JPEG);
    assert_true(layout.is_borrowed && layout.n_bytes == 0);
}

static void test_what_no_driver_may_say(void **state)
{
    (void)state;
    const struct v4l2_pix_format good = make_format(V4L2_PIX_FMT_YUYV, 640, 480, 1280, 480);
    struct {
        struct v4l2_pix_format pix;
        const char *says;
    } cases[16];
    int n = 0;
#define CASE(field, value, text)                                                                   \
    cases[n].pix = good, cases[n].pix.field = (value), cases[n++].says = (text)
    CASE(pixelformat, V4L2_PIX_FMT_YUV420, "'YU12' is none that we read");
    CASE(pixelformat, 0x1b01ffff, "'?"); // no letters to print
    CASE(width, 0, "0x480");
    CASE(height, 0, "640x0");
    CASE(width, 16386, "sides are in");
    CASE(height, UINT32_MAX, "sides are in");
    CASE(width, 641, "even sides");
    CASE(bytesperline, 1279, "cannot hold 640 pixels");
    CASE(bytesperline, UINT32_MAX, "cannot hold 640 pixels");
    CASE(sizeimage, 1280 * 480 - 1, "cannot hold YUYV pictures");
    CASE(sizeimage, 0, "cannot hold YUYV pictures");
    CASE(field, V4L2_FIELD_INTERLACED, "interlaced");
    CASE(ycbcr_enc, V4L2_YCBCR_ENC_BT2020_CONST_LUM, "encoding 7");
    CASE(ycbcr_enc, 200, "encoding 200");
    cases[n].pix = make_format(V4L2_PIX_FMT_NV12, 640, 479, 640, 720);
    cases[n++].says = "even sides";
    cases[n].pix = make_format(V4L2_PIX_FMT_RGB24, 16384, 16384, 49152, 16384);
    cases[n++].says = "pixels at most";
    for (int i = 0; i < n; i++) {
        struct gn_v4l2_layout layout;
        struct gn_error error = {0};
        assert_int_equal(gn_v4l2_layout_init(&cases[i].pix, true, &layout, &error), -EINVAL);
        if (!strstr(error.text, cases[i].says))
            fail_msg("'%s' does not say '%s'", error.text, cases[i].says);
    }
    struct v4l2_pix_format rgb = make_format(V4L2_PIX_FMT_BGR24, 640, 480, 1920, 480);
    struct gn_v4l2_layout layout;
    rgb.quantization = V4L2_QUANTIZATION_LIM_RANGE;
    assert_int_equal(gn_v4l2_layout_init(&rgb, true, &layout, NULL), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_yuyv_follows_the_standards),
        cmocka_unit_test(test_chroma_belongs_to_its_pixels),
        cmocka_unit_test(test_rgb_and_gray),
        cmocka_unit_test(test_wide_codes),
        cmocka_unit_test(test_mjpeg_is_given_as_it_is),
        cmocka_unit_test(test_what_no_driver_may_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
