/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Faces of a cube map, as OpenEXR writes them (ImfEnvmap.h), turned to the axes of our lat-long: z
 * up. In the order of the file, with what lies right and up on each face seen from inside:
 *   0: +y, right +x, up +z    1: -y, right -x, up +z    2: +z, right +y, up +x
 *   3: -z, right +y, up -x    4: +x, right -y, up +z    5: -x, right +y, up +z
 * (OpenEXR's own names, y up: +X -X +Y -Y +Z -Z.)
 */
#ifndef GN_COMMON_CUBE_MAP_H
#define GN_COMMON_CUBE_MAP_H

enum { GN_CUBE_FACES = 6 };

/** Unit direction of point (s right, t up), both in [-1, 1], of that face. Thread-safety: safe. */
void gn_cube_map_to_direction(int face, double s, double t, double out_dir[static 3]);

/** The inverse, for a direction of any length but 0: the face, out_st[2] in [-1, 1]. */
int gn_cube_map_from_direction(const double dir[static 3], double out_st[static 2]);

/**
 * Where a walk over the cube's surface arrives that leaves the face over one edge: out_st[2] on the
 * face there. One of s and t is beyond [-1, 1], by at most 2, the other in it.
 */
int gn_cube_map_cross_edge(int face, double s, double t, double out_st[static 2]);

/**
 * Solid angle in sr of the part [s0, s1] x [t0, t1] of a face: G(s1, t1) - G(s1, t0) - G(s0, t1) +
 * G(s0, t0) with G(s, t) = atan2(s t, sqrt(s^2 + t^2 + 1)), the integral of
 * (1 + s^2 + t^2)^(-3/2).
 */
double gn_cube_map_get_solid_angle(double s0, double t0, double s1, double t1);

#endif
