/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "tests/rig/environment.h"
#include "tests/rig/vec.h"

/* One lamp: a glowing disc that faces the table. */
struct lamp {
    double azimuth_deg;   // from +x towards +y
    double elevation_deg; // above the table
    double radius_deg;    // angular radius seen from the table
    double distance;      // m from the table
    double radiance[3];
};

static const struct lamp lamps[GN_RIG_LAMPS] = {
    {.azimuth_deg = 152,
     .elevation_deg = 47,
     .radius_deg = 2.6,
     .distance = 2.1,
     .radiance = {168, 140, 104}}, // warm white, from the left and behind
    {.azimuth_deg = 18,
     .elevation_deg = 38,
     .radius_deg = 2.2,
     .distance = 2.0,
     .radiance = {124, 158, 206}}, // daylight, from the right
    {.azimuth_deg = 262,
     .elevation_deg = 62,
     .radius_deg = 3.2,
     .distance = 1.9,
     .radiance = {66, 59, 49}}, // soft, above the camera
    {.azimuth_deg = 66,
     .elevation_deg = 26,
     .radius_deg = 2.0,
     .distance = 2.2,
     .radiance = {236, 132, 52}}, // amber, low, from behind
};

/* The room around the table's middle, m: x and y half sizes, floor and ceiling heights. */
static const double room_low[3] = {-2.6, -2.3, -0.75}, room_high[3] = {2.6, 2.3, 1.95};

static void get_lamp_axis(const struct lamp *lamp, double out_axis[static 3])
{
    double a = lamp->azimuth_deg * GN_RIG_PI / 180, e = lamp->elevation_deg * GN_RIG_PI / 180;
    out_axis[0] = cos(e) * cos(a);
    out_axis[1] = cos(e) * sin(a);
    out_axis[2] = sin(e);
}

/* Where the direction leaves the room, and the inward axis normal of what it meets. */
static void hit_room(const double dir[static 3], double out_point[static 3], int *out_axis)
{
    double t = INFINITY;
    for (int k = 0; k < 3; k++) {
        double side = dir[k] > 0 ? room_high[k] : room_low[k];
        if (dir[k] != 0 && side / dir[k] < t) {
            t = side / dir[k];
            *out_axis = k;
        }
    }
    vec_scale(dir, t, out_point);
}

static void get_albedo(const double point[static 3], int axis, double out_albedo[static 3])
{
    static const double wall[3] = {0.58, 0.55, 0.50}, side[3] = {0.42, 0.50, 0.52};
    static const double ceiling[3] = {0.72, 0.71, 0.69}, floor_[3] = {0.22, 0.17, 0.13};
    const double *a = axis == 2 ? (point[2] > 0 ? ceiling : floor_) : axis == 0 ? side : wall;
    memcpy(out_albedo, a, 3 * sizeof(*out_albedo));
}

/* Radiance of walls and lamps: Lambert's law under each lamp taken as a point (flux of a disc with
 * its radiance), plus a tenth for the light that has been round the room. */
static void see_room(const double dir[static 3], int n_lamps, double out_radiance[static 3])
{
    double point[3], albedo[3], light[3] = {0.10, 0.10, 0.11};
    int axis = 0;
    hit_room(dir, point, &axis);
    get_albedo(point, axis, albedo);
    memset(out_radiance, 0, 3 * sizeof(*out_radiance));
    for (int i = 0; i < n_lamps; i++) {
        double to[3], at[3], sine = sin(lamps[i].radius_deg * GN_RIG_PI / 180);
        get_lamp_axis(&lamps[i], at);
        if (vec_dot(at, dir) > cos(lamps[i].radius_deg * GN_RIG_PI / 180)) {
            memcpy(out_radiance, lamps[i].radiance, 3 * sizeof(*out_radiance));
            return;
        }
        vec_scale(at, 0.8 * lamps[i].distance, at);
        vec_subtract(at, point, to);
        double d2 = vec_dot(to, to), reach = 0.8 * lamps[i].distance * sine;
        double facing = fabs(to[axis]) / sqrt(d2);
        for (int k = 0; k < 3; k++)
            light[k] += lamps[i].radiance[k] * GN_RIG_PI * reach * reach *
                        (0.16 * facing / (d2 + 0.05) + 0.022);
    }
    for (int k = 0; k < 3; k++)
        out_radiance[k] = albedo[k] * light[k] / GN_RIG_PI;
}

/* Whether a lamp, or its rim, comes within `margin` rad of dir. */
static bool is_near_lamp(const double dir[static 3], int n_lamps, double margin)
{
    for (int i = 0; i < n_lamps; i++) {
        double at[3];
        get_lamp_axis(&lamps[i], at);
        if (vec_dot(at, dir) > cos(lamps[i].radius_deg * GN_RIG_PI / 180 + margin))
            return true;
    }
    return false;
}

struct paint_job {
    struct gn_image *map;
    int n_lamps;
};

static void paint_row(void *context, int y, int worker)
{
    const struct paint_job *job = context;
    int w = job->map->width, h = job->map->height;
    (void)worker;
    for (int x = 0; x < w; x++) {
        double sum[3] = {0};
        const double theta = GN_RIG_PI * (y + 0.5) / h,
                     phi = GN_RIG_PI - 2 * GN_RIG_PI * (x + 0.5) / w;
        const double middle[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
        int n = is_near_lamp(middle, job->n_lamps, 2 * GN_RIG_PI / h) ? 8 : 1;
        for (int i = 0; i < n * n; i++) {
            double t = GN_RIG_PI * (y + (i / n + 0.5) / n) / h, rgb[3];
            double p = GN_RIG_PI - 2 * GN_RIG_PI * (x + (i % n + 0.5) / n) / w;
            const double dir[3] = {sin(t) * cos(p), sin(t) * sin(p), cos(t)};
            see_room(dir, job->n_lamps, rgb);
            for (int k = 0; k < 3; k++)
                sum[k] += rgb[k] / (n * n);
        }
        for (int k = 0; k < 3; k++)
            gn_image_at(job->map, x, y)[k] = (float)sum[k];
    }
}

int gn_rig_paint_lamp_room(int width, int height, int n_lamps, struct gn_pool *pool,
                           struct gn_image *out_map)
{
    struct gn_image map;
    if (n_lamps < 0 || n_lamps > GN_RIG_LAMPS)
        return -EINVAL;
    int result = gn_image_init(&map, width, height, 3);
    if (result)
        return result;
    struct paint_job job = {&map, n_lamps};
    gn_pool_run(pool, height, paint_row, &job);
    *out_map = map;
    return 0;
}
