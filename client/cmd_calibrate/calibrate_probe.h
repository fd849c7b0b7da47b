/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The parts of `gnomon calibrate probe`: circle and ball, lamps, markers, and the picture of what
 * was found. Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_PROBE_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_PROBE_H

#include <stdbool.h>

#include "client/calibrate/fisheye.h"
#include "client/calibrate/fisheye_markers.h"
#include "client/calibrate/probe_pose.h"
#include "client/calibrate/spots.h"
#include "client/capture/file.h"
#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_lamps.h"
#include "client/track/bodies.h"
#include "common/device_json.h"
#include "common/error.h"
#include "common/image.h"
#include "common/options.h"
#include "proto/attr.h"

/** A marker that a picture shows. */
struct gn_probe_marker {
    struct gn_fisheye_marker seen;
    int picture;
    int sighting; // its index, -1: nothing says where it is in the world
};

/** One run of the command. Zeroed but for program and options. */
struct gn_probe_run {
    const struct gn_program *program; // for news of a camera
    const struct gn_options *options;
    struct gn_probe_setup setup;
    struct gn_file_list list;
    struct gn_image first; // codes, 1 channel, of all pictures the largest: circle, ball, picture
    struct gn_image first_light; // the same of linear light
    struct gn_image live;        // linear light of a camera's picture, which cannot be read again
    double step;                 // of codes, 0: linear light
    bool has_circle;
    struct gn_circle circle; // found, or where the ball was looked for
    double mask[3];          // x, y, radius; radius 0: none
    bool has_pose;
    struct gn_pose world_from_probe;

    int n_lamps, n_candidates, n_matched;
    struct gn_lamp lamps[GN_LAMPS_MAX];
    struct gn_fisheye_puzzle candidates[GN_FISHEYE_MAX_CANDIDATES];
    struct gn_fisheye_sighting matched[GN_FISHEYE_MAX_CANDIDATES];

    struct gn_bodies bodies;
    int n_markers, n_sightings;
    struct gn_probe_marker markers[GN_PROBE_POSE_MAX_SIGHTINGS];
    struct gn_probe_sighting sightings[GN_PROBE_POSE_MAX_SIGHTINGS];
};

/** The text of an option, NULL; and whether it was said. */
const char *gn_probe_run_get(const struct gn_probe_run *run, const char *key);
bool gn_probe_run_has(const struct gn_probe_run *run, const char *key);

/** Reads all pictures, or takes the camera's, and looks for lamps in each where there are any. Each
 * of these returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_probe_run_read_all(struct gn_probe_run *run, struct gn_error *out_error);

/** Picture i again as linear light, 1 channel, which the caller finishes; a camera's just once. */
GN_MUST_USE int gn_probe_run_read_light(struct gn_probe_run *run, int i, struct gn_image *out,
                                        struct gn_error *out_error);

/** --find-circle and --ball: into the projection, and the mask. */
GN_MUST_USE int gn_probe_run_find_circle(struct gn_probe_run *run, struct gn_error *out_error);

/** --lamps: reads the file; pairs a picture's spots with lamps; the orientation from all pairs. */
GN_MUST_USE int gn_probe_run_read_lamps(struct gn_probe_run *run, struct gn_error *out_error);
GN_MUST_USE int gn_probe_run_look_for_lamps(struct gn_probe_run *run, int picture,
                                            const struct gn_image *light,
                                            struct gn_error *out_error);
GN_MUST_USE int gn_probe_run_fit_lamps(struct gn_probe_run *run, struct gn_error *out_error);

/** --markers, --marker: what is wrong with them and the rest, NULL: nothing. */
const char *gn_probe_run_find_marker_misuse(const struct gn_probe_run *run);
/** Reads what markers there are; finds them in all pictures, and the probe's pose from them. */
GN_MUST_USE int gn_probe_run_read_markers(struct gn_probe_run *run, struct gn_error *out_error);
GN_MUST_USE int gn_probe_run_fit_markers(struct gn_probe_run *run, struct gn_error *out_error);

/** --picture: all that was found so far, drawn into the first pictures. */
GN_MUST_USE int gn_probe_run_draw(const struct gn_probe_run *run, const char *path,
                                  struct gn_error *out_error);

#endif
