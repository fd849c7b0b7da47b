/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/light_merge.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"

/** Steps of the power iteration for a principal axis. */
enum { AXIS_STEPS = 12 };

struct merge_item {
    int light; // index
    double weight;
    double dir[3];
    double along; // the axis at hand
};

/** items[first, first + n) and how they are divided best. */
struct merge_part {
    int first, n;
    double spread; // power times spread, squared
};

void gn_light_merge_finish(struct light_merge *merge)
{
    free(merge->lights);
    free(merge->items);
    free(merge->parts);
    memset(merge, 0, sizeof(*merge));
}

static int reserve(struct light_merge *merge, int n)
{
    if (n <= merge->capacity)
        return 0;
    gn_light_merge_finish(merge);
    merge->lights = malloc((size_t)n * sizeof(*merge->lights));
    merge->items = malloc((size_t)n * sizeof(*merge->items));
    merge->parts = malloc((size_t)n * sizeof(*merge->parts));
    if (!merge->lights || !merge->items || !merge->parts) {
        gn_light_merge_finish(merge);
        return -ENOMEM;
    }
    merge->capacity = n;
    return 0;
}

/** W sum w |d - mean|^2 = W^2 - |sum w d|^2 of unit directions, W = sum w. */
static double get_spread(double weight, const double sum[static 3])
{
    double square = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
    return fmax(weight * weight - square, 0);
}

static double sum_up(const struct merge_item *items, int n, double sum[static 3])
{
    double weight = 0;
    sum[0] = sum[1] = sum[2] = 0;
    for (int i = 0; i < n; i++) {
        weight += items[i].weight;
        for (int k = 0; k < 3; k++)
            sum[k] += items[i].weight * items[i].dir[k];
    }
    return weight;
}

static int add_part(struct light_merge *merge, int n_parts, int first, int n)
{
    double sum[3];
    if (n == 0)
        return n_parts;
    double weight = sum_up(merge->items + first, n, sum);
    merge->parts[n_parts] = (struct merge_part){first, n, n > 1 ? get_spread(weight, sum) : 0};
    return n_parts + 1;
}

/** Direction in which the items are spread most. */
static void get_axis(const struct merge_item *items, int n, double axis[static 3])
{
    double sum[3], weight = sum_up(items, n, sum), m[3][3] = {{0}};
    for (int i = 0; i < n; i++) {
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = items[i].dir[k] - (weight > 0 ? sum[k] / weight : 0);
        for (int k = 0; k < 9; k++)
            m[k / 3][k % 3] += items[i].weight * d[k / 3] * d[k % 3];
    }
    int widest = m[0][0] >= m[1][1] && m[0][0] >= m[2][2] ? 0 : m[1][1] >= m[2][2] ? 1 : 2;
    memcpy(axis, m[widest], sizeof(m[0]));
    for (int step = 0; step < AXIS_STEPS; step++) {
        double next[3], length = 0;
        for (int k = 0; k < 3; k++) {
            next[k] = m[k][0] * axis[0] + m[k][1] * axis[1] + m[k][2] * axis[2];
            length = fmax(length, fabs(next[k]));
        }
        for (int k = 0; k < 3; k++)
            axis[k] = length > 0 ? next[k] / length : k == widest;
    }
}

static bool is_before(const struct merge_item *x, const struct merge_item *y)
{
    if (x->along < y->along || x->along > y->along)
        return x->along < y->along;
    return x->light < y->light;
}

static void swap(struct merge_item *x, struct merge_item *y)
{
    struct merge_item z = *x;
    *x = *y;
    *y = z;
}

/** Moves item i down the heap of n, of which it may be less than its children. */
static void sift(struct merge_item *items, int i, int n)
{
    for (int child = 2 * i + 1; child < n; i = child, child = 2 * i + 1) {
        if (child + 1 < n && is_before(&items[child], &items[child + 1]))
            child++;
        if (!is_before(&items[i], &items[child]))
            break;
        swap(&items[i], &items[child]);
    }
}

/** Heap sort: qsort() may take memory, which frames do not. */
static void sort_items(struct merge_item *items, int n)
{
    for (int i = n / 2 - 1; i >= 0; i--)
        sift(items, i, n);
    for (int last = n - 1; last > 0; last--) {
        swap(&items[0], &items[last]);
        sift(items, 0, last);
    }
}

