/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The answer to HELLO: who may come in, where, and what is granted.
 */
#ifndef GN_SERVER_NET_HELLO_H
#define GN_SERVER_NET_HELLO_H

#include "server/net/session.h"

/** What a HELLO came to. */
struct gn_hello_answer {
    uint64_t session_id; // where welcome
    struct gn_room *room;
    struct gn_room_session *member; // the caller's
    uint32_t max_payload_bytes;     // longest payload that the role may send
    enum gn_msg_error_code code;    // where refused
    struct gn_error error;
};

/** Returns 0: WELCOME, and the session has joined its room; or a negative errno, code and error. */
GN_MUST_USE int gn_hello_answer(struct gn_session_host *host, const struct gn_msg_hello *hello,
                                const char *peer, struct gn_hello_answer *out_answer,
                                struct gn_msg_welcome *out_welcome);

#endif
