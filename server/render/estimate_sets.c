/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The estimate's directions, drawn from the probes' maps. */
#include "server/render/estimate.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_rows.h"

/** Mixes all bits. Source: Steele et al., "Fast splittable pseudorandom number generators", 2014,
 * with the constants of Stafford's variant 13. */
uint64_t gn_estimate_mix(uint64_t x)
{
    x += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return x ^ x >> 31;
}

/** Point i of Sobol's first two dimensions. Source: Kollig and Keller, "Efficient multidimensional
 * sampling", 2002. `shift` turns it into a random one, and leaves 256 of them a net. */
static void get_point(uint32_t i, uint64_t shift, double out[static 2])
{
    uint32_t x = (uint32_t)shift, y = (uint32_t)(shift >> 32);
    for (uint32_t k = i, u = 1u << 31, v = 1u << 31; k != 0; k >>= 1, u >>= 1, v ^= v >> 1) {
        x ^= k & 1 ? u : 0;
        y ^= k & 1 ? v : 0;
    }
    out[0] = (x + 0.5) * 0x1p-32;
    out[1] = (y + 0.5) * 0x1p-32;
}

/** Its index along the curve of Morton 1966 through squares of 1/16 x 1/16, each of which has one
 * point of a net: so packets hold neighbours. */
static int get_place(const double at[static 2])
{
    int x = (int)(at[0] * 16), y = (int)(at[1] * 16), place = 0;
    for (int bit = 0; bit < 4; bit++)
        place |= (x >> bit & 1) << 2 * bit | (y >> bit & 1) << (2 * bit + 1);
    return place;
}

static double get_patches_sum(const struct gn_radiance_map *map, int y)
{
    double sum = 0;
    for (int k = 0; k < GN_MAP_PATCHES; k++)
        sum += map->rows[y].luminance[k];
    return sum;
}

static double get_texel_power(const struct gn_radiance_map *map, size_t i)
{
    return gn_luminance(map->radiance.data + 3 * i) * (double)map->solid_angle[i];
}

/** Luminance that comes from where the map shows nothing, and of the whole sphere as bright. */
static double get_fill_power(const struct gn_radiance_map *map, double *out_sphere)
{
    double y = map->is_full_sphere ? 0 : gn_luminance(map->fill);
    *out_sphere = map->fill_solid_angle > 0 ? 4 * M_PI * y : 0;
    return *out_sphere > 0 ? map->fill_solid_angle * y : 0;
}

static void set_direction(struct estimate_set *set, int i, const double dir[static 3],
                          const float radiance[static 3], double solid_angle)
{
    for (int k = 0; k < 3; k++) {
        set->dir[k][i] = (float)dir[k];
        set->irradiance[k][i] = (float)((double)radiance[k] * solid_angle);
    }
}

/** A direction that the map does not show: one of the sphere; dark where the map shows it. */
static void draw_fill(const struct gn_radiance_map *map, const double at[static 2],
                      double probability, struct estimate_set *set, int i)
{
    static const float dark[3] = {0};
    double z = 1 - 2 * at[0], r = sqrt(fmax(0, 1 - z * z)), phi = 2 * M_PI * at[1], xy[2];
    double dir[3] = {r * cos(phi), r * sin(phi), z};
    bool is_shown = gn_projection_get_position(&map->projection, dir, xy);
    gn_pose_rotate(&map->world_from_probe, dir, dir);
    set_direction(set, i, dir, is_shown ? dark : map->fill,
                  4 * M_PI / (ESTIMATE_SET * probability));
}

/** A direction of the map by the point: a row, a patch of it, a texel of that, a place in it. Any
 * wrong sum of a row or patch changes the density, which is divided by, and not the mean. */
