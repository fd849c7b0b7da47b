/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/lib/gnomon.h"

#include <assert.h>
#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/lib/dial.h"
#include "common/clock.h"
#include "common/conn.h"

#define DEFAULT_TIMEOUT_MS 5000
#define MAX_KEPT 64
// Longest pause before a server without idle timeout is asked whether it is alive, ms.
#define KEEPALIVE_MS 15000

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
    struct gn_conn_message kept[MAX_KEPT]; // events that came while a PONG was waited for
    uint8_t *kept_headers[MAX_KEPT];       // owned copies of their headers
    size_t kept_first, kept_count;
    struct gn_buf *payload; // of the event that was last handed out
};

GN_PRINTF(3, 4) static int fail(struct gn_wire_fault *why, int err, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    if (why)
        vsnprintf(why->text, sizeof(why->text), format, args);
    va_end(args);
    return err;
}

/** The connection is of no more use. */
static int lose(struct gn_client *client, int err, const char *text)
{
    fail(&client->fault, err, "%s", text);
    client->lost = err;
    return err;
}

static int64_t deadline_after(int timeout_ms)
{
    return timeout_ms < 0 ? INT64_MAX : gn_clock_get_monotonic_ns() + timeout_ms * GN_NS_PER_MS;
}

/** Wait for the socket. Returns 1 ready, 0 deadline passed, negative errno. */
static int wait_fd(int fd, short events, int64_t deadline_ns)
{
    for (;;) {
        int64_t left = deadline_ns == INT64_MAX ? -1 : deadline_ns - gn_clock_get_monotonic_ns();
        int ms = -1;
        if (deadline_ns != INT64_MAX) {
            int64_t up = left <= 0 ? 0 : (left + GN_NS_PER_MS - 1) / GN_NS_PER_MS;
            ms = up > 60000 ? 60000 : (int)up;
        }
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
    int64_t deadline = deadline_after(client->timeout_ms);
    for (;;) {
        int n = gn_conn_flush(client->conn);
        if (n < 0)
            return lose(client, n, "the connection broke while sending");
        client->last_sent_ns = gn_clock_get_monotonic_ns();
        if (n > 0)
            return 0;
        n = wait_fd(gn_conn_get_fd(client->conn), POLLOUT, deadline);
        if (n == 0)
            return lose(client, -ETIMEDOUT, "the server takes no more data");
        if (n < 0)
            return lose(client, n, "cannot wait for the socket");
    }
}

static void release_borrowed(struct gn_buf *buf)
{
    (void)buf; // the struct is on send_message()'s stack, the bytes are the caller's
}

static int send_message(struct gn_client *client, enum gn_wire_type type, const void *msg,
                        const void *payload, size_t payload_bytes)
{
    if (client->lost)
        return client->lost;
    struct gn_buf buf;
    // Nothing writes through a queued payload.
    gn_buf_init(&buf, (uint8_t *)(uintptr_t)payload, payload_bytes, release_borrowed, NULL);
    int err = gn_conn_send(client->conn, type, msg, payload_bytes ? &buf : NULL, &client->fault);
    if (!err)
        err = flush_all(client);
    if (err && gn_conn_get_queued_bytes(client->conn) > 0)
        gn_conn_drop_queued(client->conn); // buf goes out of scope
    return err;
}

/** Read until one message is there. Returns 1, 0 at the deadline, negative errno. */
static int receive(struct gn_client *client, int64_t deadline_ns, struct gn_conn_message *out)
{
    if (client->lost)
        return client->lost;
    for (;;) {
        int n = gn_conn_read(client->conn, out);
        if (n > 0)
            return n;
        if (n < 0)
            return lose(client, n, gn_conn_get_fault(client->conn));
        n = wait_fd(gn_conn_get_fd(client->conn), POLLIN, deadline_ns);
        if (n == 0)
            return 0;
        if (n < 0)
            return lose(client, n, "cannot wait for the socket");
    }
}

static int decode(struct gn_client *client, const struct gn_conn_message *message,
                  union gn_wire_message *out)
{
    struct gn_wire_fault fault;
    int err = gn_conn_decode(message, out, &fault);
    return err ? lose(client, -EPROTO, fault.text) : 0;
}

static int open_conn(struct gn_client *client, const char *host, uint16_t port)
{
    int fd = -1;
    int err = gn_dial(host, port, deadline_after(client->timeout_ms), &fd, &client->fault);
    if (err)
        return err;
    struct gn_conn_options opts = {.receive = GN_WIRE_TO_CLIENT, .fd = fd};
    gn_conn_destroy(&client->conn);
    err = gn_conn_create(&opts, &client->conn);
    if (err)
        gn_dial_close(fd);
    client->lost = 0;
    return err;
}

static int set_field(char *out, size_t cap, const char *text, const char *fallback)
{
    const char *from = text ? text : fallback;
    gn_wire_set_string(out, cap, from);
    return strcmp(out, from) == 0 ? 0 : -EINVAL; // a cut token or room is another one
}

static int fill_hello(const struct gn_client_options *opts, struct gn_msg_hello *hello,
                      struct gn_wire_fault *why)
{
    *hello = (struct gn_msg_hello){
        .version_min = GN_PROTO_VERSION_MIN,
        .version_max = GN_PROTO_VERSION_MAX,
        .capabilities =
            GN_MSG_CAPABILITY_JPEG | GN_MSG_CAPABILITY_EXR | GN_MSG_CAPABILITY_MULTIVIEW,
        .role = opts->role,
        .want_lighting_states = opts->want_lighting_states,
        .want_lighting_maps = opts->want_lighting_maps,
        .want_statistics = opts->want_statistics,
    };
    if (opts->role < _GN_MSG_ROLE_MIN + 1 || opts->role > _GN_MSG_ROLE_MAX)
        return fail(why, -EINVAL, "role %u is none of probe, viewer, tracker", opts->role);
    if (opts->timeout_ms < 0)
        return fail(why, -EINVAL, "timeout_ms %d must be above 0", opts->timeout_ms);
    if (opts->resume_token_bytes > sizeof(hello->resume_token.bytes))
        return fail(why, -EINVAL, "resume token of %zu bytes, at most %zu",
                    opts->resume_token_bytes, sizeof(hello->resume_token.bytes));
    if (opts->resume_token_bytes > 0)
        memcpy(hello->resume_token.bytes, opts->resume_token, opts->resume_token_bytes);
    hello->resume_token.size = (pb_size_t)opts->resume_token_bytes;
    if (set_field(hello->token, sizeof(hello->token), opts->token, "") ||
        set_field(hello->room, sizeof(hello->room), opts->room, "") ||
        set_field(hello->client_name, sizeof(hello->client_name), opts->client_name, "libgnomon") ||
        set_field(hello->client_version, sizeof(hello->client_version), opts->client_version,
                  GN_VERSION))
        return fail(why, -EINVAL, "token, room, client name or version is too long or not UTF-8");
    return 0;
}

/** HELLO and its answer. Returns 0 for WELCOME, 1 for REDIRECT (in *out_redirect), or a negative
 * errno. */
static int shake_hands(struct gn_client *client, const struct gn_msg_hello *hello,
                       struct gn_msg_redirect *out_redirect)
{
    int err = send_message(client, GN_WIRE_HELLO, hello, NULL, 0);
    if (err)
        return err;
    struct gn_conn_message message;
    int n = receive(client, deadline_after(client->timeout_ms), &message);
    if (n == 0)
        return fail(&client->fault, -ETIMEDOUT, "no answer to HELLO within %d ms",
                    client->timeout_ms);
    if (n == -EBADMSG || n == -EPROTO || n == -ENOMSG || n == -EMSGSIZE || n == -EOPNOTSUPP)
        return -EPROTO;
    if (n < 0)
        return n;
    union gn_wire_message m;
    err = decode(client, &message, &m);
    gn_buf_unref(&message.payload);
    if (err)
        return err;
    switch (message.envelope.type) {
    case GN_WIRE_WELCOME:
        client->welcome = m.welcome;
        return 0;
    case GN_WIRE_REDIRECT:
        *out_redirect = m.redirect;
        return 1;
    case GN_WIRE_ERROR:
        if (m.error.code == GN_MSG_ERROR_CODE_VERSION)
            return fail(&client->fault, -EPROTONOSUPPORT,
                        "the server speaks protocol %u to %u, this client %d to %d",
                        m.error.version_min, m.error.version_max, GN_PROTO_VERSION_MIN,
                        GN_PROTO_VERSION_MAX);
        return fail(&client->fault, -EACCES, "%s: %.120s", gn_wire_get_error_text(m.error.code),
                    m.error.sentence);
    default:
        return fail(&client->fault, -EPROTO, "HELLO was answered by a message of type %u",
                    message.envelope.type);
    }
}

static int connect_and_hello(struct gn_client *client, const struct gn_client_options *opts)
{
    struct gn_msg_hello hello;
    int err = fill_hello(opts, &hello, &client->fault);
    if (err)
        return err;
    struct gn_msg_redirect redirect;
    err = open_conn(client, opts->host ? opts->host : "127.0.0.1",
                    opts->port ? opts->port : GN_PROTO_PORT);
    if (err)
        return err;
    err = shake_hands(client, &hello, &redirect);
    if (err != 1)
        return err;
    static_assert(sizeof(hello.ticket) == sizeof(redirect.ticket), "a ticket goes back as it came");
    memcpy(&hello.ticket, &redirect.ticket, sizeof(hello.ticket));
    err = open_conn(client, redirect.host, (uint16_t)redirect.port);
    if (err)
        return err;
    err = shake_hands(client, &hello, &redirect);
    if (err == 1)
        return fail(&client->fault, -ELOOP, "redirected twice, now to '%.100s' port %u",
                    redirect.host, redirect.port);
    return err;
}

int gn_client_connect(const struct gn_client_options *opts, struct gn_client **out,
                      struct gn_wire_fault *why)
{
    *out = NULL;
    struct gn_client *client = calloc(1, sizeof(*client));
    if (!client)
        return fail(why, -ENOMEM, "out of memory");
    client->timeout_ms = opts->timeout_ms > 0 ? opts->timeout_ms : DEFAULT_TIMEOUT_MS;
    int err = connect_and_hello(client, opts);
    if (err) {
        if (why)
            *why = client->fault;
        gn_client_destroy(&client);
        return err;
    }
    client->fault.text[0] = 0;
    *out = client;
    return 0;
}

void gn_client_destroy(struct gn_client **client)
{
    if (!client || !*client)
        return;
    struct gn_client *c = *client;
    *client = NULL;
    for (; c->kept_count > 0; c->kept_count--, c->kept_first++) {
        gn_buf_unref(&c->kept[c->kept_first % MAX_KEPT].payload);
        free(c->kept_headers[c->kept_first % MAX_KEPT]);
    }
    gn_buf_unref(&c->payload);
    gn_conn_destroy(&c->conn);
    free(c);
}

int gn_client_bye(struct gn_client *client, enum gn_msg_bye_reason reason)
{
    struct gn_msg_bye bye = {.reason = reason};
    return send_message(client, GN_WIRE_BYE, &bye, NULL, 0);
}

const struct gn_msg_welcome *gn_client_get_welcome(const struct gn_client *client)
{
    return &client->welcome;
}

const char *gn_client_get_fault(const struct gn_client *client)
{
    return client->fault.text;
}

int gn_client_get_fd(const struct gn_client *client)
{
    return gn_conn_get_fd(client->conn);
}

/** PING and PONG end here. Returns 1 where the message was one of them, 0, or a negative errno. */
static int deal_inside(struct gn_client *client, const struct gn_conn_message *message,
                       int64_t received_ns)
{
    uint16_t type = message->envelope.type;
    if (type != GN_WIRE_PING && type != GN_WIRE_PONG)
        return 0;
    union gn_wire_message m;
    int err = decode(client, message, &m);
    if (err)
        return err;
    if (type == GN_WIRE_PONG) {
        if (client->pong_sent_ns != 0 && m.pong.t1_ns == client->pong_sent_ns) {
            client->pong = m.pong;
            client->pong_received_ns = received_ns;
            client->pong_sent_ns = 0;
        }
        return 1;
    }
    struct gn_msg_pong pong = {
        .t1_ns = m.ping.t1_ns, .t2_ns = received_ns, .t3_ns = gn_clock_get_monotonic_ns()};
    err = send_message(client, GN_WIRE_PONG, &pong, NULL, 0);
    return err ? err : 1;
}

static int keep(struct gn_client *client, struct gn_conn_message *message)
{
    size_t bytes = message->envelope.header_bytes;
    uint8_t *header = client->kept_count < MAX_KEPT ? malloc(bytes ? bytes : 1) : NULL;
    if (!header) {
        gn_buf_unref(&message->payload);
        return lose(client, -ENOBUFS, "too many events came while the clock was measured");
    }
    if (bytes > 0)
        memcpy(header, message->header, bytes);
    size_t i = (client->kept_first + client->kept_count++) % MAX_KEPT;
    client->kept_headers[i] = header;
    client->kept[i] = *message;
    client->kept[i].header = header;
    return 0;
}

/** One PING and its PONG. Returns 1, 0 at the deadline, negative errno. */
static int ping_once(struct gn_client *client, int64_t deadline_ns)
{
    struct gn_msg_ping ping = {.t1_ns = gn_clock_get_monotonic_ns()};
    client->pong_sent_ns = ping.t1_ns;
    int err = send_message(client, GN_WIRE_PING, &ping, NULL, 0);
    while (!err && client->pong_sent_ns != 0) {
        struct gn_conn_message message;
        int n = receive(client, deadline_ns, &message);
        if (n <= 0) {
            client->pong_sent_ns = 0;
            return n;
        }
        n = deal_inside(client, &message, gn_clock_get_monotonic_ns());
        err = n < 0 ? n : n == 0 ? keep(client, &message) : 0;
    }
    return err ? err : 1;
}

int gn_client_sync_clock(struct gn_client *client, int samples, int timeout_ms)
{
    if (samples < 1 || samples > 64)
        return fail(&client->fault, -EINVAL, "%d clock samples, must be in [1, 64]", samples);
    int64_t deadline = deadline_after(timeout_ms);
    int64_t best_trip = INT64_MAX, best_offset = 0;
    for (int i = 0; i < samples; i++) {
        int n = ping_once(client, deadline);
        if (n < 0)
            return n;
        if (n == 0)
            break;
        // RFC 5905, section 8: offset and delay of four timestamps. The differences of hostile
        // clocks may not overflow: unsigned arithmetic wraps.
        uint64_t t1 = (uint64_t)client->pong.t1_ns, t2 = (uint64_t)client->pong.t2_ns;
        uint64_t t3 = (uint64_t)client->pong.t3_ns, t4 = (uint64_t)client->pong_received_ns;
        int64_t trip = (int64_t)(t4 - t1 - (t3 - t2));
        int64_t offset = (int64_t)(t2 - t1) / 2 + (int64_t)(t3 - t4) / 2;
        if (trip >= 0 && trip < best_trip) {
            best_trip = trip;
            best_offset = offset;
        }
    }
    if (best_trip == INT64_MAX)
        return fail(&client->fault, -ETIMEDOUT, "no usable answer to PING within %d ms",
                    timeout_ms);
    client->round_trip_ns = best_trip;
    client->offset_ns = best_offset;
    return 0;
}

int64_t gn_client_now_ns(void)
{
    return gn_clock_get_monotonic_ns();
}

int64_t gn_client_to_server_ns(const struct gn_client *client, int64_t own_ns)
{
    return (int64_t)((uint64_t)own_ns + (uint64_t)client->offset_ns);
}

int64_t gn_client_get_clock_offset_ns(const struct gn_client *client)
{
    return client->offset_ns;
}

int64_t gn_client_get_round_trip_ns(const struct gn_client *client)
{
    return client->round_trip_ns;
}

int gn_client_send_environment(struct gn_client *client,
                               const struct gn_msg_environment_frame *frame, const void *payload,
                               size_t payload_bytes)
{
    return send_message(client, GN_WIRE_ENVIRONMENT_FRAME, frame, payload, payload_bytes);
}

int gn_client_send_pose(struct gn_client *client, const struct gn_msg_pose *pose)
{
    return send_message(client, GN_WIRE_POSE, pose, NULL, 0);
}

int gn_client_send_camera(struct gn_client *client, const struct gn_msg_camera *camera)
{
    return send_message(client, GN_WIRE_CAMERA, camera, NULL, 0);
}

int gn_client_send_frame(struct gn_client *client, const struct gn_msg_frame *frame,
                         const void *payload, size_t payload_bytes)
{
    return send_message(client, GN_WIRE_FRAME, frame, payload, payload_bytes);
}

/** When the next keepalive PING is due. */
static int64_t get_keepalive_ns(const struct gn_client *client)
{
    uint32_t idle = client->welcome.idle_timeout_ms;
    uint32_t pause = idle > 0 && idle / 3 < KEEPALIVE_MS ? idle / 3 : KEEPALIVE_MS;
    return client->last_sent_ns + (int64_t)pause * GN_NS_PER_MS;
}

/** The next message that is for the caller, kept or new. Returns 1, 0 at the deadline, negative
 * errno. */
static int next_message(struct gn_client *client, int64_t deadline_ns, struct gn_conn_message *out,
                        uint8_t **out_header)
{
    *out_header = NULL;
    if (client->kept_count > 0) {
        *out = client->kept[client->kept_first];
        *out_header = client->kept_headers[client->kept_first];
        client->kept_first = (client->kept_first + 1) % MAX_KEPT;
        client->kept_count--;
        return 1;
    }
    for (;;) {
        int64_t alive = get_keepalive_ns(client);
        int n = receive(client, alive < deadline_ns ? alive : deadline_ns, out);
        if (n > 0)
            n = deal_inside(client, out, gn_clock_get_monotonic_ns());
        else if (n == 0 && alive >= deadline_ns)
            return 0;
        else if (n == 0) {
            struct gn_msg_ping ping = {.t1_ns = gn_clock_get_monotonic_ns()};
            n = send_message(client, GN_WIRE_PING, &ping, NULL, 0);
            n = n ? n : 1;
        }
        if (n < 0)
            return n;
        if (n == 0)
            return 1;
    }
}

int gn_client_poll(struct gn_client *client, int timeout_ms, struct gn_client_event *out_event)
{
    gn_buf_unref(&client->payload);
    struct gn_conn_message message;
    uint8_t *header;
    int n = next_message(client, deadline_after(timeout_ms), &message, &header);
    if (n <= 0)
        return n;
    out_event->type = message.envelope.type;
    out_event->received_ns = gn_clock_get_monotonic_ns();
    int err = decode(client, &message, &out_event->message);
    free(header);
    client->payload = message.payload;
    if (err)
        return err;
    out_event->payload = message.payload ? message.payload->data : NULL;
    out_event->payload_bytes = message.payload ? message.payload->len : 0;
    return 1;
}
