/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures that mean harm: each gives a picture or one line that says why not, in bounded time.
 * Made here: every truncation and every changed byte of a small file of each format, and sizes that
 * lie. With GNOMON_DATA set also its folder hdr/nasty.
 */
#include <dirent.h>
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
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/exr.h"
#include "common/file.h"
#include "common/hdr.h"
#include "common/image_file.h"
#include "common/jpeg.h"
#include "common/png.h"
#include "proto/attr.h"
#include "tests/real_data.h"

static const char path[] = "unit_hostile_pictures.tmp";

enum format { FORMAT_EXR, FORMAT_HDR, FORMAT_PNG, FORMAT_PNG16, FORMAT_JPEG, FORMAT_COUNT };

/* A good picture of 12 x 9 px; freed by the caller. */
static uint8_t *make_picture(enum format format, size_t *out_size)
{
    struct gn_image linear;
    struct gn_image8 codes;
    struct gn_image16 codes16;
    uint8_t *data = NULL;
    assert_int_equal(gn_image_init(&linear, 12, 9, 3), 0);
    assert_int_equal(gn_image8_init(&codes, 12, 9, 3), 0);
    assert_int_equal(gn_image16_init(&codes16, 12, 9, 1), 0);
    for (int i = 0; i < 12 * 9 * 3; i++) {
        linear.data[i] = i < 60 ? 1 : (float)(i * i % 97);
        codes.data[i] = (uint8_t)(i < 60 ? 9 : i * i);
        codes16.data[i / 3] = (uint16_t)(i * i);
    }
    if (format == FORMAT_JPEG) {
        struct gn_jpeg *jpeg;
        assert_int_equal(gn_jpeg_create(&jpeg), 0);
        data = malloc(gn_jpeg_get_bound(12, 9));
        assert_non_null(data);
        assert_int_equal(
            gn_jpeg_encode(jpeg, &codes, NULL, data, gn_jpeg_get_bound(12, 9), out_size, NULL), 0);
        gn_jpeg_destroy(&jpeg);
    } else {
        const struct gn_exr_channel rgb[] = {{.name = "R", .data = linear.data, .stride = 3},
                                             {.name = "G", .data = linear.data + 1, .stride = 3},
                                             {.name = "B", .data = linear.data + 2, .stride = 3}};
        int r = format == FORMAT_EXR   ? gn_exr_write_file(path, 12, 9, rgb, 3, NULL)
                : format == FORMAT_HDR ? gn_hdr_write_file(path, &linear, NULL)
                : format == FORMAT_PNG ? gn_png_write_file(path, &codes, NULL)
                                       : gn_png_write_file16(path, &codes16, NULL);
        assert_int_equal(r, 0);
        assert_int_equal(gn_file_read(path, 1 << 20, &data, out_size, NULL), 0);
        unlink(path);
    }
    gn_image_finish(&linear);
    gn_image8_finish(&codes);
    gn_image16_finish(&codes16);
    return data;
}

/* Reads from a buffer of the exact size, so that ASan sees one byte too many. */
static int read_exact(enum format format, const uint8_t *data, size_t size, struct gn_error *error)
{
    uint8_t *copy = malloc(size ? size : 1);
    assert_non_null(copy);
    memcpy(copy, data, size);
    struct gn_image image = {0};
    int r;
    if (format == FORMAT_EXR) {
        r = gn_exr_read_memory(copy, size, &image, NULL, error);
    } else if (format == FORMAT_HDR) {
        r = gn_hdr_read_memory(copy, size, &image, error);
    } else if (format == FORMAT_JPEG) {
        struct gn_jpeg *jpeg;
        struct gn_image8 codes = {0};
        int width, height, channels;
        assert_int_equal(gn_jpeg_create(&jpeg), 0);
        r = gn_jpeg_get_size(jpeg, copy, size, &width, &height, &channels, error);
        if (!r && (long)width * height > 1 << 20)
            r = gn_error_set(error, -EINVAL, "more pixels than were announced");
        if (!r)
            r = gn_image8_init(&codes, width, height, channels);
        if (!r)
            r = gn_jpeg_decode(jpeg, copy, size, &codes, error);
        gn_image8_finish(&codes);
        gn_jpeg_destroy(&jpeg);
    } else {
        struct gn_png png;
        r = gn_png_read_memory(copy, size, &png, error);
        gn_png_finish(&png);
    }
    gn_image_finish(&image);
    free(copy);
    return r;
}

