/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Which dictionary the markers in the pictures are of, where none of the one that is looked for is
 * seen: squares read with all dictionaries at once.
 */
#ifndef GN_CLIENT_TRACK_FOREIGN_H
#define GN_CLIENT_TRACK_FOREIGN_H

#include "client/track/quad.h"
#include "proto/attr.h"

/** Most markers kept. */
#define GN_FOREIGN_MAX_IDS 16

/** Markers of one dictionary; ids have at most five digits. */
struct gn_foreign_finds {
    int dictionary; // the smallest of its family that has all ids
    int n_ids;
    int ids[GN_FOREIGN_MAX_IDS]; // rising
};

/** Thread-safety: unsafe. */
struct gn_foreign;

/** Returns 0 or -ENOMEM. It takes tens of milliseconds. */
GN_MUST_USE int gn_foreign_create(struct gn_foreign **out_foreign);
/** NULL-safe; nulls *foreign. */
void gn_foreign_destroy(struct gn_foreign **foreign);

/** Reads the squares of a picture (clockwise, good to half a cell). Some milliseconds. */
void gn_foreign_look(struct gn_foreign *foreign, const struct gn_grey *grey, double (*quads)[4][2],
                     int n_quads);

/** The dictionary that most markers are of; those of 16 cells count when they were read in two
 * pictures, or with ids below 50 in the only one. False where there are none. */
bool gn_foreign_get(const struct gn_foreign *foreign, struct gn_foreign_finds *out);

#endif
