/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The hardest row of the paper's table: 640 x 480, 122 lights, with shadows. Whole frames, the
 * renderer's and those of the naive loop in turn. The naive frame is the renderer's own without
 * shadow, and then the loop. Before each of the renderer's frames all lights have turned a little,
 * so that it has none of what it keeps of them; before each second one the camera has moved as
 * well.
 */
#include <math.h>
#include <string.h>

#include "tests/bench/performance/naive.h"
#include "tests/bench/performance/performance.h"
#include "tests/bench/timing.h"

#define WIDTH 640
#define N_LIGHTS 122
#define MAX_PEERS 4
#define N_OURS 2  // the camera rests, moves
#define STEP 1e-3 // m

/** One way to do the frame, and the naive loops that do the same. */
struct kind {
    const char *name;
    struct gn_render_options options;
    int n_peers;
    enum gn_naive_real peers[MAX_PEERS / GN_NAIVE_ORDERS]; // each in both orders
    bool is_same;                                          // the same pixels: compared
};

static const struct kind kinds[] = {
    {"paper", {.quality = GN_QUALITY_SEED}, 1, {GN_NAIVE_NO_REAL}, true},
    {"one-ray",
     {.quality = GN_QUALITY_INTERACTIVE, .single_ray = true},
     2,
     {GN_NAIVE_REAL_FIRST, GN_NAIVE_REAL_WHERE_CUT},
     true},
    // The loop has one ray for a pixel still, as no loop knows where more are needed.
    {"interactive",
     {.quality = GN_QUALITY_INTERACTIVE},
     2,
     {GN_NAIVE_REAL_FIRST, GN_NAIVE_REAL_WHERE_CUT},
     false},
};

static const char *const order_names[] = {"pixels", "lights"};
static const char *const real_names[] = {"none", "first", "where-cut"};

static const char *const camera_names[N_OURS] = {"rests", "moves"};

/** The renderer's frame, after one under other light, from elsewhere where the camera moves. */
static void time_frame(struct gn_bench_rig *rig, const struct gn_lighting_state *light,
                       const struct gn_lighting_state *turned, bool moves,
                       const struct gn_render_options *options, struct gn_bench_times *times)
{
    rig->camera.world_from_camera.translation[0] += moves ? STEP : 0;
    gn_bench_rig_render(rig, turned, options);
    rig->camera.world_from_camera.translation[0] -= moves ? STEP : 0;
    gn_bench_start(times);
    gn_bench_rig_render(rig, light, options);
    gn_bench_stop(times);
}

/** The naive loop of one kind's i-th peer. */
static void choose_peer(const struct kind *kind, int i, struct gn_naive *naive)
{
    naive->order = (enum gn_naive_order)(i % GN_NAIVE_ORDERS);
    naive->real = kind->peers[i / GN_NAIVE_ORDERS];
    naive->is_unweighted = kind->options.quality == GN_QUALITY_SEED;
}

