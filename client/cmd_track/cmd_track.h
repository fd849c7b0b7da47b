/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The two halves of gnomon track: poses from a file or along a circle, and poses from markers.
 */
#ifndef GN_CLIENT_CMD_TRACK_CMD_TRACK_H
#define GN_CLIENT_CMD_TRACK_CMD_TRACK_H

#include "client/cmd.h"

/** With --markers or --marker. program: its options hold GN_FEED_PACE_OPTIONS, GN_LIVE_OPTIONS,
 * GN_POSES_OPTIONS, object, files, camera and predict-ms. Returns the exit status. */
int gn_cmd_track_camera(const struct gn_program *program, int argc, char *const argv[]);

#endif
