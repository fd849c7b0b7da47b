/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Which distant lights do objects hide from a batch's receivers, in blocks of 16 neighbours? Left
 * out, and no bit of the result with them, are rays that surely meet nothing or surely something,
 * by the silhouette that the objects have from the light (silhouette.c): of a tile, of a block,
 * then of each receiver. Flat real objects, such as the table that receivers are points of, are in
 * no silhouette: they are left out where they lie under the tangent planes of all receivers, or by
 * their boxes.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "server/render/silhouette.h"

static struct gn_kernel_horizons get_horizons(const struct receivers *r, int block)
{
    struct gn_kernel_horizons horizons;
    for (int k = 0; k < 3; k++) {
        horizons.org[k] = r->org[k] + block * LANES;
        horizons.normal[k] = r->geometric[k] + block * LANES;
    }
    return horizons;
}

/** As the kernel's get_above, of a box. */
static unsigned get_above(const struct frame *frame, const struct gn_kernel_horizons *horizons,
                          double sign, const struct box *box, double slack)
{
    static const uint16_t index[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    float corners[3][8];
    const float *const p[3] = {corners[0], corners[1], corners[2]};
    for (int i = 0; i < 8; i++) {
        for (int k = 0; k < 3; k++)
            corners[k][i] = i >> k & 1 ? box->max[k] : box->min[k];
    }
    return frame->kernels->get_above(horizons, sign, p, index, 8, slack);
}

static void add_box(struct box_list *list, const struct box *box, float margin, unsigned lanes)
{
    int i = list->n++;
    list->lanes[i] = (uint16_t)lanes;
    for (int k = 0; k < 3; k++) {
        list->min[k][i] = box->min[k] - margin;
        list->max[k][i] = box->max[k] + margin;
    }
}

/** Lanes from which rays of that direction may meet one of the list's boxes. */
static unsigned get_meeting(const struct frame *frame, const struct box_list *list,
                            const struct box *from, const float dir[static 3])
{
    unsigned lanes = 0;
    for (int first = 0; first < list->n; first += LANES) {
        struct gn_kernel_boxes boxes;
        for (int k = 0; k < 3; k++) {
            boxes.min[k] = list->min[k] + first;
            boxes.max[k] = list->max[k] + first;
        }
        unsigned met = frame->kernels->meet_boxes(&boxes, from->min, from->max, dir);
        for (; met != 0; met &= met - 1) {
            int i = first + __builtin_ctz(met);
            lanes |= i < list->n ? list->lanes[i] : 0;
        }
    }
    return lanes;
}

/** Lists the clusters of a silhouette that rays down from a block may meet. */
static void list_low(const struct frame *frame, const struct receivers *r, int block,
                     const struct clusters *clusters, struct box_list *out)
{
    const struct gn_kernel_horizons horizons = get_horizons(r, block);
    bool is_real = clusters->role == GN_RT_REAL;
    out->block = block;
    out->n = 0;
    for (int c = 0; c < clusters->n; c++) {
        const struct cluster *cluster = &clusters->cluster[c];
        if (is_real && cluster->is_flat)
            continue;
        if (get_above(frame, &horizons, -1, &cluster->box, (double)frame->margin) != 0)
            add_box(out, &cluster->box, frame->margin, 0xffff);
    }
}

/** Lists the virtual clusters that rays up from a block may meet: what is above no lane's tangent
 * plane is met by none. */
static void list_high(const struct frame *frame, const struct receivers *r, int block,
                      struct box_list *out)
{
    const struct gn_kernel_horizons horizons = get_horizons(r, block);
    const struct clusters *clusters = &frame->clusters[1];
    out->n = 0;
    for (int c = 0; c < clusters->n; c++) {
        const struct cluster *cluster = &clusters->cluster[c];
        const float *const p[3] = {clusters->vertices[0], clusters->vertices[1],
                                   clusters->vertices[2]};
        unsigned lanes =
            frame->kernels->get_above(&horizons, 1, p, clusters->corners + cluster->first_corner,
                                      cluster->n_corners, (double)cluster->slack);
        if (lanes != 0)
            add_box(out, &cluster->box, frame->margin, lanes);
    }
}

/** Do rays away from the light, from points of a block, surely miss what its silhouette is of (0:
 * the real one, 1: the virtual one)? Then what their lines meet is on the light's side. */
static bool is_before(const struct frame *frame, struct scratch *scratch, int block,
                      const float dir[static 3], int set)
{
    const float back[3] = {-dir[0], -dir[1], -dir[2]};
    const struct box *set_box = set == 0 ? &frame->solid_box : &frame->virtual_box;
    struct box_list *low = &scratch->low[set];
    if (!gn_box_may_meet_from_box(set_box, &scratch->receivers.boxes[block], back))
        return true;
    if (low->block != block)
        list_low(frame, &scratch->receivers, block, &frame->clusters[set], low);
    return get_meeting(frame, low, &scratch->receivers.boxes[block], back) == 0;
}

/** Which lanes of a block does the virtual objects' silhouette hide; rays where it does not say. */
static void cut_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                      const float dir[static 3], uint64_t *rays)
{
    const struct receivers *r = &scratch->receivers;
    const struct silhouette *silhouette = &frame->virtual_silhouettes->of[light];
    unsigned dark;
    unsigned edge;
    gn_silhouette_get_block(frame, silhouette, r, block, &dark, &edge);
    if ((dark | edge) == 0)
        return;
    unsigned lanes = gn_receivers_get_lit(frame, r, block, dir) & (dark | edge);
    if ((lanes & dark) != 0 && is_before(frame, scratch, block, dir, 1)) {
        scratch->cut[block][light] |= (uint16_t)(lanes & dark);
        lanes &= ~dark;
    }
    gn_receivers_trace(frame, scratch, block, light, lanes, GN_RT_VIRTUAL, scratch->cut, rays);
}

