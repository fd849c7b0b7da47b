/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Rigid bodies with square markers on them, as a file or a command line describes them
 * (docs/frames.md, "Markers"). The body called "world" is the room's frame of reference.
 */
#ifndef GN_CLIENT_TRACK_BODIES_H
#define GN_CLIENT_TRACK_BODIES_H

#include <stdbool.h>

#include "common/error.h"
#include "proto/attr.h"

#define GN_BODY_MAX_BODIES 32
/** Of one body. */
#define GN_BODY_MAX_MARKERS 512
#define GN_BODY_NAME_BYTES 64
/** The name of the body that is the frame of reference. */
#define GN_BODY_WORLD "world"

/** A marker on a body. A value. */
struct gn_body_marker {
    int id;
    double corners_body[4][3]; // m; clockwise as one looks at it, from its own top left
};

/** A body. Its markers are the list's. */
struct gn_body {
    char name[GN_BODY_NAME_BYTES];
    int n_markers;
    struct gn_body_marker *markers; // [n_markers], owned
};

/** A file's bodies. Caller's memory, our arrays; zeroed is empty. Thread-safety: unsafe. */
struct gn_bodies {
    int dictionary; // index into GN_MARKER_DICTIONARIES
    int n_bodies;
    struct gn_body bodies[GN_BODY_MAX_BODIES];
};

/**
 * Reads a file of bodies. Ids are checked against the dictionary's size where this build knows it;
 * an id serves once. Returns 0, or a negative errno and a sentence; *out is empty then.
 */
GN_MUST_USE int gn_bodies_read_file(const char *path, struct gn_bodies *out,
                                    struct gn_error *out_error);

/**
 * "DICTIONARY:ID:SIZE": the world is this one marker, its middle the origin. Same returns.
 */
GN_MUST_USE int gn_bodies_read_text(const char *text, struct gn_bodies *out,
                                    struct gn_error *out_error);

/** Frees the markers and zeroes *bodies. */
void gn_bodies_finish(struct gn_bodies *bodies);

/** The index of the body of that name, -1: none. */
int gn_bodies_find(const struct gn_bodies *bodies, const char *name);

/** Which marker of which body has the id. False: none. */
bool gn_bodies_find_marker(const struct gn_bodies *bodies, int id, int *out_body, int *out_marker);

#endif
