/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/conn.h"

#include <assert.h>
#include <errno.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define DEFAULT_QUEUED_BYTES ((size_t)96 << 20)
// Far more than the frames outstanding of any session, few enough to bound the
// heads' memory.
#define QUEUE_SLOTS 64
#define WRITE_PARTS 16

/** One queued message: its envelope and header in memory of the slot, which later messages use
 * again. */
struct slot {
    uint8_t *head;
    size_t head_cap;
    size_t head_len;
    size_t written;         // of head and payload together
    struct gn_buf *payload; // shared (ref), may be NULL
};

enum stage { STAGE_ENVELOPE, STAGE_HEADER, STAGE_PAYLOAD };

struct gn_conn {
    const struct gn_conn_io *io; // borrowed until destroy
    void *io_ctx;
    int fd; // -1 where io is not the plain socket
    enum gn_wire_direction receive;
    uint32_t max_payload;

    enum stage stage;
    size_t have; // bytes of the present stage
    uint8_t envelope_bytes[GN_ENVELOPE_BYTES];
    struct gn_envelope envelope;
    uint8_t *header;        // owned; the largest header so far, at most GN_LIMIT_HEADER_BYTES
    size_t header_cap;      // bytes
    struct gn_buf *payload; // owned while it fills
    int read_err;           // 0 while reading goes on
    struct gn_wire_fault fault;

    struct slot slots[QUEUE_SLOTS];
    size_t first, count; // of slots
    size_t queued_bytes, max_queued_bytes;
    bool is_torn; // a half written message was given up
};

static ssize_t socket_read(void *ctx, void *buf, size_t len)
{
    const struct gn_conn *conn = ctx;
    ssize_t n;
    do
        n = recv(conn->fd, buf, len, 0);
    while (n < 0 && errno == EINTR);
    if (n >= 0)
        return n;
    return errno == EWOULDBLOCK ? -EAGAIN : -errno;
}

static ssize_t socket_writev(void *ctx, const struct iovec *iov, int count)
{
    const struct gn_conn *conn = ctx;
    // msghdr's pointer is not const, but sendmsg does not write through it.
    struct iovec parts[WRITE_PARTS];
    memcpy(parts, iov, (size_t)count * sizeof(*iov));
    struct msghdr msg = {.msg_iov = parts, .msg_iovlen = (size_t)count};
    ssize_t n;
    do
        n = sendmsg(conn->fd, &msg, MSG_NOSIGNAL);
    while (n < 0 && errno == EINTR);
    if (n >= 0)
        return n;
    return errno == EWOULDBLOCK ? -EAGAIN : -errno;
}

static void socket_close(void *ctx)
{
    struct gn_conn *conn = ctx;
    close(conn->fd);
}

static const struct gn_conn_io socket_io = {socket_read, socket_writev, socket_close};

int gn_conn_create(const struct gn_conn_options *opts, struct gn_conn **out)
{
    *out = NULL;
    if ((opts->receive != GN_WIRE_TO_SERVER && opts->receive != GN_WIRE_TO_CLIENT) ||
        (!opts->io && opts->fd < 0))
        return -EINVAL;
    struct gn_conn *conn = calloc(1, sizeof(*conn));
    if (!conn)
        return -ENOMEM;
    conn->io = opts->io ? opts->io : &socket_io;
    conn->io_ctx = opts->io ? opts->io_ctx : conn;
    conn->fd = opts->io ? -1 : opts->fd;
    conn->receive = opts->receive;
    conn->max_payload = UINT32_MAX;
    conn->max_queued_bytes = opts->max_queued_bytes ? opts->max_queued_bytes : DEFAULT_QUEUED_BYTES;
    *out = conn;
    return 0;
}

void gn_conn_destroy(struct gn_conn **conn)
{
    if (!conn || !*conn)
        return;
    struct gn_conn *c = *conn;
    *conn = NULL;
    c->io->close(c->io_ctx);
    for (size_t i = 0; i < QUEUE_SLOTS; i++) {
        free(c->slots[i].head);
        gn_buf_unref(&c->slots[i].payload);
    }
    gn_buf_unref(&c->payload);
    free(c->header);
    free(c);
}

void gn_conn_set_max_payload(struct gn_conn *conn, uint32_t bytes)
{
    conn->max_payload = bytes;
}

/** Keep the error and its sentence, once and for all. Returns err. */
GN_PRINTF(3, 4)
static int stop_reading(struct gn_conn *conn, int err, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(conn->fault.text, sizeof(conn->fault.text), format, args);
    va_end(args);
    conn->read_err = err;
    return err;
}

static int stop_out_of_memory(struct gn_conn *conn)
{
    return stop_reading(conn, -ENOMEM, "cannot read: out of memory");
}

