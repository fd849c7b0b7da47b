/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The pose of a rigid body from points of it that are seen in a picture: OpenCV's IPPE or SQPnP to
 * begin with, then least squares of the distances in the picture, in double, with the expected
 * error of the answer.
 */
#ifndef GN_CLIENT_TRACK_POSE_FIT_H
#define GN_CLIENT_TRACK_POSE_FIT_H

#include <stdbool.h>

#include "common/camera.h"
#include "common/error.h"
#include "common/pose.h"
#include "proto/attr.h"

#define GN_POSE_FIT_MAX_POINTS 4096

/** One pose that points allow. */
struct gn_pose_fit {
    struct gn_pose camera_from_body;
    double sum_px2; // of squared distances in the picture
    double rms_px;  // per coordinate
    /**
     * Standard deviations to be expected, by error_px in each coordinate of each point:
     * sqrt(trace) of the blocks of error_px^2 (J^T J)^-1. Translation in the camera frame.
     */
    double error_m;
    double error_rad;
};

/**
 * The poses from which points_body[n][3], m, are seen at seen_px[n][2]: two where the points lie in
 * one plane and both of its poses are in front of the camera and differ, the better one first.
 * n in [4, GN_POSE_FIT_MAX_POINTS]; error_px > 0. Returns how many, [0, 2]; 0 where they allow
 * none; -ENOSYS (no OpenCV), -EINVAL, -ENOMEM or -EIO and a sentence.
 */
GN_MUST_USE int gn_pose_fit_points(const struct gn_camera *camera, const double (*points_body)[3],
                                   const double (*seen_px)[2], int n, double error_px,
                                   struct gn_pose_fit out_fits[static 2],
                                   struct gn_error *out_error);

#endif
