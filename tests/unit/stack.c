/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Responses from exposure stacks made of maps with known light by known curves, with noise: the
 * table, and the radiance that the stack merges to.
 */
#include "client/calibrate/stack.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/compare.h"
#include "common/image_file.h"
#include "proto/attr.h"
#include "tests/random.h"
#include "tests/real_data.h"
#include "tests/unit/cmocka_setup.h"

/** In the folder GNOMON_DATA names. */
#define MAPS "hdr/equirect/"

#define WIDTH 256
#define HEIGHT 128
#define PICTURES 13

static uint64_t random_state = 1;

/* Three cameras: sRGB, gamma 2.2, and one with a shoulder as film has. */
enum { SRGB, GAMMA, FILM, CURVES };
static const char *const curve_names[CURVES] = {"srgb", "gamma 2.2", "film"};

static double encode(int curve, double x)
{
    x = fmin(fmax(x, 0), 1);
    if (curve == SRGB)
        return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
    if (curve == GAMMA)
        return pow(x, 1 / 2.2);
    return log1p(20 * x) / log1p(20);
}

static double decode(int curve, double y)
{
    if (curve == SRGB)
        return y <= 0.04045 ? y / 12.92 : pow((y + 0.055) / 1.055, 2.4);
    if (curve == GAMMA)
        return pow(y, 2.2);
    return expm1(y * log1p(20)) / 20;
}

/* Five decades of light, smooth and in patches, three colours. */
static void paint(struct gn_image *map)
{
    assert_int_equal(gn_image_init(map, WIDTH, HEIGHT, 3), 0);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            for (int c = 0; c < 3; c++) {
                double tone = sin(0.05 * x + c) * cos(0.09 * y) + 0.4 * (((x / 16) ^ (y / 16)) & 1);
                gn_image_at(map, x, y)[c] = (float)pow(10, 2.2 * tone);
            }
}

/* Exposures in steps of 2; noise: of the light 1 %, of the code half a step. */
static void expose(const struct gn_image *map, int curve, double noise,
                   struct gn_image8 pictures[PICTURES], double times[PICTURES])
{
    for (int k = 0; k < PICTURES; k++) {
        times[k] = 0.004 * pow(2, k);
        assert_int_equal(gn_image8_init(&pictures[k], map->width, map->height, 3), 0);
        for (int i = 0; i < map->width * map->height * 3; i++) {
            double x = (double)map->data[i] * times[k] *
                       (1 + noise * gn_test_random_normal(&random_state));
            pictures[k].data[i] =
                (uint8_t)fmin(fmax(floor(255 * encode(curve, x) +
                                         50 * noise * gn_test_random_normal(&random_state) + 0.5),
                                   0),
                              255);
        }
    }
}

static void finish(struct gn_image8 *pictures)
{
    for (int k = 0; k < PICTURES; k++)
        gn_image8_finish(&pictures[k]);
}

/* RMS in ln of the table against the true curve over codes 10 to 245, scale free. */
static double get_table_error(const float *table, int curve)
{
    double mean = 0, sum = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int z = 10; z <= 245; z++) {
            double d = log((double)table[z] / decode(curve, z / 255.0)) - mean / 236;
            if (pass == 0)
                mean += d + mean / 236;
            else
                sum += d * d;
        }
    return sqrt(sum / 236);
}

struct radiance_error {
    double p95, worst, median; // relative, scale free
    double decades;            // of the light compared
};

/* Light that some picture shows between the rails. */
static struct radiance_error get_radiance_error(const struct gn_image *map,
                                                const struct gn_image *merged, int curve,
                                                const double times[PICTURES])
{
    long n = (long)map->width * map->height * 3, used = 0;
    double low = decode(curve, 25 / 255.0) / times[PICTURES - 1];
    double high = decode(curve, 235 / 255.0) / times[0], least = INFINITY, most = 0;
    float *ratios = malloc((size_t)n * sizeof(*ratios));
    assert_non_null(ratios);
    for (long i = 0; i < n; i++) {
        double truth = (double)map->data[i];
        if (truth < low || truth > high)
            continue;
        least = fmin(least, truth);
        most = fmax(most, truth);
        ratios[used++] = (float)((double)merged->data[i] / truth);
    }
    qsort(ratios, (size_t)used, sizeof(*ratios), gn_compare_floats);
    double scale = (double)ratios[used / 2];
    for (long i = 0; i < used; i++)
        ratios[i] = (float)fabs((double)ratios[i] / scale - 1);
    qsort(ratios, (size_t)used, sizeof(*ratios), gn_compare_floats);
    struct radiance_error e = {(double)ratios[used * 95 / 100], (double)ratios[used - 1],
                               (double)ratios[used / 2], log10(most / least)};
    free(ratios);
    return e;
}

