/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Markers read from squares that OpenCV found and could not read: light between pixels, all of the
 * pattern, and only the ids that are looked for.
 */
#ifndef GN_CLIENT_TRACK_READER_H
#define GN_CLIENT_TRACK_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "client/track/pattern.h"
#include "client/vision/markers.h"
#include "proto/attr.h"

/** Immutable after create. */
struct gn_reader;

/** For these ids of a dictionary; n_ids may be 0. Returns 0, or -ENOMEM. */
GN_MUST_USE int gn_reader_create(int dictionary, const int *ids, int n_ids,
                                 struct gn_reader **out_reader);
/** NULL-safe; nulls *reader. */
void gn_reader_destroy(struct gn_reader **reader);

/** What a marker of the reader's looks like. NULL: none of its ids. */
const struct gn_pattern *gn_reader_get_pattern(const struct gn_reader *reader, int id);

/**
 * Which marker has these corners (clockwise as they are seen, within about half a cell): writes its
 * id and corners, from its own top left. False: none of the reader's.
 */
bool gn_reader_read(const struct gn_reader *reader, const struct gn_grey *grey,
                    double corners_px[4][2], struct gn_marker_sighting *out);

#endif
