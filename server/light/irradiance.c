/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/irradiance.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "server/light/luminance.h"

static const double pi = 3.14159265358979323846;

/* Directions that are looked at first, and lowest points that are added to them. */
enum { N_SPREAD = 400, N_LOWEST = 12, N_BISECTIONS = 30 };

enum { DEFAULT_ORDER = 4 };

/* Wider spots cost the search more than their higher bands are worth. */
static const struct gn_compact_options compact = {.min_share = 0.01};

/* One direction, and what each band sends there. */
struct sample {
    double normal[3];
    double band[5];
};

/* The luminance of the harmonics' irradiance, to find where it is lowest. */
struct ringing {
    int order, n;
    double sh[GN_SH_MAX]; // A_l L_lm
    struct sample samples[N_SPREAD + N_LOWEST];
};

static double get_window(double lambda, int l)
{
    return 1 / (1 + lambda * (double)(l * l * (l + 1) * (l + 1)));
}

static void fill_sample(const struct ringing *r, const double normal[static 3], struct sample *out)
{
    double basis[GN_SH_MAX];
    gn_sh_get_basis(r->order, normal, basis);
    *out = (struct sample){.normal = {normal[0], normal[1], normal[2]}};
    for (int l = 0; l <= r->order; l++)
        for (int k = l * l; k < (l + 1) * (l + 1); k++)
            out->band[l] += r->sh[k] * basis[k];
}

static double get_windowed(const struct ringing *r, const struct sample *s, double lambda)
{
    double e = 0;
    for (int l = 0; l <= r->order; l++)
        e += get_window(lambda, l) * s->band[l];
    return e;
}

static void init_ringing(struct ringing *r, int order, const double sh[][3])
{
    r->order = order;
    r->n = N_SPREAD;
    for (int l = 0; l <= order; l++)
        for (int k = l * l; k < (l + 1) * (l + 1); k++)
            r->sh[k] = gn_sh_get_cosine_factor(l) * gn_luminance_of_sum(sh[k]);
    for (int i = 0; i < N_SPREAD; i++) { // Fibonacci's spiral
        double z = 1 - 2 * (i + 0.5) / N_SPREAD, s = sqrt(1 - z * z), phi = i * pi * (3 - sqrt(5));
        fill_sample(r, (double[3]){s * cos(phi), s * sin(phi), z}, &r->samples[i]);
    }
}

static double find_lowest(const struct ringing *r, double lambda, int *out_i)
{
    double lowest = INFINITY;
    *out_i = 0;
    for (int i = 0; i < r->n; i++) {
        double e = get_windowed(r, &r->samples[i], lambda);
        if (e < lowest) {
            lowest = e;
            *out_i = i;
        }
    }
    return lowest;
}

/* From the lowest sample down to the bottom, in steps that halve where they no longer help; adds
 * the point to the samples. */
static double descend(struct ringing *r, double lambda)
{
    int i;
    double lowest = find_lowest(r, lambda, &i);
    struct sample best = r->samples[i];
    for (double step = 0.1; step > 1e-5;) {
        bool has_moved = false;
        for (int side = 0; side < 6; side++) {
            double n[3] = {best.normal[0], best.normal[1], best.normal[2]};
            struct sample s;
            n[side / 2] += side % 2 ? step : -step;
            double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            fill_sample(r, (double[3]){n[0] / length, n[1] / length, n[2] / length}, &s);
            double e = get_windowed(r, &s, lambda);
            if (e < lowest) {
                lowest = e;
                best = s;
                has_moved = true;
            }
        }
        step *= has_moved ? 1 : 0.5;
    }
    if (r->n < N_SPREAD + N_LOWEST)
        r->samples[r->n++] = best;
    return lowest;
}

/* The smallest lambda at which no sample is negative. */
static double solve_lambda(const struct ringing *r)
{
    int i;
    double low = 0, high = 0.25;
    while (high < 1e6 && find_lowest(r, high, &i) < 0)
        high *= 2;
    for (int step = 0; step < N_BISECTIONS; step++) {
        double middle = 0.5 * (low + high);
        if (find_lowest(r, middle, &i) < 0)
            low = middle;
        else
            high = middle;
    }
    return high;
}

/* 0 where nothing rings. Samples are added at the bottom until it is not negative. */
static double find_lambda(struct ringing *r)
{
    double lambda = 0, tolerance = 1e-6 * fabs(r->samples[0].band[0]);
    while (r->n < N_SPREAD + N_LOWEST && descend(r, lambda) < -tolerance)
        lambda = solve_lambda(r);
    return lambda;
}

/* Leaves the harmonics what the lights do not give. */
static void take_lights_out(struct gn_irradiance *irradiance,
                            const struct gn_irradiance_light *lights, int n)
{
    irradiance->n_lights = n < GN_IRRADIANCE_MAX_LIGHTS ? n : GN_IRRADIANCE_MAX_LIGHTS;
    for (int i = 0; i < irradiance->n_lights; i++) {
        const double *e = lights[i].irradiance, negative[3] = {-e[0], -e[1], -e[2]};
        irradiance->lights[i] = lights[i];
        gn_sh_add_light(irradiance->order, lights[i].dir_world, negative, irradiance->sh);
    }
}

