/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A marker followed from picture to picture without searching: its edges are looked for where they
 * should be by now, and its cells must be the ones they were. It costs a fiftieth of a search.
 */
#ifndef GN_CLIENT_TRACK_FOLLOW_H
#define GN_CLIENT_TRACK_FOLLOW_H

#include <stdbool.h>

#include "client/track/edges.h"
#include "client/track/pattern.h"

/**
 * Moves corners_px, where the corners are expected, to where they are: within about 2 px, or half
 * a cell of a small one. Returns false where the edges are not there, more than a twentieth of the
 * cells are not as they should be, or a small one is not like its pattern.
 */
bool gn_follow_marker(const struct gn_grey *grey, const struct gn_camera *camera,
                      const struct gn_pattern *pattern, double corners_px[4][2]);

#endif
