/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Compositing: (shadow * background + added) * (1 - A) + virtual, in linear light. */
#include "common/composite.h"

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

enum { WIDTH = 16, HEIGHT = 50 }; // rows for several items of the pool, the last one short

/* Layers that leave every pixel alone, and a background of all codes. */
struct fixture {
    struct gn_image rgba, shadow, added;
    struct gn_image8 background, out;
    struct gn_composite_layers layers;
    struct gn_composite_options options;
    struct gn_pool *pool;
    struct gn_compositor *compositor;
};

static int set_up(void **state)
{
    static struct fixture f;
    assert_int_equal(gn_image_init(&f.rgba, WIDTH, HEIGHT, 4), 0);
    assert_int_equal(gn_image_init(&f.shadow, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image_init(&f.added, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image8_init(&f.background, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image8_init(&f.out, WIDTH, HEIGHT, 3), 0);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        f.shadow.data[i] = 1;
        f.background.data[i] = (uint8_t)i;
    }
    f.layers = (struct gn_composite_layers){&f.rgba, &f.shadow, &f.added};
    f.options = (struct gn_composite_options){0};
    assert_int_equal(gn_pool_create(3, &f.pool), 0);
    assert_int_equal(gn_compositor_create(f.pool, &f.compositor), 0);
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    gn_image_finish(&f->rgba);
    gn_image_finish(&f->shadow);
    gn_image_finish(&f->added);
    gn_image8_finish(&f->background);
    gn_image8_finish(&f->out);
    gn_compositor_destroy(&f->compositor);
    gn_pool_destroy(&f->pool);
    return 0;
}

/* The fixture's background to its out. */
static int put(struct fixture *f, const struct gn_response *response)
{
    return gn_compositor_put_image8(f->compositor, &f->layers, &f->background, response,
                                    &f->options, &f->out);
}

/* A response that would not give all codes back leaves them alone where no layer touches them. */
static void test_untouched(void **state)
{
    struct fixture *f = *state;
    static const float coarse[2] = {0, 1};
    struct gn_response r = {.type = GN_RESPONSE_TABLE,
                            .table = coarse,
                            .table_size = 2,
                            .to_rec709 = {2, -1, 0, 0, 1, 0, 0, 0, 1}};
    for (int e = 0; e < 2; e++) {
        memset(f->out.data, 9, WIDTH * HEIGHT * 3);
        f->options.encoded_multiply = e;
        assert_int_equal(put(f, &r), 0);
        assert_memory_equal(f->out.data, f->background.data, WIDTH * HEIGHT * 3);
    }
    f->layers.shadow = f->layers.added = NULL;
    assert_int_equal(put(f, &r), 0);
    assert_memory_equal(f->out.data, f->background.data, WIDTH * HEIGHT * 3);
}

/* Half the light on sRGB 188 is 137; half the code, the paper's literal reading, is 94. */
static void test_shadow_on_srgb(void **state)
{
    struct fixture *f = *state;
    struct gn_response srgb = {.type = GN_RESPONSE_SRGB, .scale = 3};
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        f->background.data[i] = 188;
        f->shadow.data[i] = 0.5f;
    }
    assert_int_equal(put(f, &srgb), 0);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
        assert_int_equal(f->out.data[i], 137);
    f->options.encoded_multiply = true;
    assert_int_equal(put(f, &srgb), 0);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
        assert_int_equal(f->out.data[i], 94);
    for (int i = 0; i < WIDTH * HEIGHT * 4; i++)
        f->rgba.data[i] = 0.5f; // light 0.5 over half of it, a sixth as the device has it
    assert_int_equal(put(f, &srgb), 0);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
        assert_int_equal(f->out.data[i], 130);
}

/* The compositor keeps the last picture's curve; another one of its type is another one. */
static void test_curves_change(void **state)
{
    struct fixture *f = *state;
    static const double gammas[] = {2, 1, 2};
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        f->background.data[i] = 100;
        f->shadow.data[i] = 0.5f;
    }
    for (int g = 0; g < 3; g++) {
        const struct gn_response response = {.type = GN_RESPONSE_GAMMA, .gamma = gammas[g]};
        assert_int_equal(put(f, &response), 0);
        assert_int_equal(f->out.data[0], g % 2 ? 50 : 71);
    }
}

/* An edge's pixel that white covers by half mixes light, not codes: over black it is 188; over
 * code 124, linear 0.2016, it is linear 0.6008, 204. */
static void test_half_covered(void **state)
{
    struct fixture *f = *state;
    const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        for (int c = 0; c < 3; c++)
            f->background.data[3 * i + c] = i % 2 ? 124 : 0;
        for (int c = 0; c < 4; c++) // premultiplied
            f->rgba.data[4 * i + c] = 0.5f;
    }
    assert_int_equal(put(f, &srgb), 0);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
        assert_int_equal(f->out.data[i], i / 3 % 2 ? 204 : 188);
}