static void check_map(const struct gn_image *map, const char *name, int n_curves)
{
    for (int curve = 0; curve < n_curves; curve++) {
        struct gn_image8 pictures[PICTURES];
        double times[PICTURES];
        expose(map, curve, 0.01, pictures, times);
        struct gn_stack stack = {pictures, times, PICTURES};
        for (int method = GN_STACK_DEBEVEC; method <= GN_STACK_ROBERTSON; method++) {
            struct gn_stack_options options = {.method = (enum gn_stack_method)method};
            struct gn_stack_response r;
            struct gn_error e = {0};
            if (gn_stack_fit(&stack, &options, &r, &e))
                fail_msg("%s", e.text);
            struct gn_image merged;
            assert_int_equal(gn_stack_merge(&stack, r.table, &merged, NULL), 0);
            double g = get_table_error(r.table, curve);
            struct radiance_error error = get_radiance_error(map, &merged, curve, times);
            printf("# %s, %s, %s (%d rounds): g %.4f, radiance over %.1f decades: median %.2f %%, "
                   "95 %% "
                   "below %.2f %%, worst %.1f %%\n",
                   name, curve_names[curve], method ? "Robertson" : "Debevec", r.iterations, g,
                   error.decades, 100 * error.median, 100 * error.p95, 100 * error.worst);
            assert_true(g < 0.01);
            assert_true(error.p95 < 0.05);
            for (int z = 1; z < 256; z++)
                assert_true(r.table[z] >= r.table[z - 1]);
            gn_image_finish(&merged);
        }
        finish(pictures);
    }
}

static void test_synthetic_map(void **unused)
{
    (void)unused;
    struct gn_image map;
    paint(&map);
    check_map(&map, "made", CURVES);
    gn_image_finish(&map);
}

/* A photographed map, thinned to 256 columns. Its light spans more than the stack does. */
static void test_photographed_map(void **unused)
{
    (void)unused;
    static const char *const names[] = {MAPS "studio_small_03_1k.hdr",
                                        MAPS "drachenfels_cellar_1k.hdr"};
    for (size_t i = 0; i < GN_ARRAY_LEN(names); i++) {
        char path[PATH_MAX];
        struct gn_image_file file;
        struct gn_image map;
        struct gn_error e = {0};
        if (gn_image_read_file(real_data_path(names[i], path), &file, &e))
            fail_msg("%s", e.text);
        assert_int_equal(gn_image_init(&map, WIDTH, HEIGHT, 3), 0);
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++)
                memcpy(gn_image_at(&map, x, y),
                       gn_image_at(&file.linear, x * file.linear.width / WIDTH,
                                   y * file.linear.height / HEIGHT),
                       3 * sizeof(float));
        check_map(&map, names[i], 1);
        gn_image_finish(&map);
        gn_image_file_finish(&file);
    }
}

static void test_refusals(void **unused)
{
    (void)unused;
    struct gn_image map;
    struct gn_image8 pictures[PICTURES];
    double times[PICTURES];
    paint(&map);
    expose(&map, SRGB, 0.01, pictures, times);
    struct gn_stack_response r;
    struct gn_stack_options options = {0};
    double same[3] = {1, 1.1, 1.05}, backwards[PICTURES], bad[3] = {1, 0, 2};
    for (int k = 0; k < PICTURES; k++)
        backwards[k] = times[PICTURES - 1 - k];
    struct gn_image8 small = {.width = 2, .height = 2, .channels = 3};
    struct gn_image8 two[2] = {pictures[0], small};
    struct gn_image8 flat;
    assert_int_equal(gn_image8_init(&flat, 64, 64, 3), 0);
    struct gn_image8 black[2] = {flat, flat};
    const struct {
        struct gn_stack stack;
        const char *word;
    } cases[] = {
        {{pictures, times, 1}, "2 to 32 pictures, found 1"},
        {{pictures, same, 3}, "differ by a factor of 1.1 only"},
        {{pictures, bad, 3}, "picture 2: its time"},
        {{two, times, 2}, "picture 2 is 2 x 2"},
        {{black, times, 2}, "shows 0 codes"},
        {{pictures, backwards, PICTURES}, "codes fall as the exposure rises"},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++)
        for (int method = 0; method < 2; method++) {
            struct gn_error e = {0};
            options.method = (enum gn_stack_method)method;
            int ret = gn_stack_fit(&cases[i].stack, &options, &r, &e);
            if (ret >= 0 || !strstr(e.text, cases[i].word))
                fail_msg("case %zu, method %d: %d \"%s\" does not say \"%s\"", i, method, ret,
                         e.text, cases[i].word);
        }
    gn_image8_finish(&flat);
    finish(pictures);
    gn_image_finish(&map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_synthetic_map),
        unit_test_with_real_data(test_photographed_map, MAPS "drachenfels_cellar_1k.hdr"),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
