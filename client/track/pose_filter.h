/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Measured poses made steady: the one-euro filter (Casiez, Roussel, Vogel 2012) on rigid motions,
 * a low pass whose cutoff rises with the speed, so that what rests is still and what moves lags
 * little. Its answer depends on time and not on how often it is asked.
 *
 * Between two measurements the motion counts as straight; the low pass y' = 2 pi fc (x - y) then
 * has the exact solution, with a = exp(-2 pi fc dt), slope v and tau = 1 / (2 pi fc),
 *   y(t + dt) = x(t + dt) - v tau + a (y(t) - x(t) + v tau),
 * for a resting x the usual y += (1 - a) (x - y). Rotations likewise, in the tangent space of the
 * last answer (exponential map), so that q and -q are one rotation.
 */
#ifndef GN_CLIENT_TRACK_POSE_FILTER_H
#define GN_CLIENT_TRACK_POSE_FILTER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/pose.h"
#include "proto/attr.h"

/** Longest prediction; beyond it the motion counts as ended. */
#define GN_POSE_FILTER_MAX_PREDICTION_NS INT64_C(100000000)

/** fc = rest_hz + slope |speed|, each for translation and rotation. */
struct gn_pose_filter_options {
    double rest_hz;              // cutoff at rest, Hz, (0, 1000]
    double hz_per_m_per_s;       // [0, 1e6]
    double hz_per_rad_per_s;     // [0, 1e6]
    double speed_hz;             // cutoff of the speeds themselves, Hz, (0, 1000]
    int64_t longest_interval_ns; // after a longer one it begins anew
};

/** What serves a hand-held camera half a metre from its marker. */
#define GN_POSE_FILTER_DEFAULTS                                                                    \
    ((struct gn_pose_filter_options){.rest_hz = 0.5,                                               \
                                     .hz_per_m_per_s = 400,                                        \
                                     .hz_per_rad_per_s = 60,                                       \
                                     .speed_hz = 2,                                                \
                                     .longest_interval_ns = INT64_C(500000000)})

/** A value: zeroed and given options it is ready. Thread-safety: unsafe. */
struct gn_pose_filter {
    struct gn_pose_filter_options options;
    bool has_pose;
    int64_t time_ns;         // of the last measurement taken
    struct gn_pose measured; // that measurement
    struct gn_pose pose;     // the answer at that time
    double speed[3];         // m/s, filtered, in the frame the pose maps to
    double turn[3];          // rad/s, filtered, in the frame the pose maps from
    double lag_s;            // 1 / (2 pi fc) of the translation, last taken
    double turn_lag_s;       // of the rotation
};

/** What an update did. */
enum gn_pose_filter_step {
    GN_POSE_FILTER_TAKEN = 0,
    GN_POSE_FILTER_BEGUN,   // the first, or the first after a long interval: taken as it is
    GN_POSE_FILTER_SKIPPED, // not later than the last: nothing changed
};

/**
 * Takes the pose measured at time_ns (any monotonic clock). Returns an enum gn_pose_filter_step, or
 * -EDOM where it is no pose (gn_pose_normalize): nothing changed then.
 */
GN_MUST_USE int gn_pose_filter_update(struct gn_pose_filter *filter, int64_t time_ns,
                                      const struct gn_pose *measured);

/**
 * The pose at time_ns by constant speed from the last answer: at that time or before the answer
 * itself, and from GN_POSE_FILTER_MAX_PREDICTION_NS on where it would be then. False before the
 * first update.
 */
bool gn_pose_filter_predict(const struct gn_pose_filter *filter, int64_t time_ns,
                            struct gn_pose *out_pose);

#endif
