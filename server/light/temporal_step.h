/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One step of the filter, for temporal.c, which follows sums and values, and temporal_lights.c.
 */
#ifndef GN_SERVER_LIGHT_TEMPORAL_STEP_H
#define GN_SERVER_LIGHT_TEMPORAL_STEP_H

#include "server/light/temporal.h"

/** Everything that the parts of one step share. */
struct gn_temporal_step {
    const struct gn_temporal *kept;
    const struct gn_temporal_input *input;
    struct gn_temporal *out; // being filled
    double tau, alpha;
    struct gn_change change;
};

/** The light as the map has it: 1 - |mean direction| = (1 - cos angular_radius) / 2. */
void gn_temporal_set_raw(struct gn_temporal_light *light, const struct gn_light *raw);
/** Moves a value by alpha of its way; where it is nearly there, to the end. True: it is there. */
bool gn_temporal_approach(double *value, double end, double alpha, double scale);
/** True where each light is as the map had it last. */
bool gn_temporal_are_lights_settled(const struct gn_temporal *temporal);

/** The step's lights, and their total. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_temporal_follow_lights(struct gn_temporal_step *step);
/** Lights that were left out until now: those of the frame, each channel times the factor. */
void gn_temporal_begin_lights(struct gn_temporal *out, const struct gn_temporal_input *input,
                              const double factor[static 3]);

#endif
