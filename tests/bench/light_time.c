/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Median time, by stage, from a raw frame to a lighting state, as a stream has it: tables shared,
 * one thread. Usage: light_time [SECONDS-PER-CASE]
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/half.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"

enum { N_RUNS_MAX = 1000, N_WARM_UP = 3, N_STAGES = 4 };

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Runs until the time is used up; returns the number of runs, times by stage in ms. */
static int run(const struct light_fixture *f, enum gn_light_method method, double seconds,
               double out_ms[N_STAGES][N_RUNS_MAX], int *out_n_lights)
{
    struct gn_lighting_state *state = NULL;
    int n = 0;
    int64_t end_ns = 0;
    for (int i = 0; n < N_RUNS_MAX && (n < 5 || gn_clock_get_monotonic_ns() < end_ns); i++) {
        struct gn_light_options options = {.method = method, .previous = state};
        struct gn_lighting_state *next;
        struct gn_error error = {0};
        int64_t start_ns = gn_clock_get_monotonic_ns();
        if (gn_lighting_state_create(&f->frame, NULL, &options, NULL, &next, &error) < 0) {
            fprintf(stderr, "light_time: %s\n", error.text);
            exit(1);
        }
        double total = (double)(gn_clock_get_monotonic_ns() - start_ns) / (double)GN_NS_PER_MS;
        gn_lighting_state_unref(&state);
        state = next;
        if (i < N_WARM_UP) {
            end_ns = gn_clock_get_monotonic_ns() + (int64_t)(seconds * (double)GN_NS_PER_S);
            continue;
        }
        double ms[N_STAGES] = {state->ms_map, state->ms_sh, state->ms_lights, total};
        for (int s = 0; s < N_STAGES; s++)
            out_ms[s][n] = ms[s];
        n++;
    }
    *out_n_lights = state->n_lights;
    gn_lighting_state_unref(&state);
    return n;
}

static void report(const char *name, struct light_fixture *f, double seconds)
{
    static double ms[N_STAGES][N_RUNS_MAX];
    for (int method = 0; method < GN_LIGHT_METHOD_COUNT; method++) {
        int n_lights, n = run(f, (enum gn_light_method)method, seconds, ms, &n_lights);
        for (int s = 0; s < N_STAGES; s++)
            qsort(ms[s], (size_t)n, sizeof(ms[s][0]), compare);
        printf("%-28s %-10s %7d %8.3f %8.3f %8.3f %8.3f %6d\n", name,
               gn_light_method_get_name((enum gn_light_method)method), n_lights, ms[0][n / 2],
               ms[1][n / 2], ms[2][n / 2], ms[3][n / 2], n);
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
    printf("%-28s %-10s %7s %8s %8s %8s %8s %6s\n", "median ms, one thread", "method", "lights",
           "map", "sh", "lights", "total", "runs");
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct light_fixture f;
        if (light_fixture_init(&f, cases[i].type, cases[i].width, cases[i].height) < 0)
            return 1;
        light_fixture_fill(&f, light_fixture_room);
        uint8_t *raw = make_raw(&f, cases[i].layout);
        if (!raw)
            return 1;
        report(cases[i].name, &f, seconds);
        free(raw);
        light_fixture_finish(&f);
    }
    return 0;
}