static void draw_texel(const struct gn_radiance_map *map, const double *rows, double at_row,
                       double at_column, double probability, struct estimate_set *set, int i)
{
    static const double up[3] = {0, 0, 1};
    static const float dark[3] = {0};
    int low = 0, high = map->radiance.height, width = map->radiance.width;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(rows[middle] <= at_row ? &low : &high) = middle;
    }
    double row = rows[low + 1] - rows[low], left = at_column * row;
    const double *patches = map->rows[low].luminance;
    int patch = 0, side = map->table->patch_side;
    while (patch < GN_MAP_PATCHES - 1 && left >= patches[patch])
        left -= patches[patch++];
    while (patch > 0 && !(patches[patch] > 0)) // rounded past the last
        patch--;
    int x = patch * side, end = x + side < width ? x + side : width;
    double sum = 0, power = 0;
    size_t first = (size_t)low * (size_t)width;
    for (int k = x; k < end; k++)
        sum += get_texel_power(map, first + (size_t)k);
    if (!(row > 0) || !(sum > 0) || x >= end) {
        set_direction(set, i, up, dark, 0);
        return;
    }
    left = fmin(fmax(left / patches[patch], 0), 1) * sum;
    while (x < end - 1 && left >= (power = get_texel_power(map, first + (size_t)x))) {
        left -= power;
        x++;
    }
    size_t texel = first + (size_t)x;
    power = get_texel_power(map, texel);
    if (!(power > 0)) {
        set_direction(set, i, up, dark, 0);
        return;
    }
    double along = fmin(fmax(left / power, 0), 1), dir[3];
    if (gn_projection_get_direction(&map->projection, x + along,
                                    low + fmin((at_row - rows[low]) / row, 1), dir))
        gn_pose_rotate(&map->world_from_probe, dir, dir);
    else
        for (size_t k = 0; k < 3; k++)
            dir[k] = map->direction_world[3 * texel + k];
    double share = patches[patch] / rows[map->radiance.height] * power / sum;
    set_direction(set, i, dir, map->radiance.data + 3 * texel,
                  (double)map->solid_angle[texel] / (ESTIMATE_SET * probability * share));
}

static int reserve_rows(struct estimate *estimate, int n)
{
    if (n <= estimate->capacity)
        return 0;
    free(estimate->rows);
    estimate->capacity = 0;
    estimate->rows = malloc(((size_t)n + 1) * sizeof(*estimate->rows));
    estimate->capacity = estimate->rows ? n : 0;
    return estimate->rows ? 0 : -ENOMEM;
}

bool gn_estimate_can_draw(const struct gn_radiance_map *map)
{
    // Light of the global model starts at finite places, which these directions have not.
    return map && map->rows && !map->geometry;
}

int gn_estimate_draw(struct estimate *estimate, int part, int n_sets, int probe,
                     const struct gn_radiance_map *map, double *out_power)
{
    double sphere, fill = get_fill_power(map, &sphere);
    if (reserve_rows(estimate, map->radiance.height) < 0)
        return -ENOMEM;
    memset(estimate->sets[probe], 0, sizeof(estimate->sets[probe]));
    double *rows = estimate->rows;
    rows[0] = 0;
    for (int y = 0; y < map->radiance.height; y++)
        rows[y + 1] = rows[y] + get_patches_sum(map, y);
    double shown = rows[map->radiance.height];
    *out_power = shown + fill;
    if (!(*out_power > 0))
        return 0;
    double share = shown / (shown + sphere);
    for (int i = 0; i < n_sets * ESTIMATE_SET; i++) {
        int set = i / ESTIMATE_SET, drawn = (part * GN_PROBES_MAX + probe) * ESTIMATE_SETS + set;
        double at[2];
        get_point((uint32_t)(i % ESTIMATE_SET), gn_estimate_mix((uint64_t)drawn), at);
        int place = get_place(at);
        if (at[0] < share)
            draw_texel(map, rows, at[0] / share * shown, at[1], share, &estimate->sets[probe][set],
                       place);
        else
            draw_fill(map, (const double[2]){(at[0] - share) / (1 - share), at[1]}, 1 - share,
                      &estimate->sets[probe][set], place);
    }
    return 0;
}
