/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The equal-area octahedral map: the unit square to the sphere and back, every part of the square
 * with the same share of the 4 pi sr.
 */
#ifndef GN_COMMON_OCTAHEDRAL_H
#define GN_COMMON_OCTAHEDRAL_H

/**
 * Unit direction of the square's point (u, v), both in [0, 1]. The middle is +z, the corners are
 * -z, the inscribed diamond is the equator; u = 1 at v = 0.5 is +x, v = 1 at u = 0.5 is +y.
 *   r = |x| + |y| of the point in its quadrant, folded back at the equator; |z| = 1 - r^2.
 * Solid angle of any area A of the square: 4 pi A.
 * Source: Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD", 2008.
 * Thread-safety: safe.
 */
void gn_octahedral_to_direction(double u, double v, double out_dir[static 3]);

/** The inverse, for a direction of any length but 0; exact to rounding at the poles too. */
void gn_octahedral_from_direction(const double dir[static 3], double out_uv[static 2]);

#endif
