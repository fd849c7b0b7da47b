/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The judge: every direction of the radiance map, exact visibility, no light extraction. For each
 * sample by itself: which directions above its horizon are hidden, then the sums.
 *
 * Left out, and no bit of the result with them, are rays whose fate is known. Of a set's clusters
 * of triangles only those matter that are not wholly under the receiver's tangent plane; a group of
 * directions is looked at only where its box may meet the box of such a cluster. A block that no
 * outline crosses (edges.c) has one ray for all its directions; each other block is a packet.
 * The sum over a block or a group that is wholly open and above the horizon, sum Phi_i (n . d_i),
 * is n . (sum Phi_i d_i), which is known.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

/** Cosines of a block's lights; returns the mask of lit ones above the surface's horizon. */
static unsigned get_cosines(const struct light_list *lights, const struct sample *s, int block,
                            float out[static LANES])
{
    const float *x = lights->dir[0] + block * LANES;
    const float *y = lights->dir[1] + block * LANES;
    const float *z = lights->dir[2] + block * LANES;
    const float *n = s->surface.normal_shading;
    const float *g = s->surface.normal_horizon;
    unsigned mask = 0;
    for (int i = 0; i < LANES; i++) {
        float c = n[0] * x[i] + n[1] * y[i] + n[2] * z[i];
        float d = g[0] * x[i] + g[1] * y[i] + g[2] * z[i];
        out[i] = d > 0 ? c : 0;
    }
    for (int i = 0; i < LANES; i++)
        mask |= (unsigned)(out[i] > 0) << i;
    return mask & lights->groups[block / LANES].lit[block % LANES];
}

/** Which of 16 boxes hold directions above the surface's horizon, and which hold no others. */
static void split_by_horizon(const struct direction_boxes *boxes, const struct sample *s,
                             unsigned *out_some, unsigned *out_all)
{
    unsigned some;
    unsigned all;
    gn_directions_split(boxes, s->surface.normal_horizon, out_some, out_all);
    if (memcmp(s->surface.normal_horizon, s->surface.normal_shading,
               sizeof(s->surface.normal_shading)) == 0)
        return;
    gn_directions_split(boxes, s->surface.normal_shading, &some, &all);
    *out_some &= some;
    *out_all &= all;
}

/** Every ray of the sample starts at one point. */
static void aim_packet(struct gn_rt_packet *packet, const struct sample *s)
{
    for (int i = 0; i < LANES; i++) {
        packet->org_x[i] = s->org[0];
        packet->org_y[i] = s->org[1];
        packet->org_z[i] = s->org[2];
        packet->t_near[i] = 0;
        packet->t_far[i] = INFINITY;
    }
}

/** Traces the packet's lanes of the mask; bit i: lane i is hidden. */
static unsigned trace(const struct frame *frame, struct gn_rt_packet *packet, enum gn_rt_set set,
                      unsigned mask, uint64_t *rays)
{
    for (int i = 0; i < LANES; i++) {
        packet->valid[i] = mask >> i & 1 ? -1 : 0;
        *rays += mask >> i & 1;
    }
    return gn_rt_get_occluded16(frame->rt, set, packet);
}

/** A ray for each light of the block that is above the horizon. */
static unsigned trace_block(const struct frame *frame, struct scratch *scratch,
                            const struct sample *s, enum gn_rt_set set, int block, uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    struct gn_rt_packet *packet = &scratch->packet;
    float cosines[LANES];
    unsigned mask = get_cosines(lights, s, block, cosines);
    if (mask == 0)
        return 0;
    size_t first = (size_t)block * LANES;
    memcpy(packet->dir_x, lights->dir[0] + first, sizeof(packet->dir_x));
    memcpy(packet->dir_y, lights->dir[1] + first, sizeof(packet->dir_y));
    memcpy(packet->dir_z, lights->dir[2] + first, sizeof(packet->dir_z));
    return trace(frame, packet, set, mask, rays);
}

/** One ray for each of the group's blocks, which no outline crosses, for all its lights.
 * above: which are wholly above the horizon. */
static void trace_uniform(const struct frame *frame, struct scratch *scratch,
                          const struct sample *s, enum gn_rt_set set, int group, unsigned blocks,
                          unsigned above, uint16_t *masks, uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    struct gn_rt_packet *packet = &scratch->packet;
    unsigned lanes[LANES];
    unsigned asked = 0;
    for (int b = 0; b < LANES; b++) {
        int block = group * LANES + b;
        int light = block * LANES;
        float cosines[LANES];
        lanes[b] = !(blocks >> b & 1) ? 0
                   : above >> b & 1   ? lights->groups[group].lit[b]
                                      : get_cosines(lights, s, block, cosines);
        while (lanes[b] && !(lanes[b] >> (light % LANES) & 1))
            light++;
        packet->dir_x[b] = lights->dir[0][light];
        packet->dir_y[b] = lights->dir[1][light];
        packet->dir_z[b] = lights->dir[2][light];
        asked |= (unsigned)(lanes[b] != 0) << b;
    }
    if (asked == 0)
        return;
    unsigned hidden = trace(frame, packet, set, asked, rays);
    for (int b = 0; b < LANES; b++) {
        if (hidden >> b & 1)
            masks[group * LANES + b] = (uint16_t)lanes[b];
    }
}

