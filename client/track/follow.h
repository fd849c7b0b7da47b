/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A marker followed from picture to picture without searching: its edges are looked for where they
 * should be by now, and its cells must be the ones they were. It costs a fiftieth of a search.
 */
#ifndef GN_CLIENT_TRACK_FOLLOW_H
#define GN_CLIENT_TRACK_FOLLOW_H

#include <stdbool.h>
#include <stdint.h>

#include "client/track/edges.h"

/** What a marker looks like: white[cells][cells] from its own top left, 1: white. */
struct gn_follow_pattern {
    int cells;
    const uint8_t *white; // borrowed
};

/**
 * Moves corners_px, where the corners are expected, to where they are: within about 2 px. Returns
 * false where the edges are not there or more than a twentieth of the cells are not as they should
 * be.
 */
bool gn_follow_marker(const struct gn_grey *grey, const struct gn_camera *camera,
                      const struct gn_follow_pattern *pattern, double corners_px[4][2]);

#endif
