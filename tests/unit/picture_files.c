/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Radiance, PNG and JPEG, and the one door that picks by content. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/file.h"
#include "common/hdr.h"
#include "common/image_file.h"
#include "common/jpeg.h"
#include "common/png.h"
#include "proto/attr.h"

static const char path[] = "unit_picture_files.tmp";

/* Header and pixels glued together. */
static int read_hdr(const char *head, const void *pixels, size_t n, struct gn_image *out,
                    struct gn_error *error)
{
    static uint8_t bytes[4096];
    size_t n_head = strlen(head);
    memcpy(bytes, head, n_head);
    memcpy(bytes + n_head, pixels, n);
    return gn_hdr_read_memory(bytes, n_head + n, out, error);
}

/* A 2 x 3 picture stored in each orientation comes out the same: value = 1 + x + 10 y. */
static void test_hdr_orientations(void **state)
{
    (void)state;
    for (int o = 0; o < 8; o++) {
        bool is_column = o & 1, x_falls = o & 2, y_rises = o & 4;
        char head[64], text_x[8], text_y[8];
        snprintf(text_x, sizeof(text_x), "%cX 2", x_falls ? '-' : '+');
        snprintf(text_y, sizeof(text_y), "%cY 3", y_rises ? '+' : '-');
        snprintf(head, sizeof(head), "#?RADIANCE\n\n%s %s\n", is_column ? text_x : text_y,
                 is_column ? text_y : text_x);
        uint8_t flat[6][4];
        for (int i = 0; i < 6; i++) {
            int x = is_column ? i / 3 : i % 2, y = is_column ? i % 3 : i / 2;
            x = x_falls ? 1 - x : x;
            y = y_rises ? 2 - y : y;
            memcpy(flat[i], (uint8_t[4]){(uint8_t)(101 + x + 10 * y), 0, 0, 136}, 4);
        }
        struct gn_image image;
        assert_int_equal(read_hdr(head, flat, sizeof(flat), &image, NULL), 0);
        assert_true(image.width == 2 && image.height == 3);
        for (int i = 0; i < 6; i++)
            assert_true(gn_image_at(&image, i % 2, i / 2)[0] ==
                        (float)(101 + i % 2 + 10 * (i / 2)));
        gn_image_finish(&image);
    }
}

static void test_hdr_old_runs_and_exposure(void **state)
{
    (void)state;
    static const uint8_t old[] = {200, 100, 50, 137, 1, 1, 1, 3, 1, 1, 1, 1, 9, 9, 9, 0};
    struct gn_image image; // one pixel, 3 more, 256 more, one black: 261
    assert_int_equal(read_hdr("#?RGBE\nEXPOSURE=2\nEXPOSURE= 4\nCOLORCORR=1 2 1\n\n-Y 1 +X 261\n",
                              old, sizeof(old), &image, NULL),
                     0);
    for (int x = 0; x < 260; x++) {
        const float *p = gn_image_at(&image, x, 0);
        assert_true(p[0] == 50 && p[1] == 12.5f && p[2] == 12.5f);
    }
    assert_true(gn_image_at(&image, 260, 0)[0] == 0);
    gn_image_finish(&image);
}

