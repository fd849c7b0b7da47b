/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/axes.h"

#include <math.h>
#include <string.h>

void gn_axes_draw_line(struct gn_image8 *rgb, const double from[static 2],
                       const double to[static 2], const uint8_t colour[static 3])
{
    double length = hypot(to[0] - from[0], to[1] - from[1]);
    int n = (int)fmin(2 * length + 1, 1e5);
    for (int i = 0; i <= n; i++) {
        double t = (double)i / n;
        for (int k = 0; k < 4; k++) {
            double x = (1 - t) * from[0] + t * to[0] + (k & 1) - 0.5;
            double y = (1 - t) * from[1] + t * to[1] + (k >> 1) - 0.5;
            if (x >= 0 && y >= 0 && x < rgb->width && y < rgb->height)
                memcpy(gn_image8_at(rgb, (int)x, (int)y), colour, 3);
        }
    }
}

void gn_axes_draw(struct gn_image8 *rgb, const struct gn_camera *camera,
                  const struct gn_pose *camera_from_frame, double reach)
{
    const double origin[3] = {0};
    double centre[3], middle[2], end[2];
    gn_pose_transform(camera_from_frame, origin, centre);
    if (!gn_camera_project(camera, centre, middle))
        return;
    for (int axis = 0; axis < 3; axis++) {
        double tip[3] = {0};
        uint8_t colour[3] = {30, 30, 30};
        tip[axis] = reach;
        colour[axis] = 255;
        gn_pose_transform(camera_from_frame, tip, tip);
        if (gn_camera_project(camera, tip, end))
            gn_axes_draw_line(rgb, middle, end, colour);
    }
}
