/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pictures on meshes: where texels lie, wrapping, sRGB, the pyramid, bad pictures. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/image.h"
#include "common/png.h"
#include "common/response.h"
#include "server/scene/texture.h"

/* 3 x 2 linear texels: R 10 per column from 10, G 100 below, 200 above. */
static struct gn_texture make_texture(bool is_srgb)
{
    uint8_t rgba[2][3][4];
    struct gn_texture texture;
    for (int y = 0; y < 2; y++) {
        for (int x = 0; x < 3; x++) {
            const uint8_t texel[4] = {(uint8_t)(10 * (x + 1)), y == 0 ? 200 : 100, 0, 255};
            memcpy(rgba[y][x], texel, sizeof(texel));
        }
    }
    assert_int_equal(gn_texture_init(&texture, rgba[0][0], 3, 2, is_srgb), 0);
    return texture;
}

static void check(const struct gn_texture_slot *slot, double u, double v, double red, double green)
{
    const float uv[2] = {(float)u, (float)v};
    float rgba[4];
    gn_texture_sample(slot, uv, 0, rgba);
    assert_float_equal(rgba[0] * 255, red, 1e-3);
    assert_float_equal(rgba[1] * 255, green, 1e-3);
    assert_float_equal(rgba[3], 1, 1e-6);
}

static void test_texels_lie_at_their_centres(void **state)
{
    (void)state;
    struct gn_texture texture = make_texture(false);
    const struct gn_texture_slot slot = {&texture, GN_WRAP_CLAMP, GN_WRAP_CLAMP};
    check(&slot, 0.5 / 3, 0.25, 10, 100); // v = 0 is the picture's bottom
    check(&slot, 1.5 / 3, 0.25, 20, 100);
    check(&slot, 2.5 / 3, 0.75, 30, 200);
    check(&slot, 1.0 / 3, 0.25, 15, 100); // halfway
    check(&slot, 1.5 / 3, 0.5, 20, 150);
    check(&slot, 1.25 / 3, 0.375, 17.5, 125);
    gn_texture_finish(&texture);
}

static void test_beyond_the_edges(void **state)
{
    (void)state;
    struct gn_texture texture = make_texture(false);
    const struct gn_texture_slot clamp = {&texture, GN_WRAP_CLAMP, GN_WRAP_CLAMP};
    const struct gn_texture_slot repeat = {&texture, GN_WRAP_REPEAT, GN_WRAP_REPEAT};
    const struct gn_texture_slot mirror = {&texture, GN_WRAP_MIRROR, GN_WRAP_MIRROR};
    check(&clamp, -7, 0.25, 10, 100);
    check(&clamp, 1e30, 1e30, 30, 200);
    check(&clamp, 0, 0.25, 10, 100);
    check(&repeat, 0, 0.25, 20, 100); // between the last and the first
    check(&repeat, 3 + 0.5 / 3, -0.75, 10, 100);
    check(&repeat, -0.5 / 3, 0.25, 30, 100);
    check(&mirror, 0, 0.25, 10, 100);
    check(&mirror, -0.5 / 3, 0.25, 10, 100);
    check(&mirror, -1.5 / 3, 0.25, 20, 100);
    check(&mirror, 1 + 0.5 / 3, -0.25, 30, 100);
    check(&mirror, -4 + 2.5 / 3, 2.75, 30, 200);
    gn_texture_finish(&texture);
}

static void test_srgb_is_made_linear_before_it_is_mixed(void **state)
{
    (void)state;
    const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    struct gn_texture texture = make_texture(true);
    for (int i = 0; i < 256; i++)
        assert_float_equal(texture.linear[i], gn_response_decode(&srgb, (float)i / 255), 1e-6);
    const struct gn_texture_slot slot = {&texture, GN_WRAP_CLAMP, GN_WRAP_CLAMP};
    double between = 255 * 0.5 * (double)(texture.linear[100] + texture.linear[200]);
    check(&slot, 0.5 / 3, 0.5, 255 * (double)texture.linear[10], between);
    gn_texture_finish(&texture);
}

