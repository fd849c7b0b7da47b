/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Triangles of emissive meshes: read, measured, cut. Thread-safety of all: safe.
 */
#ifndef GN_SERVER_LIGHT_PIECE_TRIANGLE_H
#define GN_SERVER_LIGHT_PIECE_TRIANGLE_H

#include "server/scene/scene.h"

/** A part of a mesh's triangle. */
struct gn_piece_triangle {
    double corners[3][3]; // m, world; counter-clockwise seen from where it sends light
    double uvs[3][2];
    double area;      // m^2, > 0
    double clearance; // m, of the mesh's whole triangle, as gn_rt_hit's
};

/** A triangle of the object's mesh, in world; area and clearance with it. */
void gn_piece_triangle_read(const struct gn_scene_object *object, int index,
                            struct gn_piece_triangle *out);

/** Twice the area, along the normal. */
void gn_piece_triangle_get_area_vector(const struct gn_piece_triangle *t, double out[static 3]);

/** Share [0, 1] of the area below the plane at height t, by its corners' heights s. */
double gn_piece_triangle_get_share(const double s[static 3], double t);

/** What lies on one side of the plane at height 0 (sign 1: below), as up to two triangles: their
 * number. */
int gn_piece_triangle_clip(const struct gn_piece_triangle *triangle, const double height[static 3],
                           double sign, struct gn_piece_triangle out_triangles[static 2]);

/** The point nearest to p: its plane's, where that lies inside, else a side's. Returns the squared
 * distance. */
double gn_piece_triangle_get_nearest(const struct gn_piece_triangle *t, const double p[static 3],
                                     double out[static 3]);

#endif
