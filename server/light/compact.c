/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/compact.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/lights.h"
#include "server/light/luminance.h"

static const double pi = 3.14159265358979323846;

/* A peak that turns out to be no spot costs one of these. */
enum { MAX_PEAKS = 64 };

/* A texel bright enough to be part of a spot. */
struct candidate {
    uint32_t texel;
    bool is_done; // in a spot, or near a peak that was none
    double luminance;
};

struct search {
    const struct gn_radiance_map *map;
    double max_radius, min_energy;
    int n, capacity;
    struct candidate *candidates; // owned, by rising texel
    int n_members;
    int *members;     // [n] the candidates of the spot at hand, owned
    uint32_t *sorted; // [n] its texels, by rising index, owned
};

static double get_total_energy(const struct gn_radiance_map *map)
{
    return map->figures.mean_luminance * map->figures.shown_solid_angle +
           gn_luminance(map->fill) * map->fill_solid_angle;
}

static int list_candidates(struct search *s, double threshold)
{
    size_t n = (size_t)s->map->radiance.width * (size_t)s->map->radiance.height;
    for (size_t i = 0; i < n; i++) {
        double y = gn_luminance(s->map->radiance.data + 3 * i);
        if (!(y > threshold))
            continue;
        if (s->n == s->capacity) {
            int capacity = s->capacity ? 2 * s->capacity : 256;
            struct candidate *more = realloc(s->candidates, (size_t)capacity * sizeof(*more));
            if (!more)
                return -ENOMEM;
            s->candidates = more;
            s->capacity = capacity;
        }
        s->candidates[s->n++] = (struct candidate){.texel = (uint32_t)i, .luminance = y};
    }
    s->members = malloc((size_t)s->n * sizeof(*s->members) + 1);
    s->sorted = malloc((size_t)s->n * sizeof(*s->sorted) + 1);
    return s->members && s->sorted ? 0 : -ENOMEM;
}

static const struct candidate *find_peak(const struct search *s)
{
    const struct candidate *peak = NULL;
    for (int i = 0; i < s->n; i++)
        if (!s->candidates[i].is_done && (!peak || s->candidates[i].luminance > peak->luminance))
            peak = &s->candidates[i];
    return peak;
}

/* The candidates about the peak that are brighter than the threshold. */
static void gather(struct search *s, const struct candidate *peak, double threshold)
{
    const float *d = s->map->direction_world, *axis = d + 3 * (size_t)peak->texel;
    float reach = (float)(4 * sin(s->max_radius) * sin(s->max_radius)); // chord^2 of 2 radii
    s->n_members = 0;
    for (int i = 0; i < s->n; i++) {
        const struct candidate *c = &s->candidates[i];
        const float *e = d + 3 * (size_t)c->texel;
        float x = e[0] - axis[0], y = e[1] - axis[1], z = e[2] - axis[2];
        if (!c->is_done && c->luminance > threshold && x * x + y * y + z * z <= reach) {
            s->sorted[s->n_members] = c->texel;
            s->members[s->n_members++] = i;
        }
    }
}

