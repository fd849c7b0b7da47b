/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/pass.h"

#include <math.h>
#include <string.h>

#include "server/render/draw.h"
#include "server/render/internal.h"
#include "server/render/sums.h"

/** Near lights that each sample tries, by random choice; so many or fewer it tries all. */
#define TRIES 4
#define ALL_MAX 8

/** The random numbers of one try. */
static uint64_t get_random(const struct sample *s, int i)
{
    return s->seed + (uint64_t)(i + 1) * UINT64_C(0x9e3779b97f4a7c15);
}

void gn_pass_get_point(const struct pass *pass, int x, int y, double out[static 2])
{
    // R2, turned by each pixel's own shift: the mean of its points is off by little, and in another
    // way than its neighbour's. Source: Roberts, "The Unreasonable Effectiveness of Quasirandom
    // Sequences", 2018.
    static const double steps[2] = {0.7548776662466927, 0.5698402909980532};
    uint64_t pixel = (uint64_t)y << 32 | (uint64_t)x;
    for (int k = 0; k < 2; k++) {
        double at =
            gn_draw_hash(pixel, (uint64_t)(2 * pass->sequence + k)) + pass->index * steps[k];
        out[k] = pass->is_centred ? 0.5 : at - floor(at);
    }
}

static bool tries_all(const struct frame *frame)
{
    return frame->near.cdf && frame->near.n <= ALL_MAX;
}

void gn_pass_shade(const struct frame *frame, struct scratch *scratch, int n,
                   struct tile_figures *figures)
{
    if (frame->places->n == 0 && !frame->near.cdf)
        return;
    if (frame->places->n > 0)
        memset(scratch->cut_places, 0, (size_t)frame->places->n);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        double sums[2][3] = {{0}};
        if (s->kind != SAMPLE_VIRTUAL || !s->is_lit)
            continue;
        if (frame->places->n > 0) {
            (void)gn_places_find_hidden(frame, scratch, s, GN_RT_ALL, scratch->hidden_places,
                                        &figures->rays_shade);
            gn_places_sum(frame, s, scratch->hidden_places, scratch->cut_places, false, sums);
        }
        if (tries_all(frame))
            gn_near_reference_shade(frame, s, figures);
        for (int t = 0; t < TRIES && frame->near.cdf && !tries_all(frame); t++) {
            double e[3];
            enum gn_rt_set role;
            gn_near_reference_try(frame, &s->surface, s->org, GN_RT_ALL, get_random(s, t), e, &role,
                                  &figures->rays_shade);
            figures->n_near++;
            for (int k = 0; k < 3; k++)
                sums[0][k] += e[k] / TRIES;
        }
        for (int k = 0; k < 3; k++)
            s->radiance[k] += s->through[k] * (s->surface.albedo[k] / M_PI * sums[0][k]);
    }
}

/** The same random choices among real objects alone and among all: what comes of the room's light
 * in one and not in the other is cut. */
static void try_near(const struct frame *frame, struct sample *s, struct tile_figures *figures)
{
    for (int t = 0; t < TRIES; t++) {
        double open[3];
        double all[3];
        enum gn_rt_set role;
        gn_near_reference_try(frame, &s->surface, s->org, GN_RT_REAL, get_random(s, t), open, &role,
                              &figures->rays_shadow);
        gn_near_reference_try(frame, &s->surface, s->org, GN_RT_ALL, get_random(s, t), all, &role,
                              &figures->rays_shadow);
        figures->n_near++;
        for (int k = 0; k < 3; k++) {
            if (role == GN_RT_VIRTUAL) {
                s->gain[k] += s->surface.albedo[k] / M_PI * all[k] / TRIES;
            } else {
                s->open[k] += open[k] / TRIES;
                s->cut[k] += (open[k] - all[k]) / TRIES;
            }
        }
    }
}

void gn_pass_light_receivers(const struct frame *frame, struct scratch *scratch, int n,
                             struct tile_figures *figures)
{
    if (frame->places->n == 0 && !frame->near.cdf)
        return;
    if (frame->places->n > 0)
        memset(scratch->hidden_places, 0, (size_t)frame->places->n);
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        double sums[2][3] = {{0}};
        if (!s->is_receiver)
            continue;
        if (frame->places->n > 0) {
            (void)gn_places_find_hidden(frame, scratch, s, GN_RT_VIRTUAL, scratch->cut_places,
                                        &figures->rays_shadow);
            if (frame->run_blockers)
                (void)gn_places_find_hidden(frame, scratch, s, GN_RT_REAL, scratch->hidden_places,
                                            &figures->rays_shadow);
            gn_places_sum(frame, s, scratch->hidden_places, scratch->cut_places, false, sums);
        }
        if (tries_all(frame)) {
            gn_near_reference_sum(frame, s, false, sums, figures);
            gn_near_reference_gain(frame, s, figures);
        }
        for (int k = 0; k < 3; k++) {
            s->open[k] += sums[0][k];
            s->cut[k] += sums[1][k];
        }
        if (frame->near.cdf && !tries_all(frame))
            try_near(frame, s, figures);
    }
}

void gn_pass_add_sample(const struct pass *pass, int x, int y, const struct sample *sample)
{
    gn_sums_add(pass->sums, x, y, sample);
}
