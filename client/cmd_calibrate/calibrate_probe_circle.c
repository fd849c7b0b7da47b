/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/cmd_calibrate/calibrate_input.h"
#include "client/cmd_calibrate/calibrate_probe.h"

/* A ball mirrors the camera in its middle, as large as the camera seems from the ball. */
#define DEFAULT_CAMERA_SHARE 0.12
/* theta = 2 asin r at 95 % of the radius, behind which directions crowd. */
#define BALL_THETA_MAX 2.5

static int read_guess(const struct gn_probe_run *run, struct gn_circle *out,
                      struct gn_error *out_error)
{
    double xyr[3];
    int n = gn_calibrate_read_numbers("ball", gn_probe_run_get(run, "ball"), 0, 3, xyr, out_error);
    if (n >= 0 &&
        (n != 3 || !(xyr[2] > 5 && xyr[2] <= GN_IMAGE_MAX_SIDE &&
                     fabs(xyr[0]) <= GN_IMAGE_MAX_SIDE && fabs(xyr[1]) <= GN_IMAGE_MAX_SIDE)))
        n = gn_error_set(out_error, -EINVAL,
                         "--ball: right would be X,Y,RADIUS in px, the radius above 5, none above "
                         "%d",
                         GN_IMAGE_MAX_SIDE);
    *out = (struct gn_circle){{xyr[0], xyr[1]}, xyr[2], 0, 0};
    return n < 0 ? n : 0;
}

static void take_ball(struct gn_probe_run *run)
{
    struct gn_projection *p = &run->setup.projection;
    double share = gn_probe_run_has(run, "camera-share")
                       ? gn_options_get_double(run->options, NULL, NULL, "camera-share")
                       : DEFAULT_CAMERA_SHARE;
    memcpy(run->mask, run->circle.center, sizeof(run->circle.center));
    run->mask[2] = share * run->circle.radius;
    if (!gn_probe_run_has(run, "theta-max"))
        p->theta_max = BALL_THETA_MAX;
    // Of the ball's own: r = R sin(theta / 2).
    p->radius = run->circle.radius * sin(p->theta_max / 2);
}

int gn_probe_run_find_circle(struct gn_probe_run *run, struct gn_error *out_error)
{
    struct gn_circle found;
    struct gn_projection *p = &run->setup.projection;
    bool is_ball = gn_probe_run_has(run, "ball");
    int err = 0;
    if (is_ball && p->type != GN_PROJECTION_MIRRORBALL)
        return gn_error_set(out_error, -EINVAL, "--ball is for --projection mirrorball");
    if (is_ball)
        err = read_guess(run, &run->circle, out_error);
    run->has_circle = is_ball && !err; // the guess, until there is better
    if (!err)
        err = is_ball ? gn_circle_find_ball(&run->first, &run->circle, &found, out_error)
                      : gn_circle_find_disc(&run->first, &run->first_light, &found, out_error);
    if (err)
        return err;
    run->has_circle = true;
    run->circle = found;
    printf("circle: centre %.2f, %.2f, radius %.2f px; %d points of its outline, %.2f px RMS off\n",
           found.center[0], found.center[1], found.radius, found.n_points, found.rms);
    memcpy(p->center, found.center, sizeof(p->center));
    p->radius = found.radius;
    if (is_ball)
        take_ball(run);
    return 0;
}