/** Sorts the items across their axis; how many of them are the first part, in [1, n - 1]. */
static int cut(struct merge_item *items, int n)
{
    double axis[3], all[3], left[3] = {0}, weight_left = 0, least = INFINITY;
    int best = n / 2;
    get_axis(items, n, axis);
    for (int i = 0; i < n; i++)
        items[i].along =
            items[i].dir[0] * axis[0] + items[i].dir[1] * axis[1] + items[i].dir[2] * axis[2];
    sort_items(items, n);
    double weight = sum_up(items, n, all);
    for (int i = 0; i < n - 1; i++) {
        double right[3];
        weight_left += items[i].weight;
        for (int k = 0; k < 3; k++) {
            left[k] += items[i].weight * items[i].dir[k];
            right[k] = all[k] - left[k];
        }
        double both = get_spread(weight_left, left) + get_spread(weight - weight_left, right);
        if (both < least) {
            least = both;
            best = i + 1;
        }
    }
    return best;
}

/** One light for the items. */
static struct gn_light join(const struct gn_light *lights, const struct merge_item *items, int n)
{
    if (n == 1)
        return lights[items[0].light];
    struct gn_light out = {.distance = INFINITY};
    double sum[3], normal[3] = {0}, place[3] = {0}, irradiance[3] = {0}, radius2 = 0;
    double weight = sum_up(items, n, sum), heaviest = -1;
    bool is_near = isfinite(lights[items[0].light].distance);
    for (int i = 0; i < n; i++) {
        const struct gn_light *light = &lights[items[i].light];
        double w = weight > 0 ? items[i].weight / weight : 1.0 / n;
        radius2 += w * (double)light->angular_radius * (double)light->angular_radius;
        for (int k = 0; k < 3; k++) {
            irradiance[k] += (double)light->irradiance[k];
            normal[k] += w * (double)light->normal[k];
            place[k] += w * items[i].dir[k] * (is_near ? (double)light->distance : 1);
        }
        if (items[i].weight > heaviest) {
            heaviest = items[i].weight;
            out.id = light->id;
            memcpy(out.dir_world, light->dir_world, sizeof(out.dir_world));
        }
    }
    double length = sqrt(place[0] * place[0] + place[1] * place[1] + place[2] * place[2]);
    double across = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    // A disc of radius r has the variance r^2 / 2.
    double variance = weight > 0 ? get_spread(weight, sum) / (weight * weight) : 0;
    out.angular_radius = (float)fmin(sqrt(radius2 + 2 * variance), M_PI / 2);
    for (int k = 0; k < 3; k++) {
        out.irradiance[k] = (float)irradiance[k];
        if (length > 1e-6)
            out.dir_world[k] = (float)(place[k] / length);
        out.normal[k] = across > 1e-6 ? (float)(normal[k] / across) : 0;
    }
    if (is_near)
        out.distance = (float)length;
    return out;
}

/** Discs to merge->lights, the others to merge->items, the distant ones first. */
static void sort_out(struct light_merge *merge, const struct gn_light *lights, int n,
                     int *out_discs, int *out_distant, int *out_items)
{
    *out_discs = *out_items = *out_distant = 0;
    for (int near = 0; near < 2; near++) {
        for (int i = 0; i < n; i++) {
            const struct gn_light *light = &lights[i];
            bool is_near = light->distance > 0 && isfinite(light->distance);
            if (near == is_near && light->is_disc) {
                merge->lights[(*out_discs)++] = *light;
            } else if (near == is_near) {
                struct merge_item *item = &merge->items[(*out_items)++];
                item->light = i;
                item->weight = gn_luminance(light->irradiance);
                const float *d = light->dir_world; // of unit length, but for its rounding
                double length =
                    sqrt((double)d[0] * d[0] + (double)d[1] * d[1] + (double)d[2] * d[2]);
                for (int k = 0; k < 3; k++)
                    item->dir[k] = length > 0 ? d[k] / length : 0;
            }
        }
        if (!near)
            *out_distant = *out_items;
    }
}

int gn_light_merge_make(struct light_merge *merge, const struct gn_light *lights, int n,
                        int n_wanted)
{
    int n_discs, n_distant, n_items;
    if (reserve(merge, n) < 0)
        return -ENOMEM;
    sort_out(merge, lights, n, &n_discs, &n_distant, &n_items);
    int n_parts = add_part(merge, 0, 0, n_distant);
    n_parts = add_part(merge, n_parts, n_distant, n_items - n_distant);
    while (n_parts > 0 && n_parts + n_discs < n_wanted) {
        struct merge_part *widest = &merge->parts[0];
        for (int i = 1; i < n_parts; i++) {
            if (merge->parts[i].spread > widest->spread)
                widest = &merge->parts[i];
        }
        if (!(widest->spread > 0))
            break;
        struct merge_part part = *widest;
        int first = cut(merge->items + part.first, part.n);
        // In its place and at the end.
        (void)add_part(merge, (int)(widest - merge->parts), part.first, first);
        n_parts = add_part(merge, n_parts, part.first + first, part.n - first);
    }
    for (int i = 0; i < n_parts; i++)
        merge->lights[n_discs + i] =
            join(lights, merge->items + merge->parts[i].first, merge->parts[i].n);
    return n_discs + n_parts;
}
