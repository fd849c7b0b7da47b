/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's cameras, written apart from common/camera and common/projection: the pinhole that takes
 * the pictures, and the fisheye or light probe that takes the light.
 * Camera and probe frames: x right, y down, z along the optical axis; pixel centres at
 * half-integers.
 */
#ifndef GN_TESTS_RIG_VIEW_H
#define GN_TESTS_RIG_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "common/image.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "tests/rig/environment.h"

/** The camera of one frame. */
struct gn_rig_view {
    int width, height;            // px
    double fx, fy, cx, cy;        // px
    double distortion[5];         // k1, k2, p1, p2, k3 of Brown and Conrady, OpenCV's order
    double world_from_camera[16]; // rigid, row-major
    double blur_px;               // deviation of a normal point spread, px; 0: none
};

/** What a sensor adds: the variance slope x + offset on linear values x, white at 1. */
struct gn_rig_noise {
    double slope, offset;
};

/** Unit world direction through picture position (x, y) px. */
void gn_rig_view_get_ray(const struct gn_rig_view *view, double x, double y,
                         double out_dir[static 3]);

/** A rigid matrix for a camera at `position` that looks at `target` with world +z upwards. */
void gn_rig_look_at(const double position[static 3], const double target[static 3],
                    double out_world_from_camera[static 16]);

/** Which picture a probe takes. */
enum gn_rig_probe {
    GN_RIG_FISHEYE = 0, // equidistant, 180 degrees: r = R theta / (pi/2)
    GN_RIG_ANGULAR = 1, // Debevec's light probe, 360 degrees: r = R theta / pi
};

/** Where the rig's probes stand, m: above the marker, higher than all that is on the table. */
extern const double gn_rig_probe_position[3];
/** How they look, by enum gn_rig_probe, 3x3, row-major: the fisheye up, turned by 20 degrees about
 * that; the light probe along +x with world -z downwards. */
extern const double gn_rig_world_from_probe[2][9];

/**
 * What a probe at `position` sees of the environment: each pixel the mean radiance over the part of
 * it that lies in the circle, from 4 x 4 points, 16 x 16 where those differ; 0 outside.
 * world_from_probe: 3x3, row-major.
 */
GN_MUST_USE int gn_rig_take_probe(const struct gn_rig_environment *env, enum gn_rig_probe probe,
                                  int size, const double world_from_probe[static 9],
                                  const double position[static 3], struct gn_pool *pool,
                                  struct gn_image *out_image);

/** Quaternion w, x, y, z of a rotation matrix (3x3, row-major), w >= 0 (Shepperd 1978). */
void gn_rig_get_quaternion(const double m[static 9], double out_q[static 4]);

/**
 * 8-bit sRGB codes of a picture of linear values, noise added before the curve: another frame,
 * another noise. codes: [3 n], linear: [3 n].
 */
void gn_rig_photograph(const float *linear, long n, const struct gn_rig_noise *noise, uint64_t seed,
                       int frame, uint8_t *out_codes);

#endif
