/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's glossy surfaces and glass, written apart from server/render/ggx.h, by other formulas,
 * for the same surface: GGX facets with height-correlated shadowing and Schlick's Fresnel term of
 * f0 = mix(((ior - 1) / (ior + 1))^2, albedo, metallic), times 1 + f0 (1 - E) / E, over a diffuse
 * base of (1 - metallic) albedo (1 - R): E what the facets reflect of a uniform light where they
 * reflect all, R what the dielectric's do. Facets are drawn by their own distribution, not by what
 * is visible of them; E and R are integrals over it.
 */
#ifndef GN_TESTS_RIG_GLOSS_H
#define GN_TESTS_RIG_GLOSS_H

#include <stdbool.h>

#include "proto/attr.h"

/* Angles of the eye at which E is known, evenly over the quarter circle. */
#define GN_RIG_GLOSS_ANGLES 91

/* Thread-safety: immutable after create. */
struct gn_rig_gloss {
    double alpha, metallic, dielectric; // the last: f0 of the ior
    double whole[GN_RIG_GLOSS_ANGLES];  // E
    double edge[GN_RIG_GLOSS_ANGLES];   // of it, what goes with Schlick's fifth power
};

/* roughness (0, 1]. NULL: no memory. */
struct gn_rig_gloss *gn_rig_gloss_create(double roughness, double metallic, double ior);

/* The diffuse base's albedo as seen at that cosine. */
void gn_rig_gloss_get_base(const struct gn_rig_gloss *gloss, const double albedo[static 3],
                           double cosine, double out_base[static 3]);
/* Reflects the ray's unit direction at a facet drawn by uv about the unit normal, which faces the
 * ray; multiplies the weight. False: into the surface. */
bool gn_rig_gloss_reflect(const struct gn_rig_gloss *gloss, const double albedo[static 3],
                          const double normal[static 3], const double uv[static 2],
                          double io_dir[static 3], double io_weight[static 3]);

/* Reflects or refracts at smooth glass, by Fresnel's share of `choice` [0, 1). normal: unit, faces
 * the ray; ratio: the index beyond over the one before. True: through. */
bool gn_rig_glass_choose(const double normal[static 3], double ratio, double choice,
                         double io_dir[static 3]);

#endif
