/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/estimate.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"

/** Pixels of one piece of work, and the most pieces. */
enum { CHUNK = 64, MAX_CHUNKS = 2 * ESTIMATE_PIXELS / CHUNK };
/** A factor from here on is no shadow. */
#define AFFECTED 0.995

struct sums {
    struct gn_error_sums error;
    uint64_t rays;
};

struct job {
    const struct frame *frame;
    const struct frame *truth; // with the reference's near lights
    const struct estimate *estimate;
    int step, columns, n_cells; // a pixel from each square of step x step
    int part, n_parts;          // of the cells; each has sets of its own
    int n_sets;                 // that pixels take theirs from
    bool has_blockers, has_map;
    struct sums sums[MAX_CHUNKS];
};

/** One receiver's view of a set. */
struct view {
    const struct estimate_set *set;
    float weight[ESTIMATE_SET];    // by which the light counts; 0: none, or hidden by real objects
    uint8_t is_near[ESTIMATE_SET]; // in the cone of the virtual objects
    uint8_t is_cut[ESTIMATE_SET];
    int n_cut;
};

/* Asking a pixel */

/** The cone from a point about the virtual objects: unit axis and the cosine of its half angle. */
static float get_cone(const struct frame *frame, const float org[static 3], float axis[static 3])
{
    float radius2 = 0, distance2 = 0;
    for (int k = 0; k < 3; k++) {
        float half = 0.5f * (frame->virtual_box.max[k] - frame->virtual_box.min[k]);
        axis[k] = frame->virtual_box.min[k] + half - org[k];
        radius2 += half * half;
        distance2 += axis[k] * axis[k];
    }
    for (int k = 0; k < 3 && distance2 > 0; k++)
        axis[k] /= sqrtf(distance2);
    // A little wider, against rounding.
    return distance2 > 1.001f * radius2 ? sqrtf(1 - radius2 / distance2) - 1e-4f : -2;
}

static void init_view(const struct sample *s, const struct estimate_set *set, float weight,
                      const float axis[static 3], float cosine, struct view *view)
{
    const float *n = s->surface.normal_shading, *g = s->surface.normal_horizon;
    view->set = set;
    view->n_cut = 0;
    for (int i = 0; i < ESTIMATE_SET; i++) {
        float x = set->dir[0][i], y = set->dir[1][i], z = set->dir[2][i];
        float c = n[0] * x + n[1] * y + n[2] * z;
        float d = g[0] * x + g[1] * y + g[2] * z;
        float a = axis[0] * x + axis[1] * y + axis[2] * z;
        c = d > 0 ? c : 0;
        c = c > 0 ? c : 0;
        view->weight[i] = weight * c;
        view->is_near[i] = (uint8_t)((c > 0) & (a >= cosine));
        view->is_cut[i] = 0;
    }
}

static void flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                  struct view *view, uint64_t *rays)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, set, &n, rays);
    for (; hidden != 0; hidden &= hidden - 1) {
        int i = scratch->lane_light[__builtin_ctz(hidden)];
        if (set == GN_RT_REAL) {
            view->weight[i] = 0;
        } else {
            view->is_cut[i] = 1;
            view->n_cut++;
        }
    }
}

static void trace(const struct frame *frame, struct scratch *scratch, const struct sample *s,
                  enum gn_rt_set role, struct view *view, uint64_t *rays)
{
    const struct estimate_set *set = view->set;
    for (int i = 0; i < ESTIMATE_SET; i++) {
        if (role == GN_RT_REAL ? !(view->weight[i] > 0) : !view->is_near[i])
            continue;
        const float dir[3] = {set->dir[0][i], set->dir[1][i], set->dir[2][i]};
        if (gn_packet_add(scratch, s->org, dir, 0, i, 0, INFINITY))
            flush(frame, scratch, role, view, rays);
    }
    flush(frame, scratch, role, view, rays);
}

/** Adds the view's light to sums[0], and what virtual objects cut of it to sums[1]. */
static void add_view(const struct view *view, double sums[static 2][3])
{
    for (int k = 0; k < 3; k++) {
        const float *irradiance = view->set->irradiance[k];
        for (int i = 0; i < ESTIMATE_SET; i++) {
            double e = (double)(irradiance[i] * view->weight[i]);
            sums[0][k] += e;
            sums[1][k] += view->is_cut[i] ? e : 0;
        }
    }
}

