/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The judge: every direction of the radiance map, exact visibility, no light extraction, no tiles
 * of lights. Slow on purpose; the only ray left out is one that misses the virtual objects' box.
 *
 * The map is taken as constant over each texel, as it was measured. A texel is one direction, its
 * centre, of irradiance L dOmega. One that holds much of all energy is a lamp, and one direction
 * would give it a hard shadow: it is cut into parts that share its irradiance evenly. What the map
 * does not show has the fill's radiance, on rings of equal solid angle that begin at its rim.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

// A texel with more than this share of the map's luminous energy is cut into n x n parts.
#define SHARE_4X4 1e-2
#define SHARE_2X2 1e-3
// So many texels at most can pass the shares: 1 / SHARE_4X4 and 1 / SHARE_2X2.
#define MAX_PARTS (100 * 16 + 1000 * 4)

#define FILL_RINGS 96 // of the part beyond the rim, and of the part inside it
#define FILL_SECTORS 192

static double get_luminance(const double rgb[static 3])
{
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

static void get_texel_irradiance(const struct gn_radiance_map *map, size_t i, double out[static 3])
{
    for (size_t k = 0; k < 3; k++)
        out[k] = (double)map->radiance.data[3 * i + k] * map->solid_angle[i];
}

static void add_texel(const struct gn_radiance_map *map, int x, int y, double total,
                      struct light_list *list)
{
    size_t i = (size_t)y * (size_t)map->radiance.width + (size_t)x;
    double irradiance[3];
    get_texel_irradiance(map, i, irradiance);
    double share = total > 0 ? get_luminance(irradiance) / total : 0;
    int n = share > SHARE_4X4 ? 4 : share > SHARE_2X2 ? 2 : 1;
    double dirs[16][3];
    int n_shown = 0;
    for (int part = 0; part < n * n && n > 1; part++) {
        double px = x + (part % n + 0.5) / n;
        double py = y + ((part / n) + 0.5) / n; // NOLINT(bugprone-integer-division): the row
        double dir[3];
        if (gn_projection_get_direction(&map->projection, px, py, dir))
            gn_pose_rotate(&map->world_from_probe, dir, dirs[n_shown++]);
    }
    if (n_shown == 0) {
        for (size_t k = 0; k < 3; k++)
            dirs[0][k] = map->direction_world[3 * i + k];
        n_shown = 1;
    }
    for (int k = 0; k < 3; k++)
        irradiance[k] /= n_shown;
    for (int part = 0; part < n_shown; part++)
        gn_render_lights_add(list, dirs[part], irradiance);
}

/** Cells of the sphere that the map does not show; theta from the optical axis. */
static void add_fill(const struct gn_radiance_map *map, struct light_list *list)
{
    double rim = cos(map->projection.theta_max);
    double cell[2] = {2 * M_PI * (1 - rim) / (FILL_RINGS * FILL_SECTORS),
                      2 * M_PI * (1 + rim) / (FILL_RINGS * FILL_SECTORS)};
    // Two rounds: the cells' solid angles add up to the map's own figure of what is not shown.
    double scale = 0;
    for (int round = 0; round < 2; round++) {
        double sum = 0;
        for (int i = 0; i < 2 * FILL_RINGS * FILL_SECTORS; i++) {
            int part = i / (FILL_RINGS * FILL_SECTORS);
            double ring = (i / FILL_SECTORS) % FILL_RINGS + 0.5;
            double phi = 2 * M_PI * (i % FILL_SECTORS + 0.5) / FILL_SECTORS;
            double z =
                part == 0 ? 1 - (1 - rim) * ring / FILL_RINGS : rim - (1 + rim) * ring / FILL_RINGS;
            double r = sqrt(fmax(0, 1 - z * z));
            double dir[3] = {r * cos(phi), r * sin(phi), z};
            double xy[2];
            if (gn_projection_get_position(&map->projection, dir, xy))
                continue;
            sum += cell[part];
            if (round == 0)
                continue;
            double irradiance[3];
            for (int k = 0; k < 3; k++)
                irradiance[k] = map->fill[k] * cell[part] * scale;
            gn_pose_rotate(&map->world_from_probe, dir, dir);
            gn_render_lights_add(list, dir, irradiance);
        }
        scale = sum > 0 ? map->fill_solid_angle / sum : 0;
    }
}

/** The running sum of luminance, from 0 to 1. */
static void fill_cdf(struct light_list *list)
{
    double sum = 0;
    for (int i = 0; i < list->n; i++) {
        const double e[3] = {list->irradiance[0][i], list->irradiance[1][i],
                             list->irradiance[2][i]};
        sum += get_luminance(e);
        list->cdf[i] = sum;
    }
    for (int i = 0; i < list->n && sum > 0; i++)
        list->cdf[i] /= sum;
}

int gn_reference_make_lights(const struct gn_radiance_map *map, struct light_list *list)
{
    int width = map->radiance.width;
    int height = map->radiance.height;
    bool has_fill =
        !map->is_full_sphere && (map->fill[0] > 0 || map->fill[1] > 0 || map->fill[2] > 0);
    int ret = gn_render_lights_reserve(list, width * height + MAX_PARTS +
                                                 (has_fill ? 2 * FILL_RINGS * FILL_SECTORS : 0));
    if (ret < 0)
        return ret;
    double total[3] = {0};
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        double irradiance[3];
        get_texel_irradiance(map, i, irradiance);
        for (int k = 0; k < 3; k++)
            total[k] += irradiance[k];
    }
    double luminance = get_luminance(total);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++)
            add_texel(map, x, y, luminance, list);
    }
    if (has_fill)
        add_fill(map, list);
    fill_cdf(list);
    return 0;
}

