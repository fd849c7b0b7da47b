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
/** Other orientations that are looked at closely before the best is taken for the only one. */
static const int max_rivals = 256;

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

/** The orientation by two candidates. Returns 0 or -EDOM. */
static int turn_pair(const struct match *m, int i, int k, double out_r[static 9])
{
    double b[9] = {0}, singular[3];
    const int pair[2] = {i, k};
    for (int j = 0; j < 18; j++)
        b[j % 9] += m->candidates[pair[j / 9]].dir_world[j % 9 / 3] * m->seen[pair[j / 9]][j % 3];
    return gn_solve_wahba(b, out_r, singular);
}

/** How many candidates an orientation explains; *out_error: the sum of 1 - cosine. */
static int count_explained(const struct match *m, const double r[static 9], double *out_error)
{
    double bound = cos(m->tolerance);
    int count = 0;
    *out_error = 0;
    for (int j = 0; j < m->n; j++) {
        double cosine = get_cosine(m, r, j);
        if (cosine > bound) {
            count++;
            *out_error += 1 - cosine;
        }
    }
    return count;
}

static void try_pair(struct match *m, int i, int k)
{
    double r[9], error;
    if (turn_pair(m, i, k, r) < 0)
        return;
    int count = count_explained(m, r, &error);
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

/** The candidates that an orientation explains: of rivals the nearest. */
static int keep_nearest(const struct match *m, const double r[static 9],
                        struct gn_fisheye_sighting *out)
{
    int kept = 0;
    for (int i = 0; i < m->n; i++)
        m->cosine[i] = get_cosine(m, r, i);
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
        s->error_deg = acos(fmin(m->cosine[i], 1)) * DEGREE;
    }
    return kept;
}

/** From an orientation of two to one of all that it explains; how many these are. */
static int settle(const struct match *m, const struct gn_projection *projection, double r[static 9],
                  struct gn_fisheye_sighting *out)
{
    int found = 0;
    // Again from all that was kept: the first orientation leans on two of them only.
    for (int round = 0; round < 3; round++) {
        struct gn_pose pose;
        double spread, full[16];
        found = keep_nearest(m, r, out);
        if (gn_fisheye_find_orientation(projection, out, found, &pose, &spread) < 0)
            break;
        gn_pose_to_matrix(&pose, full);
        for (int i = 0; i < 9; i++)
            r[i] = full[4 * (i / 3) + i % 3];
    }
    return found;
}

static double get_rms_deg(const struct gn_fisheye_sighting *sightings, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += sightings[i].error_deg * sightings[i].error_deg;
    return sqrt(sum / n);
}

/** Whether two orientations are apart by more than candidates may be off. */
static bool is_elsewhere(const struct match *m, const double a[static 9], const double b[static 9])
{
    double trace = 0;
    for (int i = 0; i < 9; i++)
        trace += a[i] * b[i];
    return (trace - 1) / 2 < cos(2 * m->tolerance);
}

/** Whether another orientation explains as many, and them about as well. others: [n], scratch. */
static bool has_rival(const struct match *m, const struct gn_projection *projection,
                      const struct gn_fisheye_sighting *found, int n_found, int stride,
                      struct gn_fisheye_sighting *others)
{
    double rms_deg = get_rms_deg(found, n_found);
    uint32_t at = 0;
    int n_left = max_rivals;
    for (int i = 0; i < m->n; i++)
        for (int k = i + 1; k < m->n; k++) {
            double r[9], error;
            if (!is_pair(m, i, k) || (at++ * 2654435761u >> 8) % (uint32_t)stride != 0 ||
                turn_pair(m, i, k, r) < 0 || !is_elsewhere(m, r, m->best) ||
                count_explained(m, r, &error) < n_found)
                continue;
            if (settle(m, projection, r, others) >= n_found && is_elsewhere(m, r, m->best) &&
                get_rms_deg(others, n_found) < rms_deg + GN_FISHEYE_MIN_CONTRAST_DEG)
                return true;
            if (--n_left == 0)
                return false;
        }
    return false;
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
    struct gn_fisheye_sighting *others = calloc((size_t)n + 1, sizeof(*others));
    int found = 0;
    if (m.seen && m.cosine && others) {
        for (int i = 0; i < n; i++)
            if (!gn_projection_get_direction(projection, candidates[i].xy[0], candidates[i].xy[1],
                                             m.seen[i]))
                m.seen[i][0] = m.seen[i][1] = m.seen[i][2] = NAN; // outside: near nothing
        try_pairs(&m, out_stride);
        if (m.best_count >= 2)
            found = settle(&m, projection, m.best, out_sightings);
        if (found >= 2 && has_rival(&m, projection, out_sightings, found, *out_stride, others))
            found =
                gn_error_set(out_error, -EDOM,
                             "two orientations bring %d spots to their lamps alike: is the "
                             "projection right? A picture for each lamp, or a third lamp, would "
                             "tell them apart",
                             found);
    } else {
        found = gn_error_set(out_error, -ENOMEM, "out of memory");
    }
    free(others);
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