/** Adds the room's near light, and what virtual objects cut of it. Returns whether they do. */
static bool add_near(const struct job *job, const struct sample *s, int set,
                     double sums[static 2][3], uint64_t *rays)
{
    const struct frame *truth = job->truth;
    double near[2][3] = {{0}};
    uint64_t random = gn_estimate_mix(s->seed ^ gn_estimate_mix((uint64_t)set));
    double shift = (double)(random >> 11) * 0x1p-53;
    bool is_cut = false;
    for (int i = 0; i < ESTIMATE_NEAR && truth->near.n_real > 0; i++)
        gn_near_reference_ask(truth, s, false, (i + shift) / ESTIMATE_NEAR,
                              gn_estimate_mix(random + (uint64_t)i), near, rays);
    for (int k = 0; k < 3; k++) {
        sums[0][k] += near[0][k] / ESTIMATE_NEAR;
        sums[1][k] += near[1][k] / ESTIMATE_NEAR;
        is_cut |= near[1][k] > 0;
    }
    return is_cut;
}

/** The factor of one set of directions. */
static void get_ratio(const struct job *job, struct scratch *scratch, const struct sample *s,
                      int set, double out[static 3], uint64_t *rays)
{
    const struct frame *frame = job->frame;
    double sums[2][3] = {{0}};
    float axis[3], cosine = get_cone(frame, s->org, axis);
    struct view views[GN_PROBES_MAX];
    bool is_cut = add_near(job, s, set, sums, rays);
    for (int p = 0; p < frame->blend.n && job->has_map; p++) {
        init_view(s, &job->estimate->sets[p][set], frame->blend.n > 1 ? s->weights[p] : 1, axis,
                  cosine, &views[p]);
        trace(frame, scratch, s, GN_RT_VIRTUAL, &views[p], rays);
        is_cut |= views[p].n_cut > 0;
    }
    for (int p = 0; p < frame->blend.n && job->has_map && is_cut; p++) {
        if (job->has_blockers)
            trace(frame, scratch, s, GN_RT_REAL, &views[p], rays);
        add_view(&views[p], sums);
    }
    for (int k = 0; k < 3; k++)
        out[k] =
            is_cut && sums[0][k] > frame->floor_irradiance[k] ? 1 - sums[1][k] / sums[0][k] : 1;
}

static void ask_pixel(const struct job *job, struct scratch *scratch, const struct sample *s,
                      const float factor[static 3], uint64_t random, struct sums *sums)
{
    double ratios[2][3], square = 0;
    uint64_t n_sets = (uint64_t)job->n_sets;
    int first = (int)(random % n_sets);
    int other = (int)(((uint64_t)first + 1 + (random >> 32) % (n_sets - 1)) % n_sets);
    bool is_affected = false;
    get_ratio(job, scratch, s, first, ratios[0], &sums->rays);
    get_ratio(job, scratch, s, other, ratios[1], &sums->rays);
    for (int k = 0; k < 3; k++) {
        double f = (double)factor[k];
        is_affected |= f < AFFECTED || 0.5 * (ratios[0][k] + ratios[1][k]) < AFFECTED;
        square += (f - ratios[0][k]) * (f - ratios[1][k]) / 3;
    }
    if (!is_affected)
        return;
    sums->error.n++;
    sums->error.square += square;
    sums->error.square2 += square * square;
}

static void ask_chunk(void *context, int item, int worker)
{
    struct job *job = context;
    const struct frame *frame = job->frame;
    struct scratch *scratch = &frame->scratches[worker];
    struct tile_figures figures = {0};
    struct sums sums = {0};
    int pixels[CHUNK][2];
    int n = 0, width = frame->camera->width, height = frame->camera->height;
    for (int cell = item * CHUNK; cell < (item + 1) * CHUNK && cell < job->n_cells; cell++) {
        uint64_t random = gn_estimate_mix((uint64_t)cell);
        int x = cell % job->columns * job->step + (int)(random % (uint64_t)job->step);
        int y = cell / job->columns * job->step + (int)((random >> 32) % (uint64_t)job->step);
        if (x >= width || y >= height ||
            (int)(gn_estimate_mix(random) % (uint64_t)job->n_parts) != job->part)
            continue;
        pixels[n][0] = x;
        pixels[n][1] = y;
        scratch->samples[n].seed = gn_estimate_mix(random);
        gn_primary_aim(frame, frame->rays + 3 * ((size_t)y * (size_t)width + (size_t)x),
                       &scratch->samples[n]);
        n++;
    }
    gn_primary_trace(frame, scratch->samples, n, &figures);
    gn_render_weigh_probes(frame, scratch->samples, n);
    sums.rays = figures.rays_primary;
    for (int i = 0; i < n; i++) {
        const int *at = pixels[i];
        uint64_t pixel = (uint64_t)at[1] * (uint64_t)width + (uint64_t)at[0];
        if (scratch->samples[i].is_receiver)
            ask_pixel(job, scratch, &scratch->samples[i],
                      gn_refine_get_feature(frame, at[0], at[1])->color, gn_estimate_mix(~pixel),
                      &sums);
    }
    job->sums[item] = sums;
}

