/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What a clear dielectric's surface does with a ray: reflection and refraction, by Fresnel.
 */
#ifndef GN_SERVER_RENDER_GLASS_H
#define GN_SERVER_RENDER_GLASS_H

#include <stdbool.h>

#include "proto/attr.h"
#include "server/scene/scene.h"

/**
 * Share of unpolarised light that a smooth boundary reflects: the mean of
 *   ((n_i c_i - n_t c_t) / (n_i c_i + n_t c_t))^2 and ((n_i c_t - n_t c_i) / (n_i c_t + n_t
 * c_i))^2. Source: Born and Wolf, Principles of Optics, section 1.5.2. cos_i [0, 1]; ratio: n_t /
 * n_i, of the far side's index over the near side's. *out_cos_t: of the refracted ray; 0, and the
 * share 1, in total reflection.
 */
double gn_glass_get_fresnel(double cos_i, double ratio, double *out_cos_t);

/** A ray after the surface. */
struct glass_ray {
    float dir[3];     // unit, world
    double weight[3]; // share of the radiance that arrives from there; 0: there is no such ray
};

/**
 * Both ways on for a ray of unit direction dir that meets the surface, of type glass, at the facet
 * that u[2] chooses among those the ray sees; smooth glass (alpha below GGX_MIN_ALPHA) has one. The
 * mesh is closed: from its outside the ray enters the glass, from its inside it leaves. What is
 * carried is radiance over the index squared, which refraction leaves alone; so between two points
 * in air it is radiance. The albedo takes its share of what goes through. Rough glass is Walter et
 * al.'s, EGSR 2007, shadowing of both directions height-correlated where light is reflected and
 * independent where it goes through; what it sends from facet to facet is lost.
 */
void gn_glass_split(const struct gn_surface *surface, const float dir[static 3],
                    const double u[static 2], struct glass_ray *out_reflected,
                    struct glass_ray *out_refracted);

#endif