static void test_far_away_the_mean_is_left(void **state)
{
    (void)state;
    enum { SIZE = 65 }; // odd: no texel may be lost
    uint8_t *rgba = malloc(SIZE * SIZE * 4);
    struct gn_texture texture;
    assert_non_null(rgba);
    double mean = 0;
    for (int i = 0; i < SIZE * SIZE; i++) {
        uint8_t code = i % SIZE % 2 ? 255 : 0;
        mean += code / 255.0 / (SIZE * SIZE);
        memset(rgba + 4 * i, code, 4);
    }
    for (int is_srgb = 0; is_srgb < 2; is_srgb++) {
        assert_int_equal(gn_texture_init(&texture, rgba, SIZE, SIZE, is_srgb), 0);
        const struct gn_texture_slot slot = {&texture, GN_WRAP_REPEAT, GN_WRAP_REPEAT};
        const float uv[2] = {0.3f, 0.8f};
        float out[4];
        gn_texture_sample(&slot, uv, 1e9f, out);
        assert_float_equal(out[0], mean, 0.02); // codes of 8 bits, level by level
        gn_texture_sample(&slot, uv, 8, out);
        assert_float_equal(out[1], mean, 0.1);
        gn_texture_finish(&texture);
    }
    free(rgba);
}

static void test_sixteen_bits_keep_their_alpha(void **state)
{
    (void)state;
    // One texel of 16 bits: 8080 0100 0081 4000.
    static const uint8_t png[] = {
        0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
        0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x10, 0x06, 0x00, 0x00, 0x00, 0x4f,
        0x85, 0x18, 0xca, 0x00, 0x00, 0x00, 0x11, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0x68,
        0x68, 0x60, 0x64, 0x60, 0x68, 0x74, 0x60, 0x00, 0x00, 0x09, 0x92, 0x01, 0xc3, 0xee, 0x76,
        0x8b, 0x9a, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
    static const uint8_t rounded[4] = {128, 1, 1, 64};
    struct gn_texture texture;
    assert_int_equal(gn_texture_read_memory(png, sizeof(png), false, 1, &texture, NULL), 0);
    assert_memory_equal(texture.levels[0], rounded, sizeof(rounded));
    gn_texture_finish(&texture);
}

static void test_bad_pictures_are_refused(void **state)
{
    (void)state;
    struct gn_image8 image;
    struct gn_texture texture;
    struct gn_error error = {0};
    uint8_t *data;
    size_t size;
    assert_int_equal(gn_image8_init(&image, 20, 10, 3), 0);
    assert_int_equal(gn_png_write_memory(&image, 1, &data, &size, NULL), 0);
    gn_image8_finish(&image);
    assert_int_equal(gn_texture_read_memory(data, size, true, 200, &texture, &error), 0);
    assert_int_equal(texture.n_levels, 5);
    gn_texture_finish(&texture);
    assert_int_equal(gn_texture_read_memory(data, size, true, 199, &texture, &error), -EINVAL);
    assert_non_null(strstr(error.text, "200 texels, where 199 are left"));
    for (size_t n = 0; n < size - 12; n += 7) { // without its end; all but the last chunk counts
        uint8_t *cut = malloc(n + 1);
        assert_non_null(cut);
        memcpy(cut, data, n);
        assert_int_equal(gn_texture_read_memory(cut, n, true, 1000, &texture, &error), -EINVAL);
        assert_null(texture.levels[0]);
        free(cut);
    }
    memset(data + 16, 0xff, 8); // its sides
    assert_int_equal(gn_texture_read_memory(data, size, true, 1000, &texture, &error), -EINVAL);
    assert_int_equal(gn_texture_read_memory("BM", 2, true, 1000, &texture, &error), -EINVAL);
    assert_non_null(strstr(error.text, "neither PNG nor JPEG"));
    const uint8_t jpeg[] = {0xff, 0xd8, 0xff, 0xe0, 0, 16};
    assert_int_equal(gn_texture_read_memory(jpeg, sizeof(jpeg), true, 9, &texture, &error),
                     -EINVAL);
    free(data);
    assert_int_equal(gn_texture_init(&texture, NULL, 0, 1, true), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_texels_lie_at_their_centres),
        cmocka_unit_test(test_beyond_the_edges),
        cmocka_unit_test(test_srgb_is_made_linear_before_it_is_mixed),
        cmocka_unit_test(test_far_away_the_mean_is_left),
        cmocka_unit_test(test_sixteen_bits_keep_their_alpha),
        cmocka_unit_test(test_bad_pictures_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
