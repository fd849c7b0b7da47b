/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the composite of one 640 x 480 frame of 8-bit codes takes, plain and with the camera's noise
 * and blur: medians. The layers are an object of an eighth of the picture with a shadow of another
 * eighth, as in the demo's frames, and, as the worst case, both all over it.
 * usage: bench_composite_time [frames [threads]]
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/composite.h"

enum { WIDTH = 640, HEIGHT = 480, MAX_FRAMES = 1001 };

static const struct {
    const char *name;
    struct gn_match match;
} rows[] = {
    {"plain", {{0}, {0}, 0}},
    {"noise", {{1e-3, 1e-3, 1e-3}, {1e-5, 1e-5, 1e-5}, 0}},
    {"blur 0.7 px", {{0}, {0}, 0.7}},
    {"blur 1.5 px", {{0}, {0}, 1.5}},
    {"noise, blur 0.7 px", {{1e-3, 1e-3, 1e-3}, {1e-5, 1e-5, 1e-5}, 0.7}},
};

static void check(int result, const char *what)
{
    if (result == 0)
        return;
    fprintf(stderr, "bench_composite_time: %s: %s\n", what, strerror(-result));
    exit(1);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* A disc of the object, and its shadow's beside it; everywhere: all of the picture is both. */
static void paint(struct gn_image *rgba, struct gn_image *shadow, bool everywhere)
{
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            bool is_object = hypot(x - 280, y - 240) < 110;
            bool is_shadow = !is_object && hypot(x - 380, y - 280) < 130;
            float a = everywhere ? 0.5f : is_object ? 1 : 0;
            float s = everywhere || is_shadow ? 0.6f : 1;
            for (int c = 0; c < 3; c++) {
                gn_image_at(rgba, x, y)[c] = a * 0.4f;
                gn_image_at(shadow, x, y)[c] = s;
            }
            gn_image_at(rgba, x, y)[3] = a;
        }
    }
}

int main(int argc, char *argv[])
{
    static double ms[MAX_FRAMES];
    int n_frames = argc > 1 ? atoi(argv[1]) : 101, n_threads = argc > 2 ? atoi(argv[2]) : 0;
    struct gn_pool *pool = NULL;
    struct gn_compositor *compositor = NULL;
    struct gn_image rgba = {0}, shadow = {0}, added = {0};
    struct gn_image8 picture = {0}, out = {0};
    if (n_frames < 1 || n_frames > MAX_FRAMES || n_threads < 0 || n_threads > 256) {
        fprintf(stderr, "usage: bench_composite_time [frames (1 to %d) [threads (0 to 256)]]\n",
                MAX_FRAMES);
        return 2;
    }
    check(gn_pool_create(n_threads, &pool), "threads");
    check(gn_compositor_create(pool, &compositor), "compositor");
    check(gn_image_init(&rgba, WIDTH, HEIGHT, 4), "layers");
    check(gn_image_init(&shadow, WIDTH, HEIGHT, 3), "layers");
    check(gn_image_init(&added, WIDTH, HEIGHT, 3), "layers");
    check(gn_image8_init(&picture, WIDTH, HEIGHT, 3), "picture");
    check(gn_image8_init(&out, WIDTH, HEIGHT, 3), "picture");
    for (int i = 0; i < 3 * WIDTH * HEIGHT; i++)
        picture.data[i] = (uint8_t)(40 + i * 7919LL % 160);
    const struct gn_composite_layers layers = {&rgba, &shadow, &added};
    const struct gn_response response = {.type = GN_RESPONSE_SRGB};
    printf("%d frames of %d x %d, %d threads, median ms\n", n_frames, WIDTH, HEIGHT,
           gn_pool_get_size(pool));
    printf("%-20s %8s %8s\n", "", "object", "all");
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        printf("%-20s", rows[i].name);
        for (int everywhere = 0; everywhere < 2; everywhere++) {
            paint(&rgba, &shadow, everywhere);
            for (int k = -2; k < n_frames; k++) { // two to warm up
                const struct gn_composite_options options = {.match = rows[i].match,
                                                             .frame = (uint64_t)(k + 2)};
                int64_t start_ns = gn_clock_get_monotonic_ns();
                check(gn_compositor_put_image8(compositor, &layers, &picture, &response, &options,
                                               &out),
                      "composite");
                if (k >= 0)
                    ms[k] = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
            }
            qsort(ms, (size_t)n_frames, sizeof(ms[0]), compare);
            printf(" %8.2f", ms[n_frames / 2]);
        }
        printf("\n");
    }
    gn_image8_finish(&out);
    gn_image8_finish(&picture);
    gn_image_finish(&added);
    gn_image_finish(&shadow);
    gn_image_finish(&rgba);
    gn_compositor_destroy(&compositor);
    gn_pool_destroy(&pool);
    return 0;
}
