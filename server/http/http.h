/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The operator's door: status, metrics, health and the page, over HTTP. It only reads what rooms
 * and network publish, in a thread of its own, and never makes a frame wait.
 */
#ifndef GN_SERVER_HTTP_HTTP_H
#define GN_SERVER_HTTP_HTTP_H

#include "common/error.h"
#include "common/options.h"
#include "proto/attr.h"
#include "server/room/figures.h"
#include "server/room/room.h"

/** Reads the network's figures. Called in the HTTP thread; must not block. */
typedef void (*gn_http_transport_fn)(void *context, struct gn_transport_figures *out_figures);

struct gn_http_options {
    struct gn_address address;    // port 0 picks one; loopback only
    struct gn_room *const *rooms; // [n_rooms] borrowed until destroy
    int n_rooms;
    const char *server_name;         // borrowed until destroy
    const struct gn_options *config; // borrowed until destroy: shown with the values' origin
    int max_connections;             // [4, 256]
    int timeout_s;                   // > 0: of a request, and of a resting connection
    gn_http_transport_fn get_transport;
    void *transport_context;
};

/** Thread-safety: owner thread (main). */
struct gn_http;

/** Listens and serves. Returns 0, or a negative errno and a sentence as gn_net_create(). */
GN_MUST_USE int gn_http_create(const struct gn_http_options *options, struct gn_http **out_http,
                               struct gn_error *out_error);
/** Ends all connections. NULL-safe; nulls *http. */
void gn_http_destroy(struct gn_http **http);

/** Where it listens, with the port that was picked. Borrowed. */
const char *gn_http_get_address(const struct gn_http *http);

/** Closes connections whose request is overdue; to be called about once a second. */
void gn_http_tend(struct gn_http *http);

#endif
