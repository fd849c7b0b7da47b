/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's test (section 6) on a stand-in for its scene: 814 triangles, camera 500 mm from the
 * marker, object of a teapot's size on a table among boxes; lights spread over the upper
 * hemisphere. Median of whole frames, and the paper's own seconds beside its rows.
 * cpu: processor time of all threads, which other programs on the machine disturb less.
 * usage: bench_render_time [frames [threads [row]]]
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

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

#define N_ROWS ((int)(sizeof(paper) / sizeof(paper[0])))

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

/** Medians of some frames' times, ms. */
struct times {
    double wall, spread, cpu; // spread: interquartile range of wall
};

static double get_cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/** Of n frames, after two that warm up. */
static struct times measure(struct gn_test_stage *stage, const struct gn_render_options *options,
                            int n)
{
    double wall[MAX_FRAMES];
    double cpu[MAX_FRAMES];
    for (int i = -2; i < n; i++) {
        double before = get_cpu_ms();
        gn_test_stage_render(stage, options);
        if (i < 0)
            continue;
        cpu[i] = get_cpu_ms() - before;
        wall[i] = stage->report.ms_total;
    }
    qsort(wall, (size_t)n, sizeof(wall[0]), compare);
    qsort(cpu, (size_t)n, sizeof(cpu[0]), compare);
    return (struct times){
        .wall = wall[n / 2], .spread = wall[3 * n / 4] - wall[n / 4], .cpu = cpu[n / 2]};
}

static void print_row(struct gn_test_stage *stage, const struct paper_row *row,
                      enum gn_quality quality, bool has_shadow, int n_frames)
{
    struct gn_render_options options = {.quality = quality, .no_shadow = !has_shadow};
    struct times t = measure(stage, &options, n_frames);
    const struct gn_render_report *r = &stage->report;
    uint64_t rays = r->rays_primary + r->rays_mirror + r->rays_shade + r->rays_shadow;
    double paper_s = has_shadow ? row->with_s : row->without_s;
    printf("%4dx%-4d %5d %-12s %-6s %9.2f %7.2f %9.2f %10llu %7.1f", stage->camera.width,
           stage->camera.height, r->n_lights, quality == GN_QUALITY_SEED ? "seed" : "interactive",
           has_shadow ? "yes" : "no", t.wall, t.spread, t.cpu, (unsigned long long)rays,
           1e-3 * (double)rays / t.wall);
    if (quality == GN_QUALITY_SEED && paper_s > 0)
        printf(" %7.1f s %8.0fx", paper_s, 1e3 * paper_s / t.wall);
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
    int row_only = argc > 3 ? atoi(argv[3]) : -1;
    if (n_frames < 1 || n_frames > MAX_FRAMES || n_threads < 1 || n_threads > 256 ||
        row_only >= N_ROWS) {
        fprintf(stderr, "usage: %s [frames 1..%d [threads 1..256 [row 0..%d]]]\n", argv[0],
                MAX_FRAMES, N_ROWS - 1);
        return 1;
    }
    struct gn_test_stage stage = {0};
    const double eye[3] = {0.1, -0.38, 0.31};
    const double marker[3] = {0, 0, 0};
    init_scene(&stage, n_threads);
    printf("%d triangles, %d threads, median of %d frames\n",
           stage.scene->n_real_triangles + stage.scene->n_virtual_triangles, n_threads, n_frames);
    printf(
        "size      lights quality      shadow        ms     iqr       cpu       rays  Mray/s     "
        "paper\n");
    for (int i = 0; i < N_ROWS; i++) {
        if (row_only >= 0 && i != row_only)
            continue;
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
