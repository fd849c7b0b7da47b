/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gige_tool ID FORMAT WIDTH HEIGHT RATE N deep|8: reads N pictures of gnomon-fake-gige's pattern
 * through the client's source, holds every byte to the pattern, and prints what was counted as
 * JSON. FORMAT -, WIDTH 0, RATE 0: left to the camera.
 */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "client/capture/gige.h"
#include "client/capture/pixels.h"
#include "common/clock.h"
#include "proto/attr.h"
#include "tests/rig/gige_picture.h"

/** So many reads in a row without a picture are the end: 20 s. Reads are counted, not time, which
 * goes on while the machine stands still. */
#define MAX_SILENT_READS (20000 / GN_SOURCE_WAIT_MS)

/** What one picture of the pattern becomes. */
struct expected {
    const struct gn_pixels_format *format;
    bool is_8_bit;
    int width, height;
    uint8_t *native, *bytes;
    size_t n_native, n_bytes;
};

static int init(struct expected *e, const char *name, bool is_8_bit, int width, int height)
{
    for (uint32_t top = 0x0108; top <= 0x0230; top++) {
        for (uint32_t low = 0; low < 0x100; low++) {
            const struct gn_pixels_format *f = gn_pixels_find(top << 16 | low);
            if (f && strcmp(f->name, name) == 0)
                e->format = f;
        }
    }
    if (!e->format)
        return -EINVAL;
    e->is_8_bit = is_8_bit;
    e->width = width;
    e->height = height;
    e->n_native = gn_pixels_get_bytes(e->format, width, height);
    e->n_bytes = gn_pixels_get_capture_bytes(gn_pixels_get_capture_format(e->format, is_8_bit),
                                             width, height);
    e->native = malloc(e->n_native);
    e->bytes = malloc(e->n_bytes);
    return e->native && e->bytes ? 0 : -ENOMEM;
}

/** The upper rows of a picture. */
static const uint8_t *make(struct expected *e, uint64_t id, int height)
{
    memset(e->native, 0, e->n_native);
    gn_gige_pack(e->format, NULL, id, e->width, height, e->native);
    if (gn_pixels_is_same(e->format, e->is_8_bit))
        return e->native;
    if (gn_pixels_convert(e->format, e->is_8_bit, e->width, height, e->native, e->bytes))
        memset(e->bytes, 0, e->n_bytes);
    return e->bytes;
}

static bool is_picture(struct expected *e, const struct gn_capture *capture, uint64_t id)
{
    // The first row tells most pictures apart, and needs no more than the second of a mosaic.
    size_t row_bytes = e->n_bytes / (size_t)e->height;
    return capture->data_bytes == e->n_bytes &&
           memcmp(make(e, id, 2), capture->data, row_bytes) == 0 &&
           memcmp(make(e, id, e->height), capture->data, e->n_bytes) == 0;
}

/** Whether the picture is one after the last that was seen; a camera that restarts begins at 0. */
static bool is_next(struct expected *e, const struct gn_capture *capture, uint64_t *next)
{
    for (uint64_t id = *next; id < *next + 200; id++) {
        if (is_picture(e, capture, id)) {
            *next = id + 1;
            return true;
        }
    }
    for (uint64_t id = 0; id < 4096; id++) {
        if (is_picture(e, capture, id)) {
            *next = id + 1;
            return true;
        }
    }
    return false;
}

