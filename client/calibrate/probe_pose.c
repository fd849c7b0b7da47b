/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/probe_pose.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/rectify.h"
#include "client/calibrate/solve.h"
#include "client/track/rotation.h"
#include "client/vision/markers.h"
#include "common/compare.h"
#include "common/vec3.h"

#define DEGREE 57.29577951308232

enum { MAX_GUESSING = 24, STEPS = 40, UNKNOWNS = 6 };

/** Widths of the weights, rad: from what a guess by one marker is off to what corners are. */
static const double widths[] = {3 / DEGREE, 1 / DEGREE, 0.3 / DEGREE};
/** A sighting this many times farther off than the median one is left out. */
static const double far_off = 5;
/** Poses closer than this are one. */
static const double same_rad = 1 / DEGREE;

struct problem {
    struct gn_probe_sighting *s;
    int n;
    double *weight;   // [n], of squares
    double *residual; // [8 n + 6]
    double *jacobian; // [8 n + 6][6]
};

/** Two axes across a unit direction. */
static void make_axes(const double d[static 3], double x[static 3], double y[static 3])
{
    const double helper[3] = {fabs(d[0]) < 0.6, fabs(d[0]) >= 0.6, 0};
    gn_vec3_cross(d, helper, x);
    double length = sqrt(gn_vec3_dot(x, x));
    for (int k = 0; k < 3; k++)
        x[k] /= length;
    gn_vec3_cross(d, x, y);
}

/**
 * How far a corner is off, rad on two axes across its direction, and with j the derivatives by a
 * turn of the probe about the world's axes and by its place.
 */
static void get_residual(const struct gn_pose *pose, const double corner[static 3],
                         const double dir[static 3], double r[static 2], double j[2][UNKNOWNS])
{
    double axis[2][3], to[3], d[3], cross[3];
    make_axes(dir, axis[0], axis[1]);
    for (int k = 0; k < 3; k++)
        to[k] = corner[k] - pose->translation[k];
    double distance = fmax(sqrt(gn_vec3_dot(to, to)), 1e-9);
    for (int k = 0; k < 3; k++)
        to[k] /= distance;
    gn_pose_rotate(pose, dir, d);
    gn_vec3_cross(d, to, cross);
    double sine = sqrt(gn_vec3_dot(cross, cross));
    double scale = sine > 1e-9 ? atan2(sine, gn_vec3_dot(d, to)) / sine : 1; // far off counts whole
    for (int a = 0; a < 2; a++) {
        double x[3], turn[3];
        gn_pose_rotate(pose, axis[a], x);
        double along = gn_vec3_dot(x, to);
        r[a] = scale * along;
        gn_vec3_cross(x, to, turn); // d x / d w = w x, so d r / d w = x cross to
        for (int k = 0; k < 3 && j; k++) {
            j[a][k] = scale * turn[k];
            j[a][3 + k] = -scale * (x[k] - along * to[k]) / distance;
        }
    }
}

/** The mean square of a sighting, per axis, rad^2. */
static double get_mean_square(const struct gn_pose *pose, const struct gn_probe_sighting *s)
{
    double sum = 0, r[2];
    for (int k = 0; k < 4; k++) {
        get_residual(pose, s->corners_world[k], s->dirs_probe[k], r, NULL);
        sum += r[0] * r[0] + r[1] * r[1];
    }
    return sum / 8;
}

/** Weighted residuals in units of the corners' errors; their sum of squares. */
static double fill(const struct problem *p, const struct gn_pose *pose)
{
    double sum = 0;
    for (int i = 0; i < 4 * p->n; i++) {
        const struct gn_probe_sighting *s = &p->s[i / 4];
        double share = sqrt(p->weight[i / 4]) / s->error_rad, r[2], j[2][UNKNOWNS];
        get_residual(pose, s->corners_world[i % 4], s->dirs_probe[i % 4], r, j);
        for (int a = 0; a < 2; a++) {
            p->residual[2 * i + a] = share * r[a];
            sum += share * share * r[a] * r[a];
            for (int k = 0; k < UNKNOWNS; k++)
                p->jacobian[(2 * i + a) * UNKNOWNS + k] = share * j[a][k];
        }
    }
    return sum;
}