/** The blocks of group i of 16 in which it may change whether a ray is stopped. */
static unsigned find_crossed(const struct scratch *scratch, int n_changes, int i,
                             const struct light_group *group)
{
    unsigned crossed = 0;
    for (int j = 0; j < n_changes; j++) {
        const struct change *change = &scratch->changes[j];
        if (change->groups >> i & 1)
            crossed |= change->outline ? gn_directions_cross(&group->blocks, change->outline)
                                       : gn_directions_meet(&group->blocks, change->box);
    }
    return crossed;
}

/** Marks what the set hides of a group; `crossed`: its blocks that need a ray for each light. */
static void trace_group(const struct frame *frame, struct scratch *scratch, const struct sample *s,
                        enum gn_rt_set set, int group, unsigned crossed, uint16_t *masks,
                        uint64_t *rays)
{
    const struct light_group *lights = &frame->lights->groups[group];
    unsigned some;
    unsigned all;
    split_by_horizon(&lights->blocks, s, &some, &all);
    crossed &= some;
    for (int b = 0; crossed >> b; b++) {
        int block = group * LANES + b;
        if (crossed >> b & 1)
            masks[block] = (uint16_t)trace_block(frame, scratch, s, set, block, rays);
    }
    if (some & ~crossed)
        trace_uniform(frame, scratch, s, set, group, some & ~crossed, all, masks, rays);
}

/** Of 16 groups those that the near clusters may meet; fills scratch->changes. */
static unsigned find_changes(struct scratch *scratch, int n_near,
                             const struct direction_boxes *boxes, unsigned above, int *out_n)
{
    unsigned any = 0;
    int n = 0;
    for (int j = 0; j < n_near; j++) {
        const struct seen_cluster *seen = &scratch->near[j];
        unsigned groups = gn_directions_meet(boxes, &seen->box) & above;
        any |= groups;
        if (groups && !seen->has_outlines)
            scratch->changes[n++] = (struct change){NULL, &seen->box, groups};
        for (int i = 0; i < seen->n_outlines && groups; i++) {
            const struct outline *outline = &scratch->outlines[seen->first_outline + i];
            unsigned crossed = gn_directions_cross(boxes, outline) & groups;
            if (crossed)
                scratch->changes[n++] = (struct change){outline, NULL, crossed};
        }
    }
    *out_n = n;
    return any;
}

/** Fills scratch->near. Returns their number. */
static int find_near(const struct frame *frame, struct scratch *scratch, const struct sample *s,
                     enum gn_rt_set set)
{
    int n = 0;
    for (int i = 0; i < 2; i++) {
        if (set & frame->clusters[i].role)
            n = gn_clusters_list_above(&frame->clusters[i], s->org, s->surface.normal_horizon,
                                       frame->margin, n, scratch->near, scratch->outlines);
    }
    return n;
}

/** Marks in masks[block] the directions that the set hides. True where there is one. */
static bool find_hidden(const struct frame *frame, struct scratch *scratch, const struct sample *s,
                        enum gn_rt_set set, uint16_t *masks, uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    int n_blocks = lights->n / LANES;
    unsigned found = 0;
    if (n_blocks == 0)
        return false; /* no distant light, and no masks */
    int n_near = frame->cull ? find_near(frame, scratch, s, set) : 0;
    memset(masks, 0, (size_t)n_blocks * sizeof(*masks));
    if (frame->cull && n_near == 0)
        return false;
    aim_packet(&scratch->packet, s);
    for (int first = 0; first < lights->n_groups; first += LANES) {
        const struct direction_boxes *boxes = &lights->group_boxes[first / LANES];
        unsigned above;
        unsigned all;
        int n_changes = 0;
        split_by_horizon(boxes, s, &above, &all);
        unsigned groups =
            above && frame->cull ? find_changes(scratch, n_near, boxes, above, &n_changes) : above;
        for (int i = 0; groups >> i; i++) {
            int group = first + i;
            if (!(groups >> i & 1))
                continue;
            unsigned crossed =
                frame->cull ? find_crossed(scratch, n_changes, i, &lights->groups[group]) : ~0u;
            trace_group(frame, scratch, s, set, group, crossed, masks, rays);
        }
    }
    for (int b = 0; b < n_blocks; b++)
        found |= masks[b];
    return found != 0;
}