static double get_cpu_ms(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) * 1e3 +
           (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-3;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double get_median(double *values, size_t n)
{
    qsort(values, n, sizeof(*values), compare);
    return values[n / 2];
}

int main(int argc, char *argv[])
{
    if (argc != 8)
        return 2;
    struct gn_live_options options = {.id = argv[1],
                                      .pixel_format = strcmp(argv[2], "-") ? argv[2] : NULL,
                                      .width = atoi(argv[3]),
                                      .height = atoi(argv[4]),
                                      .frame_rate_hz = atof(argv[5]),
                                      .is_8_bit = strcmp(argv[7], "8") == 0};
    struct gn_source *source = NULL;
    struct gn_error error = {0};
    struct expected expected = {0};
    long n_wanted = atol(argv[6]), n = 0, n_wrong = 0, n_unordered = 0;
    static double off_ms[100000]; // by how much steps between pictures are no whole frame times
    double age_max_ms = 0, age_min_ms = 1e9, age_sum_ms = 0, step_max_ms = 0;
    int64_t last_ns = 0, gap_ns = 0;
    uint64_t next = 0;
    int n_silent = 0;
    if (gn_gige_open(&options, &source, &error) < 0) {
        fprintf(stderr, "gige_tool: %s\n", error.text);
        return 1;
    }
    bool is_checked = options.pixel_format && options.width;
    int err =
        is_checked ? init(&expected, argv[2], options.is_8_bit, options.width, options.height) : 0;
    double cpu_ms = get_cpu_ms();
    int64_t begin_ns = gn_clock_get_monotonic_ns(), heard_ns = begin_ns;
    while (!err && n < n_wanted) {
        struct gn_capture capture;
        int got = gn_source_read(source, &capture, &error);
        int64_t now_ns = gn_clock_get_monotonic_ns();
        if (got == -EAGAIN) {
            if (error.text[0])
                fprintf(stderr, "%s\n", error.text);
            if (++n_silent > MAX_SILENT_READS)
                err = gn_error_set(&error, -ETIMEDOUT, "no picture for 20 s");
        } else if (got != 1) {
            err = got ? got : -ENODATA;
        } else {
            double age_ms = (double)(now_ns - capture.time_ns) * 1e-6;
            age_sum_ms += age_ms;
            age_max_ms = age_ms > age_max_ms ? age_ms : age_max_ms;
            age_min_ms = age_ms < age_min_ms ? age_ms : age_min_ms;
            n_wrong += is_checked && !is_next(&expected, &capture, &next);
            n_unordered += capture.time_ns <= last_ns;
            if (last_ns && now_ns - heard_ns > gap_ns)
                gap_ns = now_ns - heard_ns;
            if (n > 0 && n < (long)GN_ARRAY_LEN(off_ms) && options.frame_rate_hz > 0) {
                double steps = (double)(capture.time_ns - last_ns) * 1e-9 * options.frame_rate_hz;
                off_ms[n - 1] = fabs(steps - round(steps)) * 1e3 / options.frame_rate_hz;
            }
            last_ns = capture.time_ns;
            heard_ns = now_ns;
            n_silent = 0;
            if (n++ == 0)
                step_max_ms = (double)(now_ns - begin_ns) * 1e-6;
            printf("%ld %d\n", n, capture.format);
            fflush(stdout);
        }
    }
    struct gn_source_counts c;
    gn_source_get_counts(source, &c);
    if (err)
        fprintf(stderr, "gige_tool: %s\n", error.text);
    cpu_ms = get_cpu_ms() - cpu_ms;
    printf("{\"pictures\": %ld, \"wrong\": %ld, \"unordered\": %ld, \"complete\": %" PRIu64
           ", \"incomplete\": %" PRIu64 ", \"skipped\": %" PRIu64 ", \"lost\": %" PRIu64
           ", \"lost_packets\": %" PRIu64 ", \"resent\": %" PRIu64 ", \"reopened\": %" PRIu64
           ", \"copies\": %.3f, \"age_ms\": [%.2f, %.2f, %.2f], "
           "\"gap_ms\": %.1f, \"first_ms\": %.1f, \"cpu_ms\": %.3f, \"off_ms\": %.3f}\n",
           n, n_wrong, n_unordered, c.n_complete, c.n_incomplete, c.n_skipped, c.n_lost,
           c.n_lost_packets, c.n_resent_packets, c.n_reopened,
           c.read_bytes ? (double)c.copied_bytes / (double)c.read_bytes : 0, age_min_ms,
           n ? age_sum_ms / (double)n : 0, age_max_ms, (double)gap_ns * 1e-6, step_max_ms,
           n ? cpu_ms / (double)n : 0, n > 1 ? get_median(off_ms, (size_t)n - 1) : 0);
    gn_source_close(&source);
    free(expected.native);
    free(expected.bytes);
    return err ? 1 : 0;
}
