/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/camera.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "common/device_json.h"
#include "common/image.h"

/* Source: Brown 1971, in the form and order of OpenCV's calib3d: k1, k2, p1, p2, k3. */
struct distorted {
    double xy[2];
    double jacobian[4]; // d xy / d (x, y), row-major
};

static struct distorted distort(const double k[static 5], double x, double y)
{
    double s = x * x + y * y;
    double radial = 1.0 + s * (k[0] + s * (k[1] + s * k[4]));
    double slope = 2.0 * (k[0] + s * (2.0 * k[1] + s * 3.0 * k[4])); // d radial / dx = slope x
    double cross = x * y * slope + 2.0 * k[2] * x + 2.0 * k[3] * y;
    return (struct distorted){
        .xy = {x * radial + 2.0 * k[2] * x * y + k[3] * (s + 2.0 * x * x),
               y * radial + k[2] * (s + 2.0 * y * y) + 2.0 * k[3] * x * y},
        .jacobian = {radial + x * x * slope + 2.0 * k[2] * y + 6.0 * k[3] * x, cross, cross,
                     radial + y * y * slope + 6.0 * k[2] * y + 2.0 * k[3] * x}};
}

/*
 * Whether the radial polynomial still rises everywhere up to (x, y): beyond its first turning point
 * it folds the world back into the picture, and no lens does that. d(r radial)/dr is a cubic in
 * s = r^2; its least value on [0, s] is at an end or where its derivative vanishes.
 */
static bool is_before_fold(const double k[static 5], double x, double y)
{
    double s = x * x + y * y;
    double c1 = 3.0 * k[0], c2 = 5.0 * k[1], c3 = 7.0 * k[4];
    double at[3] = {s, 0.0, 0.0};
    double discriminant = c2 * c2 - 3.0 * c3 * c1;
    if (c3 != 0.0 && discriminant > 0.0) {
        at[1] = (-c2 + sqrt(discriminant)) / (3.0 * c3);
        at[2] = (-c2 - sqrt(discriminant)) / (3.0 * c3);
    } else if (c3 == 0.0 && c2 != 0.0) {
        at[1] = -c1 / (2.0 * c2);
    }
    for (int i = 0; i < 3; i++) {
        double t = at[i];
        if (t >= 0.0 && t <= s && !(1.0 + t * (c1 + t * (c2 + t * c3)) > 0.0))
            return false;
    }
    struct distorted d = distort(k, x, y);
    return d.jacobian[0] * d.jacobian[3] - d.jacobian[1] * d.jacobian[2] > 0.0;
}

/* Newton with step halving; stays before the fold. False where there is no answer. */
static bool undistort(const double k[static 5], double target_x, double target_y,
                      double out_xy[static 2])
{
    double x = target_x, y = target_y;
    if (!is_before_fold(k, x, y))
        x = y = 0.0;
    struct distorted d = distort(k, x, y);
    double error = hypot(d.xy[0] - target_x, d.xy[1] - target_y);
    const double tolerance = 4.0 * DBL_EPSILON * (1.0 + hypot(target_x, target_y));
    for (int i = 0; i < 100 && error > tolerance; i++) {
        const double *j = d.jacobian;
        double det = j[0] * j[3] - j[1] * j[2];
        double ex = d.xy[0] - target_x, ey = d.xy[1] - target_y;
        double step_x = (j[3] * ex - j[1] * ey) / det;
        double step_y = (j[0] * ey - j[2] * ex) / det;
        bool is_better = false;
        for (double share = 1.0; share > 1e-6 && !is_better; share *= 0.5) {
            double try_x = x - share * step_x, try_y = y - share * step_y;
            struct distorted tried = distort(k, try_x, try_y);
            double try_error = hypot(tried.xy[0] - target_x, tried.xy[1] - target_y);
            if (try_error < error && is_before_fold(k, try_x, try_y)) {
                x = try_x;
                y = try_y;
                d = tried;
                error = try_error;
                is_better = true;
            }
        }
        if (!is_better)
            break;
    }
    out_xy[0] = x;
    out_xy[1] = y;
    return error <= 1e-12 * (1.0 + hypot(target_x, target_y)) && is_before_fold(k, x, y);
}

