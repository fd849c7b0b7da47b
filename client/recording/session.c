/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/recording/session.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/lib/client.h"
#include "client/recording/recording.h"
#include "common/clock.h"

struct session {
    struct gn_recording_writer *writer; // owned; NULL once it has ended
    const struct gn_client *client;     // borrowed: it outlives us
    bool has_clock;
    int64_t offset_ns; // server minus own clock, as recorded last
    char name[64];
};

/** Writes one record; where that fails, the last. */
static void put(struct session *s, enum gn_recording_kind kind, int64_t time_ns,
                const struct gn_recording_part *parts, int n_parts)
{
    struct gn_error error = {0};
    if (!s->writer ||
        gn_recording_writer_put(s->writer, kind, time_ns, parts, n_parts, &error) == 0)
        return;
    fprintf(stderr, "%s: %s; the session goes on\n", s->name, error.text);
    gn_recording_writer_close(&s->writer);
}

/** The clock's offset, where it is another than before. */
static void put_clock(struct session *s, int64_t time_ns)
{
    int64_t offset_ns = gn_client_get_clock_offset_ns(s->client);
    if (s->has_clock && offset_ns == s->offset_ns)
        return;
    uint8_t body[8];
    for (int i = 0; i < 8; i++)
        body[i] = (uint8_t)((uint64_t)offset_ns >> (8 * i));
    s->has_clock = true;
    s->offset_ns = offset_ns;
    put(s, GN_RECORDING_CLOCK, time_ns, &(struct gn_recording_part){body, sizeof(body)}, 1);
}

static void take(void *ctx, bool is_sent, int64_t time_ns, const uint8_t *head, size_t head_bytes,
                 const void *payload, size_t payload_bytes)
{
    struct session *s = ctx;
    int type = head[6] | head[7] << 8; // of the envelope
    if (type == GN_WIRE_PING || type == GN_WIRE_PONG)
        return;
    const struct gn_recording_part parts[2] = {{head, head_bytes}, {payload, payload_bytes}};
    put_clock(s, time_ns);
    put(s, is_sent ? GN_RECORDING_SENT : GN_RECORDING_RECEIVED, time_ns, parts, 2);
}

static void end(void *ctx)
{
    struct session *s = ctx;
    gn_recording_writer_close(&s->writer);
    free(s);
}

/** HELLO and WELCOME, which went before the client could be listened to. */
static int put_greeting(struct session *s, const struct gn_client_options *opts,
                        struct gn_error *out_error)
{
    struct gn_msg_hello hello;
    struct gn_msg_welcome welcome = *gn_client_get_welcome(s->client);
    struct gn_wire_fault why = {{0}};
    uint8_t head[GN_WIRE_HEAD_BYTES];
    size_t n = 0;
    int64_t now_ns = gn_clock_get_monotonic_ns();
    int err = gn_client_fill_hello(opts, &hello, &why);
    hello.token[0] = 0;
    hello.resume_token.size = 0;
    welcome.resume_token.size = 0;
    if (!err)
        err = gn_wire_encode(GN_WIRE_HELLO, &hello, 0, head, sizeof(head), &n, &why);
    if (err)
        return gn_error_set(out_error, err, "cannot record HELLO: %s", why.text);
    put(s, GN_RECORDING_STREAM, now_ns, &(struct gn_recording_part){head, n}, 1);
    err = gn_wire_encode(GN_WIRE_WELCOME, &welcome, 0, head, sizeof(head), &n, &why);
    if (err)
        return gn_error_set(out_error, err, "cannot record WELCOME: %s", why.text);
    put(s, GN_RECORDING_RECEIVED, now_ns, &(struct gn_recording_part){head, n}, 1);
    return 0;
}

int gn_recording_record_client(const char *path, uint64_t max_bytes,
                               const struct gn_client_options *opts, struct gn_client *client,
                               struct gn_error *out_error)
{
    struct session *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->client = client;
    snprintf(s->name, sizeof(s->name), "%s", opts->client_name ? opts->client_name : "libgnomon");
    int err = gn_recording_writer_open(path, max_bytes, &s->writer, out_error);
    if (!err)
        err = put_greeting(s, opts, out_error);
    if (err) {
        end(s);
        return err;
    }
    gn_client_set_tap(client, &(struct gn_client_tap){.take = take, .close = end, .ctx = s});
    return 0;
}
