/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Which pixels get a grid of rays. One ray through each pixel's centre comes first. A pixel is done
 * again with grid x grid rays where, comparing centres with its up to 8 neighbours,
 *   - a neighbour shows another virtual object, or none where the pixel shows one, or the reverse;
 *   - or in one of the 4 lines through the pixel the second difference |a - 2 c + b| of the two
 *     opposite neighbours passes a threshold: of the radiance of a virtual object, relative to the
 *     largest of the three, or of the shadow factor of what is not virtual. At the picture's border
 *     it is the difference to the one neighbour.
 * The second difference is small on slopes, however steep, since there the centre is the mean; at a
 * step it is the step. So pixels that are not done again are off by at most half a threshold next
 * to a step, and by a twenty-fourth of it on a curve (Taylor). What is thinner than a pixel and
 * meets no centre is not seen.
 *
 *              grid   radiance   shadow
 * interactive   3x3       0.15     0.10   edges of objects and of hard shadows
 * seed          1x1          -        -   one ray through the centre, as in 2007
 * reference     4x4       0.01     0.01   within 1e-3 of 4x4 rays everywhere
 * (tests/unit/render_aa.c)
 */
#include "server/render/internal.h"

#include <math.h>

const struct refine_rule gn_refine_rules[3] = {
    [GN_QUALITY_INTERACTIVE] = {.grid = 3, .radiance = 0.15f, .shadow = 0.10f},
    [GN_QUALITY_SEED] = {.grid = 1},
    [GN_QUALITY_REFERENCE] = {.grid = 4, .radiance = 0.01f, .shadow = 0.01f},
};

bool *gn_refine_plain_at(const struct frame *frame, int x, int y)
{
    int stride = frame->tiles_x * BLOCKS;
    return &frame->plain[(size_t)(y / BLOCK) * (size_t)stride + (size_t)(x / BLOCK)];
}

bool gn_refine_is_all_plain(const struct frame *frame, int x, int y)
{
    for (int dy = -BLOCK; dy <= BLOCK; dy += BLOCK) {
        for (int dx = -BLOCK; dx <= BLOCK; dx += BLOCK) {
            bool is_inside = x + dx >= 0 && y + dy >= 0 && x + dx < frame->camera->width &&
                             y + dy < frame->camera->height;
            if (is_inside && !*gn_refine_plain_at(frame, x + dx, y + dy))
                return false;
        }
    }
    return true;
}

const struct feature *gn_refine_get_feature(const struct frame *frame, int x, int y)
{
    static const struct feature plain = {.color = {1, 1, 1}};
    if (x < 0 || y < 0 || x >= frame->camera->width || y >= frame->camera->height)
        return NULL;
    if (*gn_refine_plain_at(frame, x, y))
        return &plain;
    return &frame->features[(size_t)y * (size_t)frame->camera->width + (size_t)x];
}

/** Contrast on one line through c; a or b may lie outside the picture. */
static bool has_contrast(const struct frame *frame, const struct feature *a,
                         const struct feature *c, const struct feature *b)
{
    if (!a && !b)
        return false;
    a = a ? a : c;
    b = b ? b : c;
    for (int k = 0; k < 3; k++) {
        float difference = fabsf(a->color[k] - 2 * c->color[k] + b->color[k]);
        float threshold = frame->rule.shadow;
        if (c->owner != 0) {
            float largest = fmaxf(fmaxf(a->color[k], b->color[k]), c->color[k]);
            threshold = frame->rule.radiance * fmaxf(largest, frame->floor_radiance);
        }
        if (difference > threshold)
            return true;
    }
    return false;
}

bool gn_refine_is_needed(const struct frame *frame, int x, int y)
{
    static const int lines[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    if (frame->rule.grid < 2)
        return false;
    if (frame->options.supersample_all)
        return true;
    const struct feature *c = gn_refine_get_feature(frame, x, y);
    for (int i = 0; i < 4; i++) {
        const struct feature *a = gn_refine_get_feature(frame, x - lines[i][0], y - lines[i][1]);
        const struct feature *b = gn_refine_get_feature(frame, x + lines[i][0], y + lines[i][1]);
        if ((a && a->owner != c->owner) || (b && b->owner != c->owner))
            return true;
        if (has_contrast(frame, a, c, b))
            return true;
    }
    return false;
}
