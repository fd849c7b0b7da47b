/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Markers in the pictures of a fisheye. OpenCV looks for squares with straight sides, which a
 * fisheye bends: they are looked for in pinhole pictures made of it (rectify.h), and their edges
 * measured in one more that looks straight at them.
 */
#ifndef GN_CLIENT_CALIBRATE_FISHEYE_MARKERS_H
#define GN_CLIENT_CALIBRATE_FISHEYE_MARKERS_H

#include <stdbool.h>

#include "common/error.h"
#include "common/image.h"
#include "common/projection.h"
#include "proto/attr.h"

/** Of one picture. */
#define GN_FISHEYE_MAX_MARKERS 512

/** px of the fisheye's picture, per coordinate: a corner's error where edges were measured, and
 * where they could not be; more for markers with cells of more than some pixels. */
#define GN_FISHEYE_EDGE_ERROR_PX 0.03
#define GN_FISHEYE_COARSE_ERROR_PX 0.5

/** A marker seen. */
struct gn_fisheye_marker {
    int id;
    double dirs[4][3];       // of its corners, clockwise from its own top left, the probe's frame
    double corners_px[4][2]; // the same in the picture
    double width_px;         // mean side
    double error_rad;        // to be expected of a corner, on each of two axes
    bool is_coarse;          // its edges could not be measured: good to half a pixel
};

/** Thread-safety: unsafe. */
struct gn_fisheye_finder;

/** projection: initialised, copied. dictionary: of GN_MARKER_DICTIONARIES. Returns 0, -ENOSYS (no
 * OpenCV), -EINVAL, -ENOMEM or -EIO, and a sentence. */
GN_MUST_USE int gn_fisheye_finder_create(const struct gn_projection *projection, int dictionary,
                                         struct gn_fisheye_finder **out_finder,
                                         struct gn_error *out_error);
/** NULL-safe; nulls *finder. */
void gn_fisheye_finder_destroy(struct gn_fisheye_finder **finder);

/**
 * Finds the dictionary's markers in linear light (1 channel, the projection's size). An id that is
 * seen at two places is left out: neither may be the right one; *out_n_twice (may be NULL) counts
 * these. out_markers has GN_FISHEYE_MAX_MARKERS. Returns how many, or -ENOMEM, -EIO and a
 * sentence.
 */
GN_MUST_USE int gn_fisheye_finder_find(struct gn_fisheye_finder *finder,
                                       const struct gn_image *light,
                                       struct gn_fisheye_marker *out_markers, int *out_n_twice,
                                       struct gn_error *out_error);

#endif
