/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Square markers found in grey pictures, and poses of known points, by OpenCV: the C side of it.
 * Picture positions are ours (pixel centres at half-integers). Points in C and in C++.
 */
#ifndef GN_CLIENT_VISION_MARKERS_H
#define GN_CLIENT_VISION_MARKERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "common/error.h"
#include "proto/attr.h"

/** Names of the dictionaries, separated by '|'. */
#define GN_MARKER_DICTIONARIES                                                                     \
    "4x4_50|4x4_100|4x4_250|4x4_1000|5x5_50|5x5_100|5x5_250|5x5_1000|6x6_50|6x6_100|6x6_250|"      \
    "6x6_1000|7x7_50|7x7_100|7x7_250|7x7_1000|aruco_original|apriltag_16h5|apriltag_25h9|"         \
    "apriltag_36h10|apriltag_36h11"

/** Most cells of a marker's side, its black border among them. */
#define GN_MARKER_MAX_CELLS 9

/** "OpenCV 4.6.0", or why there is none (a static string). */
const char *gn_vision_get_version(void);
/** Whether this build has OpenCV. Without it every function below returns -ENOSYS, a sentence. */
bool gn_vision_is_built(void);

/** How OpenCV's corners are refined below a pixel. */
enum gn_marker_refinement {
    GN_MARKER_REFINE_NONE = 0, // crossings of lines through whole pixels
    GN_MARKER_REFINE_SUBPIX,   // Foerstner's corner in a window
    GN_MARKER_REFINE_CONTOUR,  // crossings of lines fitted to the contour
    GN_MARKER_REFINE_APRILTAG, // the AprilTag library's own quads; slow
};

/** One marker seen. Corners clockwise as they are seen, from the marker's own top left. */
struct gn_marker_sighting {
    int id;
    double corners[4][2]; // px: x right, y down
};

/** A rectangle of the picture, px. */
struct gn_marker_window {
    int x, y, width, height;
};

/** All-zero is the default: the first dictionary, no refinement. */
struct gn_marker_finder_options {
    int dictionary; // index into GN_MARKER_DICTIONARIES
    enum gn_marker_refinement refinement;
    bool is_small; // looks for cells of 1.2 to 4 px, in the picture at twice its size
    int window;    // of the mean that dark is told by, px, odd; 0: all of OpenCV's, 3, 13 and 23
};

/** Thread-safety: unsafe; OpenCV is kept to one thread. */
struct gn_marker_finder;

/** The index of a dictionary's name, -1 where there is none such. */
int gn_marker_find_dictionary(const char *name, size_t name_bytes);
/** Writes the name of a dictionary; "" where there is none such. */
void gn_marker_print_name(int dictionary, char *out, size_t out_bytes);
/** The number of ids of a dictionary. 0: no such dictionary, or no OpenCV. */
int gn_marker_count_ids(int dictionary);

/** Returns 0, -ENOSYS, -EINVAL (no such dictionary), -ENOMEM or -EIO, and a sentence. */
GN_MUST_USE int gn_marker_finder_create(const struct gn_marker_finder_options *options,
                                        struct gn_marker_finder **out_finder,
                                        struct gn_error *out_error);
/** NULL-safe; nulls *finder. */
void gn_marker_finder_destroy(struct gn_marker_finder **finder);

/**
 * Finds the dictionary's markers in window (NULL: everywhere) of grey[height][width]: those it
 * sees, at most max_sightings, in no order; a marker's black border counts to its corners.
 * Returns 0, -EINVAL (the picture), -ENOMEM or -EIO, and a sentence.
 */
GN_MUST_USE int gn_marker_finder_find(struct gn_marker_finder *finder, const uint8_t *grey,
                                      int width, int height, const struct gn_marker_window *window,
                                      int max_sightings, struct gn_marker_sighting *out_sightings,
                                      int *out_n_sightings, struct gn_error *out_error);

/**
 * Squares that could be markers and were not read in the last search, at most max_quads, corners
 * clockwise from any. Returns how many.
 */
int gn_marker_finder_get_unread(const struct gn_marker_finder *finder, int max_quads,
                                double (*out_quads)[4][2]);

/**
 * A marker's cells from its top left, 1: white, its black border included. out_cells has
 * GN_MARKER_MAX_CELLS squared bytes, of which the first side times side are filled.
 * Returns the side in cells; 0: no such marker, or no OpenCV.
 */
int gn_marker_get_cells(int dictionary, int id, uint8_t *out_cells);

/** A guess at a pose: rotation and translation that map object points into the camera frame. */
struct gn_vision_pose {
    double rotation[9]; // row-major
    double translation[3];
};

/**
 * Poses from which points_object[n][3] in m are seen at rays[n][2] (x/z, y/z in the camera frame,
 * lens distortion undone): for points in one plane both of IPPE's (Collins and Bartoli 2014), the
 * one that fits better first, else one by SQPnP (Terzakis and Lourakis 2020). n in [4, 4096].
 * Returns how many, 1 or 2; 0 where the points tell none; or -ENOSYS, -EINVAL, -ENOMEM, -EIO and a
 * sentence.
 */
GN_MUST_USE int gn_vision_solve_pose(const double *points_object, const double *rays, int n,
                                     bool is_planar, struct gn_vision_pose *out_poses,
                                     struct gn_error *out_error);

#ifdef __cplusplus
}
#endif

#endif
