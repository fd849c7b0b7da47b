/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Writes what was calibrated into a device's file, camera.json or probe.json (docs/frames.md): only
 * the keys that were found change, so that intrinsics, response and geometry add up in one file.
 */
#ifndef GN_CLIENT_CALIBRATE_DEVICE_FILE_H
#define GN_CLIENT_CALIBRATE_DEVICE_FILE_H

#include <stdbool.h>

#include <jansson.h>

#include "client/calibrate/curve_fit.h"
#include "common/error.h"
#include "common/pose.h"
#include "common/projection.h"
#include "proto/attr.h"

/** Numbers to write, 9 digits each. Returns a new reference, NULL without memory. */
json_t *gn_device_file_make_numbers(const double *values, int n);

/** The response object of a curve: "log" as it is, "linear" as a table where its dark is not 0. */
json_t *gn_device_file_make_curve(const struct gn_curve *curve);

/**
 * Takes found, an object, and lays its members over those of the file at path, which is made where
 * there is none; a member that is null is removed. A file that has what a camera or a probe needs
 * is read back before it is written. Steals the reference. Returns 0, or a negative errno and a
 * sentence; the file is untouched then.
 */
GN_MUST_USE int gn_device_file_update(const char *path, json_t *found, struct gn_error *out_error);

#endif
