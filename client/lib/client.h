/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Inside of libgnomon: its state, and messages out and in with deadlines. */
#ifndef GN_CLIENT_LIB_CLIENT_H
#define GN_CLIENT_LIB_CLIENT_H

#include "client/lib/gnomon.h"
#include "common/conn.h"

#define GN_CLIENT_MAX_KEPT 64

/**
 * Sees every message of a connection, PING and PONG too: one that was sent once it has gone, one
 * that came before anything is done with it. head: envelope and header; all borrowed for the call.
 * time_ns: own monotonic clock, when sending began, or when the message was whole.
 */
typedef void (*gn_client_tap_fn)(void *ctx, bool is_sent, int64_t time_ns, const uint8_t *head,
                                 size_t head_bytes, const void *payload, size_t payload_bytes);

struct gn_client_tap {
    gn_client_tap_fn take;    // NULL: none
    void (*close)(void *ctx); // when the client is destroyed
    void *ctx;
};

struct gn_client {
    struct gn_conn *conn;
    struct gn_client_tap tap;
    struct gn_msg_welcome welcome;
    struct gn_wire_fault fault;
    int timeout_ms;
    bool (*is_given_up)(void *ctx); // NULL: nobody is asked, as once connected
    void *is_given_up_ctx;
    int lost;               // the errno that ended the connection, 0 while it is good
    int64_t last_sent_ns;   // own clock
    int64_t offset_ns;      // server minus own clock
    int64_t round_trip_ns;  // of the sample that gave offset_ns
    int64_t ping_sent_ns;   // t1 of the PING whose answer is a sample; 0: none is out
    int samples_left;       // of the measurement under way, with that one; 0: none is under way
    int64_t best_offset_ns; // of its samples
    int64_t best_trip_ns;   // INT64_MAX: none yet
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

/** Wait for a socket. Returns 1 ready, 0 deadline passed, -EINTR (given up), or another negative
 * errno. */
GN_MUST_USE int gn_client_wait_fd(const struct gn_client *client, int fd, short events,
                                  int64_t deadline_ns);

/** Write a whole message, within timeout_ms. payload is not kept. Returns as
 * gn_client_send_frame(). */
GN_MUST_USE int gn_client_send(struct gn_client *client, enum gn_wire_type type, const void *msg,
                               const void *payload, size_t payload_bytes);

/** As gn_client_send, of a head that is encoded already. */
GN_MUST_USE int gn_client_send_encoded(struct gn_client *client, const uint8_t *head,
                                       size_t head_bytes, const void *payload,
                                       size_t payload_bytes);

/** From now on tap sees what is sent and what comes; one per client. Taken over by the client. */
void gn_client_set_tap(struct gn_client *client, const struct gn_client_tap *tap);

/** Read until one message is there. Returns 1, 0 at the deadline, negative errno. */
GN_MUST_USE int gn_client_receive(struct gn_client *client, int64_t deadline_ns,
                                  struct gn_conn_message *out);

/** gn_conn_decode(); a server that sends what cannot be decoded is lost (-EPROTO). */
GN_MUST_USE int gn_client_decode(struct gn_client *client, const struct gn_conn_message *message,
                                 union gn_wire_message *out);

/** The HELLO that opts ask for. Returns 0, or -EINVAL and the reason. */
GN_MUST_USE int gn_client_fill_hello(const struct gn_client_options *opts,
                                     struct gn_msg_hello *hello, struct gn_wire_fault *why);

/** Connect and be welcomed; one REDIRECT is followed. Returns as gn_client_connect(). */
GN_MUST_USE int gn_client_say_hello(struct gn_client *client, const struct gn_client_options *opts);

#endif
