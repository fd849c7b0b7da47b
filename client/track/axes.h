/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Axes of frames drawn into pictures, to look at what was found. Thread-safety: safe.
 */
#ifndef GN_CLIENT_TRACK_AXES_H
#define GN_CLIENT_TRACK_AXES_H

#include "common/camera.h"
#include "common/image.h"

/** A frame's axes, `reach` m long: x red, y green, z blue. */
void gn_axes_draw(struct gn_image8 *rgb, const struct gn_camera *camera,
                  const struct gn_pose *camera_from_frame, double reach);

#endif
