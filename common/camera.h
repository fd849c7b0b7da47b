/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The pinhole camera with Brown-Conrady distortion that takes the pictures virtual objects are
 * composited into. Camera frame: x right, y down, z along the optical axis. Pixel centres at
 * half-integers, so the principal point of an ideal w x h camera is (w/2, h/2). Thread-safety of
 * all functions: safe.
 */
#ifndef GN_COMMON_CAMERA_H
#define GN_COMMON_CAMERA_H

#include <stdbool.h>

#include "common/error.h"
#include "common/match.h"
#include "common/pose.h"
#include "common/response.h"
#include "proto/attr.h"

/** One camera: size, intrinsics, response, pose. A value; make it valid with gn_camera_check. */
struct gn_camera {
    int width;                   // px, [1, GN_IMAGE_MAX_SIDE]
    int height;                  // px
    double fx, fy;               // px, > 0
    double cx, cy;               // px
    double distortion[5];        // k1, k2, p1, p2, k3 (OpenCV's order), 1
    struct gn_response response; // default sRGB, identity matrix, scale 1
    struct gn_match match;       // default no noise, no blur
    struct gn_pose world_from_camera;
};

/**
 * Checks every range and finiteness. Returns 0, or -EINVAL and a sentence (static string) in
 * *out_reason (may be NULL).
 */
GN_MUST_USE int gn_camera_check(const struct gn_camera *camera, const char **out_reason);

/**
 * Unit direction in the camera frame through picture position (x, y) px, distortion undone (Newton
 * on the forward model). False where the distortion cannot be undone there.
 */
bool gn_camera_get_ray(const struct gn_camera *camera, double x, double y,
                       double out_dir_camera[static 3]);

/** Picture position px of a point in the camera frame. False for points at or behind the camera. */
bool gn_camera_project(const struct gn_camera *camera, const double point_camera[static 3],
                       double out_xy[static 2]);

/**
 * Reads camera.json (docs/frames.md): width, height, fx, fy, cx, cy, distortion[5],
 * world_from_camera[16 row-major], optional response, to_rec709, scale, noise, blur. On failure,
 * also where the pose is missing, returns a negative errno and one sentence in *out_error (may be
 * NULL).
 */
GN_MUST_USE int gn_camera_read_file(const char *path, struct gn_camera *out_camera,
                                    struct gn_error *out_error);

#endif
