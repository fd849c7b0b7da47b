/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What tracking takes of one core per 640 x 480 picture: medians of processor time, from the
 * picture as it is captured to the steady pose. The backdrop is plain, or as cluttered as
 * a value noise of many sizes makes it.
 * usage: bench_track_time [frames]
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "client/track/rotation.h"
#include "client/track/tracker.h"
#include "client/vision/markers.h"
#include "common/jpeg.h"
#include "tests/bench/timing.h"
#include "tests/rig/marker_picture.h"
#include "tests/rig/random.h"

enum { WIDTH = 640, HEIGHT = 480, N_SHOTS = 16 };

static const struct gn_rig_view lens = {.width = WIDTH,
                                        .height = HEIGHT,
                                        .fx = 720,
                                        .fy = 716,
                                        .cx = 331.3,
                                        .cy = 234.8,
                                        .distortion = {-0.21, 0.11, 0.0012, -0.0007, -0.03},
                                        .blur_px = 0.6};

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

/** Blotches from 4 to 64 px, as dark and as light as the markers. */
static void clutter(struct gn_image *linear)
{
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            float *p = gn_image_at(linear, x, y);
            if (fabsf(p[0] - (float)gn_rig_backdrop) > 1e-3F)
                continue;
            double sum = 0;
            for (uint32_t size = 4; size <= 64; size *= 2) {
                uint32_t out[4];
                gn_rig_philox((const uint32_t[4]){(uint32_t)x / size, (uint32_t)y / size, size, 0},
                              (const uint32_t[2]){3, 1}, out);
                sum += out[0] * 0x1p-32;
            }
            p[0] = p[1] = p[2] = (float)(0.8 * pow(sum / 5, 3));
        }
    }
}

static void shoot(const struct gn_rig_marker_camera *still, const struct gn_rig_sheet *sheet,
                  bool is_cluttered, int i, struct gn_image8 *out)
{
    struct gn_rig_marker_camera camera = *still;
    struct gn_image linear = {0};
    double s = 0.02 * sin(0.3 * i);
    const double eye[3] = {0.25 + s, -0.2, 0.38 + s}, target[3] = {0.01 + s, 0, 0};
    const struct gn_rig_noise noise = {.slope = 1e-4, .offset = 2e-6};
    gn_rig_look_at(eye, target, camera.view.world_from_camera);
    gn_bench_check(gn_rig_take_markers(&camera, sheet, sheet->n_printed > 0, &linear), "picture");
    if (is_cluttered)
        clutter(&linear);
    gn_bench_check(gn_image8_init(out, WIDTH, HEIGHT, 3), "picture");
    gn_rig_photograph(linear.data, WIDTH * HEIGHT, &noise, 3, i, out->data);
    gn_image_finish(&linear);
}

/** A world of that many markers, printed on a sheet. */
static void make_world(int columns, int n_rows, struct gn_bodies *bodies,
                       struct gn_rig_sheet *sheet)
{
    gn_bench_check(gn_bodies_read_text("6x6_250:0:0.08", bodies, NULL), "bodies");
    struct gn_body *b = &bodies->bodies[0];
    memset(sheet, 0, sizeof(*sheet));
    gn_mat4_identity(sheet->world_from_sheet);
    sheet->half_width = columns > 1 ? 0.1 : 0.06;
    sheet->half_height = columns > 1 ? 0.08 : 0.06;
    for (int i = 0; i < columns * n_rows; i++) {
        struct gn_rig_printed *p = &sheet->printed[sheet->n_printed++];
        *p = (struct gn_rig_printed){.x = (i % columns - (columns - 1) / 2.0) * 0.046,
                                     .y = ((n_rows - 1) / 2.0 - i / columns) * 0.046,
                                     .size = columns > 1 ? 0.036 : 0.08};
        p->cells = gn_marker_get_cells(bodies->dictionary, i, p->white);
        b->markers[i].id = i;
        for (int k = 0; k < 4; k++) {
            b->markers[i].corners_body[k][0] = p->x + (k == 1 || k == 2 ? 0.5 : -0.5) * p->size;
            b->markers[i].corners_body[k][1] = p->y + (k < 2 ? 0.5 : -0.5) * p->size;
        }
    }
    b->n_markers = columns * n_rows > 0 ? columns * n_rows : 1;
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
                               .fx = lens.fx,
                               .fy = lens.fy,
                               .cx = lens.cx,
                               .cy = lens.cy,
                               .response = {.type = GN_RESPONSE_SRGB},
                               .world_from_camera = {.rotation = {1, 0, 0, 0}}};
    struct gn_tracker *tracker = NULL;
    struct gn_jpeg *jpeg = NULL;
    struct gn_bench_times times = {0};
    memcpy(camera.distortion, lens.distortion, sizeof(camera.distortion));
    make_world(rows[row].columns, rows[row].rows, &bodies, &sheet);
    gn_bench_check(gn_jpeg_create(&jpeg), "jpeg");
    for (int i = 0; i < N_SHOTS; i++) {
        shoot(rig, &sheet, rows[row].is_cluttered, i, &shots[i]);
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
    const struct gn_tracker_options options = {.camera = &camera, .bodies = &bodies};
    gn_bench_check(gn_tracker_create(&options, &tracker, NULL), "tracker");
    for (int i = 0; i < n_frames + 3; i++) {
        double start_ms = get_processor_ms();
        gn_bench_check(
            gn_tracker_update(tracker, &captures[i % N_SHOTS], i * INT64_C(33000000), NULL),
            "tracking");
        if (i >= 3 && times.n < GN_BENCH_REPEATS_MAX)
            times.ms[times.n++] = get_processor_ms() - start_ms;
    }
    struct gn_tracker_counts counts;
    gn_tracker_get_counts(tracker, &counts);
    struct gn_bench_timing t = gn_bench_sum_up(&times);
    printf("%-28s %6.2f ms (IQR %.2f), %llu of %llu seen, %llu searched whole\n", rows[row].name,
           t.median, t.iqr, (unsigned long long)counts.n_seen,
           (unsigned long long)counts.n_pictures, (unsigned long long)counts.n_searched_whole);
    for (int i = 0; i < N_SHOTS; i++) {
        gn_image8_finish(&shots[i]);
        free(files[i]);
    }
    gn_tracker_destroy(&tracker);
    gn_jpeg_destroy(&jpeg);
    gn_bodies_finish(&bodies);
}

int main(int argc, char *argv[])
{
    struct gn_rig_marker_camera rig;
    int n_frames = argc > 1 ? atoi(argv[1]) : 60;
    if (!gn_vision_is_built()) {
        puts("this build has no OpenCV");
        return 0;
    }
    gn_bench_check(gn_rig_marker_camera_init(&rig, &lens), "lens");
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++)
        measure((int)i, &rig, n_frames);
    gn_rig_marker_camera_finish(&rig);
    return 0;
}
