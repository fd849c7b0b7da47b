/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Lines in pictures, to look at what was found. Thread-safety: safe.
 */
#ifndef GN_CLIENT_TRACK_AXES_H
#define GN_CLIENT_TRACK_AXES_H

#include <stdint.h>

#include "common/camera.h"
#include "common/image.h"

/** A line 2 px wide from one picture position to another; what lies outside is left out. */
void gn_axes_draw_line(struct gn_image8 *rgb, const double from[static 2],
                       const double to[static 2], const uint8_t colour[static 3]);

/** A frame's axes, `reach` m long: x red, y green, z blue. */
void gn_axes_draw(struct gn_image8 *rgb, const struct gn_camera *camera,
                  const struct gn_pose *camera_from_frame, double reach);

#endif
