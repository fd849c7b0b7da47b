/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Matching the camera: composites have its noise and its blur, and its pixels stay as they are. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/camera.h"
#include "common/composite.h"
#include "common/noise.h"
#include "common/point_spread.h"

enum { WIDTH = 70, HEIGHT = 75, PIXELS = WIDTH * HEIGHT }; // no multiples of blocks and strips

struct fixture {
    struct gn_image rgba, shadow, added, picture, out;
    struct gn_composite_layers layers;
    struct gn_composite_options options;
    struct gn_pool *pool;
    struct gn_compositor *compositor;
};

/* Layers that leave every pixel alone over a grey picture. */
static int set_up(void **state)
{
    static struct fixture f;
    assert_int_equal(gn_image_init(&f.rgba, WIDTH, HEIGHT, 4), 0);
    assert_int_equal(gn_image_init(&f.shadow, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image_init(&f.added, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image_init(&f.picture, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image_init(&f.out, WIDTH, HEIGHT, 3), 0);
    for (int i = 0; i < 3 * PIXELS; i++) {
        f.shadow.data[i] = 1;
        f.picture.data[i] = 0.5f;
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
    gn_image_finish(&f->picture);
    gn_image_finish(&f->out);
    gn_compositor_destroy(&f->compositor);
    gn_pool_destroy(&f->pool);
    return 0;
}

static void put(struct fixture *f, const struct gn_response *response)
{
    assert_int_equal(gn_compositor_put_linear(f->compositor, &f->layers, &f->picture, response,
                                              &f->options, &f->out),
                     0);
}

/* A fixed share [0, 1) for each index. */
static float get_share(uint32_t i)
{
    return (float)(gn_noise_get_key(i) >> 8) * 0x1p-24f;
}

/* Random layers in the rectangle that leaves `margin` pixels around. */
static void paint_layers(struct fixture *f, int margin)
{
    for (int y = margin; y < HEIGHT - margin; y++) {
        for (int x = margin; x < WIDTH - margin; x++) {
            uint32_t i = 16 * (uint32_t)(y * WIDTH + x);
            float *rgba = gn_image_at(&f->rgba, x, y);
            rgba[3] = fminf(fmaxf(3 * get_share(i) - 1, 0), 1); // a third each: none, partly, all
            for (uint32_t c = 0; c < 3; c++) {
                rgba[c] = rgba[3] * get_share(i + 1 + c);
                gn_image_at(&f->shadow, x, y)[c] = get_share(i + 4 + c);
                gn_image_at(&f->added, x, y)[c] = get_share(i + 7 + c) / 4;
            }
        }
    }
}

static void test_kernel(void **state)
{
    (void)state;
    static const double deviations[] = {0.05, 0.2, 0.5, 0.7, 1, 2.5, 8};
    struct gn_spread_kernel kernel;
    for (size_t i = 0; i < sizeof(deviations) / sizeof(deviations[0]); i++) {
        gn_spread_make_kernel(deviations[i], &kernel);
        double sum = (double)kernel.weights[0], variance = 0, d2 = deviations[i] * deviations[i];
        for (int k = 1; k <= kernel.radius; k++) {
            assert_true(kernel.weights[k] > 0 && kernel.weights[k] < kernel.weights[k - 1]);
            sum += 2 * (double)kernel.weights[k];
            variance += 2 * k * k * (double)kernel.weights[k];
        }
        assert_true(fabs(sum - 1) < 1e-6);
        assert_true(fabs(variance - d2) < 0.003 * d2);
    }
    gn_spread_make_kernel(0, &kernel);
    assert_true(kernel.radius == 0 && kernel.weights[0] == 1);
}

/* Over an even background, spreading the layers is spreading the sharp composite: here by its own
 * sums, in double, with the picture's border beyond it. */
static void test_blur_is_of_the_picture(void **state)
{
    struct fixture *f = *state;
    const struct gn_response response = {0};
    struct gn_spread_kernel kernel;
    struct gn_image sharp;
    static const double deviations[] = {0.4, 1.3, 8};
    paint_layers(f, 0);
    assert_int_equal(gn_image_init(&sharp, WIDTH, HEIGHT, 3), 0);
    put(f, &response);
    memcpy(sharp.data, f->out.data, 3 * PIXELS * sizeof(float));
    for (size_t d = 0; d < 3; d++) {
        gn_spread_make_kernel(deviations[d], &kernel);
        f->options.match.blur_px = deviations[d];
        put(f, &response);
        for (int i = 0; i < 3 * PIXELS; i += 37) {
            int x = i / 3 % WIDTH, y = i / 3 / WIDTH, r = kernel.radius;
            double sum = 0;
            for (int dy = -r; dy <= r; dy++) {
                for (int dx = -r; dx <= r; dx++) {
                    int at_x = x + dx < 0 ? 0 : x + dx < WIDTH ? x + dx : WIDTH - 1;
                    int at_y = y + dy < 0 ? 0 : y + dy < HEIGHT ? y + dy : HEIGHT - 1;
                    sum += (double)kernel.weights[abs(dx)] * (double)kernel.weights[abs(dy)] *
                           (double)gn_image_at(&sharp, at_x, at_y)[i % 3];
                }
            }
            assert_true(fabs(sum - (double)f->out.data[i]) < 1e-5);
        }
    }
    gn_image_finish(&sharp);
}

/* Codes of a response that does not give them back stay to the bit, except where a layer is within
 * the blur's reach; and noise reaches nothing else. */
static void test_camera_pixels_stay(void **state)
{
    struct fixture *f = *state;
    const struct gn_response response = {.type = GN_RESPONSE_LOG,
                                         .log_a = 0.9,
                                         .log_b = 0.5,
                                         .log_c = 0.1,
                                         .to_rec709 = {2, -1, 0, 0, 1, 0, 0, 0, 1}};
    struct gn_image8 picture, out;
    struct gn_spread_kernel kernel;
    assert_int_equal(gn_image8_init(&picture, WIDTH, HEIGHT, 3), 0);
    assert_int_equal(gn_image8_init(&out, WIDTH, HEIGHT, 3), 0);
    for (int i = 0; i < 3 * PIXELS; i++)
        picture.data[i] = (uint8_t)(i * 31);
    paint_layers(f, 20);
    for (int c = 0; c < 3; c++)
        f->options.match.noise_offset[c] = 0.01;
    for (int blur = 0; blur < 3; blur++) {
        f->options.match.blur_px = blur;
        gn_spread_make_kernel(blur, &kernel);
        assert_int_equal(gn_compositor_put_image8(f->compositor, &f->layers, &picture, &response,
                                                  &f->options, &out),
                         0);
        int n_changed = 0, reach = 20 - kernel.radius;
        for (int i = 0; i < 3 * PIXELS; i++) {
            int x = i / 3 % WIDTH, y = i / 3 / WIDTH;
            if (x < reach || y < reach || x >= WIDTH - reach || y >= HEIGHT - reach)
                assert_int_equal(out.data[i], picture.data[i]);
            else
                n_changed += out.data[i] != picture.data[i];
        }
        assert_true(n_changed > 1000);
    }
    gn_image8_finish(&picture);
    gn_image8_finish(&out);
}

static void test_deviates(void **state)
{
    (void)state;
    struct gn_noise noise;
    double sums[5] = {0};
    gn_noise_init(&noise);
    for (int i = 0; i < GN_NOISE_VALUES; i++)
        for (int k = 0; k < 5; k++)
            sums[k] += pow((double)noise.deviate[i], k) / GN_NOISE_VALUES;
    assert_true(fabs(sums[1]) < 1e-7 && fabs(sums[3]) < 1e-6);
    assert_true(fabs(sums[2] - 1) < 1e-6);
    assert_true(fabs(sums[4] - 3) < 0.05); // the tails end at 3.6
}

/* A camera's noise: of a mean, with the match's slope and offset. */
static double photograph(const struct gn_match *match, int c, double mean, uint32_t *seed)
{
    double u = ((double)gn_noise_get_key(++*seed) + 0.5) * 0x1p-32;
    double v = (double)gn_noise_get_key(++*seed) * 0x1p-32;
    double normal = sqrt(-2 * log(u)) * cos(2 * acos(-1.0) * v); // Box and Muller 1958
    return mean + normal * sqrt(match->noise_slope[c] * mean + match->noise_offset[c]);
}

/* Sums over pixels and frames of one kind of pixel. */
struct sums {
    double n, value, square, next_frame, next_pixel;
};

/* Covered, shadowed and half-covered pixels over a noisy picture have the mean of the formula and
 * the variance that the camera has at that mean, white in time and space. */
static void test_noise(void **state)
{
    struct fixture *f = *state;
    enum { FRAMES = 40, KINDS = 4 };
    static const float coverage[KINDS] = {1, 0, 0.5f, 0.25f}, factor[KINDS] = {1, 0.3f, 1, 0.6f};
    struct sums sums[KINDS][3] = {{{0}}};
    struct gn_response response = {.type = GN_RESPONSE_SRGB, .scale = 3};
    struct gn_match *m = &f->options.match;
    float *last = calloc(3 * PIXELS, sizeof(*last));
    double x = 0.4, u = 0.5; // background, virtual: device values
    uint32_t seed = 1;
    assert_non_null(last);
    *m = (struct gn_match){{2e-3, 1e-3, 0}, {1e-5, 0, 2e-4}, 0};
    for (int i = 0; i < PIXELS; i++) {
        int kind = i / WIDTH % KINDS;
        f->rgba.data[4 * i + 3] = coverage[kind];
        for (int c = 0; c < 3; c++) {
            f->rgba.data[4 * i + c] = (float)(3 * u) * coverage[kind];
            f->shadow.data[3 * i + c] = factor[kind];
        }
    }
    for (int frame = 0; frame < FRAMES; frame++) {
        for (int i = 0; i < 3 * PIXELS; i++)
            f->picture.data[i] = (float)(3 * photograph(m, i % 3, x, &seed));
        f->options.frame = (uint64_t)frame;
        put(f, &response);
        for (int i = 0; i < 3 * PIXELS; i++) {
            int kind = i / 3 / WIDTH % KINDS;
            double a = (double)coverage[kind], mean = (double)factor[kind] * (1 - a) * x + a * u;
            double d = (double)f->out.data[i] / 3 - mean;
            struct sums *s = &sums[kind][i % 3];
            s->n++;
            s->value += d;
            s->square += d * d;
            s->next_frame += d * (double)last[i];
            if (i >= 3 && i / 3 % WIDTH > 0)
                s->next_pixel += d * ((double)f->out.data[i - 3] / 3 - mean);
            last[i] = (float)d;
        }
    }
    for (int i = 0; i < 3 * KINDS; i++) {
        int kind = i / 3, c = i % 3;
        const struct sums *s = &sums[kind][c];
        double a = (double)coverage[kind], mean = (double)factor[kind] * (1 - a) * x + a * u;
        double variance = m->noise_slope[c] * mean + m->noise_offset[c];
        double deviations = 4 / sqrt(s->n); // of a mean, in deviations of one value
        assert_true(fabs(s->value / s->n) < deviations * sqrt(variance));
        assert_true(fabs(s->square / s->n / variance - 1) < deviations * sqrt(2));
        assert_true(fabs(s->next_frame / s->n / variance) < deviations);
        assert_true(fabs(s->next_pixel / s->n / variance) < deviations);
    }
    free(last);
}

/* Where a matrix mixes the channels, the noise that a coloured shadow leaves of the background's is
 * what remains of each channel in itself. */
static void test_noise_through_a_matrix(void **state)
{
    struct fixture *f = *state;
    const struct gn_response response = {.to_rec709 = {1, 0.8, 0, 0.1, 1, 0.3, 0, 0, 1}};
    static const double shadow[3] = {0.9, 0.5, 0.7}, device = 0.5;
    const double offset = 1e-4;
    double m[9], inverse[9];
    assert_true(gn_response_get_matrices(&response, m, inverse));
    for (int c = 0; c < 3; c++)
        f->options.match.noise_offset[c] = offset;
    for (int i = 0; i < 3 * PIXELS; i++) {
        const double *row = m + 3 * (i % 3);
        f->picture.data[i] = (float)(device * (row[0] + row[1] + row[2]));
        f->shadow.data[i] = (float)shadow[i % 3];
    }
    put(f, &response);
    for (int c = 0; c < 3; c++) {
        double sum = 0, squares = 0, kept = 0;
        for (int i = 0; i < PIXELS; i++) {
            float rgb[3];
            memcpy(rgb, f->out.data + 3 * i, sizeof(rgb));
            gn_response_multiply(inverse, rgb);
            sum += (double)rgb[c] / PIXELS;
            squares += (double)rgb[c] * (double)rgb[c] / PIXELS;
        }
        for (int k = 0; k < 3; k++)
            kept += inverse[3 * c + k] * shadow[k] * m[3 * k + c];
        double variance = offset * (1 - kept * kept);
        assert_true(fabs(squares - sum * sum - variance) < 0.08 * variance); // 4 deviations
    }
}

/* The same frame has the same noise, alone or on a pool; the next one and the other view another.
 */
static void test_noise_is_of_the_frame(void **state)
{
    struct fixture *f = *state;
    const struct gn_response response = {.to_rec709 = {0.8, 0.2, 0, 0.1, 0.9, 0, 0, 0.3, 0.7}};
    struct gn_compositor *alone;
    struct gn_image first;
    size_t bytes = 3 * PIXELS * sizeof(float);
    assert_int_equal(gn_compositor_create(NULL, &alone), 0);
    assert_int_equal(gn_image_init(&first, WIDTH, HEIGHT, 3), 0);
    paint_layers(f, 5);
    f->options.frame = 7;
    f->options.match = (struct gn_match){{1e-3, 1e-3, 1e-3}, {1e-4, 1e-4, 1e-4}, 1.1};
    assert_int_equal(
        gn_compositor_put_linear(alone, &f->layers, &f->picture, &response, &f->options, &first),
        0);
    put(f, &response);
    assert_memory_equal(first.data, f->out.data, bytes);
    f->options.frame = 8;
    put(f, &response);
    assert_memory_not_equal(first.data, f->out.data, bytes);
    gn_compositor_destroy(&alone);
    gn_image_finish(&first);
}

static void test_refusals(void **state)
{
    (void)state;
    static const double bad[] = {NAN, -1e-9, 1.01, INFINITY};
    const char *reason = NULL;
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        for (int c = 0; c < 3; c++) {
            struct gn_match slope = {0}, offset = {0};
            slope.noise_slope[c] = offset.noise_offset[c] = bad[i];
            assert_int_equal(gn_match_check(&slope, &reason), -EINVAL);
            assert_int_equal(gn_match_check(&offset, &reason), -EINVAL);
            assert_string_equal(
                reason, "slope and offset of a camera's noise must lie in [0, 1] in each channel");
        }
        const struct gn_match blur = {.blur_px = 8 * bad[i]};
        assert_int_equal(gn_match_check(&blur, &reason), -EINVAL);
        assert_string_equal(reason, "a camera's blur must lie in [0, 8] px");
    }
    const struct gn_match most = {{1, 1, 1}, {1, 1, 1}, 8};
    assert_int_equal(gn_match_check(&most, NULL), 0);
}

/* Each part of the set is what it takes when it is left out, and nothing else. */
static void test_keep(void **state)
{
    (void)state;
    const struct gn_camera full = {
        .distortion = {0.1, 0.2, 0.3, 0.4, 0.5},
        .response = {.type = GN_RESPONSE_GAMMA,
                     .gamma = 2,
                     .to_rec709 = {2, 0, 1, 0, 3, 0, 0, 0, 1},
                     .scale = 7},
        .match = {{1e-3, 1e-3, 1e-3}, {1e-5, 1e-5, 1e-5}, 2},
    };
    for (unsigned parts = 0; parts <= GN_MATCH_ALL; parts++) {
        struct gn_camera c = full;
        gn_match_keep(parts, &c);
        assert_int_equal(c.response.scale == 7, (parts & GN_MATCH_EXPOSURE) != 0);
        assert_int_equal(c.response.to_rec709[2] == 1, (parts & GN_MATCH_WHITE_BALANCE) != 0);
        assert_int_equal(c.response.type == GN_RESPONSE_GAMMA, (parts & GN_MATCH_RESPONSE) != 0);
        assert_int_equal(c.distortion[4] == 0.5, (parts & GN_MATCH_DISTORTION) != 0);
        assert_int_equal(gn_match_has_noise(&c.match), (parts & GN_MATCH_NOISE) != 0);
        assert_int_equal(c.match.blur_px == 2, (parts & GN_MATCH_BLUR) != 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kernel),
        cmocka_unit_test_setup_teardown(test_blur_is_of_the_picture, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_camera_pixels_stay, set_up, tear_down),
        cmocka_unit_test(test_deviates),
        cmocka_unit_test_setup_teardown(test_noise, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_noise_through_a_matrix, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_noise_is_of_the_frame, set_up, tear_down),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_keep),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