void gn_occlusion_find_cut(const struct frame *frame, struct scratch *scratch, uint64_t *rays)
{
    const struct receivers *r = &scratch->receivers;
    for (int b = 0; b < r->n_blocks; b++) {
        scratch->low[1].block = -1;
        for (int i = 0; i < scratch->n_shadow_lights; i++) {
            int l = scratch->shadow_lights[i];
            float dir[3];
            gn_render_lights_get_dir(frame->lights, l, dir);
            if (!frame->virtual_silhouettes)
                gn_receivers_trace(frame, scratch, b, l, gn_receivers_get_lit(frame, r, b, dir),
                                   GN_RT_VIRTUAL, scratch->cut, rays);
            else if (gn_silhouette_get_box(&frame->virtual_silhouettes->of[l], &r->boxes[b]) !=
                     SILHOUETTE_FREE)
                cut_block(frame, scratch, b, l, dir, rays);
        }
    }
    gn_receivers_flush(frame, scratch, GN_RT_VIRTUAL, scratch->cut, rays);
}

/** Lists the flat real objects that some lane of a block does not have under its tangent plane. */
static void list_flat(const struct frame *frame, const struct receivers *r, int block,
                      const struct box *const *boxes, int n, struct box_list *out)
{
    const struct gn_kernel_horizons horizons = get_horizons(r, block);
    out->n = 0;
    for (int i = 0; i < n; i++) {
        int index = (int)(boxes[i] - frame->wide_blockers);
        unsigned lanes = frame->clusters[0].is_flat[index]
                             ? get_above(frame, &horizons, 1, &frame->blockers[index], 0)
                             : 0;
        if (lanes != 0)
            add_box(out, boxes[i], 0, lanes);
    }
}

/** Which of the lanes of a block that a light reaches do real objects hide from it? Rays where
 * neither the boxes of the flat ones nor the silhouette of the others say. */
