/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/recording/index.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/** An index that is being read. */
struct building {
    struct gn_recording_index *index;
    size_t cap;                     // of index->entries
    union gn_wire_message *message; // of the record at hand; owned
};

/** Room for the streams up to this number; numbers are bounded by the reader. */
static int grow_streams(struct gn_recording_index *x, uint32_t n)
{
    if (n <= x->n_streams)
        return 0;
    struct gn_recording_stream *grown = realloc(x->streams, n * sizeof(*grown));
    if (!grown)
        return -ENOMEM;
    memset(grown + x->n_streams, 0, (n - x->n_streams) * sizeof(*grown));
    x->streams = grown;
    x->n_streams = n;
    return 0;
}

static int add_entry(struct building *b, const struct gn_recording_entry *entry)
{
    struct gn_recording_index *x = b->index;
    if (x->n_entries == GN_RECORDING_MAX_ENTRIES)
        return -E2BIG;
    if (x->n_entries == b->cap) {
        size_t cap = b->cap ? 2 * b->cap : 256;
        struct gn_recording_entry *grown = realloc(x->entries, cap * sizeof(*grown));
        if (!grown)
            return -ENOMEM;
        x->entries = grown;
        b->cap = cap;
    }
    x->entries[x->n_entries++] = *entry;
    return 0;
}

/** Decodes the message in a record, sent this way. Whether it is one. */
static bool read_message(struct building *b, const struct gn_recording_record *record,
                         enum gn_wire_direction direction, struct gn_recording_entry *entry)
{
    struct gn_envelope e;
    if (record->bytes < GN_ENVELOPE_BYTES || gn_envelope_decode(record->body, &e) < 0 ||
        !(gn_wire_get_info(e.type)->direction & direction) ||
        (uint64_t)GN_ENVELOPE_BYTES + e.header_bytes + e.payload_bytes != record->bytes ||
        gn_wire_decode(e.type, record->body + GN_ENVELOPE_BYTES, e.header_bytes, e.payload_bytes,
                       b->message, NULL) < 0)
        return false;
    entry->type = e.type;
    entry->header_bytes = e.header_bytes;
    return true;
}

/** What the replay has to know of a message beside its bytes. */
static void note_message(const union gn_wire_message *m, struct gn_recording_entry *entry)
{
    switch (entry->type) {
    case GN_WIRE_ENVIRONMENT_FRAME:
        entry->id = m->environment_frame.sequence;
        entry->value = m->environment_frame.capture_time_ns;
        break;
    case GN_WIRE_EMITTER_FRAME:
        entry->value = m->emitter_frame.capture_time_ns;
        break;
    case GN_WIRE_POSE:
        entry->value = m->pose.time_ns;
        break;
    case GN_WIRE_FRAME:
        entry->id = m->frame.id;
        entry->value = m->frame.capture_time_ns;
        entry->quality = (uint8_t)m->frame.quality;
        break;
    case GN_WIRE_RESULT:
        entry->id = m->result.id;
        entry->value = (int64_t)m->result.receipt.lighting_sequence;
        break;
    case GN_WIRE_DROPPED:
        entry->id = m->dropped.id;
        break;
    default:
        break;
    }
}

static int add_message(struct building *b, const struct gn_recording_record *record,
                       struct gn_recording_stream *stream, struct gn_recording_entry *entry)
{
    bool is_received = record->kind == GN_RECORDING_RECEIVED;
    if (!read_message(b, record, is_received ? GN_WIRE_TO_CLIENT : GN_WIRE_TO_SERVER, entry) ||
        (record->kind == GN_RECORDING_STREAM && entry->type != GN_WIRE_HELLO) ||
        entry->type >= GN_RECORDING_N_TYPES) {
        stream->n_unreadable++;
        return 0;
    }
    note_message(b->message, entry);
    stream->has_bye = stream->has_bye || entry->type == GN_WIRE_BYE;
    if (record->kind == GN_RECORDING_STREAM) {
        stream->is_known = true;
        stream->hello = b->message->hello;
    } else if (is_received) {
        stream->n_received[entry->type]++;
        stream->received_bytes += record->bytes;
    } else {
        stream->n_sent[entry->type]++;
        stream->sent_bytes += record->bytes;
    }
    return add_entry(b, entry);
}

static int add_record(struct building *b, const struct gn_recording_record *record)
{
    struct gn_recording_index *x = b->index;
    struct gn_recording_entry entry = {.time_ns = record->time_ns,
                                       .offset = record->offset,
                                       .bytes = record->bytes,
                                       .kind = record->kind,
                                       .stream = record->stream};
    int err = grow_streams(x, record->stream);
    if (err)
        return err;
    struct gn_recording_stream *stream = &x->streams[record->stream - 1];
    bool is_first = stream->last_ns == 0 && stream->first_ns == 0;
    if (is_first || record->time_ns < stream->first_ns)
        stream->first_ns = record->time_ns;
    if (record->time_ns > stream->last_ns)
        stream->last_ns = record->time_ns;
    switch (record->kind) {
    case GN_RECORDING_STREAM:
    case GN_RECORDING_SENT:
    case GN_RECORDING_RECEIVED:
        return add_message(b, record, stream, &entry);
    case GN_RECORDING_CLOCK:
        if (record->bytes != 8) {
            stream->n_unreadable++;
            return 0;
        }
        uint64_t offset_ns = 0;
        for (int i = 0; i < 8; i++)
            offset_ns |= (uint64_t)record->body[i] << (8 * i);
        entry.value = (int64_t)offset_ns;
        return add_entry(b, &entry);
    default:
        x->n_unknown++;
        return 0;
    }
}

static int compare_entries(const void *a, const void *b)
{
    const struct gn_recording_entry *x = a, *y = b;
    if (x->time_ns != y->time_ns)
        return x->time_ns < y->time_ns ? -1 : 1;
    return (x->offset > y->offset) - (x->offset < y->offset);
}

static int read_all(struct building *b, const char *path, struct gn_error *out_error)
{
    struct gn_recording_index *x = b->index;
    struct gn_recording_record record;
    int got, err = 0;
    while ((got = gn_recording_reader_next(x->reader, &record, out_error)) > 0) {
        err = add_record(b, &record);
        if (err == -E2BIG)
            return gn_error_set(out_error, err, "%s: more than %d messages", path,
                                GN_RECORDING_MAX_ENTRIES);
        if (err)
            return gn_error_set(out_error, err, "%s: out of memory", path);
    }
    if (got < 0)
        return got;
    x->damage = gn_recording_reader_get_damage(x->reader);
    if (x->n_entries > 0)
        qsort(x->entries, x->n_entries, sizeof(*x->entries), compare_entries);
    return 0;
}

int gn_recording_index_read(const char *path, struct gn_recording_index *out,
                            struct gn_error *out_error)
{
    memset(out, 0, sizeof(*out));
    struct building b = {.index = out, .message = calloc(1, sizeof(*b.message))};
    if (!b.message)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int err = gn_recording_reader_open(path, &out->reader, out_error);
    if (!err)
        err = read_all(&b, path, out_error);
    free(b.message);
    if (err)
        gn_recording_index_finish(out);
    return err;
}

void gn_recording_index_finish(struct gn_recording_index *index)
{
    gn_recording_reader_close(&index->reader);
    free(index->entries);
    free(index->streams);
    memset(index, 0, sizeof(*index));
}
