/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_samples.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <string.h>

#include "common/vec4.h"
#include "server/light/luminance.h"
#include "server/light/penrose.h"

/* log2 of GN_IMAGE_MAX_SIDE, and one for the whole. */
enum { N_LEVELS_MAX = 16 };

/* Values added in float before the sum goes to double. */
enum { N_FLOAT_MAX = 64 };

/* Which samples of the last frame stay, and which others come: shares of the importance. */
static const double stay = 1.05, come = 0.95;

/* Level by level, the maxima of 2 x 2 blocks below; the texels themselves are looked up in the map.
 * Values are luminance as a share of the brightest, times the weight of the texel. */
struct pyramid {
    const struct gn_radiance_map *map;
    const struct gn_map_sampling *sampling;
    int n_levels;
    int width[N_LEVELS_MAX], height[N_LEVELS_MAX];
    float *level[N_LEVELS_MAX]; // of the scratch; 0: two rows of the map's values
    float share;                // of the brightest: 1 / its luminance
    float plain_weight;         // of each texel that shows light; 0: its solid angle
    double scale;               // importance m = scale * value
};

static int init_pyramid(struct pyramid *p, int width, int height, struct gn_scratch *scratch)
{
    size_t n = 0, offset[N_LEVELS_MAX];
    for (int w = width, h = height;; w = (w + 1) / 2, h = (h + 1) / 2) {
        offset[p->n_levels] = n;
        p->width[p->n_levels] = w;
        p->height[p->n_levels++] = h;
        n += p->n_levels > 1 ? (size_t)w * (size_t)h : 0;
        if (w == 1 && h == 1)
            break;
    }
    // the map's values, two rows at a time, behind the levels
    float *data = gn_scratch_take(scratch, n + 2 * (size_t)width, sizeof(*data));
    if (!data)
        return -ENOMEM;
    for (int i = 1; i < p->n_levels; i++)
        p->level[i] = data + offset[i];
    p->level[0] = data + n;
    return 0;
}

static inline float get_value(const struct pyramid *p, const float *rgb, float solid_angle)
{
    float y = (float)GN_LUMINANCE_R * rgb[0] + (float)GN_LUMINANCE_G * rgb[1] +
              (float)GN_LUMINANCE_B * rgb[2];
    float weight = p->plain_weight > 0 && solid_angle > 0 ? p->plain_weight : solid_angle;
    return y * p->share * weight;
}

static float look_up(const struct pyramid *p, int level, int x, int y)
{
    size_t i = (size_t)y * (size_t)p->width[level] + (size_t)x;
    return level > 0 ? p->level[level][i]
                     : get_value(p, p->map->radiance.data + 3 * i, p->map->solid_angle[i]);
}

/* The values of one row of the map; returns their sum. */
static double read_row(const struct pyramid *p, int y, float *out_values)
{
    size_t width = (size_t)p->width[0], start = (size_t)y * width;
    const float *rgb = p->map->radiance.data + 3 * start, *w = p->map->solid_angle + start;
    double sum = 0;
    for (size_t first = 0; first < width; first += N_FLOAT_MAX) {
        size_t end = width - first < N_FLOAT_MAX ? width : first + N_FLOAT_MAX;
        float lane[4] = {0};
        size_t i = first;
        for (; i + 4 <= end; i += 4) {
            gn_vec4 l[3];
            gn_vec4_split(rgb + 3 * i, l);
            for (size_t k = 0; k < 4; k++) {
                const float at[3] = {l[0][k], l[1][k], l[2][k]};
                out_values[i + k] = get_value(p, at, w[i + k]);
                lane[k] += out_values[i + k];
            }
        }
        for (; i < end; i++) {
            out_values[i] = get_value(p, rgb + 3 * i, w[i]);
            lane[0] += out_values[i];
        }
        sum += ((double)lane[0] + (double)lane[1]) + ((double)lane[2] + (double)lane[3]);
    }
    return sum;
}

static inline float get_larger(float a, float b)
{
    return a > b ? a : b;
}

/* The maxima of 2 x 2 of two rows; the last column may stand alone. */
static void fill_row(const float *a, const float *b, int from_width, float *out_max)
{
    int n = from_width / 2;
    for (int x = 0; x < n; x++)
        out_max[x] =
            get_larger(get_larger(a[2 * x], a[2 * x + 1]), get_larger(b[2 * x], b[2 * x + 1]));
    if (from_width % 2)
        out_max[n] = get_larger(a[2 * n], b[2 * n]);
}