/** A loop over all lights of one sample: adds what reaches it through `set` to sums[0], and of that
 * what `blocked` (may be NULL) marks to sums[1]. */
static void integrate(const struct frame *frame, struct scratch *scratch, const struct sample *s,
                      enum gn_rt_set set, const uint64_t *blocked, double sums[static 2][3],
                      uint64_t *rays)
{
    const struct light_list *lights = frame->lights;
    for (int l = 0; l <= lights->n; l++) {
        bool is_full = l == lights->n;
        if (!is_full) {
            const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
            float c = surface_cosine(&s->surface, dir);
            if (!(c > 0))
                continue;
            if (blocked && frame->options.shadow_unweighted)
                c = 1;
            is_full = gn_packet_add(scratch, s->org, dir, 0, l, c);
        }
        if (!is_full)
            continue;
        int n = scratch->n_lanes;
        uint32_t hidden = 0;
        if (blocked && !frame->run_blockers)
            scratch->n_lanes = 0;
        else
            hidden = gn_packet_trace(frame, scratch, set, &n, rays);
        for (int lane = 0; lane < n; lane++) {
            int light = scratch->lane_light[lane];
            if (hidden >> lane & 1)
                continue;
            bool is_cut = blocked && (blocked[light / 64] >> (light % 64) & 1);
            for (int k = 0; k < 3; k++) {
                double e = (double)scratch->lane_weight[lane] * lights->irradiance[k][light];
                sums[0][k] += e;
                if (is_cut)
                    sums[1][k] += e;
            }
        }
    }
}

/** Marks in scratch->texel_blocked the lights that virtual objects hide. */
static void find_blocked(const struct frame *frame, struct scratch *scratch, struct sample *s,
                         struct tile_figures *figures)
{
    const struct light_list *lights = frame->lights;
    memset(scratch->texel_blocked, 0, (size_t)scratch->n_texel_words * sizeof(uint64_t));
    for (int l = 0; l <= lights->n; l++) {
        bool is_full = l == lights->n;
        if (!is_full) {
            const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
            if (!(surface_cosine(&s->surface, dir) > 0))
                continue;
            if (frame->cull && !gn_box_may_meet(&frame->virtual_box, s->org, dir))
                continue;
            is_full = gn_packet_add(scratch, s->org, dir, 0, l, 0);
        }
        if (!is_full)
            continue;
        int n;
        uint32_t hidden = gn_packet_trace(frame, scratch, GN_RT_VIRTUAL, &n, &figures->rays_shadow);
        for (int lane = 0; lane < n; lane++) {
            if (!(hidden >> lane & 1))
                continue;
            int light = scratch->lane_light[lane];
            scratch->texel_blocked[light / 64] |= UINT64_C(1) << (light % 64);
            s->is_cut = true;
        }
    }
}

void gn_reference_shade(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                        struct tile_figures *figures)
{
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (s->kind != SAMPLE_VIRTUAL || !s->is_lit)
            continue;
        double sums[2][3] = {{0}};
        double common[3] = {0};
        double touched[3] = {0};
        integrate(frame, scratch, s, GN_RT_ALL, NULL, sums, &figures->rays_shade);
        if (frame->run_bounces)
            gn_bounce_gather(frame, s, GN_RT_ALL, n_paths, common, touched, &figures->rays_shade);
        for (int k = 0; k < 3; k++) {
            s->indirect[k] = s->through[k] * (common[k] + touched[k]);
            s->radiance[k] =
                s->through[k] * (s->surface.albedo[k] / M_PI * sums[0][k]) + s->indirect[k];
        }
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

/** U and S of a receiver whose hidden lights scratch->texel_blocked marks. */
static void sum_receiver(const struct frame *frame, struct scratch *scratch, struct sample *s,
                         int n_paths, struct tile_figures *figures)
{
    double sums[2][3] = {{0}};
    uint64_t rays = 0;
    integrate(frame, scratch, s, GN_RT_REAL, scratch->texel_blocked, sums, &rays);
    figures->rays_shadow += rays;
    figures->n_rays_real += rays;
    memcpy(s->open[0], sums[0], sizeof(sums[0]));
    memcpy(s->cut[0], sums[1], sizeof(sums[1]));
    gn_shadow_weigh(frame, s);
    if (frame->run_bounces)
        add_bounces(frame, s, n_paths, figures);
    s->is_summed = true;
}

void gn_reference_shadow(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                         struct tile_figures *figures)
{
    bool groups[BATCH];
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        gn_shadow_clear(s);
        if (!s->is_receiver)
            continue;
        find_blocked(frame, scratch, s, figures);
        if (s->is_cut || frame->run_bounces)
            sum_receiver(frame, scratch, s, n_paths, figures);
    }
    // The rest of a pixel that loses light somewhere: what it weighs in the pixel's ratio.
    gn_shadow_find_groups(frame, scratch->samples, n, groups);
    memset(scratch->texel_blocked, 0, (size_t)scratch->n_texel_words * sizeof(uint64_t));
    for (int i = 0; i < n; i++) {
        struct sample *s = &scratch->samples[i];
        if (!groups[s->group] || s->is_summed || s->kind == SAMPLE_VIRTUAL)
            continue;
        if (s->is_receiver)
            sum_receiver(frame, scratch, s, n_paths, figures);
        else
            gn_shadow_see_nothing(frame, s);
    }
}
