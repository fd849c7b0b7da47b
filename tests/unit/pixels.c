/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pixels of machine-vision cameras: every format to the bit, against bytes written out here and
 * against an encoder written apart. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/pixels.h"
#include "proto/attr.h"
#include "tests/rig/gige_picture.h"
#include "tests/unit/cmocka_setup.h"

#define WIDTH 7 // odd: packed rows begin inside a byte
#define HEIGHT 5

/** All formats, by walking through the codes that PFNC gives to them. */
static const struct gn_pixels_format *get_format(int i)
{
    static const struct gn_pixels_format *all[64];
    static int n;
    bool is_listed = n > 0;
    for (uint32_t top = 0x0108; !is_listed && top <= 0x0230; top++) {
        for (uint32_t low = 0; low < 0x100; low++) {
            const struct gn_pixels_format *f = gn_pixels_find(top << 16 | low);
            if (f)
                all[n++] = f;
        }
    }
    return i < n ? all[i] : NULL;
}

static unsigned scale(unsigned code, unsigned from, unsigned to)
{
    return (unsigned)(((uint64_t)code * to * 2 + from) / (2 * (uint64_t)from));
}

/** The code that the encoder gives one sample. */
static unsigned get_code(const struct gn_pixels_format *f, int x, int y, int c)
{
    unsigned code = gn_gige_pattern(x, y, c, 77);
    return f->bits < 12 ? code >> (12 - f->bits) : code << (f->bits - 12);
}

static int get_mosaic_channel(const struct gn_pixels_format *f, int x, int y)
{
    bool is_red_x = (x & 1) == f->red_x, is_red_y = (y & 1) == f->red_y;
    return is_red_x && is_red_y ? 0 : is_red_x || is_red_y ? 1 : 2;
}

static int mirror(int i, int n)
{
    return i < 0 ? -i : i > n - 1 ? 2 * (n - 1) - i : i;
}

/** A colour of a mosaic: its own, else the mean of what lies beside, else of the corners. */
static unsigned interpolate(const struct gn_pixels_format *f, int x, int y, int c)
{
    for (int reach = 0; reach <= 2; reach++) {
        unsigned sum = 0, n = 0;
        for (int dy = -1; dy <= 1; dy++) {
            for (int dx = -1; dx <= 1; dx++) {
                int px = mirror(x + dx, WIDTH), py = mirror(y + dy, HEIGHT);
                if (abs(dx) + abs(dy) == reach && get_mosaic_channel(f, px, py) == c) {
                    sum += get_code(f, px, py, c);
                    n++;
                }
            }
        }
        if (n)
            return (2 * sum + n) / (2 * n);
    }
    fail();
    return 0;
}

static unsigned get_expected(const struct gn_pixels_format *f, int x, int y, int c)
{
    if (f->kind == GN_PIXELS_BAYER)
        return interpolate(f, x, y, c);
    return get_code(f, x, y, f->kind == GN_PIXELS_MONO ? 1 : c);
}

static void check_format(const struct gn_pixels_format *f, bool is_8_bit)
{
    enum gn_capture_format capture = gn_pixels_get_capture_format(f, is_8_bit);
    size_t n = gn_pixels_get_bytes(f, WIDTH, HEIGHT);
    size_t n_out = gn_pixels_get_capture_bytes(capture, WIDTH, HEIGHT);
    uint8_t *native = calloc(1, n), *out = malloc(n_out); // exact: sanitizers see a byte too far
    assert_true(native && out);
    gn_gige_pack(f, NULL, 77, WIDTH, HEIGHT, native);
    assert_int_equal(gn_pixels_convert(f, is_8_bit, WIDTH, HEIGHT, native, out), 0);
    if (gn_pixels_is_same(f, is_8_bit)) {
        assert_int_equal(n, n_out);
        memcpy(out, native, n);
    }
    bool is_mono = capture == GN_CAPTURE_MONO12 || capture == GN_CAPTURE_MONO16;
    unsigned to = capture == GN_CAPTURE_RGB8                                    ? 255
                  : capture == GN_CAPTURE_MONO12 || capture == GN_CAPTURE_RGB12 ? 4095
                                                                                : 65535;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            for (int c = 0; c < (is_mono ? 1 : 3); c++) {
                size_t i = (size_t)(y * WIDTH + x) * (is_mono ? 1 : 3) + (size_t)c;
                uint16_t code;
                memcpy(&code, out + 2 * i * (to != 255), 2 * (to != 255));
                unsigned got = to == 255 ? out[i] : code;
                unsigned wanted = scale(get_expected(f, x, y, c), (1u << f->bits) - 1, to);
                if (got != wanted)
                    fail_msg("%s to %u at %d,%d channel %d: %u, not %u", f->name, to, x, y, c, got,
                             wanted);
            }
        }
    }
    free(native);
    free(out);
}

