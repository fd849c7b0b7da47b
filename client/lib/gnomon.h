/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * libgnomon: a client of gnomond. Connect, send frames and poses, receive results.
 * Messages are the plain structs of gnomon.proto (struct gn_msg_frame, ...): every field is
 * documented there and in PROTOCOL.md. No call needs anything of the encoding behind them.
 */
#ifndef GN_CLIENT_LIB_GNOMON_H
#define GN_CLIENT_LIB_GNOMON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/attr.h"
#include "proto/wire.h"

struct gn_client_options {
    const char *host;           // name or address, default "127.0.0.1"
    uint16_t port;              // default GN_PROTO_PORT
    enum gn_msg_role role;      // no default
    const char *room;           // default "": the server's first
    const char *token;          // default ""
    const char *client_name;    // default "libgnomon"
    const char *client_version; // default the library's
    bool want_lighting_states;
    bool want_lighting_maps;
    bool want_statistics;
    int timeout_ms; // for each of: connecting, the answer to HELLO, one send; > 0, default 5000
    const uint8_t *resume_token; // from an earlier welcome, default none
    size_t resume_token_bytes;   // [0, 32]
    // Asked ten times a second while gn_client_connect() waits, in its thread; true ends it with
    // -EINTR. Default NULL: it waits for as long as timeout_ms says.
    bool (*is_given_up)(void *ctx);
    void *ctx; // for is_given_up
};

/** What came from the server. Which member of `message` holds is said by `type`. */
struct gn_client_event {
    enum gn_wire_type type; // RESULT, DROPPED, LIGHTING_STATE, STATISTICS, ERROR or BYE
    int64_t received_ns;    // own monotonic clock
    union gn_wire_message message;
    const uint8_t *payload; // borrowed until the next gn_client_poll(); NULL where there is none
    size_t payload_bytes;
};

/** Thread-safety: unsafe; one thread at a time. Two threads that must not wait for each other use
 * two connections. */
struct gn_client;

/**
 * Connect, say HELLO and wait for the answer; one REDIRECT is followed.
 * On failure *out is NULL and why (may be NULL) has one line that says what failed, where and why.
 * Returns 0; -EINVAL (a bad option), -EHOSTUNREACH (no such host), the socket's errno, -ETIMEDOUT,
 * -EACCES (the server said no: its sentence is in why), -EPROTONOSUPPORT (no version in common),
 * -ELOOP (redirected twice), -EPROTO (not our protocol), -EINTR (given up) or -ENOMEM.
 */
GN_MUST_USE int gn_client_connect(const struct gn_client_options *opts, struct gn_client **out,
                                  struct gn_wire_fault *why);

/** Closes without BYE. */
void gn_client_destroy(struct gn_client **client);

/** Tell the server that we are done (the session ends), and write all that is queued. Destroy
 * afterwards. */
GN_MUST_USE int gn_client_bye(struct gn_client *client, enum gn_msg_bye_reason reason);

/** What the server granted. Borrowed until destroy. */
const struct gn_msg_welcome *gn_client_get_welcome(const struct gn_client *client);

/** One line about the last call that failed; "" while none has. Borrowed until destroy. */
const char *gn_client_get_fault(const struct gn_client *client);

/** The socket, to wait for beside others; then call gn_client_poll() with timeout 0 until it
 * returns 0. */
int gn_client_get_fd(const struct gn_client *client);

/**
 * Send `samples` PINGs [1, 64] one after another and keep the offset of the one with the shortest
 * round trip (four timestamps: PROTOCOL.md, "Clock"). Events that arrive meanwhile are kept for
 * gn_client_poll(), at most 64. Do it after connecting. Returns 0, -ETIMEDOUT (no answer to any
 * within timeout_ms), -EINVAL, -ENOBUFS (too many events kept), or as gn_client_poll().
 */
GN_MUST_USE int gn_client_sync_clock(struct gn_client *client, int samples, int timeout_ms);

/**
 * The same without waiting, for every minute or so: the first PING goes out now, gn_client_poll()
 * takes each answer when it comes and sends the next, and the offset changes with the last of them;
 * until then it stays. An answer counts from when it is read: poll often meanwhile. Does nothing
 * while such a measurement is under way. Returns 0, -EINVAL, or as gn_client_send_frame().
 */
GN_MUST_USE int gn_client_begin_clock_sync(struct gn_client *client, int samples);

/** Own monotonic clock, ns (CLOCK_MONOTONIC). */
int64_t gn_client_now_ns(void);

/** Own time in the server's clock, as capture_time_ns wants it. Unsynchronised clocks count as
 * equal. */
int64_t gn_client_to_server_ns(const struct gn_client *client, int64_t own_ns);

/** Server minus own clock, ns, and the round trip of the sample it came from (error at most half of
 * it); 0 before sync. */
int64_t gn_client_get_clock_offset_ns(const struct gn_client *client);
int64_t gn_client_get_round_trip_ns(const struct gn_client *client);

/**
 * Send a message; returns when the operating system has taken all of it. payload is not kept.
 * Returns 0; -EDOM or -EMSGSIZE (a value or size the server would refuse: gn_client_get_fault()
 * says which; the connection is still good); -ETIMEDOUT or the socket's errno (the connection is
 * lost).
 */
GN_MUST_USE int gn_client_send_environment(struct gn_client *client,
                                           const struct gn_msg_environment_frame *frame,
                                           const void *payload, size_t payload_bytes);
GN_MUST_USE int gn_client_send_emitter(struct gn_client *client,
                                       const struct gn_msg_emitter_frame *frame,
                                       const void *payload, size_t payload_bytes);
GN_MUST_USE int gn_client_send_pose(struct gn_client *client, const struct gn_msg_pose *pose);
GN_MUST_USE int gn_client_send_camera(struct gn_client *client, const struct gn_msg_camera *camera);
GN_MUST_USE int gn_client_send_frame(struct gn_client *client, const struct gn_msg_frame *frame,
                                     const void *payload, size_t payload_bytes);

/**
 * Wait for the next event at most timeout_ms (0: do not wait; < 0: for ever). PING and PONG are
 * dealt with inside, and the connection is kept alive as long as this is called now and then.
 * Returns 1 and out_event; 0 at the deadline; -ENODATA (the server closed), or another negative
 * errno: the connection is lost, gn_client_get_fault() says why.
 */
GN_MUST_USE int gn_client_poll(struct gn_client *client, int timeout_ms,
                               struct gn_client_event *out_event);

#endif
