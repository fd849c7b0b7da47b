/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where the bodies with markers are in a camera's pictures: markers found, their corners refined,
 * poses fitted, the right one of two chosen, the answer made steady. Each picture's poses come of
 * that picture; a body that is not seen in it has none.
 */
#ifndef GN_CLIENT_TRACK_TRACKER_H
#define GN_CLIENT_TRACK_TRACKER_H

#include <stdbool.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "client/track/bodies.h"
#include "client/track/pose_filter.h"
#include "client/track/pose_fit.h"
#include "client/track/watch.h"
#include "common/camera.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** Least expected error of a corner, px per coordinate: what the refinement leaves on good
 * pictures. Where the corners fit their pose worse than that, what they say counts. */
#define GN_TRACKER_CORNER_ERROR_PX 0.02

struct gn_tracker_options {
    const struct gn_camera *camera;       // copied; a table of its response is borrowed
    const struct gn_bodies *bodies;       // borrowed until the tracker is destroyed
    bool is_raw;                          // no filter: each pose as it was measured
    bool is_live;                         // see gn_watch_create()
    struct gn_pose_filter_options filter; // all-zero: GN_POSE_FILTER_DEFAULTS
};

/** One body in the last picture. */
struct gn_tracked_body {
    bool is_seen;
    bool is_misfit; // its markers are not where they are listed, on one another; if by more than a
                    // tenth of their side, it is not seen
    struct gn_pose camera_from_body; // steady; as measured with is_raw
    struct gn_pose_fit fit;          // as measured
    int n_markers;                   // that it was measured by
};

/** What a tracker has counted. */
struct gn_tracker_counts {
    uint64_t n_pictures;
    uint64_t n_seen; // body times picture
    struct gn_watch_counts markers;
    uint64_t n_misfits;        // body times picture
    uint64_t n_flips_rejected; // see pose_choice.h
    uint64_t n_flips_corrected;
    uint64_t n_rest;         // steps from picture to picture at rest, over which:
    double rest_measured_m2; // sum of squared steps of the measured translations
    double rest_steady_m2;   // of the answers
    uint64_t n_moving;       // updates of the filter in motion, over which:
    double moving_lag_s;     // sum of the time by which the answer is behind
    double time_s;           // of the processor, altogether
};

/** Thread-safety: unsafe. */
struct gn_tracker;

/** Returns 0, -ENOSYS (no OpenCV), -EINVAL, -ENOMEM or -EIO, and a sentence. */
GN_MUST_USE int gn_tracker_create(const struct gn_tracker_options *options,
                                  struct gn_tracker **out_tracker, struct gn_error *out_error);
/** NULL-safe; nulls *tracker. */
void gn_tracker_destroy(struct gn_tracker **tracker);

/**
 * Looks at the picture, taken at time_ns (any monotonic clock). Returns how many bodies are seen,
 * or a negative errno and a sentence: -EBADMSG for a damaged picture, after which none is seen and
 * the next may come; others for one that is not of the camera's size or kind.
 */
GN_MUST_USE int gn_tracker_update(struct gn_tracker *tracker, const struct gn_capture *capture,
                                  int64_t time_ns, struct gn_error *out_error);

/** The body of that index in the last picture. Borrowed until the next update. */
const struct gn_tracked_body *gn_tracker_get_body(const struct gn_tracker *tracker, int body);

/** Where the camera was, in the frame of that body: the inverse. False where it was not seen. */
bool gn_tracker_get_camera(const struct gn_tracker *tracker, int body,
                           struct gn_pose *out_body_from_camera);

/** Where `body` was in the frame of `base`. False where either was not seen in the picture. */
bool gn_tracker_get_between(const struct gn_tracker *tracker, int base, int body,
                            struct gn_pose *out_base_from_body);

/**
 * Whether the last picture speaks against the list of the bodies: markers are not where it has
 * them; other ids, or another dictionary, where none of its own is seen.
 */
bool gn_tracker_is_doubtful(const struct gn_tracker *tracker);
/** Writes what does, as a sentence; false where nothing does. As slow as gn_misfit_explain(). */
bool gn_tracker_explain(const struct gn_tracker *tracker, char *out, size_t out_bytes);

void gn_tracker_get_counts(const struct gn_tracker *tracker, struct gn_tracker_counts *out);

/** The last picture in grey, with the corners that were found and the axes of the bodies drawn into
 * it (x red, y green, z blue). Returns 0, -ENOMEM, or -EINVAL before the first update. */
GN_MUST_USE int gn_tracker_draw(const struct gn_tracker *tracker, struct gn_image8 *out_rgb);

#endif
