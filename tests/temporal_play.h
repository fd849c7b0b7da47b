/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Lists of lights made by hand, followed frame by frame: for the tests of light in time. */
#ifndef GN_TESTS_TEMPORAL_PLAY_H
#define GN_TESTS_TEMPORAL_PLAY_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/temporal.h"
#include "tests/unit/cmocka_setup.h"

enum { PLAY_LIGHTS = 64 };
static const double play_tau = 0.2; // s

/* A scene of lights; each frame of it is followed in turn. */
struct play {
    struct gn_light lights[PLAY_LIGHTS];
    int n;
    int64_t time_ns;
    double tau;
    double values[3]; // follows in the input as it is
    struct gn_temporal *now;
};

static inline void put_light(struct play *p, uint64_t id, double azimuth, double elevation,
                             double power)
{
    p->lights[p->n++] = (struct gn_light){
        .dir_world = {(float)(cos(azimuth) * cos(elevation)),
                      (float)(sin(azimuth) * cos(elevation)), (float)sin(elevation)},
        .angular_radius = 0.1f,
        .irradiance = {(float)power, (float)(0.9 * power), (float)(0.5 * power)},
        .id = id};
}

/* Four lights a quarter turn apart. */
static inline void begin(struct play *p)
{
    *p = (struct play){.tau = play_tau, .time_ns = 1000};
    for (int i = 0; i < 4; i++)
        put_light(p, (uint64_t)i + 1, 1.5 * i, 0.5, 10);
}

static inline struct gn_temporal_input get_input(const struct play *p)
{
    struct gn_temporal_input input = {.time_ns = p->time_ns,
                                      .has_lights = true,
                                      .n_lights = p->n,
                                      .lights = p->lights,
                                      .n_values = 3};
    memcpy(input.values, p->values, sizeof(p->values));
    for (int i = 0; i < p->n; i++) {
        const double dir[3] = {(double)p->lights[i].dir_world[0], (double)p->lights[i].dir_world[1],
                               (double)p->lights[i].dir_world[2]};
        gn_change_add(input.sums, dir, gn_luminance(p->lights[i].irradiance));
        for (int c = 0; c < 3; c++)
            input.total[c] += (double)p->lights[i].irradiance[c];
    }
    return input;
}

/* One frame, dt s after the last. */
static inline void show(struct play *p, double dt)
{
    p->time_ns += (int64_t)(dt * 1e9);
    struct gn_temporal_input input = get_input(p);
    struct gn_temporal *next;
    assert_int_equal(gn_temporal_follow(p->now, &input, p->tau, &next), 0);
    free(p->now);
    p->now = next;
}

static inline void end(struct play *p)
{
    free(p->now);
    p->now = NULL;
}

/* The published light of that id; NULL: none. */
static inline const struct gn_light *find(const struct play *p, uint64_t id)
{
    static struct gn_light light;
    for (int i = 0; i < p->now->n_lights; i++) {
        gn_temporal_get_light(p->now, i, &light);
        if (light.id == id)
            return &light;
    }
    return NULL;
}

static inline double get_power(const struct play *p, uint64_t id)
{
    const struct gn_light *light = find(p, id);
    return light ? (double)light->irradiance[0] : 0;
}

static inline double get_sum(const struct play *p, int c)
{
    double sum = 0;
    struct gn_light light;
    for (int i = 0; i < p->now->n_lights; i++) {
        gn_temporal_get_light(p->now, i, &light);
        assert_true(isfinite(light.irradiance[c]) && light.irradiance[c] >= 0);
        sum += (double)light.irradiance[c];
    }
    return sum;
}

static inline double get_angle(const struct gn_light *light, const struct gn_light *other)
{
    double dot = 0;
    for (int k = 0; k < 3; k++)
        dot += (double)light->dir_world[k] * (double)other->dir_world[k];
    return acos(fmin(dot, 1));
}

#endif