static bool has_distortion(const double k[static 5])
{
    return k[0] != 0.0 || k[1] != 0.0 || k[2] != 0.0 || k[3] != 0.0 || k[4] != 0.0;
}

int gn_camera_check(const struct gn_camera *camera, const char **out_reason)
{
    const char *reason = NULL;
    if (camera->width < 1 || camera->height < 1 || camera->width > GN_IMAGE_MAX_SIDE ||
        camera->height > GN_IMAGE_MAX_SIDE ||
        (int64_t)camera->width * camera->height > GN_IMAGE_MAX_PIXELS)
        reason = "width and height must lie in [1, 16384] px, with at most 67108864 pixels";
    else if (!(camera->fx > 0.0 && camera->fx <= 1e6 && camera->fy > 0.0 && camera->fy <= 1e6))
        reason = "fx and fy must lie in (0, 1e6] px";
    else if (!(fabs(camera->cx) <= 1e6 && fabs(camera->cy) <= 1e6))
        reason = "cx and cy must lie in [-1e6, 1e6] px";
    for (int i = 0; i < 5; i++)
        if (!(fabs(camera->distortion[i]) <= 1e3))
            reason = "each distortion coefficient must lie in [-1000, 1000]";
    struct gn_pose pose = camera->world_from_camera;
    if (gn_pose_normalize(&pose) < 0)
        reason = "world_from_camera must be finite, its quaternion a unit one";
    if (reason == NULL && gn_response_check(&camera->response, &reason) == 0 &&
        gn_match_check(&camera->match, &reason) == 0)
        return 0;
    if (out_reason != NULL)
        *out_reason = reason;
    return -EINVAL;
}

bool gn_camera_get_ray(const struct gn_camera *camera, double x, double y,
                       double out_dir_camera[static 3])
{
    double xy[2] = {(x - camera->cx) / camera->fx, (y - camera->cy) / camera->fy};
    if (!isfinite(xy[0]) || !isfinite(xy[1]))
        return false;
    if (has_distortion(camera->distortion) && !undistort(camera->distortion, xy[0], xy[1], xy))
        return false;
    double norm = hypot(hypot(xy[0], xy[1]), 1.0);
    out_dir_camera[0] = xy[0] / norm;
    out_dir_camera[1] = xy[1] / norm;
    out_dir_camera[2] = 1.0 / norm;
    return true;
}

bool gn_camera_project(const struct gn_camera *camera, const double point_camera[static 3],
                       double out_xy[static 2])
{
    if (!(point_camera[2] > 0.0))
        return false;
    double x = point_camera[0] / point_camera[2];
    double y = point_camera[1] / point_camera[2];
    if (has_distortion(camera->distortion)) {
        if (!is_before_fold(camera->distortion, x, y))
            return false;
        struct distorted d = distort(camera->distortion, x, y);
        x = d.xy[0];
        y = d.xy[1];
    }
    x = camera->cx + camera->fx * x;
    y = camera->cy + camera->fy * y;
    if (!isfinite(x) || !isfinite(y))
        return false;
    out_xy[0] = x;
    out_xy[1] = y;
    return true;
}

int gn_camera_read_file(const char *path, struct gn_camera *out_camera, struct gn_error *out_error)
{
    struct gn_json root;
    int ret = gn_json_load_file(path, &root, out_error);
    if (ret < 0)
        return ret;
    bool has_pose = gn_json_has(&root, "world_from_camera");
    struct gn_camera camera;
    ret = gn_camera_read_json(&root, has_pose, &camera, out_error);
    if (ret == 0 && !has_pose)
        ret = gn_json_refuse(&root, "world_from_camera", out_error,
                             "missing: where the camera is, 16 numbers row-major "
                             "(docs/frames.md), which its calibration does not know");
    if (ret == 0)
        *out_camera = camera;
    gn_json_finish(&root);
    return ret;
}