static void test_hdr_refusals(void **state)
{
    (void)state;
    static const uint8_t pixels[64] = {2, 2, 0, 8, 0, 136, 1, 136, 1, 136, 1, 136, 1};
    static const struct {
        const char *head, *word;
    } cases[] = {
        {"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "rgbe"},
        {"#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n", "EXPOSURE"},
        {"#?RADIANCE\nEXPOSURE=nan\n\n-Y 1 +X 1\n", "EXPOSURE"},
        {"#?RADIANCE\n\n-Y 1 +Y 1\n", "resolution"},
        {"#?RADIANCE\n\n-Y 1 +X 1 1\n", "resolution"},
        {"#?RADIANCE\n\n-Y 999999999 +X 999999999\n", "cannot be"},
        {"#?RADIANCE\n\n-Y 1 +X 99999\n", "larger"},
        {"#?RADIANCE\n\n-Y 0 +X 9\n", "cannot be"},
        {"#?RADIANCE\n\n-Y 1 +X 8\n", "scanline 0"}, // a run of 0
        {"#?RADIANCE\n\n-Y 9 +X 9\n", "scanline 0"}, // another length in the scanline
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_image image = {0};
        struct gn_error error = {0};
        assert_int_equal(read_hdr(cases[i].head, pixels, sizeof(pixels), &image, &error), -EINVAL);
        if (!strstr(error.text, cases[i].word))
            fail_msg("case %zu: \"%s\" does not say \"%s\"", i, error.text, cases[i].word);
        assert_null(image.data);
    }
}

/* Within half a step of the shared exponent, and a second round is to the bit. */
static void test_hdr_round_trip(void **state)
{
    (void)state;
    static const int widths[] = {1, 7, 8, 300};
    for (size_t w = 0; w < GN_ARRAY_LEN(widths); w++) {
        struct gn_image image, again, third;
        assert_int_equal(gn_image_init(&image, widths[w], 5, 3), 0);
        int n = widths[w] * 15;
        for (int i = 0; i < n; i++) // runs, stretches, zeros, a rounding up to the next exponent
            image.data[i] = i % 90 < 30 ? 0.999f : i % 70 < 9 ? 0 : expf(sinf((float)i) * 20);
        assert_int_equal(gn_hdr_write_file(path, &image, NULL), 0);
        struct gn_image_file file;
        assert_int_equal(gn_image_read_file(path, &file, NULL), 0);
        again = file.linear;
        for (int i = 0; i < n; i += 3) {
            float max = fmaxf(fmaxf(image.data[i], image.data[i + 1]), image.data[i + 2]);
            for (int c = i; c < i + 3; c++)
                assert_true(fabsf(again.data[c] - image.data[c]) <= max / 255);
        }
        assert_int_equal(gn_hdr_write_file(path, &again, NULL), 0);
        assert_int_equal(gn_image_read_file(path, &file, NULL), 0);
        third = file.linear;
        assert_memory_equal(again.data, third.data, (size_t)n * sizeof(float));
        gn_image_finish(&image);
        gn_image_finish(&again);
        gn_image_finish(&third);
    }
    unlink(path);
}

static void test_png_round_trip(void **state)
{
    (void)state;
    static const int channels[] = {1, 3, 4};
    for (size_t i = 0; i < GN_ARRAY_LEN(channels); i++) {
        struct gn_image8 image;
        struct gn_image_file file;
        assert_int_equal(gn_image8_init(&image, 19, 23, channels[i]), 0);
        size_t n = (size_t)(19 * 23 * channels[i]);
        for (size_t k = 0; k < n; k++)
            image.data[k] = (uint8_t)(k * 7 + k / 31);
        assert_int_equal(gn_png_write_file(path, &image, NULL), 0);
        assert_int_equal(gn_image_read_file(path, &file, NULL), 0);
        assert_int_equal(file.kind, GN_IMAGE_CODES8);
        assert_int_equal(file.codes8.channels, channels[i]);
        assert_memory_equal(file.codes8.data, image.data, n);
        gn_image_file_finish(&file);
        gn_image8_finish(&image);
    }
    for (int c = 1; c <= 3; c += 2) { // 12-bit codes in 16 bits
        struct gn_image16 image;
        struct gn_image_file file;
        struct gn_image codes;
        assert_int_equal(gn_image16_init(&image, 19, 23, c), 0);
        size_t n = (size_t)(19 * 23 * c);
        for (size_t k = 0; k < n; k++)
            image.data[k] = (uint16_t)(k * 37 % 4096);
        assert_int_equal(gn_png_write_file16(path, &image, NULL), 0);
        assert_int_equal(gn_image_read_file(path, &file, NULL), 0);
        assert_int_equal(file.kind, GN_IMAGE_CODES16);
        assert_memory_equal(file.codes16.data, image.data, n * sizeof(uint16_t));
        assert_int_equal(gn_image_file_to_float(&file, 4095, &codes), 0);
        assert_true(codes.channels == c && codes.data[10] == (float)image.data[10] / 4095);
        gn_image_finish(&codes);
        gn_image_file_finish(&file);
        gn_image16_finish(&image);
    }
    unlink(path);
}

static void test_jpeg(void **state)
{
    (void)state;
    struct gn_jpeg *jpeg;
    struct gn_image8 image, back;
    uint8_t *bytes = malloc(gn_jpeg_get_bound(64, 48));
    size_t n = 0, n_full = 0;
    int width, height, channels;
    assert_non_null(bytes);
    assert_int_equal(gn_jpeg_create(&jpeg), 0);
    assert_int_equal(gn_image8_init(&image, 64, 48, 3), 0);
    assert_int_equal(gn_image8_init(&back, 64, 48, 3), 0);
    for (int y = 0; y < 48; y++)
        for (int x = 0; x < 64; x++)
            memcpy(gn_image8_at(&image, x, y),
                   (uint8_t[3]){(uint8_t)(x * 4), (uint8_t)(y * 5), (uint8_t)(255 - x * 2)}, 3);
    struct gn_jpeg_options full = {.quality = 95, .is_full_chroma = true};
    size_t bound = gn_jpeg_get_bound(64, 48);
    assert_int_equal(gn_jpeg_encode(jpeg, &image, &full, bytes, bound, &n_full, NULL), 0);
    assert_int_equal(gn_jpeg_encode(jpeg, &image, NULL, bytes, bound, &n, NULL), 0);
    assert_true(n < n_full);
    assert_int_equal(gn_jpeg_get_size(jpeg, bytes, n, &width, &height, &channels, NULL), 0);
    assert_true(width == 64 && height == 48 && channels == 3);
    assert_int_equal(gn_jpeg_decode(jpeg, bytes, n, &back, NULL), 0);
    for (int i = 0; i < 64 * 48 * 3; i++)
        assert_in_range(abs(image.data[i] - back.data[i]), 0, 12);
    struct gn_error error = {0};
    assert_int_equal(gn_jpeg_encode(jpeg, &image, NULL, bytes, 100, &n_full, &error), -EINVAL);
    gn_image8_finish(&back);
    assert_int_equal(gn_image8_init(&back, 48, 64, 3), 0);
    assert_int_equal(gn_jpeg_decode(jpeg, bytes, n, &back, &error), -EINVAL);
    assert_non_null(strstr(error.text, "expected"));
    assert_int_equal(gn_file_write(path, bytes, n, NULL), 0);
    struct gn_image_file file;
    assert_int_equal(gn_image_read_file(path, &file, NULL), 0);
    assert_true(file.kind == GN_IMAGE_CODES8 && file.codes8.width == 64);
    gn_image_file_finish(&file);
    unlink(path);
    gn_image8_finish(&image);
    gn_image8_finish(&back);
    gn_jpeg_destroy(&jpeg);
    free(bytes);
}

static void test_files(void **state)
{
    (void)state;
    struct gn_image_file file;
    struct gn_error error = {0};
    uint8_t *data;
    size_t size;
    assert_int_equal(gn_image_read_file("no-such-file", &file, &error), -ENOENT);
    assert_non_null(strstr(error.text, "no-such-file"));
    assert_int_equal(gn_image_read_file("/", &file, &error), -EINVAL);
    assert_int_equal(gn_image_read_file("/dev/zero", &file, &error), -EINVAL);
    assert_int_equal(gn_file_write(path, "hello", 5, NULL), 0);
    assert_int_equal(gn_image_read_file(path, &file, &error), -EINVAL);
    assert_non_null(strstr(error.text, "not a picture"));
    assert_int_equal(gn_file_read(path, 4, &data, &size, &error), -EFBIG);
    assert_int_equal(gn_file_read(path, 5, &data, &size, &error), 0);
    assert_int_equal(size, 5);
    free(data);
    /* A writer that gives up leaves what was there. */
    struct gn_file_writer writer;
    assert_int_equal(gn_file_writer_open(&writer, path, NULL), 0);
    assert_int_equal(gn_file_writer_put(&writer, "other", 5, 0), 0);
    gn_file_writer_abort(&writer);
    assert_int_equal(gn_file_read(path, 5, &data, &size, &error), 0);
    assert_memory_equal(data, "hello", 5);
    free(data);
    unlink(path);
    /* What is no file stays what it is. */
    struct stat st;
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(gn_file_write(path, "hello", 5, &error), -EINVAL);
    assert_non_null(strstr(error.text, "not a regular file"));
    assert_true(stat(path, &st) == 0 && S_ISFIFO(st.st_mode));
    unlink(path);
}

static void test_image_sizes(void **state)
{
    (void)state;
    struct gn_image image;
    struct gn_image8 image8;
    assert_int_equal(gn_image_init(&image, 0, 1, 1), -EINVAL);
    assert_int_equal(gn_image_init(&image, GN_IMAGE_MAX_SIDE + 1, 1, 1), -EINVAL);
    assert_int_equal(gn_image_init(&image, GN_IMAGE_MAX_SIDE, GN_IMAGE_MAX_SIDE, 1), -EINVAL);
    assert_int_equal(gn_image_init(&image, 1, 1, 5), -EINVAL);
    assert_null(image.data);
    assert_int_equal(gn_image_init(&image, 3, 5, 2), 0);
    assert_int_equal((uintptr_t)image.data % 64, 0);
    for (int i = 0; i < 30; i++)
        assert_true(image.data[i] == 0);
    assert_ptr_equal(gn_image_at(&image, 2, 4), image.data + 28);
    gn_image_finish(&image);
    gn_image_finish(&image);
    assert_int_equal(gn_image8_init(&image8, -1, 1, 1), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hdr_orientations),
        cmocka_unit_test(test_hdr_old_runs_and_exposure),
        cmocka_unit_test(test_hdr_refusals),
        cmocka_unit_test(test_hdr_round_trip),
        cmocka_unit_test(test_png_round_trip),
        cmocka_unit_test(test_jpeg),
        cmocka_unit_test(test_files),
        cmocka_unit_test(test_image_sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
