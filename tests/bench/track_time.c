/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What tracking takes of one core per 640 x 480 picture, 30 a second: median and mean of processor
 * time, from the picture as it is captured to the steady pose. The backdrop is plain, or as
 * cluttered as a value noise of many sizes makes it. Then what a search for a marker that is not
 * there takes, in larger pictures too: whole, and its shares of live pictures. usage:
 * bench_track_time [frames]
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "client/track/search.h"
#include "client/track/tracker.h"
#include "client/vision/markers.h"
#include "common/jpeg.h"
#include "tests/bench/marker_shots.h"
#include "tests/bench/timing.h"

enum { WIDTH = GN_BENCH_SHOT_WIDTH, HEIGHT = GN_BENCH_SHOT_HEIGHT, N_SHOTS = 16 };

/** What is measured: a picture's kind and what is in it. */
static const struct {
    const char *name;
    int columns, rows; // of markers of 36 or, alone, of 80 mm; 0: none
    bool is_jpeg, is_cluttered;
} rows[] = {
    {"one marker, RGB", 1, 1, false, false},          {"one marker, JPEG", 1, 1, true, false},
    {"one marker, RGB, clutter", 1, 1, false, true},  {"board of 12, RGB", 4, 3, false, false},
    {"board of 12, RGB, clutter", 4, 3, false, true}, {"no marker, RGB", 0, 0, false, false},
    {"no marker, RGB, clutter", 0, 0, false, true},
};

static double get_processor_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static void measure(int row, const struct gn_rig_marker_camera *rig, int n_frames)
{
    static struct gn_bodies bodies;
    static struct gn_rig_sheet sheet;
    uint8_t *files[N_SHOTS] = {0};
    struct gn_image8 shots[N_SHOTS] = {{0}};
    struct gn_capture captures[N_SHOTS];
    struct gn_camera camera = {.width = WIDTH,
                               .height = HEIGHT,
                               .fx = gn_bench_lens.fx,
                               .fy = gn_bench_lens.fy,
                               .cx = gn_bench_lens.cx,
                               .cy = gn_bench_lens.cy,
                               .response = {.type = GN_RESPONSE_SRGB},
                               .world_from_camera = {.rotation = {1, 0, 0, 0}}};
    struct gn_tracker *tracker = NULL;
    struct gn_jpeg *jpeg = NULL;
    struct gn_bench_times times = {0};
    double sum_ms = 0;
    memcpy(camera.distortion, gn_bench_lens.distortion, sizeof(camera.distortion));
    gn_bench_make_world(rows[row].columns, rows[row].rows, &bodies, &sheet);
    gn_bench_check(gn_jpeg_create(&jpeg), "jpeg");
    for (int i = 0; i < N_SHOTS; i++) {
        gn_bench_shoot(rig, &sheet, rows[row].is_cluttered, i, &shots[i]);
        size_t size = 0;
        captures[i] = (struct gn_capture){.name = "shot",
                                          .width = WIDTH,
                                          .height = HEIGHT,
                                          .format = GN_CAPTURE_RGB8,
                                          .data = shots[i].data,
                                          .data_bytes = WIDTH * HEIGHT * 3};
        if (!rows[row].is_jpeg)
            continue;
        size_t bound = gn_jpeg_get_bound(WIDTH, HEIGHT);
        files[i] = malloc(bound);
        gn_bench_check(
            files[i] ? gn_jpeg_encode(jpeg, &shots[i], NULL, files[i], bound, &size, NULL) : -1,
            "jpeg");
        captures[i].format = GN_CAPTURE_JPEG;
        captures[i].data = files[i];
        captures[i].data_bytes = size;
    }
    const struct gn_tracker_options options = {
        .camera = &camera, .bodies = &bodies, .is_live = true};
    gn_bench_check(gn_tracker_create(&options, &tracker, NULL), "tracker");
    for (int i = 0; i < n_frames + 3; i++) {
        double start_ms = get_processor_ms();
        gn_bench_check(
            gn_tracker_update(tracker, &captures[i % N_SHOTS], i * INT64_C(33333333), NULL),
            "tracking");
        if (i < 3 || times.n == GN_BENCH_REPEATS_MAX)
            continue;
        times.ms[times.n] = get_processor_ms() - start_ms;
        sum_ms += times.ms[times.n++];
    }
    struct gn_tracker_counts counts;
    gn_tracker_get_counts(tracker, &counts);
    struct gn_bench_timing t = gn_bench_sum_up(&times);
    printf("%-28s %6.2f ms (IQR %.2f), mean %.2f, %llu of %llu seen, %llu searched whole\n",
           rows[row].name, t.median, t.iqr, sum_ms / times.n, (unsigned long long)counts.n_seen,
           (unsigned long long)counts.n_pictures,
           (unsigned long long)counts.markers.n_searched_whole);
    for (int i = 0; i < N_SHOTS; i++) {
        gn_image8_finish(&shots[i]);
        free(files[i]);
    }
    gn_tracker_destroy(&tracker);
    gn_jpeg_destroy(&jpeg);
    gn_bodies_finish(&bodies);
}

