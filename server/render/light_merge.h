/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Fewer lights for the same light, so that a frame can have as many as its time allows whatever the
 * state was made with: others use the state too, and making it anew takes longer than a frame.
 */
#ifndef GN_SERVER_RENDER_LIGHT_MERGE_H
#define GN_SERVER_RENDER_LIGHT_MERGE_H

#include "server/light/state.h"

/** Memory that frames share; zeroed at first. Thread-safety: unsafe. */
struct light_merge {
    int capacity;
    struct gn_light *lights;  // [capacity], owned: what was asked for last
    struct merge_item *items; // [capacity], owned
    struct merge_part *parts; // [capacity], owned
};
void gn_light_merge_finish(struct light_merge *merge);

/**
 * At most n_wanted lights (>= 1), but one for each disc in any case, and one each for what is
 * distant and what is near: merge->lights. Of the groups, at first all lights, always that of the
 * largest power times spread, W sum w |d - mean|^2 with w the luminance, W its sum and d the
 * direction, is divided across its principal axis, where the two halves' are least together, until
 * there are enough: a shadow's error grows with both. A group's irradiances add up; direction,
 * place and normal are its means; discs stay as they are, first. The same lights always give the
 * same groups, and n + 1 groups are n of which one is divided. Returns their number or -ENOMEM.
 */
GN_MUST_USE int gn_light_merge_make(struct light_merge *merge, const struct gn_light *lights, int n,
                                    int n_wanted);

#endif