static double get_sum(const struct problem *p, const struct gn_pose *pose)
{
    double sum = 0;
    for (int i = 0; i < p->n; i++)
        if (p->weight[i] > 0)
            sum += p->weight[i] * 8 * get_mean_square(pose, &p->s[i]) /
                   (p->s[i].error_rad * p->s[i].error_rad);
    return sum;
}

/** A damped step (Levenberg 1944) from pose, whose sum is `before`; the new sum, or `before` where
 * none is lower. */
static double improve(const struct problem *p, double before, double *damping, struct gn_pose *pose)
{
    int m = 8 * p->n;
    for (int attempt = 0; attempt < 10; attempt++, *damping *= 10) {
        double step[UNKNOWNS];
        fill(p, pose); // the solver destroys it
        for (int i = 0; i < m; i++)
            p->residual[i] = -p->residual[i];
        if (gn_solve_damped_squares(p->jacobian, p->residual, m, UNKNOWNS, *damping, step) < 0)
            continue;
        struct gn_pose turn = {0}, tried = *pose;
        memset(tried.translation, 0, sizeof(tried.translation));
        gn_rotation_exp(step, turn.rotation);
        gn_pose_multiply(&turn, &tried, &tried);
        for (int k = 0; k < 3; k++)
            tried.translation[k] = pose->translation[k] + step[3 + k];
        double after = get_sum(p, &tried);
        if (after < before && gn_pose_normalize(&tried) == 0) {
            *pose = tried;
            *damping = fmax(*damping / 10, 1e-12);
            return after;
        }
    }
    return before;
}

/** To the end with the weights as they are; returns the sum of squares. */
static double settle(const struct problem *p, struct gn_pose *pose)
{
    double damping = 1e-3, sum = get_sum(p, pose);
    for (int i = 0; i < STEPS; i++) {
        double after = improve(p, sum, &damping, pose);
        if (!(sum - after > 1e-10 * sum))
            return after;
        sum = after;
    }
    return sum;
}

/** To where most sightings agree. Returns the truncated sum of their mean squares. */
static double agree(const struct problem *p, struct gn_pose *pose)
{
    double score = 0, width = 0;
    for (size_t w = 0; w < sizeof(widths) / sizeof(*widths); w++) {
        width = widths[w];
        for (int round = 0; round < 3; round++) {
            double damping = 1e-3;
            for (int i = 0; i < p->n; i++) // Cauchy's
                p->weight[i] = 1 / (1 + get_mean_square(pose, &p->s[i]) / (width * width));
            (void)improve(p, get_sum(p, pose), &damping, pose);
        }
    }
    for (int i = 0; i < p->n; i++)
        score += fmin(get_mean_square(pose, &p->s[i]), width * width);
    return score;
}

/** The poses that one sighting allows, in the order of how well they fit. */
static int guess(const struct gn_probe_sighting *s, struct gn_pose out[static 2],
                 struct gn_error *out_error)
{
    struct gn_rectified_view view;
    struct gn_vision_pose poses[2];
    double middle[3] = {0}, rays[8];
    for (int i = 0; i < 12; i++)
        middle[i % 3] += s->dirs_probe[i / 3][i % 3];
    double length = sqrt(gn_vec3_dot(middle, middle));
    for (int k = 0; k < 3; k++)
        middle[k] /= length;
    gn_rectify_aim(middle, 1, 500, &view);
    for (int k = 0; k < 4; k++) {
        double xy[2];
        if (!gn_rectify_get_position(&view, s->dirs_probe[k], xy))
            return 0;
        for (int a = 0; a < 2; a++)
            rays[2 * k + a] = (xy[a] - 0.5 * view.side) / view.focal;
    }
    int n = gn_vision_solve_pose(s->corners_world[0], rays, 4, true, poses, out_error), n_out = 0;
    for (int i = 0; i < n; i++) {
        const double *r = poses[i].rotation, *t = poses[i].translation;
        const double *v = view.probe_from_view;
        double m[16],
            turn[16] = {v[0], v[1], v[2], 0, v[3], v[4], v[5], 0, v[6], v[7], v[8], 0, 0, 0, 0, 1};
        const double view_from_world[16] = {r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1],
                                            r[6], r[7], r[8], t[2], 0,    0,    0,    1};
        gn_mat4_multiply(turn, view_from_world, m);
        if (gn_pose_from_matrix(m, &out[n_out], NULL) == 0) {
            gn_pose_invert(&out[n_out], &out[n_out]);
            n_out++;
        }
    }
    return n < 0 ? n : n_out;
}

