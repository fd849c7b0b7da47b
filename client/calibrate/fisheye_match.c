/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/fisheye.h"
#include "client/calibrate/solve.h"
#include "common/vec3.h"

#define DEGREE 57.29577951308232

/** Candidates times orientations that are compared: about two seconds. */
static const double max_work = 2e8;
/** Directions of a pair lie farther apart than this, rad. */
static const double min_apart = 0.03;

struct match {
    const struct gn_fisheye_puzzle *candidates;
    int n;
    double (*seen)[3]; // [n] directions, owned; NAN outside the picture
    double *cosine;    // [n] of the angle that an orientation leaves, owned
    double tolerance;  // rad
    double best[9];    // world_from_probe of the best orientation so far
    double best_error; // sum of 1 - cosine
    int best_count;
};

static double get_cosine(const struct match *m, const double r[static 9], int i)
{
    const double *d = m->candidates[i].dir_world, *s = m->seen[i];
    return d[0] * gn_vec3_dot(r, s) + d[1] * gn_vec3_dot(r + 3, s) + d[2] * gn_vec3_dot(r + 6, s);
}

/** Whether two candidates lie as far apart in the picture as in the world. */
static bool is_pair(const struct match *m, int i, int k)
{
    const double *a = m->candidates[i].dir_world, *b = m->candidates[k].dir_world;
    double of_seen = gn_vec3_dot(m->seen[i], m->seen[k]), of_world = gn_vec3_dot(a, b);
    return of_seen < cos(min_apart) &&
           fabs(acos(fmax(of_seen, -1)) - acos(fmin(fmax(of_world, -1), 1))) <= 2 * m->tolerance;
}

/** Counts what the orientation by two candidates explains. */
static void try_pair(struct match *m, int i, int k)
{
    double b[9] = {0}, r[9], singular[3], error = 0, bound = cos(m->tolerance);
    const int pair[2] = {i, k};
    int count = 0;
    for (int j = 0; j < 18; j++)
        b[j % 9] += m->candidates[pair[j / 9]].dir_world[j % 9 / 3] * m->seen[pair[j / 9]][j % 3];
    if (gn_solve_wahba(b, r, singular) < 0)
        return;
    for (int j = 0; j < m->n; j++) {
        double cosine = get_cosine(m, r, j);
        if (cosine > bound) {
            count++;
            error += 1 - cosine;
        }
    }
    if (count > m->best_count || (count == m->best_count && error < m->best_error)) {
        m->best_count = count;
        m->best_error = error;
        memcpy(m->best, r, sizeof(r));
    }
}

/** Tries all pairs, or one in *out_stride, picked by a hash of their number. */
static void try_pairs(struct match *m, int *out_stride)
{
    uint32_t n_pairs = 0, at = 0;
    for (int i = 0; i < m->n; i++)
        for (int k = i + 1; k < m->n; k++)
            n_pairs += is_pair(m, i, k);
    uint32_t stride = (uint32_t)fmax(ceil(n_pairs * (double)m->n / max_work), 1);
    for (int i = 0; i < m->n; i++)
        for (int k = i + 1; k < m->n; k++)
            if (is_pair(m, i, k) && (at++ * 2654435761u >> 8) % stride == 0) // Knuth's, 6.4
                try_pair(m, i, k);
    *out_stride = (int)stride;
}

static bool is_rival(const struct gn_fisheye_puzzle *a, const struct gn_fisheye_puzzle *b)
{
    return a->picture == b->picture &&
           (memcmp(a->xy, b->xy, sizeof(a->xy)) == 0 ||
            memcmp(a->dir_world, b->dir_world, sizeof(a->dir_world)) == 0);
}

/** The candidates that the best orientation explains: of rivals the nearest. */
static int keep_nearest(const struct match *m, struct gn_fisheye_sighting *out)
{
    int kept = 0;
    for (int i = 0; i < m->n; i++)
        m->cosine[i] = get_cosine(m, m->best, i);
    for (int i = 0; i < m->n; i++) {
        bool is_nearest = m->cosine[i] > cos(m->tolerance);
        for (int k = 0; k < m->n && is_nearest; k++)
            is_nearest =
                !(is_rival(&m->candidates[i], &m->candidates[k]) &&
                  (m->cosine[k] > m->cosine[i] || (m->cosine[k] == m->cosine[i] && k < i)));
        if (!is_nearest)
            continue;
        struct gn_fisheye_sighting *s = &out[kept++];
        memcpy(s->xy, m->candidates[i].xy, sizeof(s->xy));
        memcpy(s->dir_world, m->candidates[i].dir_world, sizeof(s->dir_world));
        s->error_deg = 0;
    }
    return kept;
}

/** From the best pair to all that it explains; how many these are. */
static int settle(struct match *m, const struct gn_projection *projection,
                  struct gn_fisheye_sighting *out)
{
    int found = 0;
    // Again from all that was kept: the first orientation leans on two of them only.
    for (int round = 0; round < 3 && m->best_count >= 2; round++) {
        struct gn_pose pose;
        double spread, full[16];
        found = keep_nearest(m, out);
        if (gn_fisheye_find_orientation(projection, out, found, &pose, &spread) < 0)
            break;
        gn_pose_to_matrix(&pose, full);
        for (int i = 0; i < 9; i++)
            m->best[i] = full[4 * (i / 3) + i % 3];
    }
    return found;
}

int gn_fisheye_match(const struct gn_projection *projection,
                     const struct gn_fisheye_puzzle *candidates, int n, double tolerance_deg,
                     struct gn_fisheye_sighting *out_sightings, int *out_stride,
                     struct gn_error *out_error)
{
    struct match m = {.candidates = candidates,
                      .n = n,
                      .tolerance = tolerance_deg / DEGREE,
                      .best_error = INFINITY,
                      .seen = calloc((size_t)n + 1, sizeof(*m.seen)),
                      .cosine = calloc((size_t)n + 1, sizeof(*m.cosine))};
    int found = 0;
    if (m.seen && m.cosine) {
        for (int i = 0; i < n; i++)
            if (!gn_projection_get_direction(projection, candidates[i].xy[0], candidates[i].xy[1],
                                             m.seen[i]))
                m.seen[i][0] = m.seen[i][1] = m.seen[i][2] = NAN; // outside: near nothing
        try_pairs(&m, out_stride);
        found = settle(&m, projection, out_sightings);
    } else {
        found = gn_error_set(out_error, -ENOMEM, "out of memory");
    }
    free(m.cosine);
    free(m.seen);
    if (found >= 0 && found < 2)
        return gn_error_set(out_error, -EDOM,
                            "no orientation brings two spots within %.1f degrees of their lamps: "
                            "are the directions from the probe to the lamps, in the marker's "
                            "frame, and is the projection right?",
                            tolerance_deg);
    return found;
}
