/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where bodies with markers rest in the world, from pictures of a calibrated camera that show them
 * together with the world's own markers.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_PLACES_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_PLACES_H

#include <stdbool.h>

#include "client/track/bodies.h"
#include "common/error.h"
#include "common/pose.h"
#include "proto/attr.h"

/** Pictures that are taken. */
#define GN_PLACES_MAX_PICTURES 256
/** A place more uncertain than this is refused: rad. */
#define GN_PLACES_MAX_ERROR (0.5 / 57.29577951308232)

/** Where a body is; the world itself is known, exactly. A value. */
struct gn_body_place {
    bool is_known;
    struct gn_pose world_from_body;
    double error_rad, error_m; // standard deviations
    int n_pictures;            // that show both
};

/**
 * Measures the places of all bodies that the pictures (a folder, a file or a pattern) of the camera
 * (camera.json) show together with the body "world", each picture by itself: the mean of the poses
 * that agree, turned and moved from the middlemost by no more than three times their median
 * distance, or three of their errors. Says to standard output what was found.
 * out_places[GN_BODY_MAX_BODIES]. camera_path NULL: the world alone. Returns 0, or a negative errno
 * and a sentence: -EDOM where no picture shows the world and another body, where fewer than half of
 * the poses agree, or one is too uncertain.
 */
GN_MUST_USE int gn_places_find(const struct gn_bodies *bodies, const char *camera_path,
                               const char *pattern, struct gn_body_place *out_places,
                               struct gn_error *out_error);

#endif
