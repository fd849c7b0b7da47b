/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Why markers are not where their file says: turned, too far apart, one of them elsewhere or of
 * another size.
 */
#ifndef GN_CLIENT_TRACK_MISFIT_H
#define GN_CLIENT_TRACK_MISFIT_H

#include <stddef.h>

#include "client/track/bodies.h"
#include "client/vision/markers.h"
#include "common/camera.h"

/** The most that the corners of markers of that side in the picture may be off their pose, px RMS,
 * for the pose to count as right; and to count at all. */
double gn_misfit_get_limit(double side_px);
double gn_misfit_get_gross_limit(double side_px);

/** Markers of a body in one picture. */
struct gn_misfit_view {
    const struct gn_camera *camera;
    const struct gn_body *body;
    const struct gn_marker_sighting *seen; // all of the body's
    int n_seen;                            // at most GN_BODY_MAX_MARKERS
};

/**
 * Writes what is wrong, as far as one thing explains it, as the end of a sentence. False where
 * nothing is, or memory is short. Takes 5 ms for a few markers, 0.1 s for 60. Thread-safety: safe.
 */
bool gn_misfit_explain(const struct gn_misfit_view *view, char *out, size_t out_bytes);

#endif
