/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Markers searched for in a picture: OpenCV's squares, its and our own reading of them, corners
 * below a pixel; where markers that are looked for are missing, small ones too.
 */
#ifndef GN_CLIENT_TRACK_SEARCH_H
#define GN_CLIENT_TRACK_SEARCH_H

#include "client/track/edges.h"
#include "client/track/reader.h"
#include "client/vision/markers.h"

/** Most markers in a picture. */
#define GN_SEARCH_MAX_FOUND 1024

struct gn_search_options {
    const struct gn_camera *camera; // borrowed until the search is destroyed
    int dictionary;                 // index into GN_MARKER_DICTIONARIES
    const int *ids;                 // those looked for; copied
    int n_ids;
};

/** Ways to look at a picture, bits. The last three are WHOLE's parts, each a third of its cost:
 * what is dark in surroundings of 3, 13 and 23 px. A marker is mostly found by the last two alike.
 */
enum gn_search_look {
    GN_SEARCH_WHOLE = 1,
    GN_SEARCH_SMALL = 2, // for cells from 3 px down to 1.2 px, as dear as WHOLE
    GN_SEARCH_FINE = 4,
    GN_SEARCH_MIDDLE = 8,
    GN_SEARCH_COARSE = 16,
};

/** What is in a picture. */
struct gn_search_finds {
    int n_found;
    int n_coarse; // whose corners are OpenCV's, good to half a pixel
    struct gn_marker_sighting found[GN_SEARCH_MAX_FOUND];
};

/** Thread-safety: unsafe. */
struct gn_search;

/** Returns 0, -ENOSYS (no OpenCV), -EINVAL (no such dictionary), -ENOMEM or -EIO, and a sentence.
 */
GN_MUST_USE int gn_search_create(const struct gn_search_options *options,
                                 struct gn_search **out_search, struct gn_error *out_error);
/** NULL-safe; nulls *search. */
void gn_search_destroy(struct gn_search **search);

/**
 * Finds the dictionary's markers in window (NULL: everywhere) of a picture of the camera's: each
 * once, but an id as often as it is there. Ids that are not looked for are found where OpenCV
 * reads them. looks: some of gn_search_look, SMALL only where not all ids are found by the others.
 * Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_search_find(struct gn_search *search, const struct gn_grey *grey,
                               const struct gn_marker_window *window, unsigned looks,
                               struct gn_search_finds *out_finds, struct gn_error *out_error);

/**
 * Squares in which the last gn_search_find() read no marker of its dictionary, of the size that
 * OpenCV reads. Borrowed until the next.
 */
double (*gn_search_get_unread(struct gn_search *search, int *out_n))[4][2];

/** What a marker that is looked for looks like. NULL: it is not. */
const struct gn_pattern *gn_search_get_pattern(const struct gn_search *search, int id);

#endif
