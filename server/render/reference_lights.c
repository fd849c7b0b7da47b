/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The reference's directions: the whole map, which is taken as constant over each texel, as it was
 * measured. A texel of radiance L is one light of direction and irradiance L m, where
 *   m = integral of the direction d over the texel = 1/2 sum over its edges angle e / |e|, e = a x
 * b from corner a to corner b (Lambert's formula for the irradiance of a polygon, here on the
 * sphere). Neighbours share edges, so under a constant map the texels of a hemisphere add up to pi
 * exactly. One that holds much of all energy is a lamp, and one direction would give it a hard
 * shadow: it is cut into parts that share its irradiance evenly. What the map does not show has the
 * fill's radiance, on rings of equal solid angle that begin at its rim.
 */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

// A texel with more than this share of the map's luminous energy is cut into n x n parts.
#define SHARE_4X4 1e-2
#define SHARE_2X2 1e-3
// So many texels at most can pass the shares, 1 / SHARE_4X4 and 1 / SHARE_2X2; each has a block.
#define MAX_PARTS (LANES * (100 + 1000))

#define FILL_RINGS 96 // of the part beyond the rim, and of the part inside it
#define FILL_SECTORS 192

// Edges of texels of maps with fewer texels are no arcs of great circles but bend: in steps.
#define FINE_TEXELS 65536
#define EDGE_STEPS 8