static void hide_block(const struct frame *frame, struct scratch *scratch, int block, int light,
                       unsigned lanes, uint64_t *rays)
{
    const struct receivers *r = &scratch->receivers;
    unsigned dark = 0;
    unsigned edge = 0;
    float dir[3];
    gn_render_lights_get_dir(frame->lights, light, dir);
    if (frame->real_silhouettes) {
        const struct silhouette *s = &frame->real_silhouettes->of[light];
        if (gn_silhouette_get_box(s, &r->boxes[block]) != SILHOUETTE_FREE)
            gn_silhouette_get_block(frame, s, r, block, &dark, &edge);
        lanes &= dark | edge | get_meeting(frame, &scratch->high, &r->boxes[block], dir);
        if ((lanes & dark) != 0 && is_before(frame, scratch, block, dir, 0)) {
            scratch->hidden[block][light] |= (uint16_t)(lanes & dark);
            lanes &= ~dark;
        }
    }
    gn_receivers_trace(frame, scratch, block, light, lanes, GN_RT_REAL, scratch->hidden, rays);
}

void gn_occlusion_find_hidden(const struct frame *frame, struct scratch *scratch, uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    const struct box *boxes[MAX_BLOCKERS];
    int n_boxes = frame->real_silhouettes ? gn_blockers_list_above(frame, r, boxes) : 0;
    scratch->low[0].block = -1;
    for (int b = 0; b < r->n_blocks; b++) {
        if (r->wanted[b] != 0)
            list_flat(frame, r, b, boxes, n_boxes, &scratch->high);
        for (int l = 0; l < lights->n && r->wanted[b] != 0; l++) {
            float dir[3];
            gn_render_lights_get_dir(lights, l, dir);
            unsigned lanes = gn_receivers_get_lit(frame, r, b, dir) & r->wanted[b];
            if (lanes != 0)
                hide_block(frame, scratch, b, l, lanes, rays);
        }
    }
    gn_receivers_flush(frame, scratch, GN_RT_REAL, scratch->hidden, rays);
}

/** Marks in hidden what virtual objects hide from a block; lit: the lanes that each light reaches.
 */
static void find_self(const struct frame *frame, struct scratch *scratch, int block, uint16_t *lit,
                      uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    const struct receivers *r = &scratch->receivers;
    if (frame->cull)
        list_high(frame, r, block, &scratch->high);
    for (int l = 0; l < lights->n; l++) {
        float dir[3];
        gn_render_lights_get_dir(lights, l, dir);
        unsigned lanes = gn_receivers_get_lit(frame, r, block, dir);
        lit[l] = (uint16_t)lanes;
        if (frame->cull && lanes != 0)
            lanes &= get_meeting(frame, &scratch->high, &r->boxes[block], dir);
        gn_receivers_trace(frame, scratch, block, l, lanes, GN_RT_VIRTUAL, scratch->hidden, rays);
    }
    gn_receivers_flush(frame, scratch, GN_RT_VIRTUAL, scratch->hidden, rays);
}

void gn_occlusion_find_all(const struct frame *frame, struct scratch *scratch, uint64_t *rays)
{
    struct receivers *r = &scratch->receivers;
    const struct box *boxes[MAX_BLOCKERS];
    gn_occlusion_clear(frame, scratch);
    for (int b = 0; b < r->n_blocks; b++)
        r->wanted[b] = 0xffff;
    int n_boxes = frame->real_silhouettes ? gn_blockers_list_above(frame, r, boxes) : 0;
    scratch->low[0].block = -1;
    for (int b = 0; b < r->n_blocks; b++) {
        find_self(frame, scratch, b, scratch->mask, rays);
        list_flat(frame, r, b, boxes, n_boxes, &scratch->high);
        for (int l = 0; l < frame->lights->n; l++) {
            unsigned lanes = scratch->mask[l] & ~(unsigned)scratch->hidden[b][l];
            if (lanes != 0)
                hide_block(frame, scratch, b, l, lanes, rays);
        }
        gn_receivers_flush(frame, scratch, GN_RT_REAL, scratch->hidden, rays);
    }
}

void gn_occlusion_clear(const struct frame *frame, struct scratch *scratch)
{
    size_t bytes = (size_t)frame->lights->n * sizeof(uint16_t);
    for (int b = 0; b < scratch->receivers.n_blocks; b++) {
        memset(scratch->cut[b], 0, bytes);
        memset(scratch->hidden[b], 0, bytes);
        scratch->receivers.wanted[b] = 0;
    }
}
