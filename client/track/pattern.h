/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A marker's whole pattern laid onto a picture. Where cells are so small that lens and pixels have
 * blurred them into each other, no edge is left to be measured, but all of them together still tell
 * where the marker is. Thread-safety: safe.
 */
#ifndef GN_CLIENT_TRACK_PATTERN_H
#define GN_CLIENT_TRACK_PATTERN_H

#include "client/track/quad.h"

/** What a marker looks like: white[cells][cells] from its own top left, 1: white. */
struct gn_pattern {
    int cells;
    const uint8_t *white; // borrowed
};

/**
 * Moves corners_px, from the marker's own top left, to where the picture differs least from the
 * pattern, blurred over a cell's width, times a gain plus an offset (Gauss and Newton's method on
 * linear light, the corners and both factors unknown). They are to be within half a cell of it.
 * Returns the correlation of picture and pattern then, at most 1; 0, and leaves the corners, where
 * they run away, leave the picture or the pattern is not there.
 */
double gn_pattern_fit(const struct gn_grey *grey, const struct gn_pattern *pattern,
                      double corners_px[4][2]);

#endif
