/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Copies of published states, for what makes another one of them.
 */
#ifndef GN_SERVER_LIGHT_STATE_COPY_H
#define GN_SERVER_LIGHT_STATE_COPY_H

#include "proto/attr.h"
#include "server/light/state.h"

/**
 * A state with one reference, the same light and figures: the lights are its own; map, pyramid,
 * plan, memory and the other probes' states are shared. It has no near light and no filter's state.
 * NULL: no memory. Thread-safety: others may take and drop references to the state meanwhile.
 */
GN_MUST_USE struct gn_lighting_state *gn_lighting_state_copy(const struct gn_lighting_state *state);

/** Makes the pyramid of a state that nobody else has yet, where the options want one and it has
 * none. Returns 0, or -ENOMEM and a sentence. */
GN_MUST_USE int gn_lighting_state_add_pyramid(struct gn_lighting_state *state,
                                              const struct gn_light_options *options,
                                              struct gn_error *out_error);

#endif
