/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* EXR: named layers there and back to the bit, halves, what is missing, what is refused. */
#include "common/exr.h"

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ImfCRgbaFile.h>
#include <cmocka.h>
#include <openexr.h>

#include "common/file.h"
#include "common/half.h"
#include "proto/attr.h"

enum { WIDTH = 37, HEIGHT = 41 }; // not a multiple of ZIP's 16 rows

static const char path[] = "unit_exr.tmp.exr";

/* Awkward values: denormal, huge, infinite, negative, and a spread. */
static void fill(float *data, int n)
{
    static const float odd[] = {0, -0.0f, 1e-40f, 3e38f, INFINITY, -7, 65504, 1.0f / 3};
    for (int i = 0; i < n; i++)
        data[i] = i < 8 ? odd[i] : sinf((float)i) * expf((float)(i % 50) - 25);
}

static void write_layers(const float *rgba, const float *shadow, const float *depth)
{
    const struct gn_exr_channel channels[] = {
        {.name = "virtual.R", .data = rgba, .stride = 4},
        {.name = "virtual.G", .data = rgba + 1, .stride = 4},
        {.name = "virtual.B", .data = rgba + 2, .stride = 4},
        {.name = "virtual.A", .data = rgba + 3, .stride = 4},
        {.name = "shadow.R", .data = shadow, .stride = 3},
        {.name = "shadow.G", .data = shadow + 1, .stride = 3},
        {.name = "shadow.B", .data = shadow + 2, .stride = 3},
        {.name = "depth.Z", .data = depth, .stride = 1},
    };
    struct gn_error error = {0};
    if (gn_exr_write_file(path, WIDTH, HEIGHT, channels, GN_ARRAY_LEN(channels), &error))
        fail_msg("%s", error.text);
}

static void test_layers(void **state)
{
    (void)state;
    static float rgba[WIDTH * HEIGHT * 4], shadow[WIDTH * HEIGHT * 3], depth[WIDTH * HEIGHT];
    fill(rgba, WIDTH * HEIGHT * 4);
    fill(shadow, WIDTH * HEIGHT * 3);
    fill(depth, WIDTH * HEIGHT);
    write_layers(rgba, shadow, depth);
    struct gn_image image;
    struct gn_error error = {0};
    assert_int_equal(gn_exr_read_layer(path, "virtual", "RGBA", &image, &error), 0);
    assert_int_equal(image.width, WIDTH);
    assert_int_equal(image.height, HEIGHT);
    assert_memory_equal(image.data, rgba, sizeof(rgba));
    gn_image_finish(&image);
    assert_int_equal(gn_exr_read_layer(path, "shadow", "RGB", &image, &error), 0);
    assert_memory_equal(image.data, shadow, sizeof(shadow));
    gn_image_finish(&image);
    assert_int_equal(gn_exr_read_layer(path, "depth", "Z", &image, &error), 0);
    assert_memory_equal(image.data, depth, sizeof(depth));
    gn_image_finish(&image);
    assert_int_equal(gn_exr_read_layer(path, "shadow", "RGBA", &image, &error), -ENOENT);
    assert_non_null(strstr(error.text, "shadow.A"));
    assert_int_equal(gn_exr_read_file(path, &image, NULL, &error), -EINVAL); // no plain R, G, B
    assert_non_null(strstr(error.text, path));
    unlink(path);
}

static void test_half_and_luminance(void **state)
{
    (void)state;
    static float data[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        data[i] = (float)i / 7;
    data[5] = 1e9f;
    struct gn_exr_channel y = {.name = "Y", .data = data, .stride = 1, .is_half = true};
    struct gn_image image;
    bool is_saturated = false;
    assert_int_equal(gn_exr_write_file(path, WIDTH, HEIGHT, &y, 1, NULL), 0);
    assert_int_equal(gn_exr_read_file(path, &image, &is_saturated, NULL), 0);
    assert_int_equal(image.channels, 1);
    assert_true(is_saturated);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_true(image.data[i] == gn_half_to_float(gn_half_from_float(data[i])));
    gn_image_finish(&image);
    y.is_half = false; // a float of 1e9 is no sign of missing light
    assert_int_equal(gn_exr_write_file(path, WIDTH, HEIGHT, &y, 1, NULL), 0);
    assert_int_equal(gn_exr_read_file(path, &image, &is_saturated, NULL), 0);
    assert_false(is_saturated);
    gn_image_finish(&image);
    unlink(path);
}

/* Changes the header's byte. */
static void set_compression(uint8_t *data, exr_compression_t compression)
{
    static const char key[] = "compression\0compression\0\1\0\0";
    while (memcmp(data, key, sizeof(key)) != 0)
        data++;
    data[sizeof(key)] = (uint8_t)compression;
}

/* How few bytes a size in pixels may have depends on how tightly its compression can pack. */
static void test_bytes_for_size(void **state)
{
    (void)state;
    static const struct {
        exr_compression_t compression;
        size_t ratio; // of samples to file, in bytes
        int result;
    } cases[] = {
        {EXR_COMPRESSION_ZIP, 1000, 0},         {EXR_COMPRESSION_ZIP, 1100, -EINVAL},
        {EXR_COMPRESSION_PXR24, 1318, 0}, // a black picture's
        {EXR_COMPRESSION_PXR24, 1400, -EINVAL}, {EXR_COMPRESSION_DWAA, 10000, 0},
    };
    const int width = 8192, height = 512;
    float *black = calloc((size_t)(width * height), sizeof(*black));
    uint8_t *data;
    size_t size, n_bytes = (size_t)(width * height) * sizeof(*black);
    assert_non_null(black);
    struct gn_exr_channel y = {.name = "Y", .data = black, .stride = 1};
    assert_int_equal(gn_exr_write_file(path, width, height, &y, 1, NULL), 0);
    assert_int_equal(gn_file_read(path, 1 << 20, &data, &size, NULL), 0);
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_exr_info info;
        assert_true(n_bytes / cases[i].ratio <= size);
        set_compression(data, cases[i].compression);
        assert_int_equal(gn_exr_get_info(data, n_bytes / cases[i].ratio, &info, NULL),
                         cases[i].result);
    }
    free(data);
    free(black);
    unlink(path);
}

