/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/pose_choice.h"

#include <math.h>

#include "client/track/rotation.h"

static const double unit_px = 0.25, memory_s = 0.5, longest_gap_s = 0.5, margin = 12;

static double get_misfit(const struct gn_pose_fit *fit)
{
    return fit->sum_px2 / (unit_px * unit_px);
}

static double get_angle(const struct gn_pose *pose, const struct gn_pose_fit *fit)
{
    return gn_rotation_get_angle(pose->rotation, fit->camera_from_body.rotation);
}

/** Which fit goes on from the chosen pose. */
static int match(const struct gn_pose_choice *c, const struct gn_pose_fit *fits, int n_fits,
                 const struct gn_pose *expected)
{
    if (n_fits == 1)
        return 0;
    double straight = get_angle(expected, &fits[0]), crossed = get_angle(expected, &fits[1]);
    if (c->n_poses == 2) {
        straight += get_angle(&c->pose[!c->chosen], &fits[1]);
        crossed += get_angle(&c->pose[!c->chosen], &fits[0]);
    }
    return crossed < straight;
}

static int begin(struct gn_pose_choice *c, int64_t time_ns, const struct gn_pose_fit *fits,
                 int n_fits)
{
    c->n_poses = n_fits;
    c->chosen = 0;
    c->time_ns = time_ns;
    for (int i = 0; i < n_fits; i++) {
        c->pose[i] = fits[i].camera_from_body;
        c->misfit[i] = get_misfit(&fits[i]);
    }
    return 0;
}

int gn_pose_choice_update(struct gn_pose_choice *c, int64_t time_ns, const struct gn_pose_fit *fits,
                          int n_fits, const struct gn_pose *expected)
{
    double gap_s = (double)(time_ns - c->time_ns) * 1e-9;
    if (c->n_poses == 0 || !(gap_s >= 0 && gap_s <= longest_gap_s))
        return begin(c, time_ns, fits, n_fits);
    int mine = match(c, fits, n_fits, expected ? expected : &c->pose[c->chosen]);
    if (n_fits == 1)
        return begin(c, time_ns, fits, n_fits);
    double decay = exp(-gap_s / memory_s);
    // A second pose that is new has no past: it begins with the first one's.
    double past[2] = {decay * c->misfit[c->chosen],
                      decay * c->misfit[c->n_poses == 2 ? !c->chosen : c->chosen]};
    c->n_poses = 2;
    c->chosen = mine;
    c->time_ns = time_ns;
    for (int i = 0; i < 2; i++) {
        c->pose[i] = fits[i].camera_from_body;
        c->misfit[i] = past[i != mine] + get_misfit(&fits[i]);
    }
    if (c->misfit[mine] - c->misfit[!mine] > margin) {
        c->chosen = !mine;
        c->n_changed++;
    } else if (fits[!mine].sum_px2 < fits[mine].sum_px2) {
        c->n_rejected++;
    }
    return c->chosen;
}