/** Squares so wide that the picture has about ESTIMATE_PIXELS, and surely no more than there are
 * chunks for. */
static void cut_picture(struct job *job)
{
    int width = job->frame->camera->width, height = job->frame->camera->height;
    job->step = (int)fmax(1, floor(sqrt((double)width * height / ESTIMATE_PIXELS)));
    do {
        job->columns = (width + job->step - 1) / job->step;
        job->n_cells = job->columns * ((height + job->step - 1) / job->step);
    } while (job->n_cells > MAX_CHUNKS * CHUNK && job->step++);
}

double gn_error_sums_get(const struct gn_error_sums *sums, int n_sums)
{
    struct gn_error_sums all = {0};
    for (int i = 0; i < n_sums; i++) {
        all.square += sums[i].square;
        all.square2 += sums[i].square2;
        all.n += sums[i].n;
    }
    if (all.n < ESTIMATE_LEAST)
        return -1;
    double mean = all.square / all.n;
    double variance = fmax(all.square2 / all.n - mean * mean, 0) / (all.n - 1);
    return sqrt(fmax(mean, sqrt(variance)));
}

static void sum_up(const struct job *job, int n_chunks, struct gn_render_report *report)
{
    for (int i = 0; i < n_chunks; i++) {
        report->error.square += job->sums[i].error.square;
        report->error.square2 += job->sums[i].error.square2;
        report->error.n += job->sums[i].error.n;
        report->rays_estimate += job->sums[i].rays;
    }
    report->estimated_error = gn_error_sums_get(&report->error, 1);
}

bool gn_estimate_needs_near(const struct frame *frame)
{
    return frame->options.estimate_error && !frame->pass && frame->run_shadow &&
           frame->near.n_real > 0 && frame->near.n_placed == 0 &&
           frame->options.quality != GN_QUALITY_REFERENCE;
}

static const char *why_not(const struct frame *frame)
{
    if (frame->options.quality == GN_QUALITY_REFERENCE || frame->pass)
        return "it is the reference itself";
    if (!frame->options.estimate_error)
        return "not asked for";
    if (!frame->run_shadow)
        return "there is no shadow to be off";
    if (frame->near.n_placed > 0)
        return "the global model's light starts at finite places, which are not drawn from";
    for (int p = 0; p < frame->blend.n; p++) {
        if (!gn_estimate_can_draw(frame->blend.state[p]->map))
            return "no map to draw directions from";
    }
    return NULL;
}

static void set_line(struct gn_render_report *report, const char *why_not, const char *why)
{
    assert(report->n_plan < GN_PLAN_MAX);
    report->plan[report->n_plan++] =
        (struct gn_plan_entry){.pass = "estimate", .ran = !why_not, .why = why_not ? why_not : why};
}

int gn_estimate_make(struct estimate *estimate, const struct frame *frame,
                     const struct near_lights *near, struct gn_pool *pool,
                     struct gn_render_report *report)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    double power = 0;
    struct frame truth = *frame;
    struct job job = {.frame = frame,
                      .truth = &truth,
                      .estimate = estimate,
                      .n_parts = 1,
                      .n_sets = ESTIMATE_SETS};
    const char *reason = why_not(frame);
    report->estimated_error = -1;
    if (frame->options.estimate_parts > 1) {
        job.n_parts = frame->options.estimate_parts;
        job.part = frame->options.estimate_part;
        job.n_sets = 2;
    }
    truth.near = *near;
    for (int p = 0; p < frame->blend.n && !reason; p++) {
        double one;
        if (gn_estimate_draw(estimate, job.part, job.n_sets, p, frame->blend.state[p]->map, &one) <
            0)
            return -ENOMEM;
        power += one;
    }
    job.has_map = power > 0;
    if (!reason && !job.has_map && near->n_real == 0)
        reason = "no light";
    set_line(report, reason, "some pixels ask the map, the lamps and the screens what is right");
    if (reason)
        return 0;
    // Flat real geometry hides no light from itself.
    job.has_blockers = frame->run_blockers || frame->options.shadow_ignore_real;
    cut_picture(&job);
    int n_chunks = (job.n_cells + CHUNK - 1) / CHUNK;
    gn_pool_run(pool, n_chunks, ask_chunk, &job);
    sum_up(&job, n_chunks, report);
    report->ms_estimate = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
    return 0;
}

void gn_estimate_finish(struct estimate *estimate)
{
    free(estimate->rows);
    memset(estimate, 0, sizeof(*estimate));
}