static void test_memory(void **state)
{
    (void)state;
    static float rgb[WIDTH * HEIGHT * 3];
    fill(rgb, WIDTH * HEIGHT * 3);
    const struct gn_exr_channel channels[] = {{.name = "R", .data = rgb, .stride = 3},
                                              {.name = "G", .data = rgb + 1, .stride = 3},
                                              {.name = "B", .data = rgb + 2, .stride = 3}};
    uint8_t *data;
    size_t size;
    struct gn_image image;
    struct gn_exr_info info;
    assert_int_equal(gn_exr_write_file(path, WIDTH, HEIGHT, channels, 3, NULL), 0);
    assert_int_equal(gn_file_read(path, 1 << 20, &data, &size, NULL), 0);
    assert_true(gn_exr_is_exr(data, size));
    assert_int_equal(gn_exr_get_info(data, size, &info, NULL), 0);
    assert_true(info.width == WIDTH && info.height == HEIGHT && info.channels == 3 && info.is_core);
    assert_int_equal(gn_exr_read_memory(data, size, &image, NULL, NULL), 0);
    assert_memory_equal(image.data, rgb, sizeof(rgb));
    gn_image_finish(&image);
    set_compression(data, EXR_COMPRESSION_DWAA); // refused from memory, with the reason
    struct gn_error error = {0};
    assert_int_equal(gn_exr_read_memory(data, size, &image, NULL, &error), -ENOTSUP);
    assert_non_null(strstr(error.text, "DWA"));
    free(data);
    unlink(path);
}

/* A DWA file, written by OpenEXR's own interface, is read by name; light at 65504 is reported. */
static void test_dwa_by_name(void **state)
{
    (void)state;
    for (int is_hot = 0; is_hot < 2; is_hot++) {
        static ImfRgba pixels[WIDTH * HEIGHT];
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            pixels[i].r = gn_half_from_float(is_hot ? 65504 : 2 + (float)(i % WIDTH) / WIDTH);
            pixels[i].g = gn_half_from_float(0.5f + (float)(i / WIDTH) / HEIGHT);
            pixels[i].b = gn_half_from_float(0.25f);
        }
        ImfHeader *header = ImfNewHeader();
        int x0 = -5, y0 = 7; // a data window that does not start at 0
        ImfHeaderSetDataWindow(header, x0, y0, x0 + WIDTH - 1, y0 + HEIGHT - 1);
        ImfHeaderSetDisplayWindow(header, 0, 0, 99, 99);
        ImfHeaderSetCompression(header, IMF_DWAA_COMPRESSION);
        ImfOutputFile *out = ImfOpenOutputFile(path, header, IMF_WRITE_RGB);
        assert_non_null(out);
        /* The base is where pixel (0, 0) would be, outside of the array. */
        uintptr_t first = (uintptr_t)(intptr_t)(x0 + y0 * WIDTH);
        ImfRgba *base = (ImfRgba *)((uintptr_t)pixels - first * sizeof(*pixels));
        assert_true(ImfOutputSetFrameBuffer(out, base, 1, WIDTH));
        assert_true(ImfOutputWritePixels(out, HEIGHT));
        ImfCloseOutputFile(out);
        ImfDeleteHeader(header);

        struct gn_image image;
        struct gn_error error = {0};
        bool is_saturated = !is_hot;
        if (gn_exr_read_file(path, &image, &is_saturated, &error))
            fail_msg("%s", error.text);
        assert_true(image.width == WIDTH && image.height == HEIGHT && image.channels == 3);
        assert_int_equal(is_saturated, is_hot);
        for (int i = 0; i < WIDTH * HEIGHT && !is_hot; i++) { // DWA loses a little
            assert_true(fabsf(image.data[3 * i] - gn_half_to_float(pixels[i].r)) < 0.05f);
            assert_true(fabsf(image.data[3 * i + 1] - gn_half_to_float(pixels[i].g)) < 0.05f);
        }
        gn_image_finish(&image);
    }
    unlink(path);
}

static void test_write_refusals(void **state)
{
    (void)state;
    float pixel = 1;
    struct gn_exr_channel two[2] = {{.name = "A", .data = &pixel, .stride = 1},
                                    {.name = "A", .data = &pixel, .stride = 1}};
    struct gn_error error = {0};
    assert_int_equal(gn_exr_write_file(path, 1, 1, two, 2, &error), -EINVAL);
    assert_int_equal(gn_exr_write_file(path, 0, 1, two, 1, &error), -EINVAL);
    two[0].name = "";
    assert_int_equal(gn_exr_write_file(path, 1, 1, two, 1, &error), -EINVAL);
    two[0].name = "A";
    assert_int_equal(gn_exr_write_file("no/such/folder.exr", 1, 1, two, 1, &error), -ENOENT);
    assert_non_null(strstr(error.text, "no/such/folder.exr"));
    assert_int_equal(access(path, F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layers),      cmocka_unit_test(test_half_and_luminance),
        cmocka_unit_test(test_memory),      cmocka_unit_test(test_bytes_for_size),
        cmocka_unit_test(test_dwa_by_name), cmocka_unit_test(test_write_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