static void assert_one_line(int r, const struct gn_error *error, const char *what)
{
    if (r == 0)
        return;
    if (error->text[0] == '\0' || strchr(error->text, '\n'))
        fail_msg("%s: error %d with the text \"%s\"", what, r, error->text);
}

static void test_truncations(void **state)
{
    (void)state;
    for (int f = 0; f < FORMAT_COUNT; f++) {
        size_t size;
        uint8_t *data = make_picture((enum format)f, &size);
        struct gn_error error = {0};
        assert_int_equal(read_exact((enum format)f, data, size, &error), 0);
        for (size_t n = 0; n < size; n++) {
            error.text[0] = '\0';
            int r = read_exact((enum format)f, data, n, &error);
            assert_one_line(r, &error, "truncation");
            /* The end mark of a JPEG carries nothing; all else is missed. */
            if (r == 0 && !(f == FORMAT_JPEG && n >= size - 2))
                fail_msg("format %d: %zu of %zu bytes make a picture", f, n, size);
        }
        free(data);
    }
}

static void test_changed_bytes(void **state)
{
    (void)state;
    static const uint8_t values[] = {0, 1, 0x7f, 0x80, 0xff};
    for (int f = 0; f < FORMAT_COUNT; f++) {
        size_t size;
        int n_refused = 0;
        uint8_t *data = make_picture((enum format)f, &size);
        for (size_t i = 0; i < size; i++) {
            uint8_t before = data[i];
            for (size_t v = 0; v < GN_ARRAY_LEN(values); v++) {
                struct gn_error error = {0};
                data[i] = values[v];
                int r = read_exact((enum format)f, data, size, &error);
                assert_one_line(r, &error, "changed byte");
                n_refused += r != 0;
            }
            data[i] = before;
        }
        assert_true(n_refused > 0);
        free(data);
    }
}

/* Writes a 32-bit number at the place that follows key. */
static void patch(uint8_t *data, size_t size, const char *key, size_t n_key, int offset,
                  uint32_t value, bool is_big_endian)
{
    size_t i = 0;
    while (i + n_key <= size && memcmp(data + i, key, n_key) != 0)
        i++;
    assert_true(i + n_key <= size);
    uint8_t *at = data + i + n_key + offset;
    for (int b = 0; b < 4; b++)
        at[b] = (uint8_t)(value >> 8 * (is_big_endian ? 3 - b : b));
}

/* Sets a PNG's sides, and the CRC-32 of its IHDR chunk (ISO 3309) with them. */
static void patch_png(uint8_t *data, size_t size, uint32_t side)
{
    uint32_t crc = 0xffffffff;
    patch(data, size, "IHDR", 4, 0, side, true);
    patch(data, size, "IHDR", 4, 4, side, true);
    for (int i = 12; i < 29; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ 0xedb88320 : crc >> 1;
    }
    patch(data, size, "IHDR", 4, 13, ~crc, true);
}