static void measure_kind(const struct gn_performance *run, struct gn_bench_rig *rig,
                         const struct gn_lighting_state *light,
                         const struct gn_lighting_state *turned, struct gn_naive *naive,
                         const struct kind *kind, FILE *file)
{
    struct gn_render_options without = kind->options;
    without.no_shadow = true;
    without.single_ray = true;
    int n_peers = kind->n_peers * GN_NAIVE_ORDERS;
    struct gn_bench_times times[N_OURS + MAX_PEERS] = {{0}};
    struct gn_shadow_difference differences[MAX_PEERS] = {{0}};
    uint64_t rays[MAX_PEERS];
    struct gn_image shadow;
    gn_bench_check(gn_image_init(&shadow, rig->layers.width, rig->layers.height, 3), "a picture");
    for (int round = 0; round < 1 + run->n_repeats; round++) { // the first warms up
        for (int i = N_OURS - 1; i >= 0; i--) {
            gn_bench_rig_render(rig, light,
                                &kind->options); // where the camera was before, it rests
            time_frame(rig, light, turned, i == 1, &kind->options, &times[i]);
        }
        if (round == 0)
            memcpy(shadow.data, rig->layers.shadow.data,
                   3 * sizeof(float) * (size_t)shadow.width * (size_t)shadow.height);
        for (int i = 0; i < n_peers; i++) {
            choose_peer(kind, i, naive);
            gn_bench_start(&times[N_OURS + i]);
            gn_bench_rig_render(rig, light, &without);
            gn_naive_run(naive, rig->layers.shadow.data);
            gn_bench_stop(&times[N_OURS + i]);
            if (round == 0)
                differences[i] = gn_performance_compare(&shadow, &rig->layers.shadow);
            rays[i] = naive->n_rays;
        }
        for (int i = 0; round == 0 && i < N_OURS + n_peers; i++)
            times[i].n = 0;
    }
    gn_bench_rig_render(rig, light, &kind->options);
    for (int i = 0; i < N_OURS; i++) {
        struct gn_bench_timing t = gn_bench_sum_up(&times[i]);
        fprintf(file, "%s,renderer,%s,%d,%.3f,%.3f,%llu,,,\n", kind->name, camera_names[i],
                rig->report.n_lights, t.median, t.iqr, (unsigned long long)rig->report.rays_shadow);
    }
    for (int i = 0; i < n_peers; i++) {
        choose_peer(kind, i, naive);
        struct gn_bench_timing t = gn_bench_sum_up(&times[N_OURS + i]);
        fprintf(file, "%s,%s,%s,%d,%.3f,%.3f,%llu,", kind->name, order_names[naive->order],
                real_names[naive->real], naive->n_lights, t.median, t.iqr,
                (unsigned long long)rays[i]);
        if (kind->is_same)
            fprintf(file, "%.3g,%.3g,%lld\n", differences[i].largest, differences[i].largest_code,
                    (long long)differences[i].n_off);
        else
            fprintf(file, ",,\n");
    }
    gn_image_finish(&shadow);
}

/** The same lights, turned a little about the vertical. */
static struct gn_lighting_state *make_turned(struct gn_bench_rig *rig)
{
    static const double half = 0.005; // rad
    const double turn[4] = {cos(half), 0, 0, sin(half)};
    const double *q = rig->frame.world_from_probe;
    const double old[4] = {q[0], q[1], q[2], q[3]};
    double *out = rig->frame.world_from_probe;
    out[0] = turn[0] * old[0] - turn[3] * old[3];
    out[1] = turn[0] * old[1] - turn[3] * old[2];
    out[2] = turn[0] * old[2] + turn[3] * old[1];
    out[3] = turn[0] * old[3] + turn[3] * old[0];
    struct gn_lighting_state *light = gn_bench_rig_make_seed_light(rig, N_LIGHTS);
    memcpy(out, old, sizeof(old));
    return light;
}

void gn_performance_measure_hardest(const struct gn_performance *run)
{
    struct gn_bench_rig rig;
    struct gn_naive naive;
    FILE *file = gn_performance_open(run, "hardest",
                                     "frame,loop,real,lights,ms,iqr,rays,largest,largest_code,off");
    gn_bench_rig_init(&rig, run->n_threads);
    gn_bench_rig_aim(&rig, WIDTH);
    struct gn_lighting_state *light = gn_bench_rig_make_seed_light(&rig, N_LIGHTS);
    struct gn_lighting_state *turned = make_turned(&rig);
    gn_bench_rig_render(&rig, light, NULL); // gives the layers their size
    gn_bench_check(gn_naive_init(&naive, rig.scene, rig.pool, &rig.camera, light),
                   "the naive loop");
    for (size_t i = 0; i < GN_ARRAY_LEN(kinds); i++)
        measure_kind(run, &rig, light, turned, &naive, &kinds[i], file);
    gn_naive_finish(&naive);
    gn_lighting_state_unref(&turned);
    gn_lighting_state_unref(&light);
    gn_bench_rig_finish(&rig);
    gn_performance_close(file);
}
