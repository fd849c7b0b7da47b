/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * In float over at most 64 texels, four side by side, and in double over those. What the floats
 * round away stays under 1e-6 of the light.
 */
#include "server/light/patch_run.h"

#include <math.h>

#include "common/vec4.h"
#include "server/light/luminance.h"
#include "server/light/map_geometry.h"

static const double pi = 3.14159265358979323846;

enum { LANES = 4, N_FLOAT_MAX = 64 };

typedef int lanes_of_int __attribute__((vector_size(16)));

/* In units of the map's light. */
struct float_sums {
    gn_vec4 irradiance[3], own_spread, toward[3], solid_angle, n_lit;
};

static inline void add_four(const float *light, const float *direction, gn_vec4 w, float per_unit,
                            struct float_sums *s)
{
    gn_vec4 l[3], d[3], scaled = w * per_unit;
    const gn_vec4 one = {1, 1, 1, 1};
    gn_vec4_split(light, l);
    gn_vec4_split(direction, d);
    for (int c = 0; c < 3; c++)
        l[c] *= scaled;
    gn_vec4 energy =
        (float)GN_LUMINANCE_R * l[0] + (float)GN_LUMINANCE_G * l[1] + (float)GN_LUMINANCE_B * l[2];
    for (int c = 0; c < 3; c++) {
        s->irradiance[c] += l[c];
        s->toward[c] += energy * d[c];
    }
    s->own_spread += energy * w;
    s->solid_angle += w;
    s->n_lit += (gn_vec4)((lanes_of_int)(energy > 0) & (lanes_of_int)one);
}

/* The last n < 4 of a row: nothing is read behind the map. */
static inline void add_rest(const struct gn_radiance_map *map, size_t first, size_t n,
                            float per_unit, struct float_sums *s)
{
    static const lanes_of_int masks[LANES] = {{0}, {-1}, {-1, -1}, {-1, -1, -1}};
    size_t total = (size_t)map->radiance.width * (size_t)map->radiance.height;
    const float *light = map->radiance.data + 3 * first, *w = map->solid_angle + first;
    const float *direction = map->direction_world + 3 * first;
    float copy[7][LANES] = {{0}};
    if (first + LANES > total) {
        memcpy(copy, light, 3 * n * sizeof(*light));
        memcpy(copy[3], direction, 3 * n * sizeof(*direction));
        memcpy(copy[6], w, n * sizeof(*w));
        light = copy[0];
        direction = copy[3];
        w = copy[6];
    }
    add_four(light, direction, (gn_vec4)((lanes_of_int)gn_vec4_load(w) & masks[n]), per_unit, s);
}

static inline void add_texels(const struct gn_radiance_map *map, size_t first, size_t n,
                              float per_unit, struct float_sums *s)
{
    const float *light = map->radiance.data, *direction = map->direction_world;
    size_t i = first, end = first + n;
    for (; i + LANES <= end; i += LANES)
        add_four(light + 3 * i, direction + 3 * i, gn_vec4_load(map->solid_angle + i), per_unit, s);
    if (i < end)
        add_rest(map, i, end - i, per_unit, s);
}

/* Four sums of four lanes, side by side. */
static inline gn_vec4 add_lanes(gn_vec4 a, gn_vec4 b, gn_vec4 c, gn_vec4 d)
{
    gn_vec4 ab =
        __builtin_shufflevector(a, b, 0, 4, 1, 5) + __builtin_shufflevector(a, b, 2, 6, 3, 7);
    gn_vec4 cd =
        __builtin_shufflevector(c, d, 0, 4, 1, 5) + __builtin_shufflevector(c, d, 2, 6, 3, 7);
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
           __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

double gn_run_get_unit(const struct gn_radiance_map *map)
{
    int exponent = ilogb(map->figures.max_luminance);
    return ldexp(1, exponent < -100 ? -100 : exponent > 100 ? 100 : exponent);
}

static void add_to_patch(const struct gn_run_total *s, double unit, struct gn_patch *patch)
{
    double e[3];
    for (int c = 0; c < 3; c++) {
        e[c] = unit * s->irradiance[c];
        patch->irradiance[c] += e[c];
        patch->toward[c] += unit * s->toward[c];
    }
    patch->energy += gn_luminance_of_sum(e);
    patch->own_spread += unit * s->own_spread / (4 * pi);
    patch->n_lit += (int)s->n_lit;
}

void gn_run_total_get(const struct gn_run_total *total, const struct gn_run_sums *sums,
                      struct gn_patch *patch)
{
    add_to_patch(total, sums->unit, patch);
    patch->is_placed = patch->is_placed || sums->place;
    patch->nearness += sums->unit * total->nearness;
    for (int c = 0; c < 3; c++)
        patch->normal[c] += sums->unit * total->normal[c];
}

static void sum_place(const struct gn_radiance_map *map, const struct gn_texel_run *run,
                      double unit, struct gn_run_place *out)
{
    struct gn_patch patch = {0};
    for (uint32_t i = 0; i < run->n; i++)
        gn_patch_add_texel(&patch, map, run->texel + i);
    for (int c = 0; c < 3; c++)
        out->normal[c] = (float)(patch.normal[c] / unit);
    out->nearness = (float)(patch.nearness / unit);
}

static inline struct gn_run_sum get_run_sum(const struct float_sums *s)
{
    struct gn_run_sum sum;
    gn_vec4 halves[2] = {
        add_lanes(s->irradiance[0], s->irradiance[1], s->irradiance[2], s->own_spread),
        add_lanes(s->toward[0], s->toward[1], s->toward[2], s->n_lit)};
    _Static_assert(sizeof(halves) == sizeof(sum), "two fours are a run's sum");
    memcpy(&sum, halves, sizeof(halves));
    return sum;
}

void gn_run_sums_fill(struct gn_run_sums *sums, const struct gn_radiance_map *map,
                      const struct gn_texel_run *runs, uint32_t first, uint32_t n,
                      struct gn_patch *patch)
{
    struct gn_run_total total = {0};
    float per_unit = (float)(1 / sums->unit);
    for (uint32_t k = first; k < first + n; k++) {
        struct float_sums s = {0};
        add_texels(map, runs[k].texel, runs[k].n, per_unit, &s);
        sums->sum[k] = get_run_sum(&s);
        if (sums->place)
            sum_place(map, &runs[k], sums->unit, &sums->place[k]);
        gn_run_total_add(&total, sums, k);
    }
    gn_run_total_get(&total, sums, patch);
}

void gn_patch_add_run(struct gn_patch *patch, const struct gn_radiance_map *map, uint32_t first,
                      uint32_t n)
{
    size_t end = (size_t)first + n;
    for (size_t i = first; i < end && map->geometry; i++)
        gn_patch_add_texel(patch, map, (uint32_t)i);
    for (size_t i = first; i < end && !map->geometry; i += N_FLOAT_MAX) {
        struct float_sums s = {0};
        struct gn_run_total total = {0};
        add_texels(map, i, end - i < N_FLOAT_MAX ? end - i : N_FLOAT_MAX, 1, &s);
        struct gn_run_sum sum = get_run_sum(&s);
        gn_run_total_add(&total, &(const struct gn_run_sums){.sum = &sum}, 0);
        add_to_patch(&total, 1, patch);
        const gn_vec4 w = s.solid_angle;
        patch->solid_angle += ((double)w[0] + (double)w[1]) + ((double)w[2] + (double)w[3]);
    }
}
