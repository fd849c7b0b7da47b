/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How fast shadow rays are traced, one thread, against the tracer's own loop over the same rays.
 * The packets of a real frame are recorded on their way (the linker puts record() before
 * gn_rt_get_occluded16). "call": they once more, as they were, part-filled ones too, through our
 * function. "pass": the frame's own time in its shadow passes, with what decides on rays, packs
 * them and sums. "embree16": the same rays, filled up into the tracer's own packets beforehand.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/scene/rt_loop.h"
#include "tests/bench/performance/naive.h"
#include "tests/bench/performance/performance.h"
#include "tests/bench/timing.h"

#define WIDTH 640
#define N_LIGHTS 122
/** Receivers between two whose rays are taken for the single ones. */
#define STRIDE 61

/** Packets of one set, in the order they were traced. */
struct recording {
    int n, capacity;
    struct gn_rt_packet *packets; // owned
};

/** By set - 1, while a frame of one thread is recorded; else NULL. */
static struct recording *recordings;

static void keep(struct recording *r, const struct gn_rt_packet *packet)
{
    if (r->n == r->capacity) {
        int capacity = r->capacity ? 2 * r->capacity : 4096;
        struct gn_rt_packet *more = aligned_alloc(64, (size_t)capacity * sizeof(*more));
        gn_bench_check(more ? 0 : -ENOMEM, "the recording");
        if (r->n > 0)
            memcpy(more, r->packets, (size_t)r->n * sizeof(*more));
        free(r->packets);
        r->packets = more;
        r->capacity = capacity;
    }
    r->packets[r->n++] = *packet;
}

// The linker's names for what --wrap redirects.
uint32_t __real_gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                                     const struct gn_rt_packet *packet);
uint32_t __wrap_gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                                     const struct gn_rt_packet *packet);

uint32_t __wrap_gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                                     const struct gn_rt_packet *packet)
{
    if (recordings)
        keep(&recordings[set - 1], packet);
    return __real_gn_rt_get_occluded16(rt, set, packet);
}

/** Two ways through the same rays, timed in turn. */
struct duel {
    uint64_t n_rays, n_occluded[2];
    struct gn_bench_timing ours, tracer;
};

static uint64_t count_rays(const struct recording *r)
{
    uint64_t n = 0;
    for (int i = 0; i < r->n; i++) {
        for (int lane = 0; lane < GN_RT_PACKET; lane++)
            n += r->packets[i].valid[lane] != 0;
    }
    return n;
}

static uint64_t call_packets(const struct gn_rt *rt, enum gn_rt_set set, const struct recording *r)
{
    uint64_t n = 0;
    for (int i = 0; i < r->n; i++)
        n += (uint64_t)__builtin_popcount(gn_rt_get_occluded16(rt, set, &r->packets[i]));
    return n;
}

static uint64_t call_singles(const struct gn_rt *rt, enum gn_rt_set set, const struct recording *r)
{
    uint64_t n = 0;
    for (int i = 0; i < r->n; i++) {
        const struct gn_rt_packet *p = &r->packets[i];
        for (int lane = 0; lane < GN_RT_PACKET; lane++) {
            const float org[3] = {p->org_x[lane], p->org_y[lane], p->org_z[lane]};
            const float dir[3] = {p->dir_x[lane], p->dir_y[lane], p->dir_z[lane]};
            n += p->valid[lane] &&
                 gn_rt_is_occluded(rt, set, org, dir, p->t_near[lane], p->t_far[lane]);
        }
    }
    return n;
}

static struct duel fight(const struct gn_performance *run, const struct gn_rt *rt,
                         const struct recording r[static 3], int width)
{
    struct duel duel = {0};
    struct gn_rt_loop *loops[3] = {NULL};
    struct gn_bench_times ours = {0}, tracer = {0};
    for (int i = 0; i < 3; i++) {
        gn_bench_check(
            gn_rt_loop_create(rt, (enum gn_rt_set)(i + 1), r[i].packets, r[i].n, width, &loops[i]),
            "the tracer's loop");
        duel.n_rays += count_rays(&r[i]);
    }
    for (int round = 0; round < 1 + run->n_repeats; round++) {
        for (int i = 0; i < 3; i++)
            gn_rt_loop_reset(loops[i]);
        gn_bench_start(&tracer);
        for (int i = 0; i < 3; i++)
            gn_rt_loop_run(loops[i]);
        gn_bench_stop(&tracer);
        gn_bench_start(&ours);
        duel.n_occluded[0] = 0;
        for (int i = 0; i < 3; i++)
            duel.n_occluded[0] +=
                (width == 1 ? call_singles : call_packets)(rt, (enum gn_rt_set)(i + 1), &r[i]);
        gn_bench_stop(&ours);
        if (round == 0)
            ours.n = tracer.n = 0;
    }
    for (int i = 0; i < 3; i++) {
        duel.n_occluded[1] += gn_rt_loop_count_occluded(loops[i]);
        gn_rt_loop_destroy(&loops[i]);
    }
    gn_bench_check(duel.n_occluded[0] == duel.n_occluded[1] ? 0 : -EIO,
                   "our rays and the tracer's do not agree");
    duel.ours = gn_bench_sum_up(&ours);
    duel.tracer = gn_bench_sum_up(&tracer);
    return duel;
}

