/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/view.h"

#include <math.h>
#include <string.h>

#include "tests/rig/random.h"
#include "tests/rig/sensor.h"
#include "tests/rig/vec.h"

const double gn_rig_probe_position[3] = {0, 0, 0.3};
const double gn_rig_world_from_probe[2][9] = {
    {0.93969262078590843, -0.34202014332566871, 0, 0.34202014332566871, 0.93969262078590843, 0, 0,
     0, 1},
    {0, 0, 1, -1, 0, 0, 0, -1, 0},
};

/* Points along a pixel's side: few where they see the same, many where they differ. */
#define FEW_POINTS 4
#define MANY_POINTS 16

/* Brown and Conrady: where the lens puts the ideal point p. */
static void distort(const double d[static 5], const double p[static 2], double out[static 2])
{
    double x = p[0], y = p[1], r2 = x * x + y * y;
    double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    out[0] = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x);
    out[1] = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
}

void gn_rig_view_get_ray(const struct gn_rig_view *view, double x, double y,
                         double out_dir[static 3])
{
    const double seen[2] = {(x - view->cx) / view->fx, (y - view->cy) / view->fy};
    double p[2] = {seen[0], seen[1]}, back[2];
    // Fixed point p <- p + (seen - distort(p)): contracts for the mild lenses that the rig makes.
    for (int i = 0; i < 40; i++) {
        distort(view->distortion, p, back);
        double ex = seen[0] - back[0], ey = seen[1] - back[1];
        if (ex == 0 && ey == 0)
            break;
        p[0] += ex;
        p[1] += ey;
    }
    const double *m = view->world_from_camera;
    for (int k = 0; k < 3; k++)
        out_dir[k] = m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2];
    vec_normalize(out_dir);
}

void gn_rig_look_at(const double position[static 3], const double target[static 3],
                    double out_world_from_camera[static 16])
{
    const double up[3] = {0, 0, 1};
    double right[3], down[3], ahead[3];
    vec_subtract(target, position, ahead);
    vec_normalize(ahead);
    vec_cross(ahead, up, right);
    vec_normalize(right);
    vec_cross(ahead, right, down);
    for (int k = 0; k < 3; k++) {
        out_world_from_camera[4 * k] = right[k];
        out_world_from_camera[4 * k + 1] = down[k];
        out_world_from_camera[4 * k + 2] = ahead[k];
        out_world_from_camera[4 * k + 3] = position[k];
        out_world_from_camera[12 + k] = 0;
    }
    out_world_from_camera[15] = 1;
}

struct probe_job {
    const struct gn_rig_environment *env;
    double theta_max;
    const double *world_from_probe;
    const double *position;
    struct gn_image *image;
};

/* One point of the picture; false outside the circle. */
static bool see_point(const struct probe_job *job, double x, double y, double out_rgb[static 3])
{
    double radius = job->image->width / 2.0, dx = (x - radius) / radius, dy = (y - radius) / radius;
    double r = hypot(dx, dy), theta = r * job->theta_max, dir[3];
    if (r > 1)
        return false;
    double share = r > 0 ? sin(theta) / r : 0;
    const double dir_probe[3] = {share * dx, share * dy, cos(theta)};
    vec_transform(job->world_from_probe, dir_probe, dir);
    gn_rig_environment_get_radiance(job->env, job->position, dir, out_rgb);
    return true;
}

/* Mean over n x n points of a pixel; false where they differ by more than a quarter. */
static bool take_pixel(const struct probe_job *job, int x, int y, int n, float out_rgb[static 3])
{
    double sum[3] = {0}, count = 0, low = INFINITY, high = 0, rgb[3];
    for (int i = 0; i < n * n; i++) {
        if (!see_point(job, x + (i % n + 0.5) / n, y + (i / n + 0.5) / n, rgb))
            continue;
        count++;
        for (int k = 0; k < 3; k++)
            sum[k] += rgb[k];
        low = fmin(low, rgb[0] + rgb[1] + rgb[2]);
        high = fmax(high, rgb[0] + rgb[1] + rgb[2]);
    }
    for (int k = 0; k < 3; k++)
        out_rgb[k] = count > 0 ? (float)(sum[k] / count) : 0;
    return high <= 1.25 * low;
}

static void take_row(void *context, int y, int worker)
{
    const struct probe_job *job = context;
    (void)worker;
    for (int x = 0; x < job->image->width; x++) {
        float *rgb = gn_image_at(job->image, x, y);
        if (!take_pixel(job, x, y, FEW_POINTS, rgb))
            (void)take_pixel(job, x, y, MANY_POINTS, rgb);
    }
}

int gn_rig_take_probe(const struct gn_rig_environment *env, enum gn_rig_probe probe, int size,
                      const double world_from_probe[static 9], const double position[static 3],
                      struct gn_pool *pool, struct gn_image *out_image)
{
    struct gn_image image;
    int result = gn_image_init(&image, size, size, 3);
    if (result)
        return result;
    struct probe_job job = {.env = env,
                            .theta_max = probe == GN_RIG_FISHEYE ? GN_RIG_PI / 2 : GN_RIG_PI,
                            .world_from_probe = world_from_probe,
                            .position = position,
                            .image = &image};
    gn_pool_run(pool, size, take_row, &job);
    *out_image = image;
    return 0;
}

void gn_rig_get_quaternion(const double m[static 9], double out_q[static 4])
{
    double t[4] = {m[0] + m[4] + m[8], m[0] - m[4] - m[8], m[4] - m[0] - m[8], m[8] - m[0] - m[4]};
    int best = 0;
    for (int i = 1; i < 4; i++)
        best = t[i] > t[best] ? i : best;
    // Row `best` of the symmetric matrix 4 q q^T.
    const double rows[4][4] = {
        {1 + t[0], m[7] - m[5], m[2] - m[6], m[3] - m[1]},
        {m[7] - m[5], 1 + t[1], m[1] + m[3], m[2] + m[6]},
        {m[2] - m[6], m[1] + m[3], 1 + t[2], m[5] + m[7]},
        {m[3] - m[1], m[2] + m[6], m[5] + m[7], 1 + t[3]},
    };
    double n = 2 * sqrt(1 + t[best]);
    if (rows[best][0] < 0)
        n = -n;
    for (int i = 0; i < 4; i++)
        out_q[i] = rows[best][i] / n;
}

void gn_rig_photograph(const float *linear, long n, const struct gn_rig_noise *noise, uint64_t seed,
                       int frame, uint8_t *out_codes)
{
    const uint32_t key[2] = {(uint32_t)seed, (uint32_t)(seed >> 32)};
    for (long i = 0; i < 3 * n; i++) {
        uint32_t words[4];
        gn_rig_philox((const uint32_t[4]){(uint32_t)i, (uint32_t)frame, 0, 0x70686f74}, key, words);
        double x = linear[i], deviation = sqrt(noise->slope * x + noise->offset);
        x += deviation * gn_rig_get_normal(words[0], words[1]);
        out_codes[i] = (uint8_t)floor(gn_rig_encode_srgb8(x) + 0.5);
    }
}
