/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Reflection by rough surfaces: GGX microfacets (Trowbridge and Reitz, "Average irregularity
 * representation of a rough surface for ray reflection", JOSA 65, 1975; Walter et al., "Microfacet
 * Models for Refraction through Rough Surfaces", EGSR 2007, eqs. 33, 34) with height-correlated
 * Smith shadowing (Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs",
 * JCGT 3(2), 2014, eq. 99), over a diffuse base. From the eye's direction wo, with m the half
 * vector:
 *   f = gain F(wo . m) D(m) G2(wo, wi) / (4 cos_o cos_i) + base / pi,
 *   F = f0 + (1 - f0) (1 - wo . m)^5  (Schlick, "An Inexpensive BRDF Model", 1994),
 *   f0 = mix(((ior - 1) / (ior + 1))^2, albedo, metallic), as glTF 2.0 appendix B has it,
 *   gain = 1 + f0 (1 - E) / E  (Turquin, "Practical multiple scattering compensation for microfacet
 *   models", 2019): E(cos_o, alpha), the share that reflection sends back where F is 1, is what one
 *   reflection loses between facets; with it a white metal sends all,
 *   base = (1 - metallic) albedo (1 - what the dielectric's reflection sends back of a uniform
 *   light), so that a white dielectric sends all, too.
 * It is not reciprocal: gain and base know the eye's direction only, which all our paths start
 * from. alpha = roughness^2; below GGX_MIN_ALPHA it is a mirror.
 */
#ifndef GN_SERVER_RENDER_GGX_H
#define GN_SERVER_RENDER_GGX_H

#include <stdbool.h>

#include "proto/attr.h"
#include "server/scene/scene.h"

/** Below it a surface is taken for a perfect mirror. */
#define GGX_MIN_ALPHA 1e-3

/** A surface as seen from one direction. Thread-safety: immutable. */
struct ggx {
    double frame[3][3];  // rows: tangent, bitangent, shading normal; world, unit
    double wo[3];        // in that frame, unit, z > 0: towards the eye
    double alpha;        // 0: a mirror
    double f0[3];        // per channel
    double gain[3];      // of the reflection
    double reflected[3]; // share that the reflection sends back of a uniform light
    double base[3];      // the diffuse base's albedo
};

/** E and, of it, the part that goes with (1 - wo . m)^5; cos_o in [0, 1], alpha in
 * [GGX_MIN_ALPHA, 1]. */
void gn_ggx_get_albedo(double cos_o, double alpha, double *out_whole, double *out_fresnel);

/** The surface, of type ggx, as a ray of unit direction dir sees it. A shading normal that looks
 * away from the eye is turned until it just does not. */
void gn_ggx_init(const struct gn_surface *surface, const float dir[static 3], struct ggx *out_ggx);

/**
 * A direction by u[2] in [0, 1): reflection at a facet that the eye sees (Heitz, "Sampling the GGX
 * Distribution of Visible Normals", JCGT 7(4), 2018). out_weight[3]: f cos_i / its density, of the
 * reflection alone; *out_pdf, 1/sr: that density; INFINITY for a mirror. False: the direction is
 * under the shading horizon and carries nothing.
 */
bool gn_ggx_sample(const struct ggx *ggx, const double u[static 2], float out_dir[static 3],
                   double out_weight[static 3], double *out_pdf);

/** The reflection's f cos_i for a unit direction, and the density gn_ggx_sample has there; both 0
 * of a mirror and under the horizon. */
void gn_ggx_eval(const struct ggx *ggx, const float dir[static 3], double out_value[static 3],
                 double *out_pdf);

/** A facet's unit normal that a direction wo, z > 0, sees, in the surface's frame. */
void gn_ggx_sample_facet(const double wo[static 3], double alpha, const double u[static 2],
                         double out_facet[static 3]);
/** G1: the share of the facets towards w, z != 0, that are not hidden from there. */
double gn_ggx_get_visible(const double w[static 3], double alpha);
/** G2 / G1(wo) for two directions above the surface. */
double gn_ggx_get_unmasked(const double wo[static 3], const double wi[static 3], double alpha);

#endif
