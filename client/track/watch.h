/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The bodies' markers from picture to picture: followed where they were, searched for where that
 * fails or some are missing.
 */
#ifndef GN_CLIENT_TRACK_WATCH_H
#define GN_CLIENT_TRACK_WATCH_H

#include "client/track/bodies.h"
#include "client/track/foreign.h"
#include "client/track/search.h"

/** What a watch has counted, in pictures, and markers. */
struct gn_watch_counts {
    uint64_t n_followed;       // pictures that were not searched: see follow.h
    uint64_t n_searched_whole; // in which more than the markers' surroundings was searched
    uint64_t n_looks;          // at these, each with one window or at twice the size: the work
    uint64_t n_coarse_corners; // markers whose corners are OpenCV's
};

/** Thread-safety: unsafe. */
struct gn_watch;

/** Borrows camera and bodies until it is destroyed. is_live: no picture is to wait for the search
 * of the one before. Returns as gn_search_create(). */
GN_MUST_USE int gn_watch_create(const struct gn_camera *camera, const struct gn_bodies *bodies,
                                bool is_live, struct gn_watch **out_watch,
                                struct gn_error *out_error);
/** NULL-safe; nulls *watch. */
void gn_watch_destroy(struct gn_watch **watch);

/**
 * Looks at the next picture of the camera's, taken at time_ns. Where a marker was in sight in the
 * last half second each picture is searched, for small markers once in 100 ms; later it is once in
 * 150 ms, for small ones once in 300 ms, so that each is found again in a third of a second. Live
 * pictures share these searches then: one look each 100 ms, all four in 0.4 s. Three of them find a
 * marker that is not small.
 * Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_watch_update(struct gn_watch *watch, const struct gn_grey *grey, int64_t time_ns,
                                struct gn_error *out_error);

/**
 * The bodies' markers in the last picture, but those that are there twice: they tell nothing.
 * Borrowed until the next update.
 */
const struct gn_marker_sighting *gn_watch_get_sightings(const struct gn_watch *watch, int *out_n);

/** Markers of the bodies' dictionary in the last searched picture that no body has. */
const struct gn_foreign_finds *gn_watch_get_strangers(const struct gn_watch *watch);
/** Markers of other dictionaries, where none of the bodies' is seen. False where there are none. */
bool gn_watch_get_foreign(const struct gn_watch *watch, struct gn_foreign_finds *out);

void gn_watch_get_counts(const struct gn_watch *watch, struct gn_watch_counts *out);

#endif