static void write_row(FILE *file, const char *frame, const char *what, uint64_t n_rays,
                      struct gn_bench_timing timing)
{
    fprintf(file, "%s,%s,%llu,%.4f,%.4f\n", frame, what, (unsigned long long)n_rays, timing.median,
            timing.iqr);
}

static void measure_frame(const struct gn_performance *run, struct gn_bench_rig *rig,
                          const struct gn_lighting_state *light, const char *name,
                          enum gn_quality quality, FILE *file)
{
    const struct gn_render_options options = {.quality = quality};
    struct gn_bench_times pass = {0};
    struct recording r[3] = {{0}};
    gn_bench_rig_render(rig, light, &options);
    for (int i = 0; i < run->n_repeats; i++) {
        gn_bench_rig_render(rig, light, &options);
        pass.ms[pass.n++] = rig->report.ms_shadow;
    }
    recordings = r;
    gn_bench_rig_render(rig, light, &options);
    recordings = NULL;
    r[GN_RT_ALL - 1].n = 0; // those that light virtual objects
    struct duel duel = fight(run, rig->scene->rt, r, GN_RT_PACKET);
    write_row(file, name, "embree16", duel.n_rays, duel.tracer);
    write_row(file, name, "call", duel.n_rays, duel.ours);
    write_row(file, name, "pass", rig->report.rays_shadow, gn_bench_sum_up(&pass));
    for (int i = 0; i < 3; i++)
        free(r[i].packets);
}

/** Some of the naive loop's rays at virtual objects, one by one: is the loop's tracer as it should
 * be? */
static void measure_single(const struct gn_performance *run, struct gn_bench_rig *rig,
                           const struct gn_lighting_state *light, FILE *file)
{
    struct gn_naive naive;
    struct recording r[3] = {{0}};
    struct gn_rt_packet packet = {{0}};
    int n = 0;
    gn_bench_check(gn_naive_init(&naive, rig->scene, NULL, &rig->camera, light), "the naive loop");
    for (int i = 0; i < naive.n_receivers; i += STRIDE) {
        for (int l = 0; l < naive.n_lights; l++) {
            packet.org_x[n] = naive.receivers[i].org[0];
            packet.org_y[n] = naive.receivers[i].org[1];
            packet.org_z[n] = naive.receivers[i].org[2];
            packet.dir_x[n] = naive.lights[l].dir[0];
            packet.dir_y[n] = naive.lights[l].dir[1];
            packet.dir_z[n] = naive.lights[l].dir[2];
            packet.t_far[n] = INFINITY;
            packet.valid[n++] = -1;
            if (n < GN_RT_PACKET)
                continue;
            keep(&r[GN_RT_VIRTUAL - 1], &packet);
            n = 0;
        }
    }
    struct duel duel = fight(run, rig->scene->rt, r, 1);
    write_row(file, "naive", "embree1", duel.n_rays, duel.tracer);
    write_row(file, "naive", "call", duel.n_rays, duel.ours);
    free(r[GN_RT_VIRTUAL - 1].packets);
    gn_naive_finish(&naive);
}

void gn_performance_measure_rate(const struct gn_performance *run)
{
    struct gn_bench_rig rig;
    FILE *file = gn_performance_open(run, "rate", "frame,what,rays,ms,iqr");
    gn_bench_rig_init(&rig, 1);
    gn_bench_rig_aim(&rig, WIDTH);
    struct gn_lighting_state *light = gn_bench_rig_make_seed_light(&rig, N_LIGHTS);
    measure_frame(run, &rig, light, "paper", GN_QUALITY_SEED, file);
    measure_frame(run, &rig, light, "interactive", GN_QUALITY_INTERACTIVE, file);
    measure_single(run, &rig, light, file);
    gn_lighting_state_unref(&light);
    gn_bench_rig_finish(&rig);
    gn_performance_close(file);
}
