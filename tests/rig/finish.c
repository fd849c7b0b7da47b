/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Surfaces with a pattern, as functions of the place: the table's planks and the printed marker.
 */
#include <math.h>
#include <stdint.h>

#include "tests/rig/random.h"
#include "tests/rig/room.h"

/* A fixed number in [0, 1) for each cell. */
static double get_cell_value(int x, int y, uint32_t layer)
{
    uint32_t out[4];
    gn_rig_philox((const uint32_t[4]){(uint32_t)x, (uint32_t)y, layer, 0},
                  (const uint32_t[2]){0x77006f6f, 0x64000000}, out);
    return out[0] * 0x1p-32;
}

/* Values of the cells' corners, blended smoothly. */
static double get_noise(double x, double y, uint32_t layer)
{
    double fx = floor(x), fy = floor(y), tx = x - fx, ty = y - fy;
    int ix = (int)fx, iy = (int)fy;
    tx = tx * tx * (3 - 2 * tx);
    ty = ty * ty * (3 - 2 * ty);
    double top = get_cell_value(ix, iy, layer) * (1 - tx) + get_cell_value(ix + 1, iy, layer) * tx;
    double low =
        get_cell_value(ix, iy + 1, layer) * (1 - tx) + get_cell_value(ix + 1, iy + 1, layer) * tx;
    return top * (1 - ty) + low * ty;
}

/* Oak planks 95 mm wide along x: each with its tint, growth rings as a warped saw, fine pores. */
static void get_wood(const double point[static 3], double out_albedo[static 3])
{
    const double width = 0.095;
    static const double light[3] = {0.52, 0.355, 0.215}, dark[3] = {0.33, 0.20, 0.11};
    double across = point[1] / width + 0.37, plank = floor(across), within = across - plank;
    uint32_t layer = (uint32_t)(int)plank;
    double along = point[0] + 3 * get_cell_value((int)plank, 0, 1);
    double warp = get_noise(along * 5, within * 2.2, layer) +
                  0.35 * get_noise(along * 17, within * 6, layer + 101);
    double rings = within * 5 + warp * 4.5;
    rings -= floor(rings);
    double pores = get_noise(along * 90, within * 80, layer + 202);
    double shade = 0.30 * rings * rings + 0.22 * pores + 0.30 * get_cell_value((int)plank, 1, 2);
    double edge = fmin(within, 1 - within) * width; // m to the joint
    double joint = edge < 0.0006 ? 0.45 : 1;
    for (int k = 0; k < 3; k++)
        out_albedo[k] = joint * (light[k] + (dark[k] - light[k]) * shade);
}

/* Marker 0 of the 4 x 4 dictionary that ArUco's users know (bits 1011 0101 0011 0010, 1 = white)
 * in a black border of one cell, on white paper. */
static void get_marker(const double point[static 3], double out_albedo[static 3])
{
    static const int white[4] = {0xb, 0x5, 0x3, 0x2};
    const double cell = GN_RIG_MARKER_SIDE / 6;
    int x = (int)floor(point[0] / cell) + 3, row = 2 - (int)floor(point[1] / cell);
    bool is_white = x < 0 || x > 5 || row < 0 || row > 5;
    if (x >= 1 && x <= 4 && row >= 1 && row <= 4)
        is_white = white[row - 1] >> (4 - x) & 1;
    for (int k = 0; k < 3; k++)
        out_albedo[k] = is_white ? 0.80 : 0.035;
}

void gn_rig_finish_get_albedo(enum gn_rig_finish finish, const double point[static 3],
                              double out_albedo[static 3])
{
    if (finish == GN_RIG_WOOD)
        get_wood(point, out_albedo);
    else if (finish == GN_RIG_MARKER)
        get_marker(point, out_albedo);
}
