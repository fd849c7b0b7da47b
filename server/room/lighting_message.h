/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A lighting state as the message LIGHTING_STATE, for subscribers.
 */
#ifndef GN_SERVER_ROOM_LIGHTING_MESSAGE_H
#define GN_SERVER_ROOM_LIGHTING_MESSAGE_H

#include "common/buf.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "proto/wire.h"
#include "server/light/state.h"

/** px: size of the lat-long map in the message. */
#define GN_LIGHTING_MAP_WIDTH 512
#define GN_LIGHTING_MAP_HEIGHT 256

/**
 * Fills the body but for room and node, and makes the payload: the lights' records, then the map
 * where with_map. Returns 0 or -ENOMEM. The payload is the caller's reference.
 */
GN_MUST_USE int gn_lighting_message_make(const struct gn_lighting_state *state, bool with_map,
                                         struct gn_pool *pool,
                                         struct gn_msg_lighting_state *out_body,
                                         struct gn_buf **out_payload);

#endif
