/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the pixels of one 640 x 480 frame of a V4L2 camera cost, format by format: medians of one
 * thread's processor time, and bytes written for a byte given (1: the one conversion; 0: lent).
 * usage: bench_v4l2_time [frames]
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "client/capture/v4l2_pixels.h"
#include "proto/attr.h"

enum { WIDTH = 640, HEIGHT = 480, MAX_FRAMES = 10001 };

static const struct {
    uint32_t fourcc;
    unsigned n_row_bytes, n_rows;
    bool is_8_bit;
} rows[] = {
    {V4L2_PIX_FMT_YUYV, 2 * WIDTH, HEIGHT, true},  {V4L2_PIX_FMT_NV12, WIDTH, HEIGHT * 3 / 2, true},
    {V4L2_PIX_FMT_RGB24, 3 * WIDTH, HEIGHT, true}, {V4L2_PIX_FMT_BGR24, 3 * WIDTH, HEIGHT, true},
    {V4L2_PIX_FMT_GREY, WIDTH, HEIGHT, true},      {V4L2_PIX_FMT_Y10, 2 * WIDTH, HEIGHT, false},
    {V4L2_PIX_FMT_Y12, 2 * WIDTH, HEIGHT, false},  {V4L2_PIX_FMT_Y16, 2 * WIDTH, HEIGHT, false},
};

/* No constant picture; codes of depth bits where they take two bytes. */
static void paint(uint8_t *data, size_t n, int depth)
{
    for (size_t i = 0; i < n; i++) {
        data[i] = (uint8_t)(i * 7919 % 251);
        if (depth > 8 && i % 2)
            data[i] &= (uint8_t)((1 << (depth - 8)) - 1);
    }
}

static double get_cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char *argv[])
{
    static uint8_t data[3 * WIDTH * HEIGHT], out[3 * WIDTH * HEIGHT];
    static double ms[MAX_FRAMES];
    int n_frames = argc > 1 ? atoi(argv[1]) : 501;
    if (n_frames < 1 || n_frames > MAX_FRAMES) {
        fprintf(stderr, "usage: bench_v4l2_time [frames (1 to %d)]\n", MAX_FRAMES);
        return 2;
    }
    printf("%d frames of %d x %d, median ms of one thread\n", n_frames, WIDTH, HEIGHT);
    for (size_t i = 0; i < GN_ARRAY_LEN(rows); i++) {
        const struct v4l2_pix_format pix = {.width = WIDTH,
                                            .height = HEIGHT,
                                            .pixelformat = rows[i].fourcc,
                                            .field = V4L2_FIELD_NONE,
                                            .bytesperline = rows[i].n_row_bytes,
                                            .sizeimage = rows[i].n_row_bytes * rows[i].n_rows};
        struct gn_v4l2_layout layout;
        struct gn_error error = {0};
        if (gn_v4l2_layout_init(&pix, rows[i].is_8_bit, &layout, &error) < 0) {
            fprintf(stderr, "bench_v4l2_time: %s\n", error.text);
            return 1;
        }
        bool is_sound = true;
        paint(data, sizeof(data), layout.pixels->depth);
        for (int k = -2; k < n_frames; k++) { // two to warm up
            double start_ms = get_cpu_ms();
            is_sound = gn_v4l2_has_sound_codes(&layout, data) && is_sound;
            if (!layout.is_borrowed)
                gn_v4l2_convert(&layout, data, out);
            if (k >= 0)
                ms[k] = get_cpu_ms() - start_ms;
        }
        qsort(ms, (size_t)n_frames, sizeof(ms[0]), compare);
        printf("%-5s %7.3f ms, %d copies%s\n", layout.pixels->name, ms[n_frames / 2],
               layout.is_borrowed ? 0 : 1, is_sound ? "" : ", refused");
    }
    return 0;
}
