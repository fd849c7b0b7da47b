/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pictures from files: what each format becomes, names, order, times, rounds, refusals. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/capture/file.h"
#include "common/exr.h"
#include "common/file.h"
#include "common/hdr.h"
#include "common/jpeg.h"
#include "common/png.h"
#include "tests/unit/cmocka_setup.h"

static const char dir[] = "unit_file_source.tmp";

static void make_path(const char *name, char path[static 512])
{
    snprintf(path, 512, "%s/%s", dir, name);
}

static int set_up(void **state)
{
    (void)state;
    return system("rm -rf unit_file_source.tmp && mkdir unit_file_source.tmp");
}

static int tear_down(void **state)
{
    (void)state;
    return system("rm -rf unit_file_source.tmp");
}

/* A source of the files that match, or the sentence that refuses them. */
static struct gn_source *open_source(const char *pattern,
                                     const struct gn_file_source_options *options)
{
    struct gn_file_list list = {0};
    struct gn_error error = {0};
    struct gn_source *source = NULL;
    char path[512];
    make_path(pattern, path);
    if (gn_file_list_find(path, 10, &list, &error) != 0)
        fail_msg("%s", error.text);
    assert_int_equal(gn_file_source_open(&list, options, &source), 0);
    assert_true(list.n_entries == 0 && !list.entries);
    return source;
}

static void write_png8(const char *name, int channels)
{
    char path[512];
    struct gn_image8 image;
    make_path(name, path);
    assert_int_equal(gn_image8_init(&image, 3, 2, channels), 0);
    for (int i = 0; i < 6 * channels; i++)
        image.data[i] = (uint8_t)(10 + i);
    assert_int_equal(gn_png_write_file(path, &image, NULL), 0);
    gn_image8_finish(&image);
}

static void write_png16(const char *name, int channels, int last)
{
    char path[512];
    struct gn_image16 image;
    make_path(name, path);
    assert_int_equal(gn_image16_init(&image, 3, 2, channels), 0);
    for (int i = 0; i < 6 * channels; i++)
        image.data[i] = (uint16_t)(1000 + i);
    image.data[6 * channels - 1] = (uint16_t)last;
    assert_int_equal(gn_png_write_file16(path, &image, NULL), 0);
    gn_image16_finish(&image);
}

static void write_floats(const char *name, int channels)
{
    static const char *const names[3] = {"R", "G", "B"};
    char path[512];
    struct gn_image image;
    make_path(name, path);
    assert_int_equal(gn_image_init(&image, 3, 2, channels), 0);
    for (int i = 0; i < 6 * channels; i++)
        image.data[i] = (float)(1 << i % 8);
    struct gn_exr_channel list[3];
    for (int c = 0; c < channels; c++)
        list[c] = (struct gn_exr_channel){
            .name = channels == 1 ? "Y" : names[c], .data = image.data + c, .stride = channels};
    if (strstr(name, ".hdr"))
        assert_int_equal(gn_hdr_write_file(path, &image, NULL), 0);
    else
        assert_int_equal(gn_exr_write_file(path, 3, 2, list, channels, NULL), 0);
    gn_image_finish(&image);
}

static void read_one(struct gn_source *source, enum gn_capture_format format, size_t bytes,
                     struct gn_capture *out)
{
    struct gn_error error = {0};
    if (gn_source_read(source, out, &error) != 1)
        fail_msg("%s", error.text);
    assert_true(out->width == 3 && out->height == 2 && !out->has_pose);
    assert_int_equal(out->format, format);
    assert_int_equal(out->data_bytes, bytes);
}

static void test_floats(void **state)
{
    (void)state;
    struct gn_capture c;
    const char *const names[] = {"rgb.exr", "mono.exr", "rgb.hdr"};
    for (int k = 0; k < 3; k++) {
        write_floats(names[k], k == 1 ? 1 : 3);
        struct gn_source *source = open_source(names[k], NULL);
        read_one(source, GN_CAPTURE_RGB_F32, 6 * 3 * sizeof(float), &c);
        for (int i = 0; i < 18; i++) {
            float value;
            memcpy(&value, c.data + 4 * i, 4);
            float wanted = (float)(1 << (k == 1 ? i / 3 : i) % 8);
            // Radiance shares one exponent: 1 beside 128 keeps 8 bits below it.
            assert_true(value == wanted ||
                        (k == 2 && value >= wanted * 0.5f && value <= wanted * 1.5f));
        }
        assert_int_equal(gn_source_read(source, &c, NULL), 0);
        gn_source_close(&source);
        assert_null(source);
    }
}

