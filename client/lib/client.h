/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Inside of libgnomon: its state, and messages out and in with deadlines. */
#ifndef GN_CLIENT_LIB_CLIENT_H
#define GN_CLIENT_LIB_CLIENT_H

#include "client/lib/gnomon.h"
#include "common/conn.h"

#define GN_CLIENT_MAX_KEPT 64

struct gn_client {
    struct gn_conn *conn;
    struct gn_msg_welcome welcome;
    struct gn_wire_fault fault;
    int timeout_ms;
    int lost;                // the errno that ended the connection, 0 while it is good
    int64_t last_sent_ns;    // own clock
    int64_t offset_ns;       // server minus own clock
    int64_t round_trip_ns;   // of the sample that gave offset_ns
    int64_t pong_sent_ns;    // t1 of the PING that is being waited for, 0 none
    struct gn_msg_pong pong; // its answer
    int64_t pong_received_ns;
    struct gn_conn_message kept[GN_CLIENT_MAX_KEPT]; // events that came while a PONG was waited for
    uint8_t *kept_headers[GN_CLIENT_MAX_KEPT];       // owned copies of their headers
    size_t kept_first, kept_count;
    struct gn_buf *payload; // of the event that was last handed out
};

/** Write the reason into why (may be NULL). Returns err. */
int gn_client_fail(struct gn_wire_fault *why, int err, const char *format, ...) GN_PRINTF(3, 4);

/** The connection is of no more use: keep the reason; every later call returns err. Returns err. */
int gn_client_lose(struct gn_client *client, int err, const char *text);

/** Own monotonic clock, ns; timeout_ms < 0: never. */
int64_t gn_client_get_deadline(int timeout_ms);

/** Write a whole message, within timeout_ms. payload is not kept. Returns as
 * gn_client_send_frame(). */
GN_MUST_USE int gn_client_send(struct gn_client *client, enum gn_wire_type type, const void *msg,
                               const void *payload, size_t payload_bytes);

/** Read until one message is there. Returns 1, 0 at the deadline, negative errno. */
GN_MUST_USE int gn_client_receive(struct gn_client *client, int64_t deadline_ns,
                                  struct gn_conn_message *out);

/** gn_conn_decode(); a server that sends what cannot be decoded is lost (-EPROTO). */
GN_MUST_USE int gn_client_decode(struct gn_client *client, const struct gn_conn_message *message,
                                 union gn_wire_message *out);

/** Connect and be welcomed; one REDIRECT is followed. Returns as gn_client_connect(). */
GN_MUST_USE int gn_client_say_hello(struct gn_client *client, const struct gn_client_options *opts);

#endif
