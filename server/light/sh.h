/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Spherical harmonics of the incoming light, order 2 (9 coefficients) or 4 (25), and the irradiance
 * they give.
 * Source: Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps",
 * SIGGRAPH 2001. Basis: real, orthonormal, without the Condon-Shortley sign; coefficient l (l + 1)
 * + m at its place: 00, 1-1, 10, 11, 2-2, ... 44.
 */
#ifndef GN_SERVER_LIGHT_SH_H
#define GN_SERVER_LIGHT_SH_H

#include "common/pool.h"
#include "server/light/radiance_map.h"

/** Coefficients of order 4, the highest. */
#define GN_SH_MAX 25

/** Number of coefficients of order 2 or 4. */
static inline int gn_sh_get_count(int order)
{
    return (order + 1) * (order + 1);
}

/** The basis' values in a unit direction. Thread-safety: safe, as all here. */
void gn_sh_get_basis(int order, const double dir[static 3], double out_basis[static GN_SH_MAX]);

/**
 * L_lm of the map's radiance in world axes, its fill included, in double; those above the order are
 * 0. Texels of a lat-long are integrated exactly, others by their centre and the first term of
 * their extent. Same bits whatever the pool's size. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_sh_project_map(const struct gn_radiance_map *map, int order,
                                  struct gn_pool *pool, double out_sh[static GN_SH_MAX][3]);

/** Adds a distant light: irradiance at normal incidence [3 RGB], W/m^2, times the basis. */
void gn_sh_add_light(int order, const double dir[static 3], const double irradiance[static 3],
                     double sh[static GN_SH_MAX][3]);

/** Turns coefficients from the axes a to b; b_from_a: a rotation, row-major. In place. */
void gn_sh_rotate(int order, const double b_from_a[static 9], double sh[static GN_SH_MAX][3]);

/**
 * A_l, by which the clamped cosine multiplies band l in [0, 4]: pi, 2 pi / 3, pi / 4, 0, -pi / 24.
 */
double gn_sh_get_cosine_factor(int l);

/**
 * Irradiance E(n) of L_lm, W/m^2 (not divided by pi), not clamped: may be negative by ringing. Only
 * the order's coefficients are read: 9 or 25.
 */
void gn_sh_get_irradiance(int order, const double sh[][3], const double normal[static 3],
                          double out_irradiance[static 3]);

#endif
