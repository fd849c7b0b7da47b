/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/pose_fit.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/normal.h"
#include "client/track/rotation.h"
#include "client/vision/markers.h"

/** Points out of their plane by less than this share of their extent count as in it. */
static const double plane_share = 1e-4;
/** Two poses closer than this are one. */
static const double same_rad = 2e-4;

/** A point as the least squares have it. */
struct observation {
    double point_body[3];
    double ray[2];       // x/z, y/z, distortion undone
    double px_by_ray[4]; // d (x, y) px / d ray there, row-major
};

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[static 3], const double b[static 3], double out[static 3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/** Whether the points lie in one plane: that of the first, the farthest, and the one beside these.
 */
static bool is_planar(const double (*p)[3], int n)
{
    double along[3] = {0}, normal[3] = {0}, extent2 = 0, area2 = 0;
    for (int i = 1; i < n; i++) {
        double d[3] = {p[i][0] - p[0][0], p[i][1] - p[0][1], p[i][2] - p[0][2]};
        if (dot(d, d) > extent2) {
            extent2 = dot(d, d);
            memcpy(along, d, sizeof(d));
        }
    }
    for (int i = 1; i < n; i++) {
        double d[3] = {p[i][0] - p[0][0], p[i][1] - p[0][1], p[i][2] - p[0][2]}, c[3];
        cross(along, d, c);
        if (dot(c, c) > area2) {
            area2 = dot(c, c);
            memcpy(normal, c, sizeof(c));
        }
    }
    for (int i = 1; i < n; i++) {
        double d[3] = {p[i][0] - p[0][0], p[i][1] - p[0][1], p[i][2] - p[0][2]};
        if (fabs(dot(d, normal)) > plane_share * sqrt(extent2 * area2))
            return false;
    }
    return true;
}

/** Undoes the lens for one point and takes its derivative there. */
static bool observe(const struct gn_camera *camera, const double point[static 3],
                    const double px[static 2], struct observation *out)
{
    double dir[3];
    if (!gn_camera_get_ray(camera, px[0], px[1], dir))
        return false;
    memcpy(out->point_body, point, sizeof(out->point_body));
    const double h = 1e-5;
    for (int k = 0; k < 2; k++) {
        out->ray[k] = dir[k] / dir[2];
        double more[3] = {dir[0] / dir[2], dir[1] / dir[2], 1}, less[3], a[2], b[2];
        memcpy(less, more, sizeof(less));
        more[k] += h;
        less[k] -= h;
        if (!gn_camera_project(camera, more, a) || !gn_camera_project(camera, less, b))
            return false;
        for (int i = 0; i < 2; i++)
            out->px_by_ray[2 * i + k] = (a[i] - b[i]) / (2 * h);
    }
    return true;
}

/**
 * The residuals of all points at a pose, and with jtj the normal equations of a step (w, d) that
 * turns it by w about the camera's axes through the body's origin and shifts it by d.
 * Returns the sum of squares; infinity where a point is behind the camera.
 */
static double sum_squares(const struct observation *obs, int n, const struct gn_pose *pose,
                          double jtj[6][6], double jtr[6])
{
    double sum = 0;
    if (jtj) {
        memset(jtj, 0, 36 * sizeof(double));
        memset(jtr, 0, 6 * sizeof(double));
    }
    for (int i = 0; i < n; i++) {
        const struct observation *o = &obs[i];
        double turned[3], p[3], j[2][6];
        gn_pose_rotate(pose, o->point_body, turned);
        for (int k = 0; k < 3; k++)
            p[k] = turned[k] + pose->translation[k];
        if (!(p[2] > 1e-9))
            return INFINITY;
        double x = p[0] / p[2], y = p[1] / p[2];
        const double *m = o->px_by_ray;
        double dx = x - o->ray[0], dy = y - o->ray[1];
        double r[2] = {m[0] * dx + m[1] * dy, m[2] * dx + m[3] * dy};
        sum += r[0] * r[0] + r[1] * r[1];
        if (!jtj)
            continue;
        for (int a = 0; a < 2; a++) {
            // d r / d p, then d p / d w = -[turned]x, d p / d d = 1.
            double g[3] = {m[2 * a] / p[2], m[2 * a + 1] / p[2],
                           -(m[2 * a] * x + m[2 * a + 1] * y) / p[2]};
            cross(turned, g, j[a]);
            memcpy(j[a] + 3, g, sizeof(g));
            for (int k = 0; k < 6; k++) {
                jtr[k] += j[a][k] * r[a];
                for (int l = 0; l < 6; l++)
                    jtj[k][l] += j[a][k] * j[a][l];
            }
        }
    }
    return sum;
}

/** q = exp(w) q: a turn about the axes that the pose maps to. */
static void step_pose(const struct gn_pose *from, const double step[static 6], struct gn_pose *out)
{
    struct gn_pose turn = {0}, still = *from;
    const double w[3] = {-step[0], -step[1], -step[2]};
    gn_rotation_exp(w, turn.rotation);
    memset(still.translation, 0, sizeof(still.translation));
    gn_pose_multiply(&turn, &still, out);
    for (int k = 0; k < 3; k++)
        out->translation[k] = from->translation[k] - step[3 + k];
}

/** Levenberg-Marquardt (Marquardt 1963) to the end. False where no pose comes of it. */
static bool refine(const struct observation *obs, int n, double error_px, struct gn_pose_fit *fit)
{
    double jtj[6][6], jtr[6], damping = 1e-4;
    struct gn_pose pose = fit->camera_from_body;
    double sum = sum_squares(obs, n, &pose, jtj, jtr);
    for (int i = 0; i < 60 && isfinite(sum); i++) {
        double a[6][6], step[6];
        memcpy(a, jtj, sizeof(a));
        memcpy(step, jtr, sizeof(step));
        for (int k = 0; k < 6; k++)
            a[k][k] *= 1 + damping;
        struct gn_pose tried;
        double tried_sum = INFINITY;
        if (gn_normal_decompose(a[0], 6)) {
            gn_normal_solve(a[0], 6, step);
            step_pose(&pose, step, &tried);
            tried_sum = sum_squares(obs, n, &tried, NULL, NULL);
        }
        if (!(tried_sum < sum)) {
            damping *= 10;
            if (damping > 1e6)
                break;
            continue;
        }
        bool is_end = sum - tried_sum < 1e-12 * sum + 1e-20;
        pose = tried;
        sum = sum_squares(obs, n, &pose, jtj, jtr);
        damping = fmax(damping * 0.1, 1e-12);
        if (is_end)
            break;
    }
    if (!isfinite(sum) || gn_pose_normalize(&pose) < 0 || !gn_normal_decompose(jtj[0], 6))
        return false;
    double variance[6];
    for (int k = 0; k < 6; k++) {
        double column[6] = {0};
        column[k] = 1;
        gn_normal_solve(jtj[0], 6, column);
        variance[k] = column[k];
    }
    *fit = (struct gn_pose_fit){
        .camera_from_body = pose,
        .sum_px2 = sum,
        .rms_px = sqrt(sum / (2.0 * n)),
        .error_rad = error_px * sqrt(variance[0] + variance[1] + variance[2]),
        .error_m = error_px * sqrt(variance[3] + variance[4] + variance[5]),
    };
    return true;
}

/** A first guess as a pose. */
static bool take_guess(const struct gn_vision_pose *guess, struct gn_pose *out)
{
    double m[16];
    gn_mat4_identity(m);
    for (int i = 0; i < 3; i++) {
        memcpy(m + 4 * i, guess->rotation + 3 * i, 3 * sizeof(double));
        m[4 * i + 3] = guess->translation[i];
    }
    return gn_pose_from_matrix(m, out, NULL) == 0;
}

static int fit_observations(const struct observation *obs, const double (*points)[3],
                            const double *rays, int n, double error_px, struct gn_pose_fit *out,
                            struct gn_error *out_error)
{
    struct gn_vision_pose guesses[2];
    int n_guesses =
        gn_vision_solve_pose(points[0], rays, n, is_planar(points, n), guesses, out_error);
    int n_fits = 0;
    for (int i = 0; i < n_guesses; i++) {
        struct gn_pose_fit fit = {0};
        if (take_guess(&guesses[i], &fit.camera_from_body) && refine(obs, n, error_px, &fit))
            out[n_fits++] = fit;
    }
    if (n_fits == 2 && out[1].sum_px2 < out[0].sum_px2) {
        struct gn_pose_fit fit = out[0];
        out[0] = out[1];
        out[1] = fit;
    }
    if (n_fits == 2 && gn_rotation_get_angle(out[0].camera_from_body.rotation,
                                             out[1].camera_from_body.rotation) < same_rad)
        n_fits = 1;
    return n_guesses < 0 ? n_guesses : n_fits;
}

int gn_pose_fit_points(const struct gn_camera *camera, const double (*points_body)[3],
                       const double (*seen_px)[2], int n, double error_px,
                       struct gn_pose_fit out_fits[static 2], struct gn_error *out_error)
{
    if (n < 4 || n > GN_POSE_FIT_MAX_POINTS)
        return gn_error_set(out_error, -EINVAL, "a pose needs 4 to %d points, not %d",
                            GN_POSE_FIT_MAX_POINTS, n);
    struct observation *obs = calloc((size_t)n, sizeof(*obs));
    double *rays = calloc((size_t)n, 2 * sizeof(*rays));
    int ret = obs && rays ? 0 : gn_error_set(out_error, -ENOMEM, "out of memory");
    bool is_seen = true;
    for (int i = 0; ret == 0 && i < n && is_seen; i++) {
        is_seen = observe(camera, points_body[i], seen_px[i], &obs[i]);
        rays[2 * i] = obs[i].ray[0];
        rays[2 * i + 1] = obs[i].ray[1];
    }
    if (ret == 0 && is_seen)
        ret = fit_observations(obs, points_body, rays, n, error_px, out_fits, out_error);
    free(obs);
    free(rays);
    return ret;
}
