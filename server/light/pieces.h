/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Emissive meshes cut into pieces: each a light of its own. The cuts depend on the geometry alone.
 */
#ifndef GN_SERVER_LIGHT_PIECES_H
#define GN_SERVER_LIGHT_PIECES_H

#include "common/error.h"
#include "proto/attr.h"
#include "server/light/piece_triangle.h"
#include "server/scene/scene.h"

/** Neighbouring triangles that face about the same way. */
struct gn_piece {
    uint32_t object;
    int first, n; // triangles
    int rank;     // among the object's pieces
    double area;  // m^2
    double normal[3];
};

/** All pieces of a scene, object by object. Caller's memory. */
struct gn_pieces {
    int n;
    struct gn_piece *pieces; // [n], owned
    int n_triangles;
    struct gn_piece_triangle *triangles; // [n_triangles], owned
};

/**
 * Cuts the emissive meshes of a scene into n_wanted pieces, more where the meshes face more ways
 * than that: first by the way the triangles face (six ways, about the sides of the largest
 * triangle), then always the piece with the most radiance times area squared into halves of equal
 * area across its longest extent. Returns 0, -E2BIG or -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_pieces_make(const struct gn_scene *scene, int n_wanted,
                               struct gn_pieces *out_pieces, struct gn_error *out_error);
/** Frees and zeroes. A zeroed one is fine. */
void gn_pieces_finish(struct gn_pieces *pieces);

/** The point of the piece's triangles nearest to p, moved off them by the clearance. */
void gn_piece_get_nearest(const struct gn_pieces *pieces, const struct gn_piece *piece,
                          const double p[static 3], double out_point[static 3]);

#endif