/** Weights 1 or 0 by how far each is off; returns how many are left. scratch[n]. */
static int choose(const struct problem *p, const struct gn_pose *pose, double *scratch)
{
    int n_used = 0;
    for (int i = 0; i < p->n; i++)
        scratch[i] = p->s[i].rms_rad = sqrt(get_mean_square(pose, &p->s[i]));
    qsort(scratch, (size_t)p->n, sizeof(*scratch), gn_compare_doubles);
    double median = scratch[(p->n - 1) / 2];
    for (int i = 0; i < p->n; i++) {
        struct gn_probe_sighting *s = &p->s[i];
        s->is_used = s->rms_rad <= far_off * fmax(median, s->error_rad);
        p->weight[i] = s->is_used;
        n_used += s->is_used;
    }
    return n_used;
}

/** Standard deviations, by the Jacobian at the end. unit2: the variance of a residual. */
static int judge(const struct problem *p, double unit2, struct gn_probe_pose *out)
{
    int m = 8 * p->n;
    double norm[UNKNOWNS], s[UNKNOWNS], v[UNKNOWNS * UNKNOWNS];
    fill(p, &out->world_from_probe);
    for (int k = 0; k < UNKNOWNS; k++) {
        norm[k] = gn_solve_get_length(p->jacobian + k, m, UNKNOWNS);
        for (int i = 0; i < m; i++)
            p->jacobian[i * UNKNOWNS + k] /= norm[k];
    }
    if (gn_solve_svd(p->jacobian, m, UNKNOWNS, s, v) < 0)
        return -EDOM;
    for (int k = 0; k < UNKNOWNS; k++) {
        double error = 0;
        for (int i = 0; i < UNKNOWNS; i++)
            error = hypot(error, v[k * UNKNOWNS + i] / s[i] / norm[k]);
        double *worst = k < 3 ? &out->error_rad : &out->error_m;
        *worst = fmax(*worst, error * sqrt(unit2));
    }
    return isfinite(out->error_rad + out->error_m) ? 0 : -EDOM;
}

/** How many sightings each used marker has, on the mean. */
static double count_repeats(const struct problem *p)
{
    int n_used = 0, n_markers = 0;
    for (int i = 0; i < p->n; i++) {
        bool is_new = p->s[i].is_used;
        for (int k = 0; k < i && is_new; k++)
            is_new = !(p->s[k].is_used && p->s[k].marker == p->s[i].marker);
        n_used += p->s[i].is_used;
        n_markers += is_new;
    }
    return n_markers > 0 ? (double)n_used / n_markers : 1;
}

static int refuse(const struct problem *p, const struct gn_probe_pose *out,
                  struct gn_error *out_error)
{
    if (2 * out->n_used <= p->n)
        return gn_error_set(out_error, -EDOM,
                            "only %d of %d sightings of markers fit one place of the probe: did "
                            "the probe or a marker move between pictures, are size and position "
                            "of each marker right?",
                            out->n_used, p->n);
    if (!(out->rms_rad <= GN_PROBE_POSE_MAX_RMS))
        return gn_error_set(out_error, -EDOM,
                            "the markers' corners are %.2f degrees off their places, at most %.1f "
                            "is right: are projection, circle and theta_max right, and size and "
                            "position of each marker, and did none of them move?",
                            DEGREE * out->rms_rad, DEGREE * GN_PROBE_POSE_MAX_RMS);
    if (!(out->margin >= GN_PROBE_POSE_MIN_MARGIN))
        return gn_error_set(out_error, -EDOM,
                            "two poses fit the markers nearly alike (by %.1f, at least %.0f is "
                            "right), as with small flat markers seen from far: take them nearer or "
                            "larger, tilted to the line of sight, or more of them",
                            out->margin, GN_PROBE_POSE_MIN_MARGIN);
    if (!(out->error_rad <= GN_PROBE_POSE_MAX_ERROR))
        return gn_error_set(out_error, -EDOM,
                            "the orientation is uncertain by %.2f degrees, at most %.1f is right: "
                            "take the markers nearer or larger, or more of them, far apart",
                            DEGREE * out->error_rad, DEGREE * GN_PROBE_POSE_MAX_ERROR);
    return 0;
}

