/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Outlines of what is darker than its surroundings in a grey picture, and which of them could be
 * of a square: what cv::adaptiveThreshold and cv::findContours find, several times sooner, as most
 * of clutter is let go before it is stored.
 */
#ifndef GN_CLIENT_VISION_OUTLINES_H
#define GN_CLIENT_VISION_OUTLINES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "proto/attr.h"

/** What is looked at and for. */
struct gn_outlines_options {
    const uint8_t *grey; // [height][stride], borrowed for the call
    int width, height;   // [1, GN_IMAGE_MAX_SIDE]
    long stride;
    int window;                 // dark is what is darker than the mean of window x window pixels,
                                // odd, [3, 63]
    int min_points, max_points; // of an outline; min_points >= 4
    double tolerance;           // how far a square's outline may be off its sides, of its points
};

/** Thread-safety: unsafe. */
struct gn_outlines;

/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_outlines_create(struct gn_outlines **out_outlines);
/** NULL-safe; nulls *outlines. */
void gn_outlines_destroy(struct gn_outlines **outlines);

/**
 * Finds the outlines, outer ones and those of holes, that could be a square's: they enclose enough
 * for their length and follow four lines or a few more. Dark is what is at least 7 codes below the
 * mean; beyond the picture its border's pixels count. Returns how many points all outlines have,
 * those that were let go too: the measure of the work; or -ENOMEM.
 */
GN_MUST_USE long gn_outlines_find(struct gn_outlines *outlines,
                                  const struct gn_outlines_options *options);

/** How many outlines the last picture has. */
int gn_outlines_count(const struct gn_outlines *outlines);

/** The points of one, x and y of pixel centres, whole numbers. Borrowed until the next search. */
const int32_t (*gn_outlines_get(const struct gn_outlines *outlines, int i, int *out_n))[2];

#ifdef __cplusplus
}
#endif

#endif