static void add_moment(const double moment[static 3][3], const float n[static 3],
                       double sum[static 3])
{
    for (int k = 0; k < 3; k++)
        sum[k] += moment[k][0] * n[0] + moment[k][1] * n[1] + moment[k][2] * n[2];
}

static void add_lights(const struct light_list *lights, int block, unsigned mask,
                       const float weights[static LANES], double sum[static 3])
{
    for (int i = 0; mask >> i; i++) {
        if (!(mask >> i & 1))
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += (double)weights[i] * lights->irradiance[k][block * LANES + i];
    }
}

static bool is_any_set(const uint16_t masks[static LANES])
{
    unsigned any = 0;
    for (int i = 0; i < LANES; i++)
        any |= masks[i];
    return any != 0;
}

/** What the lights that hidden does not mark send: to sums[0], and of that what cut marks to
 * sums[1]. With `even` every light above the horizon has weight 1. */
static void sum_group(const struct frame *frame, const struct sample *s, int g, bool is_above,
                      const struct scratch *scratch, bool even, double sums[static 2][3])
{
    const struct light_list *lights = frame->lights;
    const struct light_group *group = &lights->groups[g];
    const uint16_t *hidden = scratch->hidden_texels + g * LANES;
    const uint16_t *cut = scratch->cut_texels + g * LANES;
    unsigned some;
    unsigned all;
    if (is_above && !even && !is_any_set(hidden) && !is_any_set(cut)) {
        add_moment(group->moment, s->surface.normal_shading, sums[0]);
        return;
    }
    split_by_horizon(&group->blocks, s, &some, &all);
    for (int b = 0; some >> b; b++) {
        float weights[LANES];
        bool is_open = (all >> b & 1) && !hidden[b] && !even;
        if (!(some >> b & 1))
            continue;
        if (is_open)
            add_moment(group->block_moment[b], s->surface.normal_shading, sums[0]);
        if (is_open && !cut[b])
            continue;
        unsigned mask = get_cosines(lights, s, g * LANES + b, weights) & ~(unsigned)hidden[b];
        for (int i = 0; i < LANES && even; i++)
            weights[i] = 1;
        if (!is_open)
            add_lights(lights, g * LANES + b, mask, weights, sums[0]);
        add_lights(lights, g * LANES + b, mask & cut[b], weights, sums[1]);
    }
}

/** Of one probe's lights. */
static void sum_probe(const struct frame *frame, const struct scratch *scratch,
                      const struct sample *s, int probe, bool even, double sums[static 2][3])
{
    const struct light_list *lights = frame->lights;
    int start = probe > 0 ? lights->ends[probe - 1] : 0;
    for (int first = start / GROUP; first < lights->ends[probe] / GROUP; first += LANES) {
        unsigned some;
        unsigned all;
        split_by_horizon(&lights->group_boxes[first / LANES], s, &some, &all);
        for (int i = 0; some >> i; i++) {
            if (some >> i & 1)
                sum_group(frame, s, first + i, all >> i & 1, scratch, even, sums);
        }
    }
}

static void sum_lights(const struct frame *frame, const struct scratch *scratch,
                       const struct sample *s, bool even, double sums[static 2][3])
{
    for (int p = 0; p < frame->blend.n; p++) {
        double part[2][3] = {{0}};
        sum_probe(frame, scratch, s, p, even, part);
        for (int i = 0; i < 6; i++)
            sums[i / 3][i % 3] +=
                part[i / 3][i % 3] * (frame->blend.n > 1 ? (double)s->weights[p] : 1);
    }
    if (frame->places->n > 0)
        gn_places_sum(frame, s, scratch->hidden_places, scratch->cut_places, even, sums);
}

/** Nothing is hidden, or cut. */
static void clear_masks(const struct frame *frame, uint16_t *texels, uint8_t *places)
{
    if (frame->lights->n > 0) // else there may be no memory for them
        memset(texels, 0, (size_t)frame->lights->n / LANES * sizeof(*texels));
    if (frame->places->n > 0)
        memset(places, 0, (size_t)frame->places->n);
}

/** Marks what the set hides of all light. True where there is some. */
static bool find_all_hidden(const struct frame *frame, struct scratch *scratch,
                            const struct sample *s, enum gn_rt_set set, bool is_cut, uint64_t *rays)
{
    bool found = find_hidden(frame, scratch, s, set,
                             is_cut ? scratch->cut_texels : scratch->hidden_texels, rays);
    if (frame->places->n > 0)
        found |= gn_places_find_hidden(frame, scratch, s, set,
                                       is_cut ? scratch->cut_places : scratch->hidden_places, rays);
    return found;
}

