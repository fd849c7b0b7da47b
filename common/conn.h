/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The framed connection, for both ends: messages in, messages out, over any byte stream.
 * The same code serves a non-blocking socket in an event loop and a blocking one. Bytes go through
 * a small table of functions, so that TLS or a WebSocket can take the place of the plain socket. It
 * knows framing and limits, not sessions: which message may come when is for the caller.
 */
#ifndef GN_COMMON_CONN_H
#define GN_COMMON_CONN_H

#include <stdbool.h>
#include <sys/types.h>
#include <sys/uio.h>

#include "common/buf.h"
#include "proto/attr.h"
#include "proto/wire.h"

/** A byte stream. None of these raises SIGPIPE. */
struct gn_conn_io {
    /** Up to len bytes; 0 at the end of the stream; -EAGAIN would block; another negative errno. */
    ssize_t (*read)(void *ctx, void *buf, size_t len);
    /** How many bytes went; -EAGAIN would block; another negative errno. */
    ssize_t (*writev)(void *ctx, const struct iovec *iov, int count);
    /** Give everything back. ctx is not used again. */
    void (*close)(void *ctx);
};

struct gn_conn_options {
    // What may arrive: TO_SERVER in a server, TO_CLIENT in a client; no default.
    enum gn_wire_direction receive;
    size_t max_queued_bytes;     // bound on what waits to be written, default 96 MiB
    const struct gn_conn_io *io; // borrowed until destroy; NULL: fd is a plain socket
    void *io_ctx;                // for io
    int fd;                      // the socket, owned from success on (only where io is NULL)
};

/** A message as it came. */
struct gn_conn_message {
    struct gn_envelope envelope;
    // envelope.header_bytes long; borrowed until the next call with this connection
    const uint8_t *header;
    // envelope.payload_bytes long; NULL where that is 0; the caller's reference
    struct gn_buf *payload;
};

/** Thread-safety: owner thread. */
struct gn_conn;

/** Returns 0, -EINVAL or -ENOMEM (then fd and io_ctx stay the caller's). */
GN_MUST_USE int gn_conn_create(const struct gn_conn_options *opts, struct gn_conn **out);

/** Closes the stream, gives back what is queued. */
void gn_conn_destroy(struct gn_conn **conn);

/**
 * Accept no longer payloads than this, in bytes, of any type, from the next envelope on. The type's
 * own limit holds as well. A server sets 0 until HELLO is accepted, then what the session is
 * granted. Default: no further bound.
 */
void gn_conn_set_max_payload(struct gn_conn *conn, uint32_t bytes);

/** Bytes read by one call at most, so that one busy peer does not keep the others waiting. */
#define GN_CONN_READ_BYTES (1u << 20)

/**
 * Read until a message is whole, the stream would block, or GN_CONN_READ_BYTES are read.
 * No memory is taken for a header or a payload before its length is checked, and then exactly that
 * length.
 *
 * Returns 1 and out_message: a message; its payload is the caller's to unref.
 * Returns 0: none yet (poll again; level-triggered in an event loop).
 * Returns a negative errno: the connection can be read no more, and every later call returns the
 * same: -ENODATA the peer closed between messages; -ECONNRESET in the middle of one; -EOPNOTSUPP a
 * message that goes the other way; those of gn_envelope_decode(), -EMSGSIZE also for a payload over
 * gn_conn_set_max_payload(); -ENOMEM; or the stream's own. gn_conn_get_fault() then has the
 * sentence and gn_wire_get_error_code() the code for an ERROR.
 */
GN_MUST_USE int gn_conn_read(struct gn_conn *conn, struct gn_conn_message *out_message);

/** Decode a message of gn_conn_read() into out, which is made to hold every type: gn_wire_decode().
 */
GN_MUST_USE int gn_conn_decode(const struct gn_conn_message *message, union gn_wire_message *out,
                               struct gn_wire_fault *out_fault);

/** Why reading ended, "" while it has not. Borrowed until destroy. */
const char *gn_conn_get_fault(const struct gn_conn *conn);

/** The envelope last read, also the one that was refused (all 0 where there was none): what an
 * ERROR is about. */
struct gn_envelope gn_conn_get_envelope(const struct gn_conn *conn);

/**
 * Queue a message; gn_conn_flush() writes it. payload: may be NULL; one more reference is taken,
 * kept until it is written. Returns 0, -EPIPE (after gn_conn_drop_queued()), -ENOBUFS (the queue's
 * bound would be passed: nothing is queued; drop something or the peer), -ENOMEM, or what
 * gn_wire_encode() returns (out_fault, may be NULL, says why).
 */
GN_MUST_USE int gn_conn_send(struct gn_conn *conn, uint16_t type, const void *msg,
                             struct gn_buf *payload, struct gn_wire_fault *out_fault);

/**
 * As gn_conn_send, of what is encoded already: head, copied, holds the envelope and the header, and
 * whoever encoded them has checked them.
 */
GN_MUST_USE int gn_conn_send_encoded(struct gn_conn *conn, const uint8_t *head, size_t head_len,
                                     struct gn_buf *payload, struct gn_wire_fault *out_fault);

/** Write what is queued. Returns 1 all written, 0 would block, or the stream's negative errno. */
GN_MUST_USE int gn_conn_flush(struct gn_conn *conn);

/** Bytes queued and not yet written; > 0: wait until the stream can be written, then flush. */
size_t gn_conn_get_queued_bytes(const struct gn_conn *conn);

/** Messages queued and not wholly written. */
size_t gn_conn_get_queued_messages(const struct gn_conn *conn);

/**
 * Give back all that is queued, for good. Where a message was half written the stream is out of
 * step, and every later send returns -EPIPE.
 */
void gn_conn_drop_queued(struct gn_conn *conn);

/** The plain socket, for poll or epoll; -1 with another io. */
int gn_conn_get_fd(const struct gn_conn *conn);

#endif
