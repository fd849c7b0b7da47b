/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_samples.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/penrose.h"

/* log2 of GN_IMAGE_MAX_SIDE, and one for the whole. */
enum { N_LEVELS_MAX = 16 };

/* Which samples of the last frame stay, and which others come: shares of the importance. */
static const double stay = 1.05, come = 0.95;

/* Importance of each texel and, level by level, the maxima of 2 x 2 blocks below. */
struct pyramid {
    const struct gn_map_sampling *sampling;
    int n_levels;
    int width[N_LEVELS_MAX], height[N_LEVELS_MAX];
    float *level[N_LEVELS_MAX]; // into data
    float *data;
    double max;   // importance's unit: Y dOmega of the brightest texel
    double scale; // importance m = scale * texel
};

static int init_pyramid(struct pyramid *p, int width, int height)
{
    size_t n = 0, offset[N_LEVELS_MAX];
    for (int w = width, h = height;; w = (w + 1) / 2, h = (h + 1) / 2) {
        offset[p->n_levels] = n;
        p->width[p->n_levels] = w;
        p->height[p->n_levels++] = h;
        n += (size_t)w * (size_t)h;
        if (w == 1 && h == 1)
            break;
    }
    p->data = malloc(n * sizeof(*p->data));
    if (!p->data)
        return -ENOMEM;
    for (int i = 0; i < p->n_levels; i++)
        p->level[i] = p->data + offset[i];
    return 0;
}

static void fill_level(struct pyramid *p, int level)
{
    const float *from = p->level[level - 1];
    int from_width = p->width[level - 1], from_height = p->height[level - 1];
    for (int y = 0; y < p->height[level]; y++) {
        for (int x = 0; x < p->width[level]; x++) {
            float max = 0;
            for (int i = 0; i < 4; i++) {
                int fx = 2 * x + i % 2, fy = 2 * y + i / 2;
                if (fx < from_width && fy < from_height)
                    max = fmaxf(max, from[(size_t)fy * (size_t)from_width + (size_t)fx]);
            }
            p->level[level][(size_t)y * (size_t)p->width[level] + (size_t)x] = max;
        }
    }
}

/* Fills the pyramid with Y dOmega as shares of the largest; returns their sum. */
static double fill_pyramid(struct pyramid *p, const struct gn_radiance_map *map, bool is_plain)
{
    size_t width = (size_t)p->width[0], n = width * (size_t)p->height[0];
    double max = 0, sum = 0, plain = map->figures.shown_solid_angle / (double)n;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t start = 0; start < n; start += width) {
            double row = 0;
            for (size_t i = start; i < start + width; i++) {
                double w = (double)map->solid_angle[i];
                double v =
                    gn_luminance(map->radiance.data + 3 * i) * (is_plain ? plain * (w > 0) : w);
                if (pass == 0) {
                    max = fmax(max, v);
                    continue;
                }
                p->level[0][i] = max > 0 ? (float)(v / max) : 0;
                row += (double)p->level[0][i];
            }
            sum += row;
        }
    }
    for (int level = 1; level < p->n_levels; level++)
        fill_level(p, level);
    p->max = max;
    return sum;
}

/* Importances beyond the deepest level are cut to what it serves. */
static double to_importance(const struct pyramid *p, float share)
{
    return fmin(p->scale * (double)share, (double)gn_penrose_fibonacci(90));
}

static double get_at(void *context, double x, double y)
{
    const struct pyramid *p = context;
    int ix = (int)x, iy = (int)y;
    if (!(x >= 0 && y >= 0) || ix >= p->width[0] || iy >= p->height[0])
        return 0;
    return to_importance(p, p->level[0][(size_t)iy * (size_t)p->width[0] + (size_t)ix]);
}

static uint64_t get_id(const struct gn_penrose_tile *tile)
{
    return tile->path & ((UINT64_C(1) << 62) - 1);
}

