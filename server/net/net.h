/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The network side: one thread that owns the listener and all sessions' sockets, and touches no
 * pixels. Frames go to the rooms' slots; answers come back by the mailbox.
 */
#ifndef GN_SERVER_NET_NET_H
#define GN_SERVER_NET_NET_H

#include <stdint.h>

#include "common/error.h"
#include "common/options.h"
#include "proto/attr.h"
#include "server/room/figures.h"
#include "server/room/mailbox.h"
#include "server/room/room.h"

/** Most connections that a server may be set to. */
#define GN_NET_MAX_CONNECTIONS 1024

struct gn_net_options {
    struct gn_address address;    // port 0 picks one; loopback only until TLS is built
    struct gn_room *const *rooms; // [n_rooms] borrowed until destroy, n_rooms >= 1
    int n_rooms;
    struct gn_mailbox *mailbox; // borrowed until destroy
    const char *server_name;    // borrowed until destroy
    int max_connections;        // [1, GN_NET_MAX_CONNECTIONS]
    int hello_timeout_ms;       // > 0: from connecting to a whole HELLO
    int idle_timeout_ms;        // between whole messages; 0: for ever
    int stall_timeout_ms;       // > 0: something to send and not a byte taken
};

/** Thread-safety: owner thread (main), but for gn_net_get_figures(). */
struct gn_net;

/**
 * Listens; nobody is answered before gn_net_start(). Returns 0, or a negative errno and a sentence:
 * -EACCES for an address that is not loopback, -EADDRINUSE, what the name's look-up says.
 */
GN_MUST_USE int gn_net_create(const struct gn_net_options *options, struct gn_net **out_net,
                              struct gn_error *out_error);
/** Stops first where it runs. NULL-safe; nulls *net. */
void gn_net_destroy(struct gn_net **net);

/** "127.0.0.1:7340", "[::1]:7340": where it listens, with the port that was picked. Borrowed. */
const char *gn_net_get_address(const struct gn_net *net);

/** Starts the thread. Returns 0 or -EAGAIN. */
GN_MUST_USE int gn_net_start(struct gn_net *net);
/** BYE (shutdown) to every session, waits until it is read or GN_SESSION_LINGER_NS, ends. */
void gn_net_stop(struct gn_net *net);

/** Thread-safety: safe. */
void gn_net_get_figures(struct gn_net *net, struct gn_transport_figures *out_figures);

#endif
