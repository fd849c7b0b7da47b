/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/cube_map.h"

#include <math.h>

#include "common/vec3.h"

/* Of each face: where it looks, what is right, what is up. */
static const double axes[GN_CUBE_FACES][3][3] = {
    {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}},  {{0, -1, 0}, {-1, 0, 0}, {0, 0, 1}},
    {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}},  {{0, 0, -1}, {0, 1, 0}, {-1, 0, 0}},
    {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}}, {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
};

void gn_cube_map_to_direction(int face, double s, double t, double out_dir[static 3])
{
    double length = sqrt(1 + s * s + t * t);
    for (int i = 0; i < 3; i++)
        out_dir[i] = (axes[face][0][i] + s * axes[face][1][i] + t * axes[face][2][i]) / length;
}

int gn_cube_map_from_direction(const double dir[static 3], double out_st[static 2])
{
    int face = 0;
    double depth = gn_vec3_dot(dir, axes[0][0]);
    for (int i = 1; i < GN_CUBE_FACES; i++) {
        double d = gn_vec3_dot(dir, axes[i][0]);
        if (d > depth) {
            depth = d;
            face = i;
        }
    }
    out_st[0] = gn_vec3_dot(dir, axes[face][1]) / depth;
    out_st[1] = gn_vec3_dot(dir, axes[face][2]) / depth;
    return face;
}

int gn_cube_map_cross_edge(int face, double s, double t, double out_st[static 2])
{
    double depth = 2 - fmax(fabs(s), fabs(t)), dir[3]; // what is beyond goes down the next face
    for (int i = 0; i < 3; i++)
        dir[i] = depth * axes[face][0][i] + fmin(fmax(s, -1), 1) * axes[face][1][i] +
                 fmin(fmax(t, -1), 1) * axes[face][2][i];
    return gn_cube_map_from_direction(dir, out_st);
}

static double get_corner(double s, double t)
{
    return atan2(s * t, sqrt(s * s + t * t + 1));
}

double gn_cube_map_get_solid_angle(double s0, double t0, double s1, double t1)
{
    return get_corner(s1, t1) - get_corner(s1, t0) - get_corner(s0, t1) + get_corner(s0, t0);
}
