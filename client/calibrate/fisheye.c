/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/fisheye.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/solve.h"
#include "common/vec3.h"

#define DEGREE 57.29577951308232
#define MAX_PARAMETERS 10
#define MAX_STEPS 100

static double get_angle(const double a[3], const double b[3])
{
    double cross[3];
    gn_vec3_cross(a, b, cross);
    return atan2(sqrt(gn_vec3_dot(cross, cross)), gn_vec3_dot(a, b));
}

static int make_pose(const double r[9], struct gn_pose *out)
{
    double m[16] = {r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0, 0, 0, 0, 1};
    return gn_pose_from_matrix(m, out, NULL);
}

int gn_fisheye_find_orientation(const struct gn_projection *projection,
                                const struct gn_fisheye_sighting *s, int n, struct gn_pose *out,
                                double *out_spread)
{
    double b[9] = {0}, r[9], singular[3], seen[3];
    int used = 0;
    for (int i = 0; i < n; i++) {
        if (!gn_projection_get_direction(projection, s[i].xy[0], s[i].xy[1], seen))
            continue;
        for (int k = 0; k < 9; k++)
            b[k] += s[i].dir_world[k / 3] * seen[k % 3];
        used++;
    }
    if (used < 2 || gn_solve_wahba(b, r, singular) < 0)
        return -EDOM;
    *out_spread = (singular[1] + singular[2]) / used;
    return make_pose(r, out);
}

/* The state of a fit: orientation, and the parameters that move. */
struct fit {
    const struct gn_fisheye_sighting *s;
    int n, moves, n_parameters;
    struct gn_projection projection;
    struct gn_pose pose;
};

/* Parameters: small rotation of the world, centre, ln radius, k1..k4 (the focal length stays). */
static bool apply(const struct fit *f, const double *p, struct gn_projection *projection,
                  struct gn_pose *pose)
{
    double angle = sqrt(gn_vec3_dot(p, p)), half = angle > 1e-12 ? sin(angle / 2) / angle : 0.5;
    struct gn_pose turn = {{cos(angle / 2), half * p[0], half * p[1], half * p[2]}, {0}};
    gn_pose_multiply(&turn, &f->pose, pose);
    *projection = f->projection;
    int at = 3;
    if (f->moves & GN_FISHEYE_CENTER) {
        projection->center[0] += p[at++];
        projection->center[1] += p[at++];
    }
    if (f->moves & GN_FISHEYE_RADIUS) {
        projection->radius *= exp(p[at]);
        projection->focal *= exp(p[at++]);
    }
    if (f->moves & GN_FISHEYE_LENS) {
        for (int k = 0; k < 4; k++)
            projection->k[k] += p[at++];
        projection->radius = 0; // follows from focal and polynomial
    }
    return gn_projection_init(projection, NULL) == 0;
}

/* Two residuals each, rad: the error across the line of sight, on two axes of the world. */
static bool get_residuals(const struct fit *f, const double *p, double *out)
{
    struct gn_projection projection;
    struct gn_pose pose;
    if (!apply(f, p, &projection, &pose))
        return false;
    for (int i = 0; i < f->n; i++) {
        double seen[3], world[3], x[3], y[3];
        const double *d = f->s[i].dir_world;
        if (!gn_projection_get_direction(&projection, f->s[i].xy[0], f->s[i].xy[1], seen))
            return false;
        gn_pose_rotate(&pose, seen, world);
        double axis[3] = {fabs(d[0]) < 0.6, fabs(d[0]) >= 0.6, 0};
        gn_vec3_cross(d, axis, x);
        double norm = sqrt(gn_vec3_dot(x, x));
        for (int k = 0; k < 3; k++)
            x[k] /= norm;
        gn_vec3_cross(d, x, y);
        double sine = sqrt(pow(gn_vec3_dot(world, x), 2) + pow(gn_vec3_dot(world, y), 2));
        double scale = sine > 1e-12 ? get_angle(world, d) / sine : 1; // large errors count whole
        out[2 * i] = scale * gn_vec3_dot(world, x);
        out[2 * i + 1] = scale * gn_vec3_dot(world, y);
    }
    return true;
}

static double get_square(const double *r, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += r[i] * r[i];
    return sum;
}

