/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The Utah teapot as a triangle mesh, from Newell's Bezier patches (1975) in the form that SGI
 * published with a bottom. z up, spout along +x, in the data's own units: z [0, 3.15], x about
 * [-3, 3.43], y [-2, 2].
 * The published surface has holes; three watertight bodies (pot, handle, spout) come of it: a flat
 * ring fills the slit between lid and rim, and flat caps close both ends of handle and spout.
 */
#ifndef GN_TESTS_RIG_TEAPOT_H
#define GN_TESTS_RIG_TEAPOT_H

#include "server/scene/mesh.h"

/** Bands of patches of the body of revolution, from the top, and the ring that we add. */
enum gn_rig_teapot_band {
    GN_RIG_TEAPOT_KNOB = 0,
    GN_RIG_TEAPOT_LID,
    GN_RIG_TEAPOT_RING, // ours
    GN_RIG_TEAPOT_RIM,
    GN_RIG_TEAPOT_UPPER,
    GN_RIG_TEAPOT_LOWER,
    GN_RIG_TEAPOT_BOTTOM,
    GN_RIG_TEAPOT_BANDS
};

/** How finely the patches are cut. */
struct gn_rig_teapot_options {
    int around;                     // segments around the body, multiple of 4, [8, 512]
    int along[GN_RIG_TEAPOT_BANDS]; // segments down each band, [1, 128]
    int tube_around;                // segments around handle and spout, even, [4, 256]
    int handle_along;               // segments along each of the handle's two patches, [1, 128]
    int spout_along;                // segments along each of the spout's two patches, [1, 128]
};

/** Few triangles: what the demo room uses. */
extern const struct gn_rig_teapot_options gn_rig_teapot_coarse;
/** A smooth one. */
extern const struct gn_rig_teapot_options gn_rig_teapot_fine;

/** Control points of one band: rows from the top down. Row (r, k, z) stands for the quarter turn
 * (r, 0, z) (r, k, z) (k, r, z) (0, r, z); the other three quarters are turned by 90 degrees. */
extern const double gn_rig_teapot_bands[GN_RIG_TEAPOT_BANDS][4][3];
/** Half sections (y <= 0) of the two patches, [patch][row along][point across][x, y, z]. */
extern const double gn_rig_teapot_handle[2][4][4][3];
extern const double gn_rig_teapot_spout[2][4][4][3];

/**
 * Cuts the patches into triangles: positions, unit normals from the surface's derivatives (the axis
 * at the poles), outward winding, no triangle of zero area. The caller finishes *out_mesh.
 * Returns 0, -EINVAL (options out of range), -ENOMEM. Thread-safety: safe.
 */
GN_MUST_USE int gn_rig_teapot_create(const struct gn_rig_teapot_options *options,
                                     struct gn_mesh *out_mesh);

#endif
