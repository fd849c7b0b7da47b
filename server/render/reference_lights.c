/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The reference's directions: the whole map, which is taken as constant over each texel, as it was
 * measured. A texel of radiance L is one light of direction and irradiance L m, where
 *   m = integral of the direction over the texel = 1/2 sum over its edges: angle e / |e|
 * with e = a x b of an edge from a to b (Lambert's formula for the irradiance from a polygon, here
 * on the sphere). Neighbours share edges, so under a constant map the texels of a hemisphere add up
 * to pi exactly. A texel that holds much of all energy is a lamp, and one direction would give it a
 * hard shadow: it is cut into parts. What the map does not show has the fill's radiance, on rings
 * of equal solid angle that begin at its rim.
 */
#include "server/render/reference_lights.h"

#include <math.h>
#include <string.h>

#include "server/light/luminance.h"

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

/** The moment of the square [x, x + side] x [y, y + side] px, world. False where a corner is not
 * shown. */
static bool get_moment(const struct gn_radiance_map *map, double x, double y, double side,
                       double out[static 3])
{
    static const int corners[5][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
    bool is_fine = (int64_t)map->radiance.width * map->radiance.height >= FINE_TEXELS;
    int n_steps = is_fine ? 1 : EDGE_STEPS;
    double twice[3] = {0};
    double a[3];
    double b[3];
    if (!gn_projection_get_direction(&map->projection, x, y, a))
        return false;
    for (int j = 1; j <= 4 * n_steps; j++) {
        const int *from = corners[(j - 1) / n_steps];
        const int *to = corners[(j - 1) / n_steps + 1];
        double t = ((j - 1) % n_steps + 1.0) / n_steps;
        if (!gn_projection_get_direction(&map->projection,
                                         x + side * (from[0] + t * (to[0] - from[0])),
                                         y + side * (from[1] + t * (to[1] - from[1])), b))
            return false;
        add_edge(a, b, twice);
        memcpy(a, b, sizeof(a));
    }
    for (int k = 0; k < 3; k++)
        twice[k] *= 0.5;
    gn_pose_rotate(&map->world_from_probe, twice, out);
    return true;
}

static int count_parts(const double irradiance[static 3], double total)
{
    double share = total > 0 ? gn_luminance_of_sum(irradiance) / total : 0;
    return share > SHARE_4X4 ? 4 : share > SHARE_2X2 ? 2 : 1;
}

/** From the modelled surface that the probe sees there, or else from far off. */
static void add_light(const struct gn_radiance_map *map, const double dir[static 3],
                      double solid_angle, const double irradiance[static 3],
                      struct light_list *list, struct places *places)
{
    if (!gn_places_add(places, map, dir, solid_angle, irradiance)) {
        gn_render_lights_add(list, dir, irradiance);
        return;
    }
    for (int k = 0; k < 3; k++)
        list->total[k] += irradiance[k];
}

/** Adds a part of a texel, or all of it: a square around `centre` (unit, world) that has a share of
 * the texel's irradiance where its moment is not known or makes no sense (corners outside, a rim
 * that is one direction). */
static void add_part(const struct gn_radiance_map *map, size_t texel, const double corner[static 2],
                     double side, const double centre[static 3], double solid_angle,
                     struct light_list *list, struct places *places)
{
    double dir[3] = {centre[0], centre[1], centre[2]};
    double length = solid_angle;
    double moment[3];
    if (get_moment(map, corner[0], corner[1], side, moment)) {
        double along = dot(moment, centre) / solid_angle; // < 0: the corners run the other way
        if (fabs(along) > 0.1 && fabs(along) < 2) {
            length = sqrt(dot(moment, moment));
            for (int k = 0; k < 3; k++)
                dir[k] = copysign(1, along) * moment[k] / length;
        }
    }
    double irradiance[3];
    for (size_t k = 0; k < 3; k++)
        irradiance[k] = length * (double)map->radiance.data[3 * texel + k];
    add_light(map, dir, solid_angle, irradiance, list, places);
}

/** Adds texel (x, y) in n x n parts, those that the map shows. */
static void add_texel(const struct gn_radiance_map *map, int x, int y, int n,
                      struct light_list *list, struct places *places)
{
    size_t texel = (size_t)y * (size_t)map->radiance.width + (size_t)x;
    double centres[16][3];
    double corners[16][2];
    int n_shown = 0;
    for (int part = 0; part < n * n && n > 1; part++) {
        int row = part / n;
        const double corner[2] = {x + (double)(part % n) / n, y + (double)row / n};
        double dir[3];
        if (!gn_projection_get_direction(&map->projection, corner[0] + 0.5 / n, corner[1] + 0.5 / n,
                                         dir))
            continue;
        memcpy(corners[n_shown], corner, sizeof(corner));
        gn_pose_rotate(&map->world_from_probe, dir, centres[n_shown++]);
    }
    if (n_shown == 0) {
        for (size_t k = 0; k < 3; k++)
            centres[0][k] = map->direction_world[3 * texel + k];
        corners[0][0] = x;
        corners[0][1] = y;
        n = n_shown = 1;
    }
    for (int part = 0; part < n_shown; part++)
        add_part(map, texel, corners[part], 1.0 / n, centres[part],
                 (double)map->solid_angle[texel] / n_shown, list, places);
}

/** The lights of a square of 4 x 4 texels, a block; or those of its texels that are cut, a block
 * each. */
static void add_square(const struct gn_radiance_map *map, int x0, int y0, double total, bool is_cut,
                       struct light_list *list, struct places *places)
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
            add_texel(map, x, y, 1, list, places);
        } else if (n > 1 && is_cut) {
            add_texel(map, x, y, n, list, places);
            gn_render_lights_pad(list, LANES);
        }
    }
    gn_render_lights_pad(list, LANES);
}

