/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/environment.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/vec.h"

/* What lies more than a few degrees below the horizon gets this part of its share of the samples.
 */
#define BELOW_HORIZON_SHARE 0.02
#define BELOW_HORIZON_DEG 4

static void clean_texels(struct gn_image *map)
{
    size_t n = (size_t)map->width * (size_t)map->height * 3;
    for (size_t i = 0; i < n; i++)
        map->data[i] = map->data[i] > 0 ? fminf(map->data[i], FLT_MAX) : 0;
}

double gn_rig_environment_get_texel_solid_angle(const struct gn_rig_environment *env, int y)
{
    double h = env->map.height;
    return 2 * GN_RIG_PI / env->map.width * (cos(GN_RIG_PI * y / h) - cos(GN_RIG_PI * (y + 1) / h));
}

static double add_channels(const float rgb[static 3])
{
    return (double)rgb[0] + rgb[1] + rgb[2];
}

/* Bright is what exceeds a multiple of the map's mean over the sphere. */
static double find_threshold(const struct gn_rig_environment *env)
{
    double sum = 0;
    for (int y = 0; y < env->map.height; y++)
        for (int x = 0; x < env->map.width; x++)
            sum += add_channels(gn_image_at(&env->map, x, y)) *
                   gn_rig_environment_get_texel_solid_angle(env, y);
    return GN_RIG_BRIGHT * sum / (4 * GN_RIG_PI);
}

/* Fills both tables with running sums of importance: the bright texels' sum of channels times solid
 * angle. */
static void fill_tables(struct gn_rig_environment *env)
{
    int w = env->map.width, h = env->map.height;
    for (int y = 0; y < h; y++) {
        double *columns = env->column_cdf + (size_t)y * (size_t)(w + 1);
        double weight = gn_rig_environment_get_texel_solid_angle(env, y);
        weight *= 180.0 * y / h < 90 + BELOW_HORIZON_DEG ? 1 : BELOW_HORIZON_SHARE;
        for (int x = 0; x < w; x++) {
            double sum = add_channels(gn_image_at(&env->map, x, y));
            columns[x + 1] = columns[x] + (sum > env->threshold ? weight * sum : 0);
        }
        env->row_cdf[y + 1] = env->row_cdf[y] + columns[w];
    }
}

int gn_rig_environment_init(struct gn_image *map, double distance,
                            struct gn_rig_environment *out_env, struct gn_error *out_error)
{
    struct gn_rig_environment env = {.map = *map, .distance = distance};
    size_t w = (size_t)map->width, h = (size_t)map->height;
    if (map->channels != 3 || !(distance >= 0) || !isfinite(distance))
        return gn_error_set(out_error, -EINVAL,
                            "environment: %d channels and a distance of %g m, need 3 and a finite "
                            "distance >= 0",
                            map->channels, distance);
    clean_texels(map);
    env.row_cdf = calloc(h + 1, sizeof(*env.row_cdf));
    env.column_cdf = calloc(h * (w + 1), sizeof(*env.column_cdf));
    if (!env.row_cdf || !env.column_cdf) {
        free(env.row_cdf);
        free(env.column_cdf);
        return gn_error_set(out_error, -ENOMEM, "environment: no memory for %zu x %zu texels", w,
                            h);
    }
    env.threshold = find_threshold(&env);
    fill_tables(&env);
    memset(map, 0, sizeof(*map));
    *out_env = env;
    return 0;
}

void gn_rig_environment_finish(struct gn_rig_environment *env)
{
    gn_image_finish(&env->map);
    free(env->row_cdf);
    free(env->column_cdf);
    memset(env, 0, sizeof(*env));
}

/* The texel seen along dir from the middle. */
static void find_texel(const struct gn_rig_environment *env, const double dir[static 3], int *out_x,
                       int *out_y)
{
    int w = env->map.width, h = env->map.height;
    double theta = atan2(hypot(dir[0], dir[1]), dir[2]);
    double u = 0.5 - atan2(dir[1], dir[0]) / (2 * GN_RIG_PI);
    int x = (int)floor(u * w), y = (int)floor(theta / GN_RIG_PI * h);
    *out_x = x < 0 ? 0 : x >= w ? w - 1 : x;
    *out_y = y < 0 ? 0 : y >= h ? h - 1 : y;
}

double gn_rig_environment_get_distance(const struct gn_rig_environment *env,
                                       const double point[static 3], const double dir[static 3])
{
    if (env->distance == 0)
        return INFINITY;
    // |p + t d| = R, the farther root; outside the sphere there is no light.
    double b = vec_dot(point, dir), c = vec_dot(point, point) - env->distance * env->distance;
    return c < 0 ? -b + sqrt(b * b - c) : INFINITY;
}

/* The direction from the middle to where the ray meets the light; false: nowhere. */
static bool see_light(const struct gn_rig_environment *env, const double point[static 3],
                      const double dir[static 3], double out_dir[static 3], double *out_distance)
{
    *out_distance = gn_rig_environment_get_distance(env, point, dir);
    memcpy(out_dir, dir, 3 * sizeof(*out_dir));
    if (env->distance == 0)
        return true;
    if (!isfinite(*out_distance))
        return false;
    for (int k = 0; k < 3; k++)
        out_dir[k] = (point[k] + *out_distance * dir[k]) / env->distance;
    return true;
}