static void test_codes8(void **state)
{
    (void)state;
    struct gn_capture c;
    const char *const names[] = {"gray.png", "rgb.png", "rgba.png"};
    const int channels[] = {1, 3, 4};
    for (int k = 0; k < 3; k++) {
        write_png8(names[k], channels[k]);
        for (int is_wide = 0; is_wide < 2; is_wide++) {
            struct gn_file_source_options options = {.is_8_bit_16 = is_wide};
            struct gn_source *source = open_source(names[k], &options);
            read_one(source, is_wide ? GN_CAPTURE_RGB16 : GN_CAPTURE_RGB8, is_wide ? 36 : 18, &c);
            for (int i = 0; i < 18; i++) {
                int code = 10 + i / 3 * channels[k] + (channels[k] == 1 ? 0 : i % 3);
                int got = is_wide ? c.data[2 * i] | c.data[2 * i + 1] << 8 : c.data[i];
                assert_int_equal(got, is_wide ? 257 * code : code);
            }
            gn_source_close(&source);
        }
    }
}

static void test_codes16(void **state)
{
    (void)state;
    static const enum gn_capture_format formats[2][2] = {{GN_CAPTURE_MONO16, GN_CAPTURE_MONO12},
                                                         {GN_CAPTURE_RGB16, GN_CAPTURE_RGB12}};
    struct gn_capture c;
    for (int is_rgb = 0; is_rgb < 2; is_rgb++) {
        int n = is_rgb ? 18 : 6;
        write_png16("fits.png", is_rgb ? 3 : 1, 4095);
        write_png16("over.png", is_rgb ? 3 : 1, 4096);
        for (int is_12 = 0; is_12 < 2; is_12++) {
            struct gn_file_source_options options = {.is_12_bit = is_12};
            struct gn_source *source = open_source("fits.png", &options);
            read_one(source, formats[is_rgb][is_12], (size_t)(2 * n), &c);
            assert_int_equal(c.data[0] | c.data[1] << 8, 1000);
            assert_int_equal(c.data[2 * n - 2] | c.data[2 * n - 1] << 8, 4095);
            gn_source_close(&source);

            struct gn_error error = {0};
            source = open_source("over.png", &options);
            assert_int_equal(gn_source_read(source, &c, &error), is_12 ? -EDOM : 1);
            if (is_12)
                assert_non_null(strstr(error.text, "over.png: code 4096 is no 12-bit code"));
            gn_source_close(&source);
        }
    }
}

static void test_jpeg(void **state)
{
    (void)state;
    struct gn_jpeg *jpeg;
    struct gn_image8 image;
    uint8_t bytes[8192], *in_file = NULL;
    size_t n = 0, n_file = 0;
    char path[512];
    assert_int_equal(gn_jpeg_create(&jpeg), 0);
    assert_int_equal(gn_image8_init(&image, 3, 2, 3), 0);
    assert_true(gn_jpeg_get_bound(3, 2) <= sizeof(bytes));
    assert_int_equal(gn_jpeg_encode(jpeg, &image, NULL, bytes, sizeof(bytes), &n, NULL), 0);
    gn_image8_finish(&image);
    gn_jpeg_destroy(&jpeg);
    make_path("a.png", path); // the name does not matter
    assert_int_equal(gn_file_write(path, bytes, n, NULL), 0);
    struct gn_capture c;
    struct gn_source *source = open_source("a.png", NULL);
    read_one(source, GN_CAPTURE_JPEG, n, &c);
    assert_int_equal(gn_file_read(path, sizeof(bytes), &in_file, &n_file, NULL), 0);
    assert_memory_equal(c.data, in_file, n);
    free(in_file);
    gn_source_close(&source);

    struct gn_error error = {0};
    assert_int_equal(gn_file_write(path, bytes, 12, NULL), 0);
    source = open_source("a.png", NULL);
    assert_int_equal(gn_source_read(source, &c, &error), -EINVAL);
    assert_non_null(strstr(error.text, "a.png: "));
    gn_source_close(&source);
}