/** All texels, in squares of 4 x 4 and those in squares of 16 x 16, which are groups. */
static void add_texels(const struct gn_radiance_map *map, double total, bool is_cut,
                       struct light_list *list, struct places *places)
{
    for (int y = 0; y < map->radiance.height; y += 16) {
        for (int x = 0; x < map->radiance.width; x += 16) {
            for (int square = 0; square < 16; square++)
                add_square(map, x + square % 4 * 4, y + square / 4 * 4, total, is_cut, list,
                           places);
            if (!is_cut)
                gn_render_lights_pad(list, GROUP);
        }
    }
    gn_render_lights_pad(list, GROUP);
}

/** Cell i of a group of cells of the sphere, theta from the optical axis: its middle and solid
 * angle; 0: the map shows it. */
static double get_cell(const struct gn_radiance_map *map, int group, int i, double dir[static 3])
{
    int groups_x = FILL_SECTORS / 16;
    int ring = group / groups_x * 16 + i / LANES / 4 * 4 + i % LANES / 4;
    int sector = group % groups_x * 16 + i / LANES % 4 * 4 + i % LANES % 4;
    bool is_beyond = ring >= FILL_RINGS; // the rim
    double rim = cos(map->projection.theta_max);
    double along = (ring % FILL_RINGS + 0.5) / FILL_RINGS;
    double phi = 2 * M_PI * (sector + 0.5) / FILL_SECTORS;
    double z = is_beyond ? rim - (1 + rim) * along : 1 - (1 - rim) * along;
    double cell = 2 * M_PI * (is_beyond ? 1 + rim : 1 - rim) / (FILL_RINGS * FILL_SECTORS);
    double r = sqrt(fmax(0, 1 - z * z));
    double xy[2];
    dir[0] = r * cos(phi);
    dir[1] = r * sin(phi);
    dir[2] = z;
    return gn_projection_get_position(&map->projection, dir, xy) ? 0 : cell;
}

double gn_reference_get_fill_cell(const struct gn_radiance_map *map, int group, int i)
{
    double dir[3];
    return get_cell(map, group, i, dir);
}

void gn_reference_add_fill_cell(const struct gn_radiance_map *map, int group, int i, double scale,
                                struct light_list *list, struct places *places)
{
    double dir[3];
    double irradiance[3];
    double cell = get_cell(map, group, i, dir) * scale;
    for (int k = 0; k < 3; k++)
        irradiance[k] = map->fill[k] * cell;
    gn_pose_rotate(&map->world_from_probe, dir, dir);
    if (cell > 0)
        add_light(map, dir, cell, irradiance, list, places);
}