static void test_all_formats(void **state)
{
    (void)state;
    int n = 0;
    for (; get_format(n); n++) {
        check_format(get_format(n), false);
        check_format(get_format(n), true);
        for (int k = 0; k < n; k++)
            assert_string_not_equal(get_format(k)->name, get_format(n)->name);
    }
    assert_int_equal(n, 9 + 8 * 4 + 8);
}

/** Bytes as the standard draws them. */
static void test_packing(void **state)
{
    (void)state;
    static const struct {
        uint32_t code;
        uint8_t bytes[8];
        uint16_t samples[4]; // as MONO12, or as MONO16 of 10 bits
    } cases[] = {
        {0x01100005, {0xbc, 0x0a, 0x23, 0x01, 0xff, 0x0f, 0, 0}, {0xabc, 0x123, 0xfff, 0}},
        {0x010C0006, {0xab, 0x3c, 0x12, 0xff, 0x0f, 0x00}, {0xabc, 0x123, 0xfff, 0}},
        {0x010C0047, {0xbc, 0x3a, 0x12, 0xff, 0x0f, 0x00}, {0xabc, 0x123, 0xfff, 0}},
        {0x010C0004, {0xa9, 0x01, 0x4f, 0xff, 0x03, 0x00}, {0x2a5, 0x13c, 0x3ff, 0}},
        {0x010A0046, {0xa5, 0xf2, 0xf4, 0x3f, 0x00}, {0x2a5, 0x13c, 0x3ff, 0}},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        const struct gn_pixels_format *f = gn_pixels_find(cases[i].code);
        uint16_t out[4];
        memcpy(out, cases[i].bytes, 8);
        assert_int_equal(gn_pixels_convert(f, false, 4, 1, cases[i].bytes, out), 0);
        for (int k = 0; k < 4; k++)
            assert_int_equal(out[k], f->bits == 12 ? cases[i].samples[k]
                                                   : scale(cases[i].samples[k], 1023, 65535));
    }
    const uint8_t gray[3] = {0, 128, 255};
    uint16_t wide[3];
    assert_int_equal(gn_pixels_convert(gn_pixels_find(0x01080001), false, 3, 1, gray, wide), 0);
    assert_true(wide[0] == 0 && wide[1] == 128 * 257 && wide[2] == 65535);
}

/** A mosaic of a plane in x and y is that plane, but at the border. */
static void test_mosaic_of_a_plane(void **state)
{
    (void)state;
    uint8_t native[2 * WIDTH * HEIGHT];
    uint16_t out[3 * WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int code = 100 + 20 * (i % WIDTH) + 6 * (i / WIDTH);
        native[2 * i] = (uint8_t)code;
        native[2 * i + 1] = (uint8_t)(code >> 8);
    }
    for (uint32_t code = 0x01100010; code <= 0x01100013; code++) {
        const struct gn_pixels_format *f = gn_pixels_find(code);
        assert_int_equal(gn_pixels_convert(f, false, WIDTH, HEIGHT, native, out), 0);
        for (int y = 1; y < HEIGHT - 1; y++) {
            for (int x = 1; x < WIDTH - 1; x++) {
                for (int c = 0; c < 3; c++)
                    assert_int_equal(out[3 * (y * WIDTH + x) + c], 100 + 20 * x + 6 * y);
            }
        }
    }
}

static void test_refusals(void **state)
{
    (void)state;
    const struct gn_pixels_format *mono12 = gn_pixels_find(0x01100005);
    const struct gn_pixels_format *mono10 = gn_pixels_find(0x01100003);
    uint8_t native[8] = {0xff, 0x0f, 0, 0, 0, 0, 0, 0};
    uint16_t out[4];
    assert_true(gn_pixels_is_same(mono12, false) && !gn_pixels_is_same(mono12, true));
    assert_int_equal(gn_pixels_convert(mono12, false, 4, 1, native, NULL), 0);
    assert_int_equal(gn_pixels_convert(mono10, false, 4, 1, native, out), -EDOM);
    native[7] = 0x10;
    assert_int_equal(gn_pixels_convert(mono12, false, 4, 1, native, NULL), -EDOM);
    assert_null(gn_pixels_find(0));
    assert_null(gn_pixels_find(0x01080002)); // Mono8s
    static const int sides[][2] = {{0, 4}, {4, 0}, {-1, 4}, {16385, 1}, {1, 16385}};
    for (size_t i = 0; i < GN_ARRAY_LEN(sides); i++)
        assert_int_equal(gn_pixels_get_bytes(mono12, sides[i][0], sides[i][1]), 0);
    assert_int_equal(gn_pixels_get_bytes(mono12, 16384, 16384), 2u << 28);
    assert_int_equal(gn_pixels_get_bytes(gn_pixels_find(0x010C0047), 3, 1), 5);
    assert_int_equal(gn_pixels_get_bytes(gn_pixels_find(0x010A0046), 3, 1), 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_formats),
        cmocka_unit_test(test_packing),
        cmocka_unit_test(test_mosaic_of_a_plane),
        cmocka_unit_test(test_refusals),
    };
    cmocka_set_message_output(CM_OUTPUT_TAP);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
