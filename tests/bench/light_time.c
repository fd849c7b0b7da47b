/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Median time, by stage, from a raw frame to a published lighting state, as a stream has it: tables
 * shared, smoothed in time, each frame a little brighter or darker than the last, one thread. The
 * floor is what must be moved, at the speed at which this machine copies that much memory: the raw
 * frame read, the map written (12 bytes a texel), and for harmonics and for lights each radiance,
 * direction and solid angle read (28). faults: pages mapped anew, a frame.
 * Usage: light_time [SECONDS-PER-CASE [CASE [METHOD]]], the last two parts of names.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "common/clock.h"
#include "common/half.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"

enum { N_RUNS_MAX = 1000, N_WARM_UP = 3, N_STAGES = 6 };

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* This thread's, which a busy machine does not lengthen by the time that others took. */
static double get_cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static long get_faults(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt;
}

/* Runs until the time is used up; returns the number of runs, times by stage in ms. */
static int run(struct light_fixture *f, enum gn_light_method method, double seconds,
               double out_ms[N_STAGES][N_RUNS_MAX], int *out_n_lights, long *out_n_faults)
{
    struct gn_lighting_state *state = NULL;
    int n = 0;
    long first_fault = 0;
    int64_t end_ns = 0;
    for (int i = 0; n < N_RUNS_MAX && (n < 5 || gn_clock_get_monotonic_ns() < end_ns); i++) {
        struct gn_light_options options = {.method = method, .previous = state, .smoothing = 0.4};
        f->frame.capture_time_ns += 33333333;
        f->frame.response.scale = i % 2 ? 1.0 : 1.01;
        struct gn_lighting_state *next;
        struct gn_error error = {0};
        double start_cpu_ms = get_cpu_ms();
        int64_t start_ns = gn_clock_get_monotonic_ns();
        if (gn_lighting_state_create(&f->frame, NULL, &options, NULL, &next, &error) < 0) {
            fprintf(stderr, "light_time: %s\n", error.text);
            exit(1);
        }
        double cpu = get_cpu_ms() - start_cpu_ms;
        double total = (double)(gn_clock_get_monotonic_ns() - start_ns) / (double)GN_NS_PER_MS;
        gn_lighting_state_unref(&state);
        state = next;
        if (i < N_WARM_UP) {
            first_fault = get_faults();
            end_ns = gn_clock_get_monotonic_ns() + (int64_t)(seconds * (double)GN_NS_PER_S);
            continue;
        }
        double ms[N_STAGES] = {state->ms_map,      state->ms_sh, state->ms_lights,
                               state->ms_temporal, total,        cpu};
        for (int s = 0; s < N_STAGES; s++)
            out_ms[s][n] = ms[s];
        n++;
    }
    *out_n_lights = state->n_lights;
    *out_n_faults = (get_faults() - first_fault) / n;
    gn_lighting_state_unref(&state);
    return n;
}

static void report(const char *name, const char *method_part, struct light_fixture *f,
                   double seconds, double floor_ms)
{
    static double ms[N_STAGES][N_RUNS_MAX];
    memset(ms, 0, sizeof(ms)); // its pages are there before faults are counted
    for (int method = 0; method < GN_LIGHT_METHOD_COUNT; method++) {
        const char *method_name = gn_light_method_get_name((enum gn_light_method)method);
        if (!strstr(method_name, method_part))
            continue;
        long n_faults;
        int n_lights, n = run(f, (enum gn_light_method)method, seconds, ms, &n_lights, &n_faults);
        for (int s = 0; s < N_STAGES; s++)
            qsort(ms[s], (size_t)n, sizeof(ms[s][0]), compare);
        printf("%-28s %-10s %7d %8.3f %8.3f %8.3f %8.3f %8.3f %8.3f %8.3f %6ld %6d\n", name,
               method_name, n_lights, ms[0][n / 2], ms[1][n / 2], ms[2][n / 2], ms[3][n / 2],
               ms[4][n / 2], ms[5][n / 2], floor_ms, n_faults, n);
    }
}