/** From the guesses to the answer; guesses[n_guesses], scratch[n]. */
static int fit(const struct problem *p, struct gn_pose *guesses, int n_guesses, double *scratch,
               struct gn_probe_pose *out, struct gn_error *out_error)
{
    double best = INFINITY, sum;
    struct gn_pose pose = {{1, 0, 0, 0}, {0}};
    for (int i = 0; i < n_guesses; i++) {
        double score = agree(p, &guesses[i]);
        if (score < best) {
            best = score;
            pose = guesses[i];
        }
    }
    if (!isfinite(best))
        return gn_error_set(out_error, -EDOM, "the markers' corners allow no pose at all");
    for (int round = 0; round < 4; round++) {
        out->n_used = choose(p, &pose, scratch);
        sum = settle(p, &pose);
    }
    // Each pose again by what is used: another one may fit these alike, or better.
    double other = INFINITY;
    for (int i = 0; i < n_guesses; i++) {
        double of_guess = settle(p, &guesses[i]);
        bool is_same = gn_rotation_get_angle(pose.rotation, guesses[i].rotation) < same_rad;
        if (of_guess < sum) {
            other = is_same ? other : sum;
            sum = of_guess;
            pose = guesses[i];
        } else if (!is_same) {
            other = fmin(other, of_guess);
        }
    }
    int n_residuals = 8 * out->n_used;
    double found = sum / fmax(n_residuals - UNKNOWNS, 1);
    // What corners are off by may be the same in all pictures of a marker.
    double unit2 = fmax(found, 1) * count_repeats(p), mean = 0;
    for (int i = 0; i < p->n; i++) {
        p->s[i].rms_rad = sqrt(get_mean_square(&pose, &p->s[i]));
        mean += p->s[i].is_used ? p->s[i].rms_rad * p->s[i].rms_rad / out->n_used : 0;
    }
    out->world_from_probe = pose;
    out->rms_rad = sqrt(mean);
    out->margin = (other - sum) / unit2;
    if (judge(p, unit2, out) < 0)
        return gn_error_set(out_error, -EDOM, "the markers' corners determine no pose");
    return refuse(p, out, out_error);
}

int gn_probe_pose_fit(struct gn_probe_sighting *sightings, int n, struct gn_probe_pose *out,
                      struct gn_error *out_error)
{
    *out = (struct gn_probe_pose){0};
    if (n < 1 || n > GN_PROBE_POSE_MAX_SIGHTINGS)
        return gn_error_set(out_error, -EDOM, "%d sightings of markers, right is 1 to %d", n,
                            GN_PROBE_POSE_MAX_SIGHTINGS);
    size_t rows = 8 * (size_t)n + UNKNOWNS;
    double *memory = malloc((rows * (UNKNOWNS + 1) + 2 * (size_t)n) * sizeof(*memory));
    if (!memory)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    struct problem p = {.s = sightings, .n = n, .residual = memory, .jacobian = memory + rows};
    p.weight = memory + rows * (UNKNOWNS + 1);
    struct gn_pose guesses[2 * MAX_GUESSING];
    int n_guesses = 0, got = 0, step = (n + MAX_GUESSING - 1) / MAX_GUESSING;
    for (int i = 0; i < n && got >= 0; i += step) {
        got = guess(&sightings[i], guesses + n_guesses, out_error);
        n_guesses += got > 0 ? got : 0;
    }
    int err = got < 0 ? got : fit(&p, guesses, n_guesses, p.weight + n, out, out_error);
    free(memory);
    return err;
}
