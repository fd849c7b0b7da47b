/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Irradiance of any normal: bright compact lights exactly, what they leave by spherical harmonics.
 */
#ifndef GN_SERVER_LIGHT_IRRADIANCE_H
#define GN_SERVER_LIGHT_IRRADIANCE_H

#include <stdbool.h>

#include "common/image.h"
#include "server/light/compact.h"
#include "server/light/sh.h"

/** Most compact lights that are taken out of the harmonics. */
#define GN_IRRADIANCE_MAX_LIGHTS GN_COMPACT_MAX

/** All-zero is the default. */
struct gn_irradiance_options {
    int order;        // of the harmonics, 2 or 4; default 4
    bool dering;      // window them so that they are nowhere negative
    bool keep_lights; // leave compact lights in the harmonics, as in the paper
};

/** One light that is taken out. */
struct gn_irradiance_light {
    double dir_world[3];
    double irradiance[3]; // at normal incidence, W/m^2
};

/** E(n) = harmonics + sum of max(0, n . d) over the lights. A value. Thread-safety: immutable. */
struct gn_irradiance {
    int order;               // 2 or 4; 0: there is none
    double sh[GN_SH_MAX][3]; // A_l w_l L_lm of the light that the lights leave
    double lambda;           // window w_l = 1 / (1 + lambda l^2 (l + 1)^2); 0: none
    double min_luminance;    // W/m^2, the smallest of the harmonics' E before the window
    int n_lights;
    struct gn_irradiance_light lights[GN_IRRADIANCE_MAX_LIGHTS];
};

/**
 * From L_lm of all light and the lights in it, the brightest first: the low bands of all light stay
 * as they are, the lights' higher bands come in addition. A light counts as a point: where the disc
 * of angular radius r that it stands for meets the horizon, E is off by at most 2 r / (3 pi) of its
 * irradiance. Lights beyond GN_IRRADIANCE_MAX_LIGHTS stay in the harmonics. dering: the smallest
 * lambda for which the harmonics' luminance is nowhere negative.
 * Source of the window: Sloan, "Stupid Spherical Harmonics (SH) Tricks", GDC 2008.
 */
void gn_irradiance_init(struct gn_irradiance *irradiance, int order, const double sh[][3],
                        const struct gn_irradiance_light *lights, int n_lights, bool dering);

/**
 * Both of a map: L_lm of all its light, and the irradiance. options may be NULL; a bad order is our
 * bug (assert). Same bits whatever the pool's size. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_irradiance_init_from_map(struct gn_irradiance *irradiance,
                                            double out_sh[static GN_SH_MAX][3],
                                            const struct gn_radiance_map *map,
                                            const struct gn_irradiance_options *options,
                                            struct gn_pool *pool);

/**
 * What the irradiance becomes where the light follows the frames: sh is L_lm as it is now; the
 * lights are the frame's, with that share [0, 1] of their power, and the previous ones' (NULL:
 * none) with the rest, one where both mean the same.
 */
void gn_irradiance_follow(struct gn_irradiance *irradiance, const struct gn_irradiance *previous,
                          double share, const double sh[][3], bool dering);

/** E(n), W/m^2 (not divided by pi), clamped at 0; normal unit, world. */
void gn_irradiance_get(const struct gn_irradiance *irradiance, const double normal[static 3],
                       double out_irradiance[static 3]);

/** Wide enough that a bilinear look-up is within 0.5 % of band 2. */
#define GN_IRRADIANCE_MAP_WIDTH 64

/**
 * E of the lat-long directions (axes of common/projection.h, in world). map inited by the call.
 * Returns as gn_image_init.
 */
GN_MUST_USE int gn_irradiance_make_map(const struct gn_irradiance *irradiance, int width,
                                       int height, struct gn_image *out_map);

#endif
