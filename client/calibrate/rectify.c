/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/rectify.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "common/compare.h"
#include "common/vec3.h"

#define PI 3.14159265358979323846

/** Between rings of views, and between views of a ring, rad. */
static const double tile_step = 35 * PI / 180;
/** Pixels of a view to one in the middle of the picture. */
static const double fineness = 1.5;
/** Most of a view's light to its least. */
static const double max_range = 1000;
/** Above the lightest percent: paper is not lit evenly. */
static const double headroom = 1.5;

void gn_rectify_aim(const double dir[static 3], double half_width, double focal,
                    struct gn_rectified_view *out)
{
    double y[3] = {fabs(dir[1]) < 0.8 ? 0 : 1, fabs(dir[1]) < 0.8 ? 1 : 0, 0}, x[3];
    gn_vec3_cross(y, dir, x);
    double length = sqrt(gn_vec3_dot(x, x));
    for (int k = 0; k < 3; k++)
        x[k] /= length;
    gn_vec3_cross(dir, x, y);
    for (int k = 0; k < 3; k++) {
        out->probe_from_view[3 * k] = x[k];
        out->probe_from_view[3 * k + 1] = y[k];
        out->probe_from_view[3 * k + 2] = dir[k];
    }
    out->side = (int)fmin(fmax(ceil(2 * half_width * focal), 16), GN_RECTIFY_MAX_SIDE);
    out->focal = out->side / (2 * half_width);
}

int gn_rectify_tile(const struct gn_projection *projection,
                    struct gn_rectified_view out_views[static GN_RECTIFY_MAX_VIEWS])
{
    int n = 0;
    for (double theta = 0; theta < projection->theta_max; theta += tile_step) {
        int n_ring = theta > 0 ? (int)ceil(2 * PI * sin(theta) / tile_step) : 1;
        for (int i = 0; i < n_ring && n < GN_RECTIFY_MAX_VIEWS; i++) {
            double phi = 2 * PI * i / n_ring;
            const double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            gn_rectify_aim(dir, 1, fineness * projection->focal, &out_views[n++]);
        }
    }
    return n;
}

void gn_rectify_get_direction(const struct gn_rectified_view *view, const double xy[static 2],
                              double out_dir[static 3])
{
    const double ray[3] = {(xy[0] - 0.5 * view->side) / view->focal,
                           (xy[1] - 0.5 * view->side) / view->focal, 1};
    double length = sqrt(gn_vec3_dot(ray, ray));
    for (int k = 0; k < 3; k++)
        out_dir[k] = gn_vec3_dot(view->probe_from_view + 3 * k, ray) / length;
}

bool gn_rectify_get_position(const struct gn_rectified_view *view, const double dir[static 3],
                             double out_xy[static 2])
{
    const double *m = view->probe_from_view;
    double ray[3];
    for (int k = 0; k < 3; k++)
        ray[k] = m[k] * dir[0] + m[3 + k] * dir[1] + m[6 + k] * dir[2];
    if (!(ray[2] > 1e-6))
        return false;
    for (int k = 0; k < 2; k++)
        out_xy[k] = 0.5 * view->side + view->focal * ray[k] / ray[2];
    return true;
}

/** The light between pixel centres; negative where the picture shows none. */
static float sample(const struct gn_image *light, double x, double y)
{
    int i = (int)floor(x - 0.5), j = (int)floor(y - 0.5);
    if (i < 0 || j < 0 || i + 1 >= light->width || j + 1 >= light->height)
        return -1;
    double s = x - 0.5 - i, t = y - 0.5 - j;
    const float *p = gn_image_at(light, i, j), *q = gn_image_at(light, i, j + 1);
    double v = (1 - t) * ((1 - s) * (double)p[0] + s * (double)p[1]) +
               t * ((1 - s) * (double)q[0] + s * (double)q[1]);
    return isfinite(v) ? (float)fmax(v, 0) : -1;
}

/** From the darkest to the lightest percent of what was taken in the middle; sorts into scratch. */
static void find_range(const float *taken, int side, double core, float *scratch, double *out_low,
                       double *out_high)
{
    int from = (int)(0.5 * side * (1 - core)), n = 0, stride = 1 + (side - 2 * from) / 128;
    for (int y = from; y < side - from; y += stride)
        for (int x = from; x < side - from; x += stride)
            if (taken[y * side + x] >= 0)
                scratch[n++] = taken[y * side + x];
    qsort(scratch, (size_t)n, sizeof(*scratch), gn_compare_floats);
    *out_high = n > 0 ? headroom * (double)scratch[n - 1 - n / 100] : 0;
    *out_low = n > 0 ? fmax((double)scratch[n / 100], *out_high / max_range) : 0;
}

/** The mean of across x across places of a pixel; negative where the picture lacks one. */
static float take_pixel(const struct gn_rectified_view *view,
                        const struct gn_projection *projection, const struct gn_image *light, int x,
                        int y, int across)
{
    float sum = 0;
    for (int i = 0; i < across * across; i++) {
        const double xy[2] = {x + (i % across + 0.5) / across,
                              y + ((double)(i / across) + 0.5) / across};
        double dir[3], at[2];
        gn_rectify_get_direction(view, xy, dir);
        float v =
            gn_projection_get_position(projection, dir, at) ? sample(light, at[0], at[1]) : -1;
        if (v < 0)
            return -1;
        sum += v;
    }
    return sum / (float)(across * across);
}

int gn_rectify_take(const struct gn_rectified_view *view, const struct gn_projection *projection,
                    const struct gn_image *light, double core, struct gn_image8 *out_grey,
                    float out_linear[static 256])
{
    size_t n = (size_t)view->side * (size_t)view->side;
    float *taken = malloc(2 * n * sizeof(*taken));
    if (!taken)
        return -ENOMEM;
    int across = (int)fmin(ceil(projection->focal / view->focal), 8);
    for (size_t i = 0; i < n; i++)
        taken[i] =
            take_pixel(view, projection, light, (int)i % view->side, (int)i / view->side, across);
    double low, high;
    find_range(taken, view->side, core, taken + n, &low, &high);
    double decades = high > low && low > 0 ? log(high / low) : 0;
    for (size_t i = 0; i < n; i++) {
        double t =
            decades > 0 && (double)taken[i] > low ? log((double)taken[i] / low) / decades : 0;
        out_grey->data[i] = (uint8_t)(255 * fmin(t, 1) + 0.5);
    }
    for (int code = 0; code < 256; code++)
        out_linear[code] = (float)exp(decades * (code / 255.0 - 1));
    free(taken);
    return 0;
}