static void fill_level(const struct pyramid *p, int level)
{
    size_t from_width = (size_t)p->width[level - 1], width = (size_t)p->width[level];
    for (int y = 0; y < p->height[level]; y++) {
        const float *a = p->level[level - 1] + 2 * (size_t)y * from_width;
        const float *b = 2 * y + 1 < p->height[level - 1] ? a + from_width : a;
        fill_row(a, b, (int)from_width, p->level[level] + (size_t)y * width);
    }
}

/* Fills the pyramid in one pass over the map; returns the sum of the texels' values. */
static double fill_pyramid(struct pyramid *p)
{
    float *rows[2] = {p->level[0], p->level[0] + p->width[0]};
    double sum = 0;
    for (int y = 0; y < p->height[0]; y += 2) {
        bool has_two = y + 1 < p->height[0];
        sum += read_row(p, y, rows[0]);
        if (has_two)
            sum += read_row(p, y + 1, rows[1]);
        if (p->n_levels > 1)
            fill_row(rows[0], rows[has_two], p->width[0],
                     p->level[1] + (size_t)(y / 2) * (size_t)p->width[1]);
    }
    for (int level = 2; level < p->n_levels; level++)
        fill_level(p, level);
    return sum;
}

/* Importances beyond the deepest level are cut to what it serves. */
static double to_importance(const struct pyramid *p, float value)
{
    return fmin(p->scale * (double)value, (double)gn_penrose_fibonacci(90));
}

static double get_at(void *context, double x, double y)
{
    const struct pyramid *p = context;
    int ix = (int)x, iy = (int)y;
    if (!(x >= 0 && y >= 0) || ix >= p->width[0] || iy >= p->height[0])
        return 0;
    return to_importance(p, look_up(p, 0, ix, iy));
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
            max = get_larger(look_up(p, level, x, y), max);
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

static int grow(struct gn_map_samples *s, struct gn_scratch *scratch)
{
    size_t n = (size_t)s->n, capacity = s->capacity ? 2 * (size_t)s->capacity : 1024;
    uint32_t *texel = gn_scratch_grow(scratch, s->texel, n, capacity, sizeof(*texel));
    uint64_t *id = gn_scratch_grow(scratch, s->id, n, capacity, sizeof(*id));
    if (!texel || !id)
        return -ENOMEM;
    s->texel = texel;
    s->id = id;
    s->capacity = (int)capacity;
    return 0;
}

/* Where samples go. */
struct sink {
    struct gn_map_samples *samples;
    struct gn_scratch *scratch;
    struct pyramid *pyramid;
};

static int accept_sample(void *context, const struct gn_penrose_sample *sample)
{
    struct sink *sink = context;
    struct gn_map_samples *s = sink->samples;
    double at[2] = {sample->x, sample->y};
    if (s->n == s->capacity && grow(s, sink->scratch) < 0)
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
                        struct gn_scratch *scratch, struct gn_map_samples *samples)
{
    double max = map->figures.max_luminance;
    if (!(max > 0))
        return 0;
    struct pyramid pyramid = {
        .map = map, .sampling = sampling, .share = (float)fmin(1 / max, (double)FLT_MAX)};
    int rc = init_pyramid(&pyramid, map->radiance.width, map->radiance.height, scratch);
    if (rc < 0)
        return rc;
    if (sampling->is_plain)
        pyramid.plain_weight =
            (float)(map->figures.shown_solid_angle /
                    ((double)map->radiance.width * (double)map->radiance.height));
    double sum = fill_pyramid(&pyramid), unit = 1 / (double)pyramid.share;
    if (sum > 0) {
        double size = fmax(pyramid.width[0], pyramid.height[0]);
        double power = sampling->power > 0 ? sampling->power : sum * unit / sampling->n_wanted;
        pyramid.scale = size * size * unit / (GN_PENROSE_DENSITY * power);
        const struct gn_penrose_importance importance = {size, &pyramid, get_at, get_max,
                                                         sampling->kept ? get_threshold : NULL};
        struct sink sink = {samples, scratch, &pyramid};
        rc = gn_penrose_sample_domain(&importance, accept_sample, &sink);
        samples->power = power;
    }
    return rc;
}
