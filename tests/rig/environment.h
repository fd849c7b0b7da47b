/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's light: a lat-long map of constant texels around the scene, infinitely far or painted on
 * the inside of a sphere, with exact sampling. Written apart from server/light.
 * Lat-long: row 0 is +z, the middle looks along +x, the right half towards -y (DESIGN's axes).
 */
#ifndef GN_TESTS_RIG_ENVIRONMENT_H
#define GN_TESTS_RIG_ENVIRONMENT_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/pool.h"
#include "proto/attr.h"

/** Lamps of the procedural room. */
#define GN_RIG_LAMPS 4

/** Texels brighter than this multiple of the map's mean are bright. */
#define GN_RIG_BRIGHT 3.0

/**
 * Light around the scene. Its bright texels (lamps, the sun) are for sampling by importance, the
 * dim rest for rays that leave a surface in proportion to the cosine: each texel belongs to one
 * way. Thread-safety: immutable after init.
 */
struct gn_rig_environment {
    struct gn_image map; // [height][width][3 RGB] radiance, finite, >= 0; owned
    double distance;     // m, radius of the sphere around the marker; 0: infinitely far
    double threshold;    // a texel is bright where its channels' sum exceeds this
    double *row_cdf;     // [height + 1], owned
    double *column_cdf;  // [height][width + 1], owned
};

/** A direction chosen in proportion to the bright light from there. */
struct gn_rig_light_sample {
    double dir[3];          // unit, from the point to the light
    double distance;        // m; INFINITY for distant light
    double radiance[3];     // towards the point
    double pdf_solid_angle; // 1/sr, seen from the point
};

/**
 * Takes the pixels of *map (zeroed for the caller) and builds the tables. NaN and negative texels
 * become 0, infinite ones the largest finite float. Texels more than 4 degrees below the horizon
 * get a fiftieth of their share of the samples: the table hides them from nearly everything.
 * Returns 0, -EINVAL (not 3 channels, distance not finite or < 0), -ENOMEM; on failure
 * the map is still the caller's.
 */
GN_MUST_USE int gn_rig_environment_init(struct gn_image *map, double distance,
                                        struct gn_rig_environment *out_env,
                                        struct gn_error *out_error);
/** Frees everything and zeroes *env. */
void gn_rig_environment_finish(struct gn_rig_environment *env);

/** Solid angle of one texel of row y, sr: exact. */
double gn_rig_environment_get_texel_solid_angle(const struct gn_rig_environment *env, int y);

/** Radiance that reaches `point` from unit direction dir. True where it comes from a bright texel.
 */
bool gn_rig_environment_get_radiance(const struct gn_rig_environment *env,
                                     const double point[static 3], const double dir[static 3],
                                     double out_radiance[static 3]);
/** Distance to the light along dir, m; INFINITY for distant light or where dir leads away. */
double gn_rig_environment_get_distance(const struct gn_rig_environment *env,
                                       const double point[static 3], const double dir[static 3]);

/**
 * The direction that belongs to uv in [0, 1)^2: inversion of the marginal and conditional sums of
 * the bright texels. False where there are none, or outside the sphere of a near environment.
 */
bool gn_rig_environment_sample(const struct gn_rig_environment *env, const double point[static 3],
                               const double uv[static 2], struct gn_rig_light_sample *out_sample);
/** Density with which gn_rig_environment_sample chooses dir, 1/sr. */
double gn_rig_environment_get_pdf(const struct gn_rig_environment *env,
                                  const double point[static 3], const double dir[static 3]);

/** Irradiance of an unshadowed surface with unit normal, from distant light: the plain sum over
 * texels with the cosine at their centres. */
void gn_rig_environment_get_irradiance(const struct gn_rig_environment *env,
                                       const double normal[static 3],
                                       double out_irradiance[static 3]);

/** Turns a lat-long picture about +z by `turn` rad (right-handed) into *out_map, area-weighted. */
GN_MUST_USE int gn_rig_turn_map(const struct gn_image *map, double turn, struct gn_image *out_map);

/**
 * The lamp room: a box of four walls, a ceiling and a floor, with lamps 0 .. n_lamps - 1 switched
 * on, each a disc of a few degrees that also lights the walls around it. A texel has the mean
 * of 8 x 8 points near a lamp, else the radiance of its centre. Returns 0, -EINVAL, -ENOMEM.
 */
GN_MUST_USE int gn_rig_paint_lamp_room(int width, int height, int n_lamps, struct gn_pool *pool,
                                       struct gn_image *out_map);

#endif
