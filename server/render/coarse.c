/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The shadow term at a coarser resolution: where the frame's step is more than 1, a pixel whose
 * column and row are not both multiples of it waits while the shadow of the others is worked out.
 * Then it takes the bilinear mean of the four such pixels about it, where all five see one flat
 * piece of surface and the four differ by less than an edge would; else it is worked out as well.
 * A shadow that is narrower than the step and falls between them is not seen.
 */
#include "server/render/internal.h"

#include <math.h>

/** Factors that differ by more are not taken means of. */
#define LARGEST_STEP 0.1f
/** Cosine of normals of one plane; and how far apart, in widths of a pixel, its points may be along
 * the normal. */
#define SAME_NORMAL 0.9999f
#define SAME_PLANE 0.25f

static bool is_between(const struct frame *frame, int x, int y)
{
    return x % frame->shadow_step != 0 || y % frame->shadow_step != 0;
}

bool gn_coarse_put_off(const struct frame *frame, int x, int y, struct sample *s)
{
    struct spot *spot = &frame->spots[(size_t)y * (size_t)frame->camera->width + (size_t)x];
    spot->kind = SPOT_OTHER;
    if (s->kind != SAMPLE_REAL || !s->is_receiver)
        return false;
    for (int k = 0; k < 3; k++) {
        spot->point[k] = s->surface.point[k];
        spot->normal[k] = s->surface.normal_shading[k];
    }
    spot->object = s->object;
    spot->kind = is_between(frame, x, y) ? SPOT_WAITS : SPOT_KNOWN;
    s->is_receiver = spot->kind == SPOT_KNOWN;
    return !s->is_receiver;
}

/** The spot of a pixel; NULL: outside the picture, or in a block of which nothing is kept. */
static const struct spot *get_spot(const struct frame *frame, int x, int y)
{
    if (x >= frame->camera->width || y >= frame->camera->height || *gn_refine_plain_at(frame, x, y))
        return NULL;
    return &frame->spots[(size_t)y * (size_t)frame->camera->width + (size_t)x];
}

bool gn_coarse_waits(const struct frame *frame, int x, int y)
{
    const struct spot *spot = get_spot(frame, x, y);
    return spot && spot->kind == SPOT_WAITS;
}

static bool is_same_plane(const struct frame *frame, const struct spot *a, const struct spot *b)
{
    float to[3];
    float away[3];
    for (int k = 0; k < 3; k++) {
        to[k] = b->point[k] - a->point[k];
        away[k] = a->point[k] - frame->origin[k];
    }
    float width = frame->pixel_angle * sqrtf(dot3(away, away));
    return b->object == a->object && dot3(a->normal, b->normal) > SAME_NORMAL &&
           fabsf(dot3(to, a->normal)) < SAME_PLANE * width;
}

bool gn_coarse_interpolate(const struct frame *frame, int x, int y, float out_factor[static 3],
                           float out_color[static 3])
{
    int step = frame->shadow_step;
    int left = x - x % step;
    int top = y - y % step;
    float u = (float)(x - left) / (float)step;
    float v = (float)(y - top) / (float)step;
    const struct spot *spot = get_spot(frame, x, y);
    float low[3] = {1, 1, 1};
    float high[3] = {0};
    for (int k = 0; k < 3; k++)
        out_factor[k] = out_color[k] = 0;
    for (int i = 0; i < 4; i++) {
        int at[2] = {left + i % 2 * step, top + i / 2 * step};
        const struct spot *corner = get_spot(frame, at[0], at[1]);
        if (!corner || corner->kind != SPOT_KNOWN || !is_same_plane(frame, spot, corner))
            return false;
        const float *color = gn_refine_get_feature(frame, at[0], at[1])->color;
        const float *factor = gn_image_at(&frame->layers->shadow, at[0], at[1]);
        float weight = (i % 2 ? u : 1 - u) * (i / 2 ? v : 1 - v);
        for (int k = 0; k < 3; k++) {
            low[k] = fminf(low[k], color[k]);
            high[k] = fmaxf(high[k], color[k]);
            out_factor[k] += weight * factor[k];
            out_color[k] += weight * color[k];
        }
    }
    return high[0] - low[0] < LARGEST_STEP && high[1] - low[1] < LARGEST_STEP &&
           high[2] - low[2] < LARGEST_STEP;
}
