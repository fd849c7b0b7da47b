/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's test (section 6) on a stand-in for its scene: 814 triangles, camera 500 mm from the
 * marker, object of a teapot's size on a table among boxes; lights spread over the upper
 * hemisphere. Median of whole frames, and the paper's own seconds beside its rows.
 * usage: bench_render_time [frames [threads]]
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/meshes.h"
#include "tests/stage.h"

#define MAX_FRAMES 101

static const float grey[3] = {0.5f, 0.5f, 0.5f};

/** The paper's table: seconds without and with shadow on its machine (Athlon 3000+, 2007). */
static const struct paper_row {
    int width, n_lights;
    double without_s, with_s; // 0: not given
} paper[] = {
    {320, 59, 0.5, 1.2},  {640, 59, 1.3, 4.0},   {320, 76, 0.6, 1.3},
    {640, 76, 0.7, 4.6},  {320, 86, 0.6, 3.7},   {640, 86, 1.5, 14.0},
    {320, 122, 0.7, 6.2}, {640, 122, 2.2, 24.0}, {640, 178, 0, 0},
};

static void paint_one(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 1;
}

/** Table 2, five boxes 60, ball 4 * 14 * 13 = 728, and a plane of 24: 814 triangles. */
static void init_scene(struct gn_test_stage *stage, int n_threads)
{
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(0.8f, 1), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    for (int i = 0; i < 5; i++) {
        double angle = 2 * M_PI * i / 5 + 0.3;
        gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_box(0.05f, 0.04f, 0.06f),
                          0.17 * cos(angle), 0.17 * sin(angle), 0.03, GN_MATERIAL_DIFFUSE, grey);
    }
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.05f, 14), 0, 0, 0.052,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_disc(0.03f, 24), 0, 0, 0.104,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(stage, n_threads);
    gn_test_stage_set_map(stage, 64, 32, paint_one, NULL);
}

/** n lights of the upper hemisphere, even by Fibonacci, some far brighter than the rest. */
static void set_lights(struct gn_test_stage *stage, int n)
{
    struct gn_light *lights = calloc((size_t)n, sizeof(*lights));
    if (!lights)
        abort();
    for (int i = 0; i < n; i++) {
        double z = 1 - (i + 0.5) / n;
        double phi = i * M_PI * (3 - sqrt(5));
        lights[i].dir_world[0] = (float)(sqrt(1 - z * z) * cos(phi));
        lights[i].dir_world[1] = (float)(sqrt(1 - z * z) * sin(phi));
        lights[i].dir_world[2] = (float)z;
        for (int k = 0; k < 3; k++)
            lights[i].irradiance[k] = (float)((i % 10 == 0 ? 20 : 1) * 2 * M_PI / n);
    }
    gn_test_stage_set_lights(stage, lights, n);
    free(lights);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a;
    double y = *(const double *)b;
    return (x > y) - (x < y);
}

/** Median ms of n frames after three that warm up; *out_spread: interquartile range. */
static double measure(struct gn_test_stage *stage, const struct gn_render_options *options, int n,
                      double *out_spread)
{
    double ms[MAX_FRAMES];
    for (int i = -3; i < n; i++) {
        gn_test_stage_render(stage, options);
        if (i >= 0)
            ms[i] = stage->report.ms_total;
    }
    qsort(ms, (size_t)n, sizeof(ms[0]), compare);
    *out_spread = ms[3 * n / 4] - ms[n / 4];
    return ms[n / 2];
}

static void print_row(struct gn_test_stage *stage, const struct paper_row *row,
                      enum gn_quality quality, bool has_shadow, int n_frames)
{
    struct gn_render_options options = {.quality = quality, .no_shadow = !has_shadow};
    double spread;
    double ms = measure(stage, &options, n_frames, &spread);
    const struct gn_render_report *r = &stage->report;
    uint64_t rays = r->rays_primary + r->rays_mirror + r->rays_shade + r->rays_shadow;
    double paper_s = has_shadow ? row->with_s : row->without_s;
    printf("%4dx%-4d %5d %-12s %-6s %9.2f %7.2f %10llu %7.1f", stage->camera.width,
           stage->camera.height, r->n_lights, quality == GN_QUALITY_SEED ? "seed" : "interactive",
           has_shadow ? "yes" : "no", ms, spread, (unsigned long long)rays,
           1e-3 * (double)rays / ms);
    if (quality == GN_QUALITY_SEED && paper_s > 0)
        printf(" %7.1f s %8.0fx", paper_s, 1e3 * paper_s / ms);
    printf("\n");
    if (getenv("GN_BENCH_PASSES"))
        printf(
            "    primary %.2f, shade %.2f, shadow %.2f ms; rays %llu, %llu, %llu; refined %lld\n",
            r->ms_primary, r->ms_shade, r->ms_shadow, (unsigned long long)r->rays_primary,
            (unsigned long long)r->rays_shade, (unsigned long long)r->rays_shadow,
            (long long)r->n_refined_pixels);
}

int main(int argc, char **argv)
{
    int n_frames = argc > 1 ? atoi(argv[1]) : 11;
    int n_threads = argc > 2 ? atoi(argv[2]) : 2;
    if (n_frames < 1 || n_frames > MAX_FRAMES || n_threads < 1 || n_threads > 256) {
        fprintf(stderr, "usage: %s [frames 1..%d [threads 1..256]]\n", argv[0], MAX_FRAMES);
        return 1;
    }
    struct gn_test_stage stage = {0};
    const double eye[3] = {0.1, -0.38, 0.31};
    const double marker[3] = {0, 0, 0};
    init_scene(&stage, n_threads);
    printf("%d triangles, %d threads, median of %d frames\n",
           stage.scene->n_real_triangles + stage.scene->n_virtual_triangles, n_threads, n_frames);
    printf("size      lights quality      shadow        ms     iqr       rays  Mray/s     paper\n");
    for (size_t i = 0; i < sizeof(paper) / sizeof(paper[0]); i++) {
        const struct paper_row *row = &paper[i];
        gn_test_stage_aim(&stage, row->width, row->width * 3 / 4, row->width, eye, marker);
        set_lights(&stage, row->n_lights);
        for (int variant = 0; variant < 4; variant++)
            print_row(&stage, row, variant < 2 ? GN_QUALITY_SEED : GN_QUALITY_INTERACTIVE,
                      variant % 2 == 1, n_frames);
    }
    gn_test_stage_finish(&stage);
    return 0;
}