static int compare_texels(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static bool is_member(const struct search *s, uint32_t texel)
{
    return bsearch(&texel, s->sorted, (size_t)s->n_members, sizeof(texel), compare_texels) != NULL;
}

/* Mean over the members' neighbours in the picture that are none. */
static void get_background(const struct search *s, float out_background[static 3])
{
    const struct gn_radiance_map *map = s->map;
    int width = map->radiance.width;
    double sum[3] = {0}, weight = 0;
    for (int i = 0; i < s->n_members; i++) {
        int x = (int)(s->sorted[i] % (uint32_t)width), y = (int)(s->sorted[i] / (uint32_t)width);
        for (int k = 0; k < 9; k++) {
            int at[2] = {x, y};
            if (!gn_projection_step(&map->projection, k % 3 - 1, k / 3 - 1, at))
                continue;
            uint32_t texel = (uint32_t)at[1] * (uint32_t)width + (uint32_t)at[0];
            double w = (double)map->solid_angle[texel];
            if (!(w > 0) || is_member(s, texel))
                continue;
            for (int c = 0; c < 3; c++)
                sum[c] += w * (double)map->radiance.data[3 * (size_t)texel + (size_t)c];
            weight += w;
        }
    }
    for (int c = 0; c < 3; c++)
        out_background[c] = weight > 0 ? (float)(sum[c] / weight) : 0;
}

/* The spot of the members, less the background. False: there is nothing above it. */
static bool weigh(const struct search *s, struct gn_compact_light *out_light)
{
    const struct gn_radiance_map *map = s->map;
    struct gn_compact_light light = {.n = s->n_members};
    struct gn_patch whole = {0}, above = {0};
    for (int i = 0; i < s->n_members; i++)
        gn_patch_add_texel(&whole, map, s->sorted[i]);
    get_background(s, light.background);
    for (int c = 0; c < 3; c++) {
        double mean = whole.irradiance[c] / whole.solid_angle;
        if ((double)light.background[c] > mean)
            light.background[c] = nextafterf((float)mean, 0);
        light.irradiance[c] =
            fmax(whole.irradiance[c] - (double)light.background[c] * whole.solid_angle, 0);
    }
    double floor = gn_luminance(light.background);
    for (int i = 0; i < s->n_members; i++) {
        size_t t = s->sorted[i];
        double w = (double)map->solid_angle[t];
        double energy = fmax(gn_luminance(map->radiance.data + 3 * t) - floor, 0) * w;
        above.energy += energy;
        above.own_spread += energy * w / (4 * pi);
        for (size_t c = 0; c < 3; c++)
            above.toward[c] += energy * (double)map->direction_world[3 * t + c];
    }
    struct gn_light disc;
    if (!gn_patch_get_light(&above, &disc))
        return false;
    double length = sqrt(above.toward[0] * above.toward[0] + above.toward[1] * above.toward[1] +
                         above.toward[2] * above.toward[2]);
    for (int c = 0; c < 3; c++)
        light.dir_world[c] = above.toward[c] / length;
    light.angular_radius = (double)disc.angular_radius;
    light.energy = gn_luminance_of_sum(light.irradiance);
    light.solid_angle = whole.solid_angle;
    *out_light = light;
    return true;
}

/* A spot about the peak, its texels in s->sorted. False: there is none. */
static bool find_spot(struct search *s, const struct candidate *peak,
                      struct gn_compact_light *out_light)
{
    for (int divisor = 64; divisor > 1; divisor /= 4) {
        gather(s, peak, peak->luminance / divisor);
        if (!weigh(s, out_light) || out_light->energy < s->min_energy)
            return false;
        if (out_light->angular_radius <= s->max_radius)
            return true;
    }
    return false;
}

static int keep_spot(const struct search *s, struct gn_compact_light *light,
                     struct gn_compact_lights *out)
{
    size_t n = (size_t)out->n_texels + (size_t)light->n;
    uint32_t *texel = realloc(out->texel, n * sizeof(*texel));
    if (!texel)
        return -ENOMEM;
    out->texel = texel;
    light->first = out->n_texels;
    memcpy(texel + light->first, s->sorted, (size_t)light->n * sizeof(*texel));
    out->n_texels += light->n;
    int place = out->n++;
    for (; place > 0 && out->light[place - 1].energy < light->energy; place--)
        out->light[place] = out->light[place - 1];
    out->light[place] = *light;
    return 0;
}

int gn_compact_find(const struct gn_radiance_map *map, const struct gn_compact_options *options,
                    struct gn_compact_lights *out_lights)
{
    struct gn_compact_options o = options ? *options : (struct gn_compact_options){0};
    o.max_radius = o.max_radius == 0 ? pi / 180 : o.max_radius;
    o.min_share = o.min_share == 0 ? 0.05 : o.min_share;
    o.max_n = o.max_n == 0 ? GN_COMPACT_MAX : o.max_n;
    assert(o.max_radius > 0 && o.max_radius <= 0.5 && o.min_share > 0 && o.min_share <= 1);
    assert(o.max_n >= 1 && o.max_n <= GN_COMPACT_MAX);
    memset(out_lights, 0, sizeof(*out_lights));

    struct search s = {.map = map, .max_radius = o.max_radius};
    s.min_energy = o.min_share * get_total_energy(map);
    // A disc of the largest radius has at least this mean luminance; its edge may have less.
    double mean = s.min_energy / (2 * pi * (1 - cos(o.max_radius)));
    int rc = 0;
    if (!(map->figures.max_luminance > mean))
        return 0;
    rc = list_candidates(&s, mean / 4);
    for (int i = 0; rc == 0 && i < MAX_PEAKS && out_lights->n < o.max_n; i++) {
        const struct candidate *peak = find_peak(&s);
        struct gn_compact_light light;
        if (!peak || peak->luminance < mean)
            break;
        if (find_spot(&s, peak, &light)) {
            light.share = light.energy / get_total_energy(map);
            rc = keep_spot(&s, &light, out_lights);
        }
        gather(&s, peak, 0); // what is left about it is its glow, or a larger lamp
        for (int k = 0; k < s.n_members; k++)
            s.candidates[s.members[k]].is_done = true;
    }
    free(s.candidates);
    free(s.members);
    free(s.sorted);
    if (rc < 0)
        gn_compact_finish(out_lights);
    return rc;
}

void gn_compact_finish(struct gn_compact_lights *lights)
{
    free(lights->texel);
    memset(lights, 0, sizeof(*lights));
}

/* Sums over one row of what is left. */
struct row_sums {
    double irradiance[3], max_luminance;
};

struct resum {
    struct gn_radiance_map *map;
    struct row_sums *rows; // [height]
};

static void sum_row(void *context, int y, int worker)
{
    (void)worker;
    const struct resum *r = context;
    size_t width = (size_t)r->map->radiance.width, start = (size_t)y * width;
    struct row_sums sums = {{0}, 0};
    for (size_t i = start; i < start + width; i++) {
        const float *l = r->map->radiance.data + 3 * i;
        double w = (double)r->map->solid_angle[i], luminance = gn_luminance(l);
        sums.max_luminance = luminance > sums.max_luminance ? luminance : sums.max_luminance;
        for (int c = 0; c < 3; c++)
            sums.irradiance[c] += (double)l[c] * w;
    }
    r->rows[y] = sums;
}

/* Summed anew: a difference would leave the rounding of a sun in the sum of the rest. */
static int sum_anew(struct gn_radiance_map *map, struct gn_pool *pool)
{
    struct gn_radiance_map_figures *f = &map->figures;
    struct resum r = {map, malloc((size_t)map->radiance.height * sizeof(*r.rows))};
    if (!r.rows)
        return -ENOMEM;
    gn_pool_run(pool, map->radiance.height, sum_row, &r);
    double sum[3] = {0}, max = 0;
    for (int y = 0; y < map->radiance.height; y++) {
        max = fmax(max, r.rows[y].max_luminance);
        for (int c = 0; c < 3; c++)
            sum[c] += r.rows[y].irradiance[c];
    }
    f->max_luminance = max;
    f->mean_luminance = gn_luminance_of_sum(sum) / f->shown_solid_angle;
    memcpy(f->shown_irradiance, sum, sizeof(sum));
    free(r.rows);
    return 0;
}

int gn_compact_get_rest(const struct gn_compact_lights *lights, const struct gn_radiance_map *map,
                        struct gn_pool *pool, struct gn_radiance_map **out_rest)
{
    struct gn_radiance_map *rest;
    *out_rest = NULL;
    int rc = gn_radiance_map_copy(map, &rest);
    if (rc < 0)
        return rc;
    for (int i = 0; i < lights->n; i++) {
        const struct gn_compact_light *light = &lights->light[i];
        for (int k = light->first; k < light->first + light->n; k++)
            memcpy(rest->radiance.data + 3 * (size_t)lights->texel[k], light->background,
                   sizeof(light->background));
    }
    rc = sum_anew(rest, pool);
    if (rc < 0)
        gn_radiance_map_unref(&rest);
    *out_rest = rest;
    return rc;
}