static bool has_fill(const struct gn_radiance_map *map)
{
    return !map->is_full_sphere && (map->fill[0] > 0 || map->fill[1] > 0 || map->fill[2] > 0);
}

double gn_reference_get_fill_scale(const struct gn_radiance_map *map)
{
    double sum = 0;
    if (!has_fill(map))
        return 0;
    for (int group = 0; group < GN_FILL_GROUPS; group++) {
        for (int i = 0; i < GROUP; i++)
            sum += gn_reference_get_fill_cell(map, group, i);
    }
    return sum > 0 ? map->fill_solid_angle / sum : 0;
}

/** Cells of the sphere that the map does not show; as the texels. */
static void add_fill(const struct gn_radiance_map *map, struct light_list *list,
                     struct places *places)
{
    double scale = gn_reference_get_fill_scale(map);
    for (int group = 0; group < GN_FILL_GROUPS; group++) {
        for (int i = 0; i < GROUP; i++) {
            gn_reference_add_fill_cell(map, group, i, scale, list, places);
            if (i % LANES == LANES - 1)
                gn_render_lights_pad(list, LANES);
        }
        gn_render_lights_pad(list, GROUP);
    }
}

void gn_reference_fill_cdf(struct light_list *list)
{
    double sum = 0;
    for (int i = 0; i < list->n; i++) {
        const double e[3] = {list->irradiance[0][i], list->irradiance[1][i],
                             list->irradiance[2][i]};
        sum += gn_luminance_of_sum(e);
        list->cdf[i] = sum;
    }
    for (int i = 0; i < list->n && sum > 0; i++)
        list->cdf[i] /= sum;
}

/** Most lights of one map. */
static int64_t get_capacity(const struct gn_radiance_map *map)
{
    int64_t groups =
        (int64_t)((map->radiance.width + 15) / 16) * ((map->radiance.height + 15) / 16);
    return groups * GROUP + MAX_PARTS + 2 * GROUP + (has_fill(map) ? GN_FILL_GROUPS * GROUP : 0);
}

void gn_reference_sum_map(const struct gn_radiance_map *map, double out_total[static 3])
{
    double total[3] = {0};
    for (size_t i = 0; i < (size_t)map->radiance.width * (size_t)map->radiance.height; i++) {
        double irradiance[3];
        get_texel_irradiance(map, i, irradiance);
        for (int k = 0; k < 3; k++)
            total[k] += irradiance[k];
    }
    memcpy(out_total, total, sizeof(total));
}

void gn_reference_add_texel(const struct gn_radiance_map *map, int x, int y, double luminance,
                            struct light_list *list, struct places *places)
{
    double irradiance[3];
    get_texel_irradiance(map, (size_t)y * (size_t)map->radiance.width + (size_t)x, irradiance);
    add_texel(map, x, y, count_parts(irradiance, luminance), list, places);
}

static void add_map(const struct gn_radiance_map *map, struct light_list *list,
                    struct places *places)
{
    double total[3];
    gn_reference_sum_map(map, total);
    double luminance = gn_luminance_of_sum(total);
    add_texels(map, luminance, false, list, places);
    add_texels(map, luminance, true, list, places);
    if (has_fill(map))
        add_fill(map, list, places);
}

int gn_reference_make_lights(const struct gn_blend *blend, struct light_list *list,
                             struct places *places)
{
    int64_t capacity = 0;
    bool is_global = false;
    for (int i = 0; i < blend->n; i++) {
        capacity += get_capacity(blend->state[i]->map) + (blend->n > 1 ? GROUP * LANES : 0);
        is_global |= blend->state[i]->map->geometry != NULL;
    }
    int ret = gn_render_lights_reserve(list, capacity);
    if (ret == 0)
        ret = gn_places_reserve(places, is_global ? capacity : 0);
    if (ret < 0)
        return ret;
    for (int i = 0; i < blend->n; i++) {
        add_map(blend->state[i]->map, list, places);
        gn_render_lights_pad(list, blend->n > 1 ? GROUP * LANES : GROUP);
        list->ends[i] = list->n;
        places->ends[i] = places->n;
    }
    gn_directions_fill_groups(list);
    gn_reference_fill_cdf(list);
    gn_places_fill_cdf(places);
    return 0;
}
