/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What of a recorded message is sent: all of it, but for the capture time, which is moved to now,
 * and, where light is pinned, the light that a frame waits for.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/cmd_replay/playback_internal.h"
#include "client/lib/client.h"

/** What a frame waits for its light at most, when that is pinned. */
#define PINNED_WAIT_MS GN_LIMIT_LIGHTING_WAIT_MS

int gn_playback_grow(uint8_t **data, size_t *cap, size_t bytes, struct gn_error *out_error)
{
    if (bytes <= *cap)
        return 0;
    uint8_t *grown = realloc(*data, bytes);
    if (!grown)
        return gn_error_set(out_error, -ENOMEM, "out of memory for a message");
    *data = grown;
    *cap = bytes;
    return 0;
}

/**
 * A capture time of the recorded server's clock in the clock of the one that is there now. Between
 * two of them lies what lay between them, to the nanosecond, where time is not stretched. Recorded
 * times may be anything: the sums wrap.
 */
static int64_t map_time(const struct gn_playback *p, const struct gn_playback_stream *s,
                        int64_t recorded_ns)
{
    uint64_t since = (uint64_t)recorded_ns - (uint64_t)s->clock_ns -
                     (uint64_t)gn_recording_reader_get_begin_ns(p->index->reader) -
                     (uint64_t)p->first_ns;
    if (!p->options->is_fast && p->options->rate_factor != 1) {
        double stretched = (double)(int64_t)since / p->options->rate_factor;
        since = (uint64_t)llround(fmax(-4e18, fmin(4e18, stretched)));
    }
    return gn_client_to_server_ns(s->client, (int64_t)((uint64_t)p->capture_base_ns + since));
}

/** Sets one field of the header in head, which has room for one more. */
static int set_field(uint8_t *header, size_t *n, uint32_t field, uint64_t value)
{
    uint8_t copy[GN_LIMIT_HEADER_BYTES];
    memcpy(copy, header, *n);
    return gn_recording_set_field(copy, *n, field, value, header, GN_LIMIT_HEADER_BYTES, n);
}

/** The header as it is sent, into header. */
static int change_header(const struct gn_playback *p, const struct gn_playback_stream *s,
                         const struct gn_recording_entry *entry, uint8_t *header, size_t *n)
{
    uint32_t field = gn_recording_get_time_field(entry->type);
    int err = 0;
    // A POSE of time 0 is one of when it comes.
    if (field && !(entry->type == GN_WIRE_POSE && entry->value == 0))
        err = set_field(header, n, field, (uint64_t)map_time(p, s, entry->value));
    const struct gn_recording_entry *answer =
        entry->type == GN_WIRE_FRAME ? gn_playback_find_answer(p, s->number, entry->id) : NULL;
    if (err || !p->options->pins_light || !answer || answer->type != GN_WIRE_RESULT ||
        answer->value <= 0)
        return err;
    err = set_field(header, n, GN_RECORDING_FRAME_LIGHTING_MIN_SEQUENCE, (uint64_t)answer->value);
    return err ? err : set_field(header, n, GN_RECORDING_FRAME_LIGHTING_WAIT_MS, PINNED_WAIT_MS);
}

/** Remembers a frame until its answer comes. */
static void note_frame(struct gn_playback *p, struct gn_playback_stream *s,
                       const struct gn_recording_entry *entry)
{
    const struct gn_recording_entry *answer = gn_playback_find_answer(p, s->number, entry->id);
    struct gn_playback_pending *pending = s->pending;
    while (pending->id != 0) // there is room: see is_held()
        pending++;
    *pending = (struct gn_playback_pending){
        .id = entry->id,
        .sent_ns = gn_client_now_ns(),
        .is_reference = entry->quality == GN_MSG_QUALITY_REFERENCE,
        .light = answer && answer->type == GN_WIRE_RESULT ? (uint64_t)answer->value : 0,
    };
    s->n_pending++;
    s->n_frames++;
    p->counts->n_frames++;
}

int gn_playback_send(struct gn_playback *p, struct gn_playback_stream *s,
                     const struct gn_recording_entry *entry, struct gn_error *out_error)
{
    int err = gn_playback_grow(&p->message, &p->message_cap, entry->bytes, out_error);
    if (!err)
        err = gn_recording_reader_load(p->index->reader, entry->offset, entry->bytes, p->message,
                                       out_error);
    if (err)
        return err;
    struct gn_envelope envelope;
    uint8_t head[GN_ENVELOPE_BYTES + GN_LIMIT_HEADER_BYTES];
    size_t n = entry->header_bytes;
    err = gn_envelope_decode(p->message, &envelope);
    if (err || (uint64_t)GN_ENVELOPE_BYTES + n > entry->bytes || n > GN_LIMIT_HEADER_BYTES)
        return gn_error_set(out_error, -EBADMSG, "the recording was changed while it was read");
    memcpy(head + GN_ENVELOPE_BYTES, p->message + GN_ENVELOPE_BYTES, n);
    err = change_header(p, s, entry, head + GN_ENVELOPE_BYTES, &n);
    const struct gn_wire_info *info = gn_wire_get_info(envelope.type);
    if (!err && n > info->max_header_bytes)
        err = -EMSGSIZE;
    if (err)
        return gn_error_set(out_error, err, "a %s of stream %u has a header that cannot be changed",
                            info->name, s->number);
    envelope.header_bytes = (uint32_t)n;
    gn_envelope_encode(&envelope, head);
    size_t payload_at = GN_ENVELOPE_BYTES + (size_t)entry->header_bytes;
    if (entry->type == GN_WIRE_FRAME)
        note_frame(p, s, entry);
    err = gn_client_send_encoded(s->client, head, GN_ENVELOPE_BYTES + n, p->message + payload_at,
                                 entry->bytes - payload_at);
    p->counts->n_sent += !err;
    if (err)
        gn_playback_lose_stream(p, s, gn_client_get_fault(s->client));
    return 0;
}
