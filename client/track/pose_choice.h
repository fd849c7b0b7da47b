/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Which of the two poses that a flat marker allows is the true one, over time. Seen from far or
 * nearly face on, both fit a single picture almost as well, and the worse one often wins by noise.
 *
 * The rule: both are followed from picture to picture, each matched to what is nearest to it in
 * rotation (the chosen one from where it is expected). Each gathers its squared distances in the
 * picture, in units of 0.25 px, those of the past fading with a time constant of 0.5 s. The chosen
 * one is the better one of the first picture and stays until the other's sum is lower by 12.
 */
#ifndef GN_CLIENT_TRACK_POSE_CHOICE_H
#define GN_CLIENT_TRACK_POSE_CHOICE_H

#include <stdbool.h>
#include <stdint.h>

#include "client/track/pose_fit.h"

/** Zeroed it is ready. A value. Thread-safety: unsafe. */
struct gn_pose_choice {
    int n_poses;            // that are followed, [0, 2]
    int chosen;             // of these
    struct gn_pose pose[2]; // camera_from_body, last seen
    double misfit[2];       // the gathered sums
    int64_t time_ns;
    uint64_t n_rejected; // pictures in which the other pose fitted better
    uint64_t n_changed;  // times the other was chosen after all
};

/**
 * Takes the n_fits [1, 2] poses of the picture of time_ns; expected: where the chosen pose should
 * be now, NULL: where it was. After 0.5 s without a picture it begins anew. Returns the index of
 * the fit that is the true one by the rule.
 */
int gn_pose_choice_update(struct gn_pose_choice *choice, int64_t time_ns,
                          const struct gn_pose_fit *fits, int n_fits,
                          const struct gn_pose *expected);

#endif
