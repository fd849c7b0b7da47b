/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/axes.h"

#include "common/draw.h"

void gn_axes_draw(struct gn_image8 *rgb, const struct gn_camera *camera,
                  const struct gn_pose *camera_from_frame, double reach)
{
    static const struct gn_ink inks[3] = {{255, 30, 30}, {30, 255, 30}, {30, 30, 255}};
    const double origin[3] = {0};
    double centre[3], middle[2], end[2];
    gn_pose_transform(camera_from_frame, origin, centre);
    if (!gn_camera_project(camera, centre, middle))
        return;
    for (int axis = 0; axis < 3; axis++) {
        double tip[3] = {0};
        tip[axis] = reach;
        gn_pose_transform(camera_from_frame, tip, tip);
        if (gn_camera_project(camera, tip, end))
            gn_draw_line(rgb, middle, end, inks[axis]);
    }
}
