/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The map's directions in blocks of 16 neighbours and groups of 16 blocks, and conservative tests
 * of 16 boxes of directions at once. All loops are over 16 lanes, for the compiler to vectorise.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

// Wider than the rounding of directions and of their products.
#define WIDEN 1e-6f
// In place of 1 / 0: times a length it is farther than the kernel's FAR.
#define HUGE_INVERSE 3e38f

static inline float min2(float a, float b)
{
    return a < b ? a : b;
}

static inline float max2(float a, float b)
{
    return a > b ? a : b;
}

void gn_directions_set_box(struct direction_boxes *boxes, int lane, const struct box *box)
{
    bool is_empty = box->min[0] > box->max[0];
    for (int k = 0; k < 3; k++) {
        float a = is_empty ? 0 : box->min[k] - WIDEN;
        float b = is_empty ? 0 : box->max[k] + WIDEN;
        boxes->min[k][lane] = a;
        boxes->max[k][lane] = b;
        boxes->min_rises[k][lane] = a > 0 ? min2(1 / a, HUGE_INVERSE) : HUGE_INVERSE;
        boxes->min_falls[k][lane] = a < 0 ? max2(1 / a, -HUGE_INVERSE) : -HUGE_INVERSE;
        boxes->max_rises[k][lane] = b > 0 ? min2(1 / b, HUGE_INVERSE) : HUGE_INVERSE;
        boxes->max_falls[k][lane] = b < 0 ? max2(1 / b, -HUGE_INVERSE) : -HUGE_INVERSE;
    }
}

static unsigned pack(const int32_t flags[static LANES])
{
    unsigned mask = 0;
    for (int i = 0; i < LANES; i++)
        mask |= (unsigned)(flags[i] & 1) << i;
    return mask;
}

unsigned gn_directions_meet(const struct direction_boxes *boxes, const struct box *box)
{
    return gn_kernels_get()->meet(boxes, box->min, box->max);
}

/** Bounds of n . d over each box. */
static void get_bounds(const struct direction_boxes *boxes, const float n[static 3],
                       float low[static LANES], float high[static LANES])
{
    for (int i = 0; i < LANES; i++)
        low[i] = high[i] = 0;
    for (int k = 0; k < 3; k++) {
        const float *a = n[k] > 0 ? boxes->min[k] : boxes->max[k];
        const float *b = n[k] > 0 ? boxes->max[k] : boxes->min[k];
        for (int i = 0; i < LANES; i++) {
            low[i] += n[k] * a[i];
            high[i] += n[k] * b[i];
        }
    }
}

unsigned gn_directions_cross(const struct direction_boxes *boxes, const struct outline *outline)
{
    float low[LANES];
    float high[LANES];
    int32_t flags[LANES];
    get_bounds(boxes, outline->plane, low, high);
    for (int i = 0; i < LANES; i++)
        flags[i] = (low[i] <= outline->width) & (high[i] >= -outline->width);
    unsigned crossed = pack(flags);
    return crossed ? crossed & gn_directions_meet(boxes, &outline->box) : 0;
}

void gn_directions_split(const struct direction_boxes *boxes, const float n[static 3],
                         unsigned *out_some, unsigned *out_all)
{
    float low[LANES];
    float high[LANES];
    int32_t some[LANES];
    int32_t all[LANES];
    get_bounds(boxes, n, low, high);
    for (int i = 0; i < LANES; i++) {
        some[i] = high[i] > 0;
        all[i] = low[i] > 0;
    }
    *out_some = pack(some);
    *out_all = pack(all);
}

static void grow(struct box *box, const struct box *by)
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = fminf(box->min[k], by->min[k]);
        box->max[k] = fmaxf(box->max[k], by->max[k]);
    }
}

static void grow_by_light(const struct light_list *list, int l, struct box *box)
{
    const float d[3] = {list->dir[0][l], list->dir[1][l], list->dir[2][l]};
    struct box point;
    memcpy(point.min, d, sizeof(d));
    memcpy(point.max, d, sizeof(d));
    grow(box, &point);
}

static void fill_block(const struct light_list *list, int block, struct light_group *group,
                       struct box *out_box)
{
    int lane_block = block % LANES;
    double(*moment)[3] = group->block_moment[lane_block];
    for (int i = 0; i < LANES; i++) {
        int l = block * LANES + i;
        bool is_lit = false;
        for (int k = 0; k < 3; k++) {
            is_lit |= list->irradiance[k][l] > 0;
            for (int a = 0; a < 3; a++)
                moment[k][a] += (double)list->irradiance[k][l] * (double)list->dir[a][l];
        }
        if (!is_lit)
            continue;
        group->lit[lane_block] |= (uint16_t)(1u << i);
        grow_by_light(list, l, out_box);
    }
    for (int k = 0; k < 3; k++) {
        for (int a = 0; a < 3; a++)
            group->moment[k][a] += moment[k][a];
    }
}

void gn_directions_fill_groups(struct light_list *list)
{
    static const struct box empty = {{INFINITY, INFINITY, INFINITY},
                                     {-INFINITY, -INFINITY, -INFINITY}};
    gn_render_lights_pad(list, GROUP);
    list->n_groups = list->n / GROUP;
    for (int g = 0; g < list->n_groups; g++) {
        struct light_group *group = &list->groups[g];
        struct box group_box = empty;
        memset(group, 0, sizeof(*group));
        for (int b = 0; b < LANES; b++) {
            struct box box = empty;
            fill_block(list, g * LANES + b, group, &box);
            gn_directions_set_box(&group->blocks, b, &box);
            grow(&group_box, &box);
        }
        gn_directions_set_box(&list->group_boxes[g / LANES], g % LANES, &group_box);
    }
    for (int g = list->n_groups; g % LANES != 0; g++)
        gn_directions_set_box(&list->group_boxes[g / LANES], g % LANES, &empty);
}