/** The envelope is not one that may come: say why. */
static int refuse_envelope(struct gn_conn *conn, int err)
{
    const struct gn_envelope *e = &conn->envelope;
    const struct gn_wire_info *info = gn_wire_get_info(e->type);
    const char *name = info ? info->name : "?";
    if (err == -EBADMSG)
        return stop_reading(conn, err, "not this protocol: a message starts with the bytes GNOM");
    if (err == -EPROTONOSUPPORT)
        return stop_reading(conn, err, "protocol version %u, this side speaks %d to %d", e->version,
                            GN_PROTO_VERSION_MIN, GN_PROTO_VERSION_MAX);
    if (err == -EPROTO)
        return stop_reading(conn, err, "%s: flags %u and stream %u, must be 0", name, e->flags,
                            e->stream);
    if (!info)
        return stop_reading(conn, err, "no message has type %u", e->type);
    if (err == -EOPNOTSUPP)
        return stop_reading(conn, err, "%s: this side does not receive such messages", name);
    return stop_reading(
        conn, err, "%s: header of %u and payload of %u bytes, at most %u and %u here", name,
        e->header_bytes, e->payload_bytes, info->max_header_bytes,
        info->max_payload_bytes < conn->max_payload ? info->max_payload_bytes : conn->max_payload);
}

/** After the 20 bytes: check them, and only then take memory. */
static int begin_message(struct gn_conn *conn)
{
    memset(&conn->envelope, 0, sizeof(conn->envelope));
    const struct gn_envelope *e = &conn->envelope;
    int err = gn_envelope_decode(conn->envelope_bytes, &conn->envelope);
    if (!err && !(gn_wire_get_info(e->type)->direction & conn->receive))
        err = -EOPNOTSUPP;
    if (!err && e->payload_bytes > conn->max_payload)
        err = -EMSGSIZE;
    if (err)
        return refuse_envelope(conn, err);
    if (e->header_bytes > conn->header_cap) {
        uint8_t *header = realloc(conn->header, e->header_bytes);
        if (!header)
            return stop_out_of_memory(conn);
        conn->header = header;
        conn->header_cap = e->header_bytes;
    }
    return 0;
}

/** Where the present stage's bytes go, and how many it has in all. */
static uint8_t *get_target(struct gn_conn *conn, size_t *out_bytes)
{
    switch (conn->stage) {
    case STAGE_HEADER:
        *out_bytes = conn->envelope.header_bytes;
        return conn->header;
    case STAGE_PAYLOAD:
        *out_bytes = conn->envelope.payload_bytes;
        return conn->payload->data;
    case STAGE_ENVELOPE:
        break;
    }
    *out_bytes = GN_ENVELOPE_BYTES;
    return conn->envelope_bytes;
}

/** The present stage is full: go to the next. Returns 1 where that ends the message, 0, or what
 * stop_reading() returned. */
static int end_stage(struct gn_conn *conn)
{
    conn->have = 0;
    if (conn->stage == STAGE_ENVELOPE) {
        int err = begin_message(conn);
        if (err)
            return err;
        conn->stage = STAGE_HEADER;
        if (conn->envelope.header_bytes > 0)
            return 0;
    }
    if (conn->stage == STAGE_HEADER && conn->envelope.payload_bytes > 0) {
        if (gn_buf_create(conn->envelope.payload_bytes, &conn->payload))
            return stop_out_of_memory(conn);
        conn->stage = STAGE_PAYLOAD;
        return 0;
    }
    conn->stage = STAGE_ENVELOPE;
    return 1;
}

int gn_conn_read(struct gn_conn *conn, struct gn_conn_message *out_message)
{
    if (conn->read_err)
        return conn->read_err;
    for (size_t budget = GN_CONN_READ_BYTES; budget > 0;) {
        size_t want;
        uint8_t *target = get_target(conn, &want);
        size_t ask = want - conn->have < budget ? want - conn->have : budget;
        ssize_t n = conn->io->read(conn->io_ctx, target + conn->have, ask);
        if (n == -EAGAIN)
            return 0;
        if (n < 0)
            return stop_reading(conn, (int)n, "cannot read: %s", strerror((int)-n));
        if (n == 0 && conn->stage == STAGE_ENVELOPE && conn->have == 0)
            return stop_reading(conn, -ENODATA, "the peer closed the connection");
        if (n == 0)
            return stop_reading(conn, -ECONNRESET,
                                "the peer closed the connection in the middle of a message");
        conn->have += (size_t)n;
        budget -= (size_t)n;
        if (conn->have < want)
            continue;
        int end = end_stage(conn);
        if (end < 0)
            return end;
        if (end == 0)
            continue;
        out_message->envelope = conn->envelope;
        out_message->header = conn->header;
        out_message->payload = conn->payload;
        conn->payload = NULL;
        return 1;
    }
    return 0;
}

int gn_conn_decode(const struct gn_conn_message *message, union gn_wire_message *out,
                   struct gn_wire_fault *out_fault)
{
    const struct gn_envelope *e = &message->envelope;
    return gn_wire_decode(e->type, message->header, e->header_bytes, e->payload_bytes, out,
                          out_fault);
}