bool gn_rig_environment_get_radiance(const struct gn_rig_environment *env,
                                     const double point[static 3], const double dir[static 3],
                                     double out_radiance[static 3])
{
    double seen[3], distance;
    int x, y;
    memset(out_radiance, 0, 3 * sizeof(*out_radiance));
    if (!see_light(env, point, dir, seen, &distance))
        return false;
    find_texel(env, seen, &x, &y);
    for (int k = 0; k < 3; k++)
        out_radiance[k] = gn_image_at(&env->map, x, y)[k];
    return add_channels(gn_image_at(&env->map, x, y)) > env->threshold;
}

/* Density over the directions from the middle of a texel. */
static double get_texel_pdf(const struct gn_rig_environment *env, int x, int y)
{
    const double *columns = env->column_cdf + (size_t)y * (size_t)(env->map.width + 1);
    if (columns[x + 1] == columns[x])
        return 0;
    return (columns[x + 1] - columns[x]) / env->row_cdf[env->map.height] /
           gn_rig_environment_get_texel_solid_angle(env, y);
}

/* Solid angle at the middle per solid angle at the point, for the part of the sphere seen along
 * dir: dA cos / t^2 against dA / R^2. */
static double get_view_ratio(const struct gn_rig_environment *env, const double seen[static 3],
                             const double dir[static 3], double distance)
{
    if (env->distance == 0)
        return 1;
    double r = env->distance / distance;
    return 1 / (r * r * vec_dot(seen, dir));
}

/* The entry with table[i] <= value < table[i + 1]; entries of zero width are never chosen. */
static int find_entry(const double *table, int n, double value)
{
    int low = 0, high = n;
    while (high - low > 1) {
        int mid = (low + high) / 2;
        if (table[mid] <= value)
            low = mid;
        else
            high = mid;
    }
    return low;
}

bool gn_rig_environment_sample(const struct gn_rig_environment *env, const double point[static 3],
                               const double uv[static 2], struct gn_rig_light_sample *out_sample)
{
    int w = env->map.width, h = env->map.height;
    if (env->row_cdf[h] == 0)
        return false;
    double target = uv[0] * env->row_cdf[h];
    int y = find_entry(env->row_cdf, h, target);
    double in_row = (target - env->row_cdf[y]) / (env->row_cdf[y + 1] - env->row_cdf[y]);
    const double *columns = env->column_cdf + (size_t)y * (size_t)(w + 1);
    target = uv[1] * columns[w];
    int x = find_entry(columns, w, target);
    double in_column = (target - columns[x]) / (columns[x + 1] - columns[x]);

    // Within the texel: uniform in phi and in cos(theta).
    double top = cos(GN_RIG_PI * y / h), bottom = cos(GN_RIG_PI * (y + 1) / h);
    double z = top + in_row * (bottom - top), r = sqrt(fmax(0, 1 - z * z));
    double phi = GN_RIG_PI - 2 * GN_RIG_PI * (x + in_column) / w;
    double seen[3] = {r * cos(phi), r * sin(phi), z};

    struct gn_rig_light_sample s = {.distance = INFINITY};
    memcpy(s.dir, seen, sizeof(seen));
    if (env->distance > 0) {
        double to[3];
        if (vec_dot(point, point) >= env->distance * env->distance)
            return false;
        for (int k = 0; k < 3; k++)
            to[k] = env->distance * seen[k] - point[k];
        s.distance = vec_length(to);
        vec_scale(to, 1 / s.distance, s.dir);
    }
    s.pdf_solid_angle = get_texel_pdf(env, x, y) * get_view_ratio(env, seen, s.dir, s.distance);
    for (int k = 0; k < 3; k++)
        s.radiance[k] = gn_image_at(&env->map, x, y)[k];
    *out_sample = s;
    return true;
}

double gn_rig_environment_get_pdf(const struct gn_rig_environment *env,
                                  const double point[static 3], const double dir[static 3])
{
    double seen[3], distance;
    int x, y;
    if (!see_light(env, point, dir, seen, &distance))
        return 0;
    find_texel(env, seen, &x, &y);
    return get_texel_pdf(env, x, y) * get_view_ratio(env, seen, dir, distance);
}

void gn_rig_environment_get_irradiance(const struct gn_rig_environment *env,
                                       const double normal[static 3],
                                       double out_irradiance[static 3])
{
    int w = env->map.width, h = env->map.height;
    memset(out_irradiance, 0, 3 * sizeof(*out_irradiance));
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            double theta = GN_RIG_PI * (y + 0.5) / h,
                   phi = GN_RIG_PI - 2 * GN_RIG_PI * (x + 0.5) / w;
            const double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            double cosine =
                fmax(0, vec_dot(dir, normal)) * gn_rig_environment_get_texel_solid_angle(env, y);
            for (int k = 0; k < 3; k++)
                out_irradiance[k] += cosine * gn_image_at(&env->map, x, y)[k];
        }
}

int gn_rig_turn_map(const struct gn_image *map, double turn, struct gn_image *out_map)
{
    struct gn_image out;
    int w = map->width, result = gn_image_init(&out, w, map->height, 3);
    if (result)
        return result;
    // Column x shows phi = pi - 2 pi u; a turn by +t moves the picture left by t / (2 pi) of it.
    double shift = fmod(turn / (2 * GN_RIG_PI), 1) * w;
    double whole = floor(shift), rest = shift - whole;
    for (int y = 0; y < map->height; y++)
        for (int x = 0; x < w; x++) {
            int a = (int)fmod(x + whole + 2.0 * w, w), b = (a + 1) % w;
            for (int k = 0; k < 3; k++)
                gn_image_at(&out, x, y)[k] = (float)((1 - rest) * gn_image_at(map, a, y)[k] +
                                                     rest * gn_image_at(map, b, y)[k]);
        }
    *out_map = out;
    return 0;
}
