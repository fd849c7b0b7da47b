/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Photographs of printed markers with exactly known places, for judging poses: each pixel is the
 * mean of the light over its square, through the lens, before noise and codes.
 */
#ifndef GN_TESTS_RIG_MARKER_PICTURE_H
#define GN_TESTS_RIG_MARKER_PICTURE_H

#include <stdint.h>

#include "common/image.h"
#include "proto/attr.h"
#include "tests/rig/view.h"

enum { GN_RIG_SHEET_MARKERS = 64 };

/** A printed marker, upright on its sheet. */
struct gn_rig_printed {
    double x, y, size; // its middle and its side, m
    int cells;         // of its side
    uint8_t white[81]; // [cells][cells], from the top left; 1: white
};

/** A sheet of white paper; its frame has x right, y up, z out of it. */
struct gn_rig_sheet {
    double world_from_sheet[16]; // rigid, row-major
    double half_width, half_height;
    int n_printed;
    struct gn_rig_printed printed[GN_RIG_SHEET_MARKERS];
};

/** Linear values of paper, ink and what is behind. */
extern const double gn_rig_paper, gn_rig_ink, gn_rig_backdrop;

/** A camera whose lens has been worked out, for many pictures. Caller's memory, our rays. */
struct gn_rig_marker_camera {
    struct gn_rig_view view; // its pose is that of the next picture
    double *rays;            // [2 height + 1][2 width + 1][3]: a way every half pixel, owned
    double least_z;          // of a way that the lens lets through
};

/** A fisheye: r = focal (theta + k[0] theta^3 + k[1] theta^5) up to theta_max, dark outside. */
struct gn_rig_fisheye {
    int width, height; // px
    double center[2];  // px
    double focal;      // px
    double k[2];
    double theta_max; // rad
    double blur_px;
};

/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_rig_marker_camera_init(struct gn_rig_marker_camera *camera,
                                          const struct gn_rig_view *view);
/** The same with a fisheye; only size, pose and blur of camera->view mean something then. */
GN_MUST_USE int gn_rig_marker_fisheye_init(struct gn_rig_marker_camera *camera,
                                           const struct gn_rig_fisheye *lens);
/** Frees the rays and zeroes *camera. */
void gn_rig_marker_camera_finish(struct gn_rig_marker_camera *camera);

/**
 * The linear RGB picture (grey) of the sheets, of which the nearest counts: a pixel's mean from
 * 16 x 16 points where they differ. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_rig_take_markers(const struct gn_rig_marker_camera *camera,
                                    const struct gn_rig_sheet *sheets, int n_sheets,
                                    struct gn_image *out_linear);

#endif