/* Declared sizes far beyond the bytes that are there: refused before the memory is taken. */
static void test_lying_sizes(void **state)
{
    (void)state;
    static const uint32_t sides[] = {0, 8192, 16384, 16385, 0x7fffffff, 0xffffffff};
    clock_t begin = clock(); // of the processor: a busy machine is no failure
    for (size_t s = 0; s < GN_ARRAY_LEN(sides); s++) {
        size_t size;
        struct gn_error error = {0};
        uint8_t *data = make_picture(FORMAT_EXR, &size);
        static const char key[] = "dataWindow\0box2i\0\20\0\0"; // and the size's last byte
        patch(data, size, key, sizeof(key), 8, sides[s] - 1, false);
        patch(data, size, key, sizeof(key), 12, sides[s] - 1, false);
        int r = read_exact(FORMAT_EXR, data, size, &error);
        assert_true(r != 0);
        assert_one_line(r, &error, "EXR");
        assert_true(sides[s] != 8192 || strstr(error.text, "cannot be in"));
        free(data);

        data = make_picture(FORMAT_PNG, &size);
        patch_png(data, size, 12); // not what it is, but consistent: the CRC is right
        assert_int_equal(read_exact(FORMAT_PNG, data, size, &error), -EINVAL);
        assert_null(strstr(error.text, "CRC"));
        patch_png(data, size, sides[s]);
        r = read_exact(FORMAT_PNG, data, size, &error);
        assert_true(r != 0 && !strstr(error.text, "CRC"));
        assert_one_line(r, &error, "PNG");
        assert_true(sides[s] != 8192 || strstr(error.text, "too short"));
        free(data);

        char head[96];
        int n = snprintf(head, sizeof(head), "#?RADIANCE\n\n-Y %u +X %u\n", sides[s], sides[s]);
        r = read_exact(FORMAT_HDR, (const uint8_t *)head, (size_t)n, &error);
        assert_true(r != 0);
        assert_one_line(r, &error, "Radiance");
        assert_true(sides[s] != 8192 || strstr(error.text, "cannot be in"));
    }
    assert_true(clock() - begin < 5 * CLOCKS_PER_SEC);
}

/* All files of GNOMON_DATA/folder; returns how many gave a picture. */
static int read_folder(const char *folder, int *out_n)
{
    char path_of_folder[PATH_MAX], name[PATH_MAX + 256];
    DIR *dir = opendir(real_data_path(folder, path_of_folder));
    int n_good = 0;
    *out_n = 0;
    assert_non_null(dir);
    for (struct dirent *entry = readdir(dir); entry; entry = readdir(dir)) {
        struct stat st;
        struct gn_image_file file;
        struct gn_error error = {0};
        snprintf(name, sizeof(name), "%s/%s", path_of_folder, entry->d_name);
        if (stat(name, &st) < 0 || !S_ISREG(st.st_mode))
            continue;
        clock_t begin = clock();
        int r = gn_image_read_file(name, &file, &error);
        if (clock() - begin > 10 * CLOCKS_PER_SEC)
            fail_msg("%s took more than 10 s of the processor", name);
        assert_one_line(r, &error, name);
        n_good += r == 0;
        ++*out_n;
        gn_image_file_finish(&file);
    }
    closedir(dir);
    return n_good;
}

static void test_nasty_files(void **state)
{
    (void)state;
    int n;
    assert_true(read_folder("hdr/nasty", &n) >= 6); // those with R, G, B
    read_folder("hdr/nasty/damaged", &n);
    assert_true(n >= 100);
}

/* The Radiance suite's gradient: column x was computed as 6 x / 128 + 0.1 before its exposure. */
static void test_gradient(void **state)
{
    (void)state;
    char name[PATH_MAX];
    struct gn_image_file file;
    real_data_path("hdr/nasty/radiance_h_gradient.hdr", name);
    assert_int_equal(gn_image_read_file(name, &file, NULL), 0);
    for (int x = 0; x < 128; x++) {
        float value = gn_image_at(&file.linear, x, 64)[1], expected = 6.0f * (float)x / 128 + 0.1f;
        assert_true(fabsf(value - expected) <= 0.01f * expected);
    }
    gn_image_file_finish(&file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_truncations),
        cmocka_unit_test(test_changed_bytes),
        cmocka_unit_test(test_lying_sizes),
        unit_test_with_real_data(test_nasty_files, "hdr/nasty/damaged"),
        unit_test_with_real_data(test_gradient, "hdr/nasty/radiance_h_gradient.hdr"),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