/* The fixture's picture as it comes off the wire; the caller's. */
static uint8_t *make_raw(struct light_fixture *f, enum gn_pixel_layout layout)
{
    size_t n = (size_t)f->image.width * (size_t)f->image.height;
    int n_values = layout == GN_PIXELS_MONO_U16 ? 1 : 3, value_bytes = 2;
    if (layout == GN_PIXELS_RGB_F32)
        value_bytes = 4;
    if (layout == GN_PIXELS_MONO_U16 || layout == GN_PIXELS_RGB_U16) {
        f->frame.response = (struct gn_response){// y = a + b ln(c + x) over five decades
                                                 .type = GN_RESPONSE_LOG,
                                                 .log_a = 0.6,
                                                 .log_b = 0.08,
                                                 .log_c = 0.01};
        f->frame.code_max = 4095;
        gn_response_from_radiance(&f->frame.response, f->image.data, (long)n);
    }
    uint8_t *raw = malloc(n * (size_t)(n_values * value_bytes));
    for (size_t i = 0; raw && i < n * (size_t)n_values; i++) {
        float v = f->image.data[n_values == 1 ? 3 * i + 1 : i];
        uint16_t bits16 = f->frame.code_max ? (uint16_t)lrintf(v * 4095) : gn_half_from_float(v);
        if (value_bytes == 4)
            memcpy(raw + 4 * i, &v, 4);
        else
            memcpy(raw + 2 * i, &bits16, 2);
    }
    f->frame.layout = layout;
    f->frame.raw = raw;
    f->frame.codes = NULL;
    return raw;
}

static int get_texel_bytes(enum gn_pixel_layout layout)
{
    return layout == GN_PIXELS_RGB_F32 ? 12 : layout == GN_PIXELS_MONO_U16 ? 2 : 6;
}

/* Of a copy whose two sides together have so many bytes: each is read or written once. Both are
 * written first, so that each has pages of its own. The best of some. */
static double get_ms_per_byte(size_t bytes)
{
    size_t half = bytes / 2;
    unsigned char *from = malloc(half), *to = malloc(half);
    double best = 1e9;
    if (from && to) {
        for (size_t i = 0; i < half; i++)
            from[i] = (unsigned char)i;
        memset(to, 0, half);
    }
    for (int i = 0; from && to && i < 15; i++) {
        int64_t start_ns = gn_clock_get_monotonic_ns();
        from[i] = (unsigned char)~i;
        memcpy(to, from, half);
        double ms = (double)(gn_clock_get_monotonic_ns() - start_ns) / (double)GN_NS_PER_MS;
        best = ms < best && to[i] == from[i] ? ms : best;
    }
    free(from);
    free(to);
    return best / (2 * (double)half);
}

int main(int argc, char **argv)
{
    static const struct {
        const char *name;
        enum gn_projection_type type;
        int width, height;
        enum gn_pixel_layout layout; // 16 bits: the codes of a log sensor, 12 of them used
    } cases[] = {
        {"fisheye 300x300 float", GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300, GN_PIXELS_RGB_F32},
        {"fisheye 300x300 log 12 bit", GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300,
         GN_PIXELS_MONO_U16},
        {"latlong 1024x512 float", GN_PROJECTION_LATLONG, 1024, 512, GN_PIXELS_RGB_F32},
        {"latlong 1024x512 log 12 bit", GN_PROJECTION_LATLONG, 1024, 512, GN_PIXELS_RGB_U16},
        {"latlong 2048x1024 float", GN_PROJECTION_LATLONG, 2048, 1024, GN_PIXELS_RGB_F32},
        {"latlong 2048x1024 half", GN_PROJECTION_LATLONG, 2048, 1024, GN_PIXELS_RGB_F16},
        {"latlong 2048x1024 log 12 bit", GN_PROJECTION_LATLONG, 2048, 1024, GN_PIXELS_RGB_U16},
    };
    double seconds = argc > 1 ? strtod(argv[1], NULL) : 0.3;
    const char *case_part = argc > 2 ? argv[2] : "", *method_part = argc > 3 ? argv[3] : "";
    printf("%-28s %-10s %7s %8s %8s %8s %8s %8s %8s %8s %6s %6s\n", "median ms, one thread",
           "method", "lights", "map", "sh", "lights", "time", "total", "cpu", "floor", "faults",
           "runs");
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct light_fixture f;
        if (!strstr(cases[i].name, case_part))
            continue;
        if (light_fixture_init(&f, cases[i].type, cases[i].width, cases[i].height) < 0)
            return 1;
        light_fixture_fill(&f, light_fixture_room);
        uint8_t *raw = make_raw(&f, cases[i].layout);
        if (!raw)
            return 1;
        double texels = (double)cases[i].width * cases[i].height;
        double bytes = texels * (get_texel_bytes(cases[i].layout) + 12 + 28 + 28);
        report(cases[i].name, method_part, &f, seconds, bytes * get_ms_per_byte((size_t)bytes));
        free(raw);
        light_fixture_finish(&f);
    }
    return 0;
}