static void test_order_times_rounds(void **state)
{
    (void)state;
    struct gn_capture c;
    char path[512];
    write_png8("b.png", 3);
    write_png8("a.2.PNG", 3);
    write_png8("c", 3); // no picture by its extension
    make_path("notes.txt", path);
    assert_int_equal(gn_file_write(path, "x", 1, NULL), 0);
    const char *const names[] = {"a.2", "b", "c"};
    for (int is_pattern = 0; is_pattern < 2; is_pattern++) {
        struct gn_file_source_options options = {.is_looped = true};
        int n = is_pattern ? 3 : 2;
        struct gn_source *source = open_source(is_pattern ? "[abc]*" : "", &options);
        for (int i = 0; i < 3 * n; i++) {
            read_one(source, GN_CAPTURE_RGB8, 18, &c);
            assert_string_equal(c.name, names[i % n]);
            assert_true(c.time_s > 0.1 * i - 1e-9 && c.time_s < 0.1 * i + 1e-9);
        }
        gn_source_close(&source);
    }
    // A round of one picture takes a second; a sequence's times begin at its first.
    struct gn_file_list list = {0};
    struct gn_file_entry *entry = NULL;
    struct gn_source *source = NULL;
    make_path("b.png", path);
    assert_int_equal(gn_file_list_add(&list, path, &entry), 0);
    entry->time_s = 7;
    struct gn_file_source_options options = {.is_looped = true};
    assert_int_equal(gn_file_source_open(&list, &options, &source), 0);
    for (int i = 0; i < 3; i++) {
        read_one(source, GN_CAPTURE_RGB8, 18, &c);
        assert_true(c.time_s == i);
    }
    gn_source_close(&source);
}

static void test_refusals(void **state)
{
    (void)state;
    struct gn_file_list list = {0};
    struct gn_error error = {0};
    char path[512];
    assert_int_equal(gn_file_list_find(dir, 0, &list, &error), -ENOENT);
    assert_non_null(strstr(error.text, "unit_file_source.tmp: no picture in this folder"));
    make_path("x*", path);
    assert_int_equal(gn_file_list_find(path, 0, &list, &error), -ENOENT);
    assert_non_null(strstr(error.text, "x*: no file there"));

    make_path("sub", path);
    assert_int_equal(mkdir(path, 0777), 0);
    write_png8("sub/a.png", 3);
    write_png8("a.jpg", 3);
    for (int i = 0; i < 2; i++) {
        make_path(i ? "sub/a.png" : "a.jpg", path);
        assert_int_equal(gn_file_list_add(&list, path, NULL), 0);
        assert_int_equal(gn_file_list_check_names(&list, &error), i ? -EEXIST : 0);
    }
    assert_non_null(strstr(error.text, "the same name"));
    gn_file_list_finish(&list);

    struct gn_source *source = NULL;
    struct gn_capture c;
    make_path("sub", path); // a folder where a picture should be
    assert_int_equal(gn_file_list_add(&list, path, NULL), 0);
    assert_int_equal(gn_file_source_open(&list, NULL, &source), 0);
    assert_int_equal(gn_source_read(source, &c, &error), -EINVAL);
    assert_non_null(strstr(error.text, "not a regular file"));
    gn_source_close(&source);
    gn_source_close(&source); // nothing
}

static void test_names(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"a/b/c.png", "c"},
        {"c.JPEG", "c"},
        {"shot.0001", "shot.0001"},
        {"a.b/c", "c"},
        {".png", ".png"},
        {"x\x1b[2J\xff.exr", "x?[2J?"},
        {"/frame.7.hdr", "frame.7"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
        char name[GN_FILE_NAME_BYTES];
        gn_file_get_name(cases[i][0], name);
        assert_string_equal(name, cases[i][1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_floats, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_codes8, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_codes16, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_jpeg, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_order_times_rounds, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_refusals, set_up, tear_down),
        cmocka_unit_test(test_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
