/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/lib/gnomon.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "client/lib/client.h"
#include "common/clock.h"

#define DEFAULT_TIMEOUT_MS 5000
// Longest pause before a server without idle timeout is asked whether it is alive, ms.
#define KEEPALIVE_MS 15000

int gn_client_connect(const struct gn_client_options *opts, struct gn_client **out,
                      struct gn_wire_fault *why)
{
    *out = NULL;
    struct gn_client *client = calloc(1, sizeof(*client));
    if (!client)
        return gn_client_fail(why, -ENOMEM, "out of memory");
    client->timeout_ms = opts->timeout_ms > 0 ? opts->timeout_ms : DEFAULT_TIMEOUT_MS;
    client->is_given_up = opts->is_given_up;
    client->is_given_up_ctx = opts->ctx;
    int err = gn_client_say_hello(client, opts);
    if (err) {
        if (why)
            *why = client->fault;
        gn_client_destroy(&client);
        return err;
    }
    client->fault.text[0] = 0;
    client->is_given_up = NULL;
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
        gn_buf_unref(&c->kept[c->kept_first % GN_CLIENT_MAX_KEPT].payload);
        free(c->kept_headers[c->kept_first % GN_CLIENT_MAX_KEPT]);
    }
    gn_buf_unref(&c->payload);
    gn_conn_destroy(&c->conn);
    if (c->tap.close)
        c->tap.close(c->tap.ctx);
    free(c);
}

