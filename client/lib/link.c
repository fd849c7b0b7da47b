/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Whole messages over a non-blocking socket, each call with a deadline. */
#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "client/lib/client.h"
#include "common/clock.h"

/** How often who connects is asked whether to go on, ms. */
#define ASK_MS 100

int gn_client_fail(struct gn_wire_fault *why, int err, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    if (why)
        vsnprintf(why->text, sizeof(why->text), format, args);
    va_end(args);
    return err;
}

int gn_client_lose(struct gn_client *client, int err, const char *text)
{
    gn_client_fail(&client->fault, err, "%s", text);
    client->lost = err;
    return err;
}

int64_t gn_client_get_deadline(int timeout_ms)
{
    return timeout_ms < 0 ? INT64_MAX : gn_clock_get_monotonic_ns() + timeout_ms * GN_NS_PER_MS;
}

int gn_client_wait_fd(const struct gn_client *client, int fd, short events, int64_t deadline_ns)
{
    for (;;) {
        if (client->is_given_up && client->is_given_up(client->is_given_up_ctx))
            return -EINTR;
        int64_t left = deadline_ns == INT64_MAX ? -1 : deadline_ns - gn_clock_get_monotonic_ns();
        int ms = -1;
        if (deadline_ns != INT64_MAX) {
            int64_t up = left <= 0 ? 0 : (left + GN_NS_PER_MS - 1) / GN_NS_PER_MS;
            ms = up > 60000 ? 60000 : (int)up;
        }
        if (client->is_given_up && (ms < 0 || ms > ASK_MS))
            ms = ASK_MS;
        struct pollfd p = {.fd = fd, .events = events};
        int n = poll(&p, 1, ms);
        if (n > 0)
            return 1;
        if (n < 0 && errno != EINTR)
            return -errno;
        if (deadline_ns != INT64_MAX && gn_clock_get_monotonic_ns() >= deadline_ns)
            return 0;
    }
}

static int flush_all(struct gn_client *client)
{
    int64_t deadline = gn_client_get_deadline(client->timeout_ms);
    for (;;) {
        int n = gn_conn_flush(client->conn);
        if (n < 0)
            return gn_client_lose(client, n, "the connection broke while sending");
        client->last_sent_ns = gn_clock_get_monotonic_ns();
        if (n > 0)
            return 0;
        n = gn_client_wait_fd(client, gn_conn_get_fd(client->conn), POLLOUT, deadline);
        if (n == 0)
            return gn_client_lose(client, -ETIMEDOUT, "the server takes no more data");
        if (n < 0)
            return gn_client_lose(client, n, "cannot wait for the socket");
    }
}

static void release_borrowed(struct gn_buf *buf)
{
    (void)buf; // the struct is on gn_client_send()'s stack, the bytes are the caller's
}

int gn_client_send_encoded(struct gn_client *client, const uint8_t *head, size_t head_bytes,
                           const void *payload, size_t payload_bytes)
{
    if (client->lost)
        return client->lost;
    struct gn_buf buf;
    int64_t begin_ns = gn_clock_get_monotonic_ns();
    // Nothing writes through a queued payload.
    gn_buf_init(&buf, (uint8_t *)(uintptr_t)payload, payload_bytes, release_borrowed, NULL);
    int err = gn_conn_send_encoded(client->conn, head, head_bytes, payload_bytes ? &buf : NULL,
                                   &client->fault);
    if (!err)
        err = flush_all(client);
    if (err && gn_conn_get_queued_bytes(client->conn) > 0)
        gn_conn_drop_queued(client->conn); // buf goes out of scope
    if (!err && client->tap.take)
        client->tap.take(client->tap.ctx, true, begin_ns, head, head_bytes, payload, payload_bytes);
    return err;
}

int gn_client_send(struct gn_client *client, enum gn_wire_type type, const void *msg,
                   const void *payload, size_t payload_bytes)
{
    uint8_t head[GN_WIRE_HEAD_BYTES];
    size_t head_bytes = 0;
    if (client->lost)
        return client->lost;
    // No type's limit is as high: gn_wire_encode() refuses it in words.
    uint32_t bytes = payload_bytes < UINT32_MAX ? (uint32_t)payload_bytes : UINT32_MAX;
    int err = gn_wire_encode(type, msg, bytes, head, sizeof(head), &head_bytes, &client->fault);
    return err ? err : gn_client_send_encoded(client, head, head_bytes, payload, payload_bytes);
}

void gn_client_set_tap(struct gn_client *client, const struct gn_client_tap *tap)
{
    client->tap = *tap;
}

/** Shows the tap what came. */
static void tap_received(struct gn_client *client, const struct gn_conn_message *message)
{
    uint8_t head[GN_ENVELOPE_BYTES + GN_LIMIT_HEADER_BYTES];
    size_t n = message->envelope.header_bytes;
    gn_envelope_encode(&message->envelope, head);
    if (n > 0)
        memcpy(head + GN_ENVELOPE_BYTES, message->header, n);
    client->tap.take(client->tap.ctx, false, gn_clock_get_monotonic_ns(), head,
                     GN_ENVELOPE_BYTES + n, message->payload ? message->payload->data : NULL,
                     message->payload ? message->payload->len : 0);
}

int gn_client_receive(struct gn_client *client, int64_t deadline_ns, struct gn_conn_message *out)
{
    if (client->lost)
        return client->lost;
    for (;;) {
        int n = gn_conn_read(client->conn, out);
        if (n > 0 && client->tap.take)
            tap_received(client, out);
        if (n > 0)
            return n;
        if (n < 0)
            return gn_client_lose(client, n, gn_conn_get_fault(client->conn));
        n = gn_client_wait_fd(client, gn_conn_get_fd(client->conn), POLLIN, deadline_ns);
        if (n == 0)
            return 0;
        if (n < 0)
            return gn_client_lose(client, n, "cannot wait for the socket");
    }
}

int gn_client_decode(struct gn_client *client, const struct gn_conn_message *message,
                     union gn_wire_message *out)
{
    struct gn_wire_fault fault;
    int err = gn_conn_decode(message, out, &fault);
    return err ? gn_client_lose(client, -EPROTO, fault.text) : 0;
}