void gn_reference_shade(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                        struct tile_figures *figures)
{
    clear_masks(frame, scratch->cut_texels, scratch->cut_places);
    for (int i = 0; i < n && !is_cancelled(frame); i++) {
        struct sample *s = &scratch->samples[i];
        if (s->kind != SAMPLE_VIRTUAL || !s->is_lit)
            continue;
        double sums[2][3] = {{0}};
        double common[3] = {0};
        double touched[3] = {0};
        (void)find_all_hidden(frame, scratch, s, GN_RT_ALL, false, &figures->rays_shade);
        sum_lights(frame, scratch, s, false, sums);
        if (frame->run_bounces)
            gn_bounce_gather(frame, s, GN_RT_ALL, n_paths, common, touched, &figures->rays_shade);
        for (int k = 0; k < 3; k++) {
            double bounced = s->through[k] * (common[k] + touched[k]);
            s->indirect[k] += bounced;
            s->radiance[k] += s->through[k] * (s->surface.albedo[k] / M_PI * sums[0][k]) + bounced;
        }
        gn_near_add_emission(frame, s);
        if (frame->near.n > 0)
            gn_near_reference_shade(frame, s, figures);
    }
}

/** What bounces add to a receiver's sums: B by walks among real objects alone, C and T - C by the
 * same walks among all. */
static void add_bounces(const struct frame *frame, struct sample *s, int n_paths,
                        struct tile_figures *figures)
{
    double real[3];
    double common[3];
    double none[3];
    gn_bounce_gather(frame, s, GN_RT_REAL, n_paths, real, none, &figures->rays_shadow);
    gn_bounce_gather(frame, s, GN_RT_ALL, n_paths, common, s->gain, &figures->rays_shadow);
    for (int k = 0; k < 3; k++) {
        s->base[k] += real[k];
        s->lost[k] += fmax(0, real[k] - common[k]);
    }
}

/** U and S of a receiver whose lights that virtual objects hide scratch->cut_texels marks. */
static void sum_receiver(const struct frame *frame, struct scratch *scratch, struct sample *s,
                         int n_paths, struct tile_figures *figures)
{
    double sums[2][3] = {{0}};
    uint64_t rays = 0;
    if (frame->run_blockers)
        (void)find_all_hidden(frame, scratch, s, GN_RT_REAL, false, &rays);
    else
        clear_masks(frame, scratch->hidden_texels, scratch->hidden_places);
    sum_lights(frame, scratch, s, frame->options.shadow_unweighted, sums);
    figures->rays_shadow += rays;
    figures->n_rays_real += rays;
    if (frame->near.n > 0)
        gn_near_reference_sum(frame, s, frame->options.shadow_unweighted, sums, figures);
    memcpy(s->open, sums[0], sizeof(sums[0]));
    memcpy(s->cut, sums[1], sizeof(sums[1]));
    gn_shadow_weigh(frame, s);
    if (frame->run_bounces)
        add_bounces(frame, s, n_paths, figures);
    s->is_summed = true;
}

void gn_reference_sum_uncut(const struct frame *frame, struct scratch *scratch, struct sample *s,
                            int n_paths, struct tile_figures *figures)
{
    clear_masks(frame, scratch->cut_texels, scratch->cut_places);
    sum_receiver(frame, scratch, s, n_paths, figures);
}

void gn_reference_shadow(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                         struct tile_figures *figures)
{
    bool groups[BATCH];
    for (int i = 0; i < n && !is_cancelled(frame); i++) {
        struct sample *s = &scratch->samples[i];
        gn_shadow_clear(s);
        if (!s->is_receiver)
            continue;
        s->is_cut = find_all_hidden(frame, scratch, s, GN_RT_VIRTUAL, true, &figures->rays_shadow);
        if (!s->is_cut && frame->near.n_real > 0)
            s->is_cut = gn_near_reference_is_cut(frame, s, figures);
        if (s->is_cut || frame->run_bounces)
            sum_receiver(frame, scratch, s, n_paths, figures);
    }
    // The rest of a pixel that loses light somewhere: what it weighs in the pixel's ratio.
    gn_shadow_find_groups(frame, scratch->samples, n, groups);
    clear_masks(frame, scratch->cut_texels, scratch->cut_places);
    for (int i = 0; i < n && !is_cancelled(frame); i++) {
        struct sample *s = &scratch->samples[i];
        if (!groups[s->group] || s->is_summed || s->kind == SAMPLE_VIRTUAL)
            continue;
        if (s->is_receiver)
            sum_receiver(frame, scratch, s, n_paths, figures);
        else
            gn_shadow_see_nothing(frame, s);
    }
    for (int i = 0; i < n && frame->near.n_virtual > 0; i++) {
        if (scratch->samples[i].is_receiver)
            gn_near_reference_gain(frame, &scratch->samples[i], figures);
    }
}
