/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/pose_filter.h"

#include <math.h>

#include "client/track/rotation.h"

static const double two_pi = 6.28318530717958647692;

static double length(const double v[static 3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/**
 * The low pass over dt seconds of an input that goes straight from x0 to x1, from answer y to
 * *out_y, and of its slope's low pass. speed_decay: exp(-2 pi fc dt) of the latter.
 * Returns tau. The cutoff is that of the mean speed, so that it too depends little on dt.
 */
static double low_pass(const double x0[static 3], const double x1[static 3],
                       const double y[static 3], double dt, double rest_hz, double hz_per_speed,
                       double speed_decay, double speed[static 3], double out_y[static 3])
{
    double slope[3], next_speed[3];
    for (int i = 0; i < 3; i++) {
        slope[i] = (x1[i] - x0[i]) / dt;
        next_speed[i] = slope[i] + speed_decay * (speed[i] - slope[i]);
    }
    double mean_speed = (length(speed) + length(next_speed)) / 2;
    double tau = 1 / (two_pi * (rest_hz + hz_per_speed * mean_speed));
    double decay = exp(-dt / tau);
    for (int i = 0; i < 3; i++) {
        double behind = slope[i] * tau;
        out_y[i] = x1[i] - behind + decay * (y[i] - x0[i] + behind);
        speed[i] = next_speed[i];
    }
    return tau;
}

static void begin(struct gn_pose_filter *f, int64_t time_ns, const struct gn_pose *pose)
{
    *f = (struct gn_pose_filter){.options = f->options,
                                 .has_pose = true,
                                 .time_ns = time_ns,
                                 .measured = *pose,
                                 .pose = *pose};
}

int gn_pose_filter_update(struct gn_pose_filter *f, int64_t time_ns, const struct gn_pose *measured)
{
    struct gn_pose pose = *measured;
    int err = gn_pose_normalize(&pose);
    if (err)
        return err;
    if (f->has_pose && time_ns <= f->time_ns)
        return GN_POSE_FILTER_SKIPPED;
    // In unsigned numbers, which do not overflow.
    uint64_t interval_ns = (uint64_t)time_ns - (uint64_t)f->time_ns;
    if (!f->has_pose || interval_ns > (uint64_t)f->options.longest_interval_ns) {
        begin(f, time_ns, &pose);
        return GN_POSE_FILTER_BEGUN;
    }
    const struct gn_pose_filter_options *o = &f->options;
    const double origin[3] = {0};
    double dt = (double)interval_ns * 1e-9, decay = exp(-two_pi * o->speed_hz * dt);
    double from[3], to[3], turn[3], moved[3];
    gn_rotation_between(f->pose.rotation, f->measured.rotation, from);
    gn_rotation_between(f->pose.rotation, pose.rotation, to);
    f->turn_lag_s =
        low_pass(from, to, origin, dt, o->rest_hz, o->hz_per_rad_per_s, decay, f->turn, turn);
    f->lag_s = low_pass(f->measured.translation, pose.translation, f->pose.translation, dt,
                        o->rest_hz, o->hz_per_m_per_s, decay, f->speed, moved);
    gn_rotation_turn(f->pose.rotation, turn);
    for (int i = 0; i < 3; i++)
        f->pose.translation[i] = moved[i];
    f->measured = pose;
    f->time_ns = time_ns;
    return GN_POSE_FILTER_TAKEN;
}

bool gn_pose_filter_predict(const struct gn_pose_filter *f, int64_t time_ns,
                            struct gn_pose *out_pose)
{
    if (!f->has_pose)
        return false;
    *out_pose = f->pose;
    if (time_ns <= f->time_ns)
        return true;
    uint64_t ahead_ns = (uint64_t)time_ns - (uint64_t)f->time_ns;
    if (ahead_ns > (uint64_t)GN_POSE_FILTER_MAX_PREDICTION_NS)
        ahead_ns = (uint64_t)GN_POSE_FILTER_MAX_PREDICTION_NS;
    double ahead_s = (double)ahead_ns * 1e-9, turn[3];
    for (int i = 0; i < 3; i++) {
        out_pose->translation[i] += f->speed[i] * ahead_s;
        turn[i] = f->turn[i] * ahead_s;
    }
    gn_rotation_turn(out_pose->rotation, turn);
    return true;
}
