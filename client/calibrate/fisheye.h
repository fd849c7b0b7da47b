/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where a probe looks, and what its lens is like, from spots whose directions in the world are
 * known. Thread-safety: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_FISHEYE_H
#define GN_CLIENT_CALIBRATE_FISHEYE_H

#include "common/error.h"
#include "common/pose.h"
#include "common/projection.h"
#include "proto/attr.h"

#define GN_FISHEYE_MAX_SIGHTINGS 512

/** A lamp seen: where in the picture, and its unit direction in the world. */
struct gn_fisheye_sighting {
    double xy[2];
    double dir_world[3];
    double error_deg; // out
};

/**
 * The rotation that carries the directions seen to those of the world best (Wahba 1965), without
 * translation. *out_spread: how well they determine it, 0: not. Returns 0 or -EDOM.
 */
GN_MUST_USE int gn_fisheye_find_orientation(const struct gn_projection *projection,
                                            const struct gn_fisheye_sighting *sightings, int n,
                                            struct gn_pose *out, double *out_spread);

/** What may move besides the orientation. Each needs more lamps, spread over the picture. */
enum {
    GN_FISHEYE_CENTER = 1, // 2 numbers
    GN_FISHEYE_RADIUS = 2, // 1: the radius at theta_max
    GN_FISHEYE_LENS = 4,   // 4: the model becomes Kannala-Brandt's polynomial
};

struct gn_fisheye_fit {
    struct gn_projection projection;
    struct gn_pose world_from_probe; // no translation
    double rms_deg, worst_deg;
    double uncertainty_deg; // standard deviation of the orientation's worst axis
    double condition;       // of the last step's matrix, columns scaled
};

/** Of a fit; a lens's five odd powers of theta are alike by nature and reach 1e3 with lamps all
 * over the picture. */
#define GN_FISHEYE_MAX_CONDITION 1e4

/**
 * Orientation by SVD (Wahba), then orientation and what `moves` says together by Gauss-Newton with
 * damping (Levenberg 1944), by QR. projection: initialised, radial. Returns 0, or -EDOM and a
 * sentence: fewer than two directions, directions nearly on one line, lens not determined by
 * these lamps. How far each is off is told, not judged.
 */
GN_MUST_USE int gn_fisheye_fit(const struct gn_projection *projection, int moves,
                               struct gn_fisheye_sighting *sightings, int n,
                               struct gn_fisheye_fit *out_fit, struct gn_error *out_error);

/** A spot, and a light that it may be. */
struct gn_fisheye_puzzle {
    double xy[2];        // px, of the spot
    double dir_world[3]; // of the light
    int picture;         // that shows the spot
};

/** An orientation that explains as many spots is taken for worse where it is worse by this RMS. */
#define GN_FISHEYE_MIN_CONTRAST_DEG 0.5

/** Pairs of spots and lights that are matched. */
#define GN_FISHEYE_MAX_CANDIDATES 4096

/**
 * Finds which spot is which light over all pictures together: every pair of candidates that lie
 * apart gives an orientation; the one that explains most of them within tolerance_deg wins. Of a
 * picture's spots near one light, and of lights near one spot, only the nearest counts then: flares
 * stay out. candidates[n]: all pairs of a picture's spots and lights. out_sightings has room for n.
 * n in [0, GN_FISHEYE_MAX_CANDIDATES]. It takes some seconds at most: where pairs are too many, one
 * in *out_stride is tried, else that is 1. Returns how many sightings; -EDOM and a sentence where
 * there are not two, or where another orientation explains as many about as well; or -ENOMEM.
 */
GN_MUST_USE int gn_fisheye_match(const struct gn_projection *projection,
                                 const struct gn_fisheye_puzzle *candidates, int n,
                                 double tolerance_deg, struct gn_fisheye_sighting *out_sightings,
                                 int *out_stride, struct gn_error *out_error);

#endif