/** The picture in grey and, mirrored at its edges, beside and below itself. The caller frees it. */
static uint8_t *make_larger(const struct gn_image8 *shot, int width, int height)
{
    uint8_t *grey = malloc((size_t)width * (size_t)height);
    gn_bench_check(grey ? 0 : -1, "memory");
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int u = x / WIDTH % 2 ? WIDTH - 1 - x % WIDTH : x % WIDTH;
            int v = y / HEIGHT % 2 ? HEIGHT - 1 - y % HEIGHT : y % HEIGHT;
            grey[y * width + x] = shot->data[3 * (v * WIDTH + u) + 1];
        }
    }
    return grey;
}

/** Processor time of such a look, ms; the first one takes memory, too. */
static double measure_look(struct gn_search *search, const struct gn_grey *grey, unsigned looks)
{
    static struct gn_search_finds finds;
    struct gn_bench_times times = {0};
    for (int i = 0; i < 8; i++) {
        double start_ms = get_processor_ms();
        gn_bench_check(gn_search_find(search, grey, NULL, looks, &finds, NULL), "search");
        if (i > 0)
            times.ms[times.n++] = get_processor_ms() - start_ms;
    }
    return gn_bench_sum_up(&times).median;
}

static void measure_search(const struct gn_rig_marker_camera *rig, bool is_cluttered, int width,
                           int height)
{
    static const int id = 7;
    struct gn_bodies bodies;
    struct gn_rig_sheet sheet;
    struct gn_image8 shot = {0};
    struct gn_search *search = NULL;
    const struct gn_camera camera = {.width = width,
                                     .height = height,
                                     .fx = width,
                                     .fy = width,
                                     .cx = width / 2.0,
                                     .cy = height / 2.0,
                                     .world_from_camera = {.rotation = {1, 0, 0, 0}}};
    const struct gn_search_options options = {.camera = &camera, .ids = &id, .n_ids = 1};
    gn_bench_make_world(0, 0, &bodies, &sheet);
    gn_bench_shoot(rig, &sheet, is_cluttered, 0, &shot);
    uint8_t *pixels = make_larger(&shot, width, height);
    struct gn_grey grey = {.pixels = pixels, .width = width, .height = height};
    for (int i = 0; i < 256; i++)
        grey.linear[i] = (float)i / 255.0F;
    gn_bench_check(gn_search_create(&options, &search, NULL), "search");
    printf("%4d x %4d, %-7s  whole %6.2f ms, with small ones %6.2f; shares:", width, height,
           is_cluttered ? "clutter" : "plain", measure_look(search, &grey, GN_SEARCH_WHOLE),
           measure_look(search, &grey, GN_SEARCH_WHOLE | GN_SEARCH_SMALL));
    for (unsigned look = GN_SEARCH_SMALL; look <= GN_SEARCH_COARSE; look *= 2)
        printf(" %.2f", measure_look(search, &grey, look));
    printf(" ms\n");
    gn_search_destroy(&search);
    gn_image8_finish(&shot);
    gn_bodies_finish(&bodies);
    free(pixels);
}

int main(int argc, char *argv[])
{
    static const int sizes[][2] = {{640, 480}, {1280, 720}, {1920, 1080}};
    struct gn_rig_marker_camera rig;
    int n_frames = argc > 1 ? atoi(argv[1]) : 60;
    if (!gn_vision_is_built()) {
        puts("this build has no OpenCV");
        return 0;
    }
    gn_bench_check(gn_rig_marker_camera_init(&rig, &gn_bench_lens), "lens");
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++)
        measure((int)i, &rig, n_frames);
    for (int i = 0; i < 2 * 3; i++)
        measure_search(&rig, i % 2 == 0, sizes[i / 2][0], sizes[i / 2][1]);
    gn_rig_marker_camera_finish(&rig);
    return 0;
}