void gn_irradiance_init(struct gn_irradiance *irradiance, int order, const double sh[][3],
                        const struct gn_irradiance_light *lights, int n_lights, bool dering)
{
    *irradiance = (struct gn_irradiance){.order = order};
    memcpy(irradiance->sh, sh, (size_t)gn_sh_get_count(order) * sizeof(*sh));
    take_lights_out(irradiance, lights, n_lights);
    struct ringing ringing;
    init_ringing(&ringing, order, (const double(*)[3])irradiance->sh);
    irradiance->min_luminance = descend(&ringing, 0);
    if (dering && irradiance->min_luminance < 0)
        irradiance->lambda = find_lambda(&ringing);
    for (int l = 0; l <= order; l++)
        for (int k = l * l; k < (l + 1) * (l + 1); k++)
            for (int c = 0; c < 3; c++)
                irradiance->sh[k][c] *=
                    gn_sh_get_cosine_factor(l) * get_window(irradiance->lambda, l);
}

int gn_irradiance_init_from_map(struct gn_irradiance *irradiance,
                                double out_sh[static GN_SH_MAX][3],
                                const struct gn_radiance_map *map,
                                const struct gn_irradiance_options *options, struct gn_pool *pool)
{
    static const struct gn_irradiance_options defaults = {0};
    if (!options)
        options = &defaults;
    int order = options->order ? options->order : DEFAULT_ORDER;
    assert(order == 2 || order == 4);
    struct gn_compact_lights spots = {0};
    struct gn_irradiance_light lights[GN_IRRADIANCE_MAX_LIGHTS];
    int rc = gn_sh_project_map(map, order, pool, out_sh);
    if (rc == 0 && !options->keep_lights)
        rc = gn_compact_find(map, &compact, &spots);
    if (rc < 0)
        return rc;
    for (int i = 0; i < spots.n; i++) {
        memcpy(lights[i].dir_world, spots.light[i].dir_world, sizeof(lights[i].dir_world));
        memcpy(lights[i].irradiance, spots.light[i].irradiance, sizeof(lights[i].irradiance));
    }
    gn_irradiance_init(irradiance, order, (const double(*)[3])out_sh, lights, spots.n,
                       options->dering);
    gn_compact_finish(&spots);
    return 0;
}

/* The light among n that lies within a degree, or -1. */
static int find_near(const struct gn_irradiance_light *lights, int n, const double dir[static 3])
{
    for (int i = 0; i < n; i++) {
        const double *d = lights[i].dir_world;
        if (d[0] * dir[0] + d[1] * dir[1] + d[2] * dir[2] > 1 - 1.5e-4)
            return i;
    }
    return -1;
}

void gn_irradiance_follow(struct gn_irradiance *irradiance, const struct gn_irradiance *previous,
                          double share, const double sh[][3], bool dering)
{
    struct gn_irradiance_light lights[2 * GN_IRRADIANCE_MAX_LIGHTS];
    int n = irradiance->n_lights;
    memcpy(lights, irradiance->lights, (size_t)n * sizeof(*lights));
    for (int i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            lights[i].irradiance[c] *= share;
    for (int i = 0; share < 1 && previous && i < previous->n_lights; i++) {
        const struct gn_irradiance_light *old = &previous->lights[i];
        int place = find_near(lights, n, old->dir_world);
        double faded[3], rest = 0, all = 0;
        for (int c = 0; c < 3; c++) {
            faded[c] = (1 - share) * old->irradiance[c];
            rest += faded[c];
            all += sh[0][c];
        }
        if (place < 0 && !(rest > 1e-3 * all)) // its few higher bands are left away
            continue;
        if (place < 0) {
            place = n++;
            lights[place] = (struct gn_irradiance_light){0};
            memcpy(lights[place].dir_world, old->dir_world, sizeof(old->dir_world));
        }
        for (int c = 0; c < 3; c++)
            lights[place].irradiance[c] += faded[c];
    }
    gn_irradiance_init(irradiance, irradiance->order, sh, lights, n, dering);
}

void gn_irradiance_get(const struct gn_irradiance *irradiance, const double normal[static 3],
                       double out_irradiance[static 3])
{
    double basis[GN_SH_MAX], e[3] = {0};
    gn_sh_get_basis(irradiance->order, normal, basis);
    for (int k = 0; k < gn_sh_get_count(irradiance->order); k++)
        for (int c = 0; c < 3; c++)
            e[c] += basis[k] * irradiance->sh[k][c];
    for (int i = 0; i < irradiance->n_lights; i++) {
        const struct gn_irradiance_light *light = &irradiance->lights[i];
        const double *d = light->dir_world;
        double cosine = fmax(d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2], 0);
        for (int c = 0; c < 3; c++)
            e[c] += cosine * light->irradiance[c];
    }
    for (int c = 0; c < 3; c++)
        out_irradiance[c] = fmax(e[c], 0);
}

int gn_irradiance_make_map(const struct gn_irradiance *irradiance, int width, int height,
                           struct gn_image *out_map)
{
    int rc = gn_image_init(out_map, width, height, 3);
    for (int y = 0; rc == 0 && y < height; y++) {
        for (int x = 0; x < width; x++) {
            double theta = pi * (y + 0.5) / height, phi = pi - 2 * pi * (x + 0.5) / width, e[3];
            double n[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            gn_irradiance_get(irradiance, n, e);
            for (int c = 0; c < 3; c++)
                gn_image_at(out_map, x, y)[c] = (float)e[c];
        }
    }
    return rc;
}