/* d residuals / d parameters by central differences, [2 n][n_parameters]. */
static bool differentiate(const struct fit *f, double *jacobian, double *plus, double *minus)
{
    for (int j = 0; j < f->n_parameters; j++) {
        double p[MAX_PARAMETERS] = {0}, step = 1e-6;
        bool is_center = (f->moves & GN_FISHEYE_CENTER) && (j == 3 || j == 4);
        step = is_center ? 1e-3 : step; // px, else rad or relative
        p[j] = step;
        if (!get_residuals(f, p, plus))
            return false;
        p[j] = -step;
        if (!get_residuals(f, p, minus))
            return false;
        for (int i = 0; i < 2 * f->n; i++)
            jacobian[i * f->n_parameters + j] = (plus[i] - minus[i]) / (2 * step);
    }
    return true;
}

struct scratch {
    double *jacobian, *copy, *right, *residual, *plus, *minus;
};

/* One damped step, tried with more damping until it helps. Returns whether it did. */
static bool improve(struct fit *f, struct scratch *w, double *damping)
{
    int m = 2 * f->n, k = f->n_parameters;
    double zero[MAX_PARAMETERS] = {0};
    if (!get_residuals(f, zero, w->residual) || !differentiate(f, w->jacobian, w->plus, w->minus))
        return false;
    double before = get_square(w->residual, m);
    for (int attempt = 0; attempt < 12; attempt++, *damping *= 10) {
        double step[MAX_PARAMETERS];
        memcpy(w->copy, w->jacobian, (size_t)(m * k) * sizeof(double));
        for (int i = 0; i < m; i++)
            w->right[i] = -w->residual[i];
        if (gn_solve_damped_squares(w->copy, w->right, m, k, *damping, step) < 0)
            continue;
        if (get_residuals(f, step, w->plus) && get_square(w->plus, m) < before) {
            struct gn_projection projection;
            struct gn_pose pose;
            double after = get_square(w->plus, m);
            if (!apply(f, step, &projection, &pose))
                return false;
            f->projection = projection;
            f->pose = pose;
            *damping = fmax(*damping / 10, 1e-12);
            return before - after > 1e-12 * before;
        }
    }
    return false;
}

/* Figures of the solution: angles, and what the Jacobian says of them. */
static int judge(const struct fit *f, struct scratch *w, struct gn_fisheye_sighting *s,
                 struct gn_fisheye_fit *out, struct gn_error *out_error)
{
    int m = 2 * f->n, k = f->n_parameters;
    double zero[MAX_PARAMETERS] = {0}, singular[MAX_PARAMETERS], v[MAX_PARAMETERS * MAX_PARAMETERS];
    double norm[MAX_PARAMETERS] = {0}, sum = 0;
    *out = (struct gn_fisheye_fit){.projection = f->projection, .world_from_probe = f->pose};
    if (!get_residuals(f, zero, w->residual) || !differentiate(f, w->jacobian, w->plus, w->minus))
        return gn_error_set(out_error, -EDOM,
                            "these lamps do not determine the lens, which the fit made one that "
                            "cannot be: take lamps near the middle and near the rim");
    for (int i = 0; i < f->n; i++) {
        s[i].error_deg = DEGREE * hypot(w->residual[2 * i], w->residual[2 * i + 1]);
        out->worst_deg = fmax(out->worst_deg, s[i].error_deg);
        sum += s[i].error_deg * s[i].error_deg;
    }
    out->rms_deg = sqrt(sum / f->n);
    memcpy(w->copy, w->jacobian, (size_t)(m * k) * sizeof(double));
    out->condition = gn_solve_get_condition(w->copy, m, k);
    if (!(out->condition <= GN_FISHEYE_MAX_CONDITION))
        return gn_error_set(out_error, -EDOM,
                            "these lamps do not determine what is asked for (condition number "
                            "%.3g, at most %g is right): take lamps in more directions, near the "
                            "middle and near the rim, or fit less",
                            out->condition, GN_FISHEYE_MAX_CONDITION);
    memcpy(w->copy, w->jacobian, (size_t)(m * k) * sizeof(double));
    for (int j = 0; j < k; j++) {
        norm[j] = gn_solve_get_length(w->copy + j, m, k);
        for (int i = 0; i < m; i++)
            w->copy[i * k + j] /= norm[j];
    }
    if (gn_solve_svd(w->copy, m, k, singular, v) < 0)
        return gn_error_set(out_error, -EDOM, "the fit of the lens is not finite");
    double sigma = sqrt(get_square(w->residual, m) / (m > k ? m - k : 1));
    for (int j = 0; j < 3; j++) {
        double error = 0;
        for (int i = 0; i < k; i++)
            error = hypot(error, v[j * k + i] / singular[i] * sigma / norm[j]);
        out->uncertainty_deg = fmax(out->uncertainty_deg, DEGREE * error);
    }
    return 0;
}

