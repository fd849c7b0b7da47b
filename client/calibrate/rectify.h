/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pinhole pictures made of a fisheye's: straight lines are straight in them, so that squares can be
 * looked for. Thread-safety: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_RECTIFY_H
#define GN_CLIENT_CALIBRATE_RECTIFY_H

#include <stdbool.h>

#include "common/image.h"
#include "common/projection.h"
#include "proto/attr.h"

/** px, of a view's side. */
#define GN_RECTIFY_MAX_SIDE 1200
/** Most views that gn_rectify_tile makes. */
#define GN_RECTIFY_MAX_VIEWS 64

/** Which pinhole picture. Square, its principal point in its middle; axes as a camera's. */
struct gn_rectified_view {
    double probe_from_view[9]; // row-major
    double focal;              // px
    int side;                  // px
};

/** A view along the unit direction, so wide that it reaches half_width (its tangent) from the
 * middle to each side; focal in px, less where the side would be above GN_RECTIFY_MAX_SIDE. */
void gn_rectify_aim(const double dir[static 3], double half_width, double focal,
                    struct gn_rectified_view *out_view);

/**
 * Views 90 degrees wide that overlap over all that the picture shows: what is up to 40 degrees wide
 * lies within one of them. They are half as fine again as the middle of the picture.
 * Returns how many.
 */
int gn_rectify_tile(const struct gn_projection *projection,
                    struct gn_rectified_view out_views[static GN_RECTIFY_MAX_VIEWS]);

/** The unit direction in the probe's frame of a position in the view, and back: false behind it. */
void gn_rectify_get_direction(const struct gn_rectified_view *view, const double xy[static 2],
                              double out_dir[static 3]);
bool gn_rectify_get_position(const struct gn_rectified_view *view, const double dir[static 3],
                             double out_xy[static 2]);

/**
 * Takes the view of a picture of linear light (1 channel) as codes of 8 bits on a logarithmic
 * scale, three decades at most, from the darkest to the lightest percent of what lies within `core`
 * (0, 1] of its middle, black where the picture shows nothing. A pixel that holds several of the
 * picture's is the mean of so many places. out_grey: initialised, 1 channel, of
 * side x side samples at least, which are written without a gap. out_linear: the light that each
 * code stands for, the largest 1. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_rectify_take(const struct gn_rectified_view *view,
                                const struct gn_projection *projection,
                                const struct gn_image *light, double core,
                                struct gn_image8 *out_grey, float out_linear[static 256]);

#endif
