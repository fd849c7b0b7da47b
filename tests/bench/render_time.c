/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's table (section 6) on the rig's room: 814 triangles with the teapot, camera 500 mm
 * from the marker, the lamp room with four lamps on as its 300 x 300 fisheye sees it, and the
 * lights that the paper's partition makes of it at the settings of seed_settings.h. Medians of
 * whole frames without codec, the paper's own seconds beside its rows; below them interactive
 * quality. cpu: processor time of all threads, which other programs on the machine disturb less.
 * usage: bench_render_time [frames [threads]]
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "tests/bench/rig_frame.h"
#include "tests/bench/timing.h"

/** The paper's table: seconds without and with shadow on its machine (Athlon 3000+, 2007). The rows
 * of 76 lights shade by the irradiance map; of 178 lights the paper gives no times. */
static const struct paper_row {
    int width, n_lights;
    double without_s, with_s; // 0: not given
} paper[] = {
    {320, 59, 0.5, 1.2},  {640, 59, 1.3, 4.0},   {320, 86, 0.6, 3.7}, {640, 86, 1.5, 14.0},
    {320, 122, 0.7, 6.2}, {640, 122, 2.2, 24.0}, {320, 76, 0.6, 1.3}, {640, 76, 0.7, 4.6},
    {320, 178, 0, 0},     {640, 178, 0, 0},
};

static double get_cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/** Renders and prints a row: medians after two frames that warm up. Returns the wall time, ms. */
static double measure(struct gn_bench_rig *rig, int n_frames, const struct gn_lighting_state *light,
                      const char *name, const struct gn_render_options *options)
{
    struct gn_bench_times wall = {0}, cpu = {0};
    for (int i = -2; i < n_frames; i++) {
        double cpu_before = get_cpu_ms();
        gn_bench_start(&wall);
        gn_bench_rig_render(rig, light, options);
        if (i < 0)
            continue;
        gn_bench_stop(&wall);
        cpu.ms[cpu.n++] = get_cpu_ms() - cpu_before;
    }
    struct gn_bench_timing w = gn_bench_sum_up(&wall);
    const struct gn_render_report *r = &rig->report;
    uint64_t rays = r->rays_primary + r->rays_mirror + r->rays_shade + r->rays_shadow;
    printf("%4dx%-4d %6d %-22s %-6s %9.2f %7.2f %9.2f %10llu %7.1f", rig->camera.width,
           rig->camera.height, light->n_lights, name, options->no_shadow ? "no" : "yes", w.median,
           w.iqr, gn_bench_sum_up(&cpu).median, (unsigned long long)rays,
           1e-3 * (double)rays / w.median);
    return w.median;
}

static void print_paper_row(struct gn_bench_rig *rig, int n_frames, const struct paper_row *row,
                            bool has_shadow)
{
    bool is_map = row->n_lights == 76;
    struct gn_render_options options = {.quality = GN_QUALITY_SEED,
                                        .shading =
                                            is_map ? GN_SHADING_IRRADIANCE : GN_SHADING_LIGHTS,
                                        .no_shadow = !has_shadow};
    struct gn_lighting_state *light = gn_bench_rig_make_seed_light(rig, row->n_lights);
    gn_bench_rig_aim(rig, row->width);
    double ms = measure(rig, n_frames, light, is_map ? "seed, irradiance map" : "seed", &options);
    double paper_s = has_shadow ? row->with_s : row->without_s;
    if (paper_s > 0)
        printf(" %6.1f s %7.0fx", paper_s, 1e3 * paper_s / ms);
    printf("\n");
    gn_lighting_state_unref(&light);
}

int main(int argc, char **argv)
{
    struct gn_bench_rig rig;
    int n_frames = argc > 1 ? atoi(argv[1]) : 11;
    int n_threads = argc > 2 ? atoi(argv[2]) : 2;
    if (n_frames < 1 || n_frames > GN_BENCH_REPEATS_MAX || n_threads < 1 || n_threads > 256) {
        fprintf(stderr, "usage: %s [frames 1..%d [threads 1..256]]\n", argv[0],
                GN_BENCH_REPEATS_MAX);
        return 1;
    }
    gn_bench_rig_init(&rig, n_threads);
    printf("%d triangles, %d threads, median of %d frames\n",
           rig.scene->n_real_triangles + rig.scene->n_virtual_triangles, n_threads, n_frames);
    printf("size      lights quality                shadow        ms     iqr       cpu       rays"
           "  Mray/s  paper\n");
    for (size_t i = 0; i < GN_ARRAY_LEN(paper); i++) {
        print_paper_row(&rig, n_frames, &paper[i], false);
        print_paper_row(&rig, n_frames, &paper[i], true);
    }
    for (int i = 0; i < 4; i++) {
        struct gn_light_options light_options = {.n_lights = i < 2 ? 64 : 122};
        struct gn_render_options options = {.quality = GN_QUALITY_INTERACTIVE};
        struct gn_lighting_state *light = gn_bench_rig_make_light(&rig, &light_options);
        gn_bench_rig_aim(&rig, i % 2 ? 640 : 320);
        (void)measure(&rig, n_frames, light, "interactive", &options);
        printf("\n");
        gn_lighting_state_unref(&light);
    }
    gn_bench_rig_finish(&rig);
    return 0;
}