static int run(struct fit *f, struct gn_fisheye_sighting *s, struct gn_fisheye_fit *out,
               struct gn_error *out_error)
{
    size_t rows = 2 * (size_t)f->n + MAX_PARAMETERS;
    double *memory = malloc(rows * (2 * MAX_PARAMETERS + 4) * sizeof(double));
    if (!memory)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    struct scratch w = {memory,
                        memory + rows * MAX_PARAMETERS,
                        memory + rows * 2 * MAX_PARAMETERS,
                        memory + rows * (2 * MAX_PARAMETERS + 1),
                        memory + rows * (2 * MAX_PARAMETERS + 2),
                        memory + rows * (2 * MAX_PARAMETERS + 3)};
    double damping = 1e-3;
    for (int i = 0; i < MAX_STEPS && improve(f, &w, &damping); i++)
        ;
    int err = judge(f, &w, s, out, out_error);
    free(memory);
    return err;
}

/* Kannala-Brandt's polynomial in place of a model with a formula: r / f = theta + k1 theta^3 + ...
 * fitted to it at 32 angles. */
static int make_polynomial(struct gn_projection *p)
{
    struct gn_projection kb = *p;
    double a[32 * 4], b[32];
    if (p->type == GN_PROJECTION_FISHEYE_KANNALA_BRANDT)
        return 0;
    for (int i = 0; i < 32; i++) {
        double theta = p->theta_max * (i + 0.5) / 32, xy[2];
        double dir[3] = {sin(theta), 0, cos(theta)};
        if (!gn_projection_get_position(p, dir, xy))
            return -EDOM;
        for (int k = 0; k < 4; k++)
            a[4 * i + k] = pow(theta, 2 * k + 3);
        b[i] = (xy[0] - p->center[0]) / p->focal - theta;
    }
    if (gn_solve_least_squares(a, b, 32, 4, kb.k) < 0)
        return -EDOM;
    kb.type = GN_PROJECTION_FISHEYE_KANNALA_BRANDT;
    kb.radius = 0;
    *p = kb;
    return gn_projection_init(p, NULL);
}

int gn_fisheye_fit(const struct gn_projection *projection, int moves,
                   struct gn_fisheye_sighting *sightings, int n, struct gn_fisheye_fit *out_fit,
                   struct gn_error *out_error)
{
    struct fit f = {.s = sightings, .n = n, .moves = moves, .projection = *projection};
    double spread = 0;
    if (n > GN_FISHEYE_MAX_SIGHTINGS)
        return gn_error_set(out_error, -EDOM, "%d lamps, at most %d are taken", n,
                            GN_FISHEYE_MAX_SIGHTINGS);
    if (n < 2 || gn_fisheye_find_orientation(projection, sightings, n, &f.pose, &spread) < 0 ||
        !(spread > 3e-4)) // two directions 2 degrees apart: sin^2 / 4
        return gn_error_set(out_error, -EDOM,
                            "%d lamps seen do not determine an orientation: at least two, well "
                            "apart, are needed (a turn about the line through one is not seen)",
                            n);
    f.n_parameters = 3 + (moves & GN_FISHEYE_CENTER ? 2 : 0) + (moves & GN_FISHEYE_RADIUS ? 1 : 0) +
                     (moves & GN_FISHEYE_LENS ? 4 : 0);
    if (2 * n < f.n_parameters + (moves ? 2 : 0))
        return gn_error_set(out_error, -EDOM, "%d lamps are too few for %d unknowns: at least %d",
                            n, f.n_parameters, f.n_parameters / 2 + 2);
    if ((moves & GN_FISHEYE_LENS) && make_polynomial(&f.projection) < 0)
        return gn_error_set(out_error, -EDOM, "no polynomial fits the lens's model");
    return run(&f, sightings, out_fit, out_error);
}
