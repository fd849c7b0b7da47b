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
 * A state with one reference, the same light and figures: the lights are its own; map, plan, memory
 * and the other probes' states are shared. It has no near light and no filter's state. NULL: no
 * memory. Thread-safety: others may take and drop references to the state meanwhile.
 */
GN_MUST_USE struct gn_lighting_state *gn_lighting_state_copy(const struct gn_lighting_state *state);

#endif