static double get_luminance(const double rgb[static 3])
{
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

static void get_texel_irradiance(const struct gn_radiance_map *map, size_t i, double out[static 3])
{
    for (size_t k = 0; k < 3; k++)
        out[k] = (double)map->radiance.data[3 * i + k] * map->solid_angle[i];
}

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** Adds the edge's part of twice the moment. */
static void add_edge(const double a[static 3], const double b[static 3], double moment[static 3])
{
    const double e[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    double length = sqrt(dot(e, e));
    if (!(length > 0))
        return;
    double scale = atan2(length, dot(a, b)) / length;
    for (int k = 0; k < 3; k++)
        moment[k] += scale * e[k];
}

/** The texel's moment per solid angle, world. False where a corner is not shown, or where the
 * corners do not say how the texel lies (the rim that is one direction). */
static bool get_moment(const struct gn_radiance_map *map, int x, int y, double out[static 3])
{
    static const int corners[5][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
    size_t i = (size_t)y * (size_t)map->radiance.width + (size_t)x;
    bool is_fine = (int64_t)map->radiance.width * map->radiance.height >= FINE_TEXELS;
    int n_steps = is_fine ? 1 : EDGE_STEPS;
    double moment[3] = {0};
    double a[3];
    double b[3];
    if (!gn_projection_get_direction(&map->projection, x, y, a))
        return false;
    for (int j = 1; j <= 4 * n_steps; j++) {
        const int *from = corners[(j - 1) / n_steps];
        const int *to = corners[(j - 1) / n_steps + 1];
        double t = ((j - 1) % n_steps + 1.0) / n_steps;
        if (!gn_projection_get_direction(&map->projection, x + from[0] + t * (to[0] - from[0]),
                                         y + from[1] + t * (to[1] - from[1]), b))
            return false;
        add_edge(a, b, moment);
        memcpy(a, b, sizeof(a));
    }
    gn_pose_rotate(&map->world_from_probe, moment, moment);
    const float *c = map->direction_world + 3 * i;
    const double centre[3] = {c[0], c[1], c[2]};
    double along = dot(moment, centre) / (2 * map->solid_angle[i]);
    if (!(fabs(along) > 0.9 && fabs(along) < 1.01))
        return false;
    for (int k = 0; k < 3; k++)
        out[k] = copysign(0.5, along) * moment[k] / map->solid_angle[i];
    return true;
}

static int count_parts(const double irradiance[static 3], double total)
{
    double share = total > 0 ? get_luminance(irradiance) / total : 0;
    return share > SHARE_4X4 ? 4 : share > SHARE_2X2 ? 2 : 1;
}

static void add_whole(const struct gn_radiance_map *map, int x, int y, double irradiance[static 3],
                      struct light_list *list)
{
    double dir[3];
    double length = 1;
    if (get_moment(map, x, y, dir)) {
        length = sqrt(dot(dir, dir));
    } else {
        size_t i = (size_t)y * (size_t)map->radiance.width + (size_t)x;
        for (size_t k = 0; k < 3; k++)
            dir[k] = map->direction_world[3 * i + k];
    }
    for (int k = 0; k < 3; k++) {
        dir[k] /= length;
        irradiance[k] *= length;
    }
    gn_render_lights_add(list, dir, irradiance);
}

static void add_parts(const struct gn_radiance_map *map, int x, int y, int n,
                      double irradiance[static 3], struct light_list *list)
{
    double dirs[16][3];
    int n_shown = 0;
    for (int part = 0; part < n * n; part++) {
        int row = part / n;
        double dir[3];
        if (gn_projection_get_direction(&map->projection, x + (part % n + 0.5) / n,
                                        y + (row + 0.5) / n, dir))
            gn_pose_rotate(&map->world_from_probe, dir, dirs[n_shown++]);
    }
    if (n_shown == 0) {
        add_whole(map, x, y, irradiance, list);
        return;
    }
    for (int k = 0; k < 3; k++)
        irradiance[k] /= n_shown;
    for (int part = 0; part < n_shown; part++)
        gn_render_lights_add(list, dirs[part], irradiance);
}

/** The lights of a square of 4 x 4 texels, a block; or those of its texels that are cut, a block
 * each. */
static void add_square(const struct gn_radiance_map *map, int x0, int y0, double total, bool is_cut,
                       struct light_list *list)
{
    for (int i = 0; i < 16; i++) {
        int x = x0 + i % 4;
        int y = y0 + i / 4;
        double irradiance[3];
        if (x >= map->radiance.width || y >= map->radiance.height)
            continue;
        get_texel_irradiance(map, (size_t)y * (size_t)map->radiance.width + (size_t)x, irradiance);
        if (!(irradiance[0] > 0 || irradiance[1] > 0 || irradiance[2] > 0))
            continue;
        int n = count_parts(irradiance, total);
        if (n == 1 && !is_cut) {
            add_whole(map, x, y, irradiance, list);
        } else if (n > 1 && is_cut) {
            add_parts(map, x, y, n, irradiance, list);
            gn_render_lights_pad(list, LANES);
        }
    }
    gn_render_lights_pad(list, LANES);
}

/** All texels, in squares of 4 x 4 and those in squares of 16 x 16, which are groups. */
static void add_texels(const struct gn_radiance_map *map, double total, bool is_cut,
                       struct light_list *list)
{
    for (int y = 0; y < map->radiance.height; y += 16) {
        for (int x = 0; x < map->radiance.width; x += 16) {
            for (int square = 0; square < 16; square++)
                add_square(map, x + square % 4 * 4, y + square / 4 * 4, total, is_cut, list);
            if (!is_cut)
                gn_render_lights_pad(list, GROUP);
        }
    }
    gn_render_lights_pad(list, GROUP);
}

/** Adds a cell of what the map does not show; scale 0: only its solid angle counts. */
static double add_cell(const struct gn_radiance_map *map, int ring, int sector, double scale,
                       struct light_list *list)
{
    bool is_beyond = ring >= FILL_RINGS; // the rim
    double rim = cos(map->projection.theta_max);
    double along = (ring % FILL_RINGS + 0.5) / FILL_RINGS;
    double phi = 2 * M_PI * (sector + 0.5) / FILL_SECTORS;
    double z = is_beyond ? rim - (1 + rim) * along : 1 - (1 - rim) * along;
    double cell = 2 * M_PI * (is_beyond ? 1 + rim : 1 - rim) / (FILL_RINGS * FILL_SECTORS);
    double r = sqrt(fmax(0, 1 - z * z));
    double dir[3] = {r * cos(phi), r * sin(phi), z};
    double xy[2];
    if (gn_projection_get_position(&map->projection, dir, xy))
        return 0;
    double irradiance[3];
    for (int k = 0; k < 3; k++)
        irradiance[k] = map->fill[k] * cell * scale;
    gn_pose_rotate(&map->world_from_probe, dir, dir);
    gn_render_lights_add(list, dir, irradiance);
    return cell;
}

/** Cells of the sphere that the map does not show, theta from the optical axis; as the texels. */
static void add_fill(const struct gn_radiance_map *map, struct light_list *list)
{
    // Two rounds: the cells' solid angles add up to the map's own figure of what is not shown.
    double scale = 0;
    for (int round = 0; round < 2; round++) {
        double sum = 0;
        for (int i = 0; i < 2 * FILL_RINGS * FILL_SECTORS; i++) {
            int group = i / GROUP;
            int block = i / LANES % LANES;
            int lane = i % LANES;
            int groups_x = FILL_SECTORS / 16;
            int ring = group / groups_x * 16 + block / 4 * 4 + lane / 4;
            int sector = group % groups_x * 16 + block % 4 * 4 + lane % 4;
            sum += add_cell(map, ring, sector, scale, list);
            if (lane == LANES - 1)
                gn_render_lights_pad(list, LANES);
            if (block == LANES - 1 && lane == LANES - 1)
                gn_render_lights_pad(list, GROUP);
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
    int64_t capacity = (int64_t)((width + 15) / 16) * ((height + 15) / 16) * GROUP + MAX_PARTS +
                       2 * GROUP + (has_fill ? 2 * FILL_RINGS * FILL_SECTORS : 0);
    int ret = gn_render_lights_reserve(list, capacity);
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
    add_texels(map, luminance, false, list);
    add_texels(map, luminance, true, list);
    if (has_fill)
        add_fill(map, list);
    gn_directions_fill_groups(list);
    fill_cdf(list);
    return 0;
}
