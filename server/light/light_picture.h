/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A picture of a lighting state for people: the tone-mapped map with its lights on it.
 */
#ifndef GN_SERVER_LIGHT_LIGHT_PICTURE_H
#define GN_SERVER_LIGHT_LIGHT_PICTURE_H

#include <stdbool.h>

#include "common/image.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "server/light/state.h"

/** Options; all-zero is the default. */
struct gn_light_picture_options {
    int width, height;  // px; default 512 x 256
    double exposure_ev; // stops on top of the automatic exposure; default 0
    bool no_lights;     // leave the discs out
    bool has_regions;   // draw the base division's borders
};

/**
 * A lat-long picture in world axes (common/projection.h), 8-bit sRGB, 3 channels. Exposure puts the
 * logarithmic mean luminance at a middle grey. Each light is a disc of its colour, its area as its
 * luminance, weak over strong. picture is inited by the call. Returns 0, -EINVAL for a size that
 * gn_image8_init refuses or an exposure outside [-60, 60], -ENOMEM.
 */
GN_MUST_USE int gn_light_picture_make(const struct gn_lighting_state *state,
                                      const struct gn_light_picture_options *options,
                                      struct gn_pool *pool, struct gn_image8 *out_picture);

#endif
