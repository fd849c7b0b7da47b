/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Irradiance by spherical harmonics of order 2 (9 coefficients).
 * Source: Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps",
 * SIGGRAPH 2001. Basis: real, orthonormal, without the Condon-Shortley sign; order 00, 1-1, 10, 11,
 * 2-2, 2-1, 20, 21, 22.
 */
#ifndef GN_SERVER_LIGHT_SH_H
#define GN_SERVER_LIGHT_SH_H

#include "common/image.h"
#include "common/pool.h"
#include "server/light/radiance_map.h"

/** L_lm of the map's radiance in world axes, its fill included, in double. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_sh_project_map(const struct gn_radiance_map *map, struct gn_pool *pool,
                                  double out_sh[static 9][3]);

/** Irradiance E(n), W/m^2 (not divided by pi), not clamped: may be negative by ringing. */
void gn_sh_get_irradiance(const double sh[static 9][3], const double normal[static 3],
                          double out_irradiance[static 3]);

/**
 * E of the lat-long directions (axes of common/projection.h, in world), clamped at 0; 64 x 32 keeps
 * a bilinear look-up within 0.5 % of band 2. map inited by the call. Returns as gn_image_init.
 */
GN_MUST_USE int gn_sh_make_irradiance_map(const double sh[static 9][3], int width, int height,
                                          struct gn_image *out_map);

#endif