int gn_client_bye(struct gn_client *client, enum gn_msg_bye_reason reason)
{
    struct gn_msg_bye bye = {.reason = reason};
    return gn_client_send(client, GN_WIRE_BYE, &bye, NULL, 0);
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

/** Sends the PING of the next sample. */
static int send_sample(struct gn_client *client)
{
    struct gn_msg_ping ping = {.t1_ns = gn_clock_get_monotonic_ns()};
    client->ping_sent_ns = ping.t1_ns;
    return gn_client_send(client, GN_WIRE_PING, &ping, NULL, 0);
}

/** Ends the measurement with the best of its samples. Returns whether there was one. */
static bool end_samples(struct gn_client *client)
{
    client->samples_left = 0;
    client->ping_sent_ns = 0;
    if (client->best_trip_ns == INT64_MAX)
        return false;
    client->round_trip_ns = client->best_trip_ns;
    client->offset_ns = client->best_offset_ns;
    return true;
}

/** The answer to a PING; where it is a sample the next one is sent, or all are there. */
static int take_pong(struct gn_client *client, const struct gn_msg_pong *pong, int64_t received_ns)
{
    if (client->ping_sent_ns == 0 || pong->t1_ns != client->ping_sent_ns)
        return 0;
    client->ping_sent_ns = 0;
    // RFC 5905, section 8: offset and delay of four timestamps. The differences of hostile clocks
    // may not overflow: unsigned arithmetic wraps.
    uint64_t t1 = (uint64_t)pong->t1_ns, t2 = (uint64_t)pong->t2_ns;
    uint64_t t3 = (uint64_t)pong->t3_ns, t4 = (uint64_t)received_ns;
    int64_t trip = (int64_t)(t4 - t1 - (t3 - t2));
    if (trip >= 0 && trip < client->best_trip_ns) {
        client->best_trip_ns = trip;
        client->best_offset_ns = (int64_t)(t2 - t1) / 2 + (int64_t)(t3 - t4) / 2;
    }
    if (--client->samples_left > 0)
        return send_sample(client);
    (void)!end_samples(client);
    return 0;
}

/** PING and PONG end here. Returns 1 where the message was one of them, 0, or a negative errno. */
static int deal_inside(struct gn_client *client, const struct gn_conn_message *message,
                       int64_t received_ns)
{
    uint16_t type = message->envelope.type;
    if (type != GN_WIRE_PING && type != GN_WIRE_PONG)
        return 0;
    union gn_wire_message m;
    int err = gn_client_decode(client, message, &m);
    if (!err && type == GN_WIRE_PONG)
        err = take_pong(client, &m.pong, received_ns);
    else if (!err) {
        struct gn_msg_pong pong = {
            .t1_ns = m.ping.t1_ns, .t2_ns = received_ns, .t3_ns = gn_clock_get_monotonic_ns()};
        err = gn_client_send(client, GN_WIRE_PONG, &pong, NULL, 0);
    }
    return err ? err : 1;
}

static int keep(struct gn_client *client, struct gn_conn_message *message)
{
    size_t bytes = message->envelope.header_bytes;
    uint8_t *header = client->kept_count < GN_CLIENT_MAX_KEPT ? malloc(bytes ? bytes : 1) : NULL;
    if (!header) {
        gn_buf_unref(&message->payload);
        return gn_client_lose(client, -ENOBUFS,
                              "too many events came while the clock was measured");
    }
    if (bytes > 0)
        memcpy(header, message->header, bytes);
    size_t i = (client->kept_first + client->kept_count++) % GN_CLIENT_MAX_KEPT;
    client->kept_headers[i] = header;
    client->kept[i] = *message;
    client->kept[i].header = header;
    return 0;
}

static int begin_samples(struct gn_client *client, int samples)
{
    if (samples < 1 || samples > 64)
        return gn_client_fail(&client->fault, -EINVAL, "%d clock samples, must be in [1, 64]",
                              samples);
    client->samples_left = samples;
    client->best_trip_ns = INT64_MAX;
    return send_sample(client);
}

int gn_client_begin_clock_sync(struct gn_client *client, int samples)
{
    return client->samples_left > 0 ? client->lost : begin_samples(client, samples);
}

int gn_client_sync_clock(struct gn_client *client, int samples, int timeout_ms)
{
    int64_t deadline = gn_client_get_deadline(timeout_ms);
    int err = begin_samples(client, samples);
    while (!err && client->samples_left > 0) {
        struct gn_conn_message message;
        int n = gn_client_receive(client, deadline, &message);
        if (n == 0)
            break;
        if (n > 0)
            n = deal_inside(client, &message, gn_clock_get_monotonic_ns());
        err = n < 0 ? n : n == 0 ? keep(client, &message) : 0;
    }
    if (err)
        return err;
    if (!end_samples(client))
        return gn_client_fail(&client->fault, -ETIMEDOUT, "no usable answer to PING within %d ms",
                              timeout_ms);
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
    return gn_client_send(client, GN_WIRE_ENVIRONMENT_FRAME, frame, payload, payload_bytes);
}

int gn_client_send_emitter(struct gn_client *client, const struct gn_msg_emitter_frame *frame,
                           const void *payload, size_t payload_bytes)
{
    return gn_client_send(client, GN_WIRE_EMITTER_FRAME, frame, payload, payload_bytes);
}

int gn_client_send_pose(struct gn_client *client, const struct gn_msg_pose *pose)
{
    return gn_client_send(client, GN_WIRE_POSE, pose, NULL, 0);
}

int gn_client_send_camera(struct gn_client *client, const struct gn_msg_camera *camera)
{
    return gn_client_send(client, GN_WIRE_CAMERA, camera, NULL, 0);
}

int gn_client_send_frame(struct gn_client *client, const struct gn_msg_frame *frame,
                         const void *payload, size_t payload_bytes)
{
    return gn_client_send(client, GN_WIRE_FRAME, frame, payload, payload_bytes);
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
        client->kept_first = (client->kept_first + 1) % GN_CLIENT_MAX_KEPT;
        client->kept_count--;
        return 1;
    }
    for (;;) {
        int64_t alive = get_keepalive_ns(client);
        int n = gn_client_receive(client, alive < deadline_ns ? alive : deadline_ns, out);
        if (n > 0)
            n = deal_inside(client, out, gn_clock_get_monotonic_ns());
        else if (n == 0 && alive >= deadline_ns)
            return 0;
        else if (n == 0) {
            struct gn_msg_ping ping = {.t1_ns = gn_clock_get_monotonic_ns()};
            n = gn_client_send(client, GN_WIRE_PING, &ping, NULL, 0);
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
    int n = next_message(client, gn_client_get_deadline(timeout_ms), &message, &header);
    if (n <= 0)
        return n;
    out_event->type = message.envelope.type;
    out_event->received_ns = gn_clock_get_monotonic_ns();
    int err = gn_client_decode(client, &message, &out_event->message);
    free(header);
    client->payload = message.payload;
    if (err)
        return err;
    out_event->payload = message.payload ? message.payload->data : NULL;
    out_event->payload_bytes = message.payload ? message.payload->len : 0;
    return 1;
}