const char *gn_conn_get_fault(const struct gn_conn *conn)
{
    return conn->fault.text;
}

struct gn_envelope gn_conn_get_envelope(const struct gn_conn *conn)
{
    return conn->envelope;
}

int gn_conn_send(struct gn_conn *conn, uint16_t type, const void *msg, struct gn_buf *payload,
                 struct gn_wire_fault *out_fault)
{
    uint8_t head[GN_WIRE_HEAD_BYTES];
    size_t head_len = 0;
    size_t payload_len = payload ? payload->len : 0;
    if (conn->is_torn)
        return -EPIPE;
    // No type's limit is as high: gn_wire_encode() refuses it in words.
    uint32_t payload_bytes = payload_len < UINT32_MAX ? (uint32_t)payload_len : UINT32_MAX;
    int err = gn_wire_encode(type, msg, payload_bytes, head, sizeof(head), &head_len, out_fault);
    return err ? err : gn_conn_send_encoded(conn, head, head_len, payload, out_fault);
}

int gn_conn_send_encoded(struct gn_conn *conn, const uint8_t *head, size_t head_len,
                         struct gn_buf *payload, struct gn_wire_fault *out_fault)
{
    size_t payload_len = payload ? payload->len : 0;
    if (conn->is_torn)
        return -EPIPE;
    size_t bytes = head_len + payload_len;
    if (conn->count == QUEUE_SLOTS || bytes > conn->max_queued_bytes - conn->queued_bytes) {
        if (out_fault)
            snprintf(out_fault->text, sizeof(out_fault->text),
                     "%zu messages of %zu bytes wait to be written already", conn->count,
                     conn->queued_bytes);
        return -ENOBUFS;
    }
    struct slot *slot = &conn->slots[(conn->first + conn->count) % QUEUE_SLOTS];
    if (head_len > slot->head_cap) {
        uint8_t *grown = realloc(slot->head, head_len);
        if (!grown)
            return -ENOMEM;
        slot->head = grown;
        slot->head_cap = head_len;
    }
    memcpy(slot->head, head, head_len);
    slot->head_len = head_len;
    slot->written = 0;
    slot->payload = payload_len ? gn_buf_ref(payload) : NULL;
    conn->count++;
    conn->queued_bytes += bytes;
    return 0;
}

/** The unwritten parts of the queue's front. Returns how many. */
static int gather(const struct gn_conn *conn, struct iovec parts[static WRITE_PARTS])
{
    int n = 0;
    for (size_t i = 0; i < conn->count && n + 2 <= WRITE_PARTS; i++) {
        const struct slot *slot = &conn->slots[(conn->first + i) % QUEUE_SLOTS];
        size_t skip = slot->written;
        if (skip < slot->head_len) {
            parts[n++] = (struct iovec){slot->head + skip, slot->head_len - skip};
            skip = 0;
        } else {
            skip -= slot->head_len;
        }
        if (slot->payload)
            parts[n++] = (struct iovec){slot->payload->data + skip, slot->payload->len - skip};
    }
    return n;
}

/** Take n written bytes off the queue's front. */
static void advance(struct gn_conn *conn, size_t n)
{
    assert(n <= conn->queued_bytes);
    conn->queued_bytes -= n;
    while (n > 0) {
        struct slot *slot = &conn->slots[conn->first];
        size_t all = slot->head_len + (slot->payload ? slot->payload->len : 0);
        size_t part = all - slot->written < n ? all - slot->written : n;
        slot->written += part;
        n -= part;
        if (slot->written < all)
            return;
        gn_buf_unref(&slot->payload);
        conn->first = (conn->first + 1) % QUEUE_SLOTS;
        conn->count--;
    }
}

int gn_conn_flush(struct gn_conn *conn)
{
    while (conn->count > 0) {
        struct iovec parts[WRITE_PARTS];
        ssize_t n = conn->io->writev(conn->io_ctx, parts, gather(conn, parts));
        if (n == -EAGAIN || n == 0)
            return 0;
        if (n < 0)
            return (int)n;
        advance(conn, (size_t)n);
    }
    return 1;
}

void gn_conn_drop_queued(struct gn_conn *conn)
{
    conn->is_torn = conn->is_torn || (conn->count > 0 && conn->slots[conn->first].written > 0);
    for (; conn->count > 0; conn->count--) {
        gn_buf_unref(&conn->slots[conn->first].payload);
        conn->first = (conn->first + 1) % QUEUE_SLOTS;
    }
    conn->queued_bytes = 0;
}

size_t gn_conn_get_queued_bytes(const struct gn_conn *conn)
{
    return conn->queued_bytes;
}

size_t gn_conn_get_queued_messages(const struct gn_conn *conn)
{
    return conn->count;
}

int gn_conn_get_fd(const struct gn_conn *conn)
{
    return conn->fd;
}