/* All terms at once, each channel its own, against the formula; in place; on a pool too. */
static void test_formula(void **state)
{
    struct fixture *f = *state;
    struct gn_image radiance, out;
    assert_int_equal(gn_image_init(&radiance, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image_init(&out, WIDTH, HEIGHT, 3), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        f->rgba.data[4 * i + 3] = (float)(i % 5) / 4;
        for (int c = 0; c < 3; c++) {
            radiance.data[3 * i + c] = (float)(i + c);
            f->rgba.data[4 * i + c] = (float)(i % 3 + c) / 8;
            f->shadow.data[3 * i + c] = (float)((i + c) % 4) / 4;
            f->added.data[3 * i + c] = (float)((i + 2 * c) % 6) / 2;
        }
    }
    const struct gn_response linear = {.scale = 255.0 / 16};
    struct gn_compositor *alone;
    assert_int_equal(gn_compositor_create(NULL, &alone), 0);
    assert_int_equal(
        gn_compositor_put_linear(alone, &f->layers, &radiance, &linear, &f->options, &out), 0);
    gn_compositor_destroy(&alone);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        float a = f->rgba.data[i / 3 * 4 + 3], v = f->rgba.data[i / 3 * 4 + i % 3];
        float expected = (f->shadow.data[i] * radiance.data[i] + f->added.data[i]) * (1 - a) + v;
        assert_true(out.data[i] == expected); // all numbers are short: exact in float
    }
    assert_int_equal(gn_compositor_put_linear(f->compositor, &f->layers, &radiance, &linear,
                                              &f->options, &radiance),
                     0);
    assert_memory_equal(radiance.data, out.data, WIDTH * HEIGHT * 3 * sizeof(float));
    /* The 8-bit way, through a linear response of 1/16 radiance per code step. */
    assert_int_equal(put(f, &linear), 0);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        double a = (double)f->rgba.data[i / 3 * 4 + 3], v = (double)f->rgba.data[i / 3 * 4 + i % 3];
        double x = f->background.data[i] / 16.0;
        x = ((double)f->shadow.data[i] * x + (double)f->added.data[i]) * (1 - a) + v;
        assert_true(fabs(fmin(x * 16, 255) - f->out.data[i]) <= 0.501);
    }
    gn_image_finish(&radiance);
    gn_image_finish(&out);
}

/* Codes come from a table of edges: they are those of the curve, rounded, for every response. */
static void test_codes_of_curves(void **state)
{
    struct fixture *f = *state;
    static const float flat[] = {0, 0, 0.01f, 0.01f, 0.01f, 1, 1};
    static const struct gn_response responses[] = {
        {.type = GN_RESPONSE_TABLE, .table = flat, .table_size = 7},
        {.type = GN_RESPONSE_LINEAR, .scale = 3},
        {.type = GN_RESPONSE_SRGB},
        {.type = GN_RESPONSE_SRGB, .to_rec709 = {0.8, 0.2, 0, 0.1, 0.9, 0, 0, 0.3, 0.7}},
        {.type = GN_RESPONSE_GAMMA, .gamma = 2.4},
        {.type = GN_RESPONSE_LOG, .log_a = 0.8, .log_b = 0.06, .log_c = 1e-5},
    };
    for (size_t r = 0; r < sizeof(responses) / sizeof(responses[0]); r++) {
        for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
            f->rgba.data[i / 3 * 4 + 3] = 1;
            // Seven decades, what lies beyond both ends, and where the table is flat.
            f->rgba.data[i / 3 * 4 + i % 3] = i < 9    ? 0
                                              : i < 18 ? 0.01f
                                                       : powf(10, (float)(i % 701) / 100 - 6);
        }
        assert_int_equal(put(f, &responses[r]), 0);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            float rgb[3];
            memcpy(rgb, f->rgba.data + 4 * i, sizeof(rgb));
            gn_response_from_radiance(&responses[r], rgb, 1);
            for (int c = 0; c < 3; c++)
                assert_true(fabsf(rgb[c] * 255 - f->out.data[3 * i + c]) <= 0.5001f);
        }
    }
}

/* Pixels with any coverage are counted, of each picture anew; added light and shadow are none. */
static void test_covered_pixels(void **state)
{
    struct fixture *f = *state;
    const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    assert_int_equal(gn_compositor_get_n_covered(f->compositor), 0);
    f->shadow.data[0] = 0.5f;
    f->added.data[7] = 1;
    assert_int_equal(put(f, &srgb), 0);
    assert_int_equal(gn_compositor_get_n_covered(f->compositor), 0);
    static const int places[] = {0, 1, WIDTH, WIDTH * HEIGHT / 2, WIDTH * HEIGHT - 1};
    for (int i = 0; i < 5; i++)
        f->rgba.data[4 * places[i] + 3] = 0.25f * (float)(i % 4 + 1);
    for (int again = 0; again < 2; again++) {
        assert_int_equal(put(f, &srgb), 0);
        assert_int_equal(gn_compositor_get_n_covered(f->compositor), 5);
    }
    f->options.match.blur_px = 1; // an edge is wider then
    assert_int_equal(put(f, &srgb), 0);
    assert_true(gn_compositor_get_n_covered(f->compositor) > 5);
    memset(f->rgba.data, 0, sizeof(float) * 4 * WIDTH * HEIGHT);
    assert_int_equal(put(f, &srgb), 0);
    assert_int_equal(gn_compositor_get_n_covered(f->compositor), 0);
}

static void test_refusals(void **state)
{
    struct fixture *f = *state;
    struct gn_response r = {0};
    struct gn_image small;
    assert_int_equal(gn_image_init(&small, WIDTH, HEIGHT - 1, 3), 0);
    f->layers.added = &small;
    assert_int_equal(put(f, &r), -EINVAL);
    assert_int_equal(
        gn_compositor_put_linear(f->compositor, &f->layers, &small, &r, &f->options, &small),
        -EINVAL);
    f->layers.added = NULL;
    r.scale = -1;
    assert_int_equal(put(f, &r), -EINVAL);
    r.scale = 0;
    f->options.match.blur_px = NAN;
    assert_int_equal(put(f, &r), -EINVAL);
    gn_image_finish(&small);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_untouched, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_shadow_on_srgb, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_curves_change, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_half_covered, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_formula, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_codes_of_curves, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_covered_pixels, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_refusals, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