/* Exact up to the level where the box spans at most two blocks either way; a bound above it. */
static double get_max(void *context, const double low[static 2], const double high[static 2])
{
    const struct pyramid *p = context;
    double scale = p->sampling->kept ? stay : 1;
    if (high[0] < 0 || high[1] < 0 || low[0] >= p->width[0] || low[1] >= p->height[0])
        return 0;
    int x0 = (int)fmax(low[0], 0), x1 = (int)fmin(high[0], p->width[0] - 1);
    int y0 = (int)fmax(low[1], 0), y1 = (int)fmin(high[1], p->height[0] - 1);
    int level = 0;
    while (x1 - x0 > 1 || y1 - y0 > 1) {
        x0 /= 2;
        x1 /= 2;
        y0 /= 2;
        y1 /= 2;
        level++;
    }
    float max = 0;
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++)
            max = fmaxf(max, p->level[level][(size_t)y * (size_t)p->width[level] + (size_t)x]);
    return scale * to_importance(p, max);
}

static double get_threshold(void *context, const struct gn_penrose_tile *point, double importance)
{
    const struct gn_map_sampling *s = ((const struct pyramid *)context)->sampling;
    int low = 0, high = s->n_kept;
    while (low < high) {
        int middle = low + (high - low) / 2;
        if (s->kept[middle] < get_id(point))
            low = middle + 1;
        else
            high = middle;
    }
    return importance * (low < s->n_kept && s->kept[low] == get_id(point) ? stay : come);
}

static int grow(struct gn_map_samples *s)
{
    int capacity = s->capacity ? 2 * s->capacity : 1024;
    uint32_t *texel = realloc(s->texel, (size_t)capacity * sizeof(*texel));
    s->texel = texel ? texel : s->texel;
    uint64_t *id = realloc(s->id, (size_t)capacity * sizeof(*id));
    s->id = id ? id : s->id;
    if (!texel || !id)
        return -ENOMEM;
    s->capacity = capacity;
    return 0;
}

/* Where samples go. */
struct sink {
    struct gn_map_samples *samples;
    struct pyramid *pyramid;
};

static int accept_sample(void *context, const struct gn_penrose_sample *sample)
{
    struct sink *sink = context;
    struct gn_map_samples *s = sink->samples;
    double at[2] = {sample->x, sample->y};
    if (s->n == s->capacity && grow(s) < 0)
        return -ENOMEM;
    if (sink->pyramid->sampling->is_relaxed) {
        int phase = gn_penrose_get_phase(sample->importance);
        double moved[2];
        gn_penrose_get_corrected(sample, gn_penrose_table[phase], moved);
        if (get_at(sink->pyramid, moved[0], moved[1]) >= 0.5 * sample->importance)
            memcpy(at, moved, sizeof(at));
    }
    s->texel[s->n] =
        (uint32_t)(int)at[1] * (uint32_t)sink->pyramid->width[0] + (uint32_t)(int)at[0];
    s->id[s->n++] = get_id(&sample->tile);
    return 0;
}

int gn_map_samples_draw(const struct gn_radiance_map *map, const struct gn_map_sampling *sampling,
                        struct gn_map_samples *samples)
{
    struct pyramid pyramid = {.sampling = sampling};
    int rc = init_pyramid(&pyramid, map->radiance.width, map->radiance.height);
    if (rc < 0)
        return rc;
    double sum = fill_pyramid(&pyramid, map, sampling->is_plain);
    if (sum > 0) {
        double size = fmax(pyramid.width[0], pyramid.height[0]);
        double power =
            sampling->power > 0 ? sampling->power : sum * pyramid.max / sampling->n_wanted;
        pyramid.scale = size * size * pyramid.max / (GN_PENROSE_DENSITY * power);
        const struct gn_penrose_importance importance = {size, &pyramid, get_at, get_max,
                                                         sampling->kept ? get_threshold : NULL};
        struct sink sink = {samples, &pyramid};
        rc = gn_penrose_sample_domain(&importance, accept_sample, &sink);
        samples->power = power;
    }
    free(pyramid.data);
    return rc;
}

void gn_map_samples_finish(struct gn_map_samples *samples)
{
    free(samples->texel);
    free(samples->id);
    *samples = (struct gn_map_samples){0};
}
