/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Light in time: powers and directions of the lights, and linear figures of the map, follow the
 * frames by an exact exponential of the capture times,
 *   y += (1 - exp(-dt / tau)) (x - y),
 * so that the result depends on time and not on the number of frames. What is filtered is power
 * and its first moment, both sums over the map: the filtered lights of regions that stay are the
 * lights of the filtered map, and no power comes or goes by the filter. Lights that the map has no
 * more fade out, new ones fade in. Where the light changes by much at once, the lights there take
 * their new values at once. After Havran et al. 2005, which filters powers and directions too.
 */
#ifndef GN_SERVER_LIGHT_TEMPORAL_H
#define GN_SERVER_LIGHT_TEMPORAL_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/attr.h"
#include "server/light/state.h"
#include "server/light/temporal_change.h"

/** Longest gap between two frames that is bridged; after a longer one the filter starts anew. */
#define GN_TEMPORAL_GAP_MS 500.0
/** Most frames in a row whose capture time does not rise; the next starts the filter anew. */
#define GN_TEMPORAL_HOLDS_MAX 8
/** Most linear figures besides the total. */
#define GN_TEMPORAL_VALUES_MAX 96

/** What a frame says, unfiltered. Borrowed. */
struct gn_temporal_input {
    int64_t time_ns; // of capture
    bool has_lights; // false: lights were left out, not: there are none
    int n_lights;
    const struct gn_light *lights; // [n_lights] finite; id 0 or seen twice: no light's successor
    double total[3];               // what the lights' irradiance is meant to add up to, or nearly
    double sums[GN_CHANGE_SUMS];   // where the map's light is; they alone set the pace
    int n_values;                  // [0, GN_TEMPORAL_VALUES_MAX]; 0: left out
    double values[GN_TEMPORAL_VALUES_MAX]; // R, G, B in turn, linear in the map's radiance
};

/** One light that is followed. */
struct gn_temporal_light {
    struct gn_light raw;  // as the map had it last
    double irradiance[3]; // filtered, W/m^2
    double moment[3];     // filtered: luminance of the irradiance times the mean direction
    double fading_from;   // 0: in the map; else its luminance when the map had it last
};

/** What the filter keeps. Thread-safety: immutable after create. */
struct gn_temporal {
    struct gn_temporal_input
        input; // of the last frame that it followed; its lights are those below
    double total[3];
    double sums[GN_CHANGE_SUMS];
    double values[GN_TEMPORAL_VALUES_MAX];
    double values_share; // of the way that the values went to the frame's; 0: held, 1: all of it
    double factor[3];    // times the frame's: values that were added; else 1
    struct gn_temporal_figures figures;
    int n_held;      // frames in a row whose time did not rise
    bool is_settled; // nothing would change if the same frame came for ever
    int n_lights;
    struct gn_temporal_light lights[]; // [n_lights] by falling luminance
};

/**
 * One step: a pure function of what was kept (NULL: nothing; starts anew), the frame and tau
 * (s, > 0). Lights or values that one of both has and the other has not begin or end, and move
 * nothing of the rest: begun, they are the frame's with the power of the filtered total. Returns 0
 * or -ENOMEM; *out_temporal is the caller's, freed by free().
 */
GN_MUST_USE int gn_temporal_follow(const struct gn_temporal *kept,
                                   const struct gn_temporal_input *input, double tau,
                                   struct gn_temporal **out_temporal);

/**
 * No step: what was kept, with the lights or values of the same frame that were left out and are in
 * the input now, begun as above; without those that the input has no more. sums are not read.
 */
GN_MUST_USE int gn_temporal_complete(const struct gn_temporal *kept,
                                     const struct gn_temporal_input *input,
                                     struct gn_temporal **out_temporal);

/**
 * The same frame seen again at a later time: as gn_temporal_follow() with the last frame's lights.
 */
GN_MUST_USE int gn_temporal_follow_same(const struct gn_temporal *kept, int64_t time_ns, double tau,
                                        struct gn_temporal **out_temporal);

/** The i-th light as it is published: the raw one, to the bit, where the filter has settled. */
void gn_temporal_get_light(const struct gn_temporal *temporal, int i, struct gn_light *out_light);

#endif
