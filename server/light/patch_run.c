/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Sums over texels in a row, as memory is read fastest: in float over at most 64 texels, four side
 * by side, and in double over those. What the floats round away stays under 1e-6 of the light.
 */
#include "server/light/lights.h"
#include "server/light/luminance.h"
#include "server/light/vec4.h"

static const double pi = 3.14159265358979323846;

enum { LANES = 4, N_FLOAT_MAX = 64 };

typedef int lanes_of_int __attribute__((vector_size(16)));

struct float_sums {
    gn_vec4 irradiance[3], toward[3], own_spread, solid_angle;
    lanes_of_int n_dark; // below zero: -1 for each texel
};

static inline void add_four(const float *light, const float *direction, const float *solid_angle,
                            struct float_sums *s)
{
    gn_vec4 l[3], d[3], w = gn_vec4_load(solid_angle);
    gn_vec4_split(light, l);
    gn_vec4_split(direction, d);
    s->n_dark += (lanes_of_int)(l[0] + l[1] + l[2] <= 0) | (lanes_of_int)(w <= 0);
    for (int c = 0; c < 3; c++)
        l[c] *= w;
    gn_vec4 energy =
        (float)GN_LUMINANCE_R * l[0] + (float)GN_LUMINANCE_G * l[1] + (float)GN_LUMINANCE_B * l[2];
    for (int c = 0; c < 3; c++) {
        s->irradiance[c] += l[c];
        s->toward[c] += energy * d[c];
    }
    s->own_spread += energy * w;
    s->solid_angle += w;
}

static double add_lanes(gn_vec4 v)
{
    return ((double)v[0] + (double)v[1]) + ((double)v[2] + (double)v[3]);
}

/* At most N_FLOAT_MAX; the last few are filled up with black ones. */
static void add_few(struct gn_patch *patch, const struct gn_radiance_map *map, size_t first,
                    size_t n)
{
    const float *light = map->radiance.data + 3 * first, *w = map->solid_angle + first;
    const float *direction = map->direction_world + 3 * first;
    struct float_sums s = {0};
    size_t i = 0;
    for (; i + LANES <= n; i += LANES)
        add_four(light + 3 * i, direction + 3 * i, w + i, &s);
    if (i < n) {
        float tail[7][LANES] = {{0}};
        memcpy(tail, light + 3 * i, 3 * (n - i) * sizeof(*light));
        memcpy(tail[3], direction + 3 * i, 3 * (n - i) * sizeof(*direction));
        memcpy(tail[6], w + i, (n - i) * sizeof(*w));
        add_four(tail[0], tail[3], tail[6], &s);
        i += LANES;
    }
    double e[3];
    for (int c = 0; c < 3; c++) {
        e[c] = add_lanes(s.irradiance[c]);
        patch->irradiance[c] += e[c];
        patch->toward[c] += add_lanes(s.toward[c]);
    }
    patch->energy += GN_LUMINANCE_R * e[0] + GN_LUMINANCE_G * e[1] + GN_LUMINANCE_B * e[2];
    patch->own_spread += add_lanes(s.own_spread) / (4 * pi);
    patch->solid_angle += add_lanes(s.solid_angle);
    patch->n_lit += (int)i + s.n_dark[0] + s.n_dark[1] + s.n_dark[2] + s.n_dark[3];
}

void gn_patch_add_run(struct gn_patch *patch, const struct gn_radiance_map *map, uint32_t first,
                      uint32_t n)
{
    size_t end = (size_t)first + n;
    for (size_t i = first; i < end && map->geometry; i++)
        gn_patch_add_texel(patch, map, (uint32_t)i);
    for (size_t i = first; i < end && !map->geometry; i += N_FLOAT_MAX)
        add_few(patch, map, i, end - i < N_FLOAT_MAX ? end - i : N_FLOAT_MAX);
}
