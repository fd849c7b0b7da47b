/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a recording holds, in the order of time; and its messages as they are sent again. */
#ifndef GN_CLIENT_RECORDING_INDEX_H
#define GN_CLIENT_RECORDING_INDEX_H

#include "client/recording/recording.h"
#include "proto/wire.h"

/** Most entries: a viewer's frames and answers at 60 a second for more than four hours. */
#define GN_RECORDING_MAX_ENTRIES 2000000
#define GN_RECORDING_N_TYPES 64

/** One record that can be replayed. */
struct gn_recording_entry {
    int64_t time_ns; // since the recording began
    uint64_t offset; // of the message in the file
    uint32_t bytes;  // of the message: envelope, header, payload
    uint32_t header_bytes;
    uint16_t kind;
    uint16_t type;   // of the message
    uint32_t stream; // from 1 on
    uint64_t id;     // FRAME, RESULT, DROPPED: the frame's; ENVIRONMENT_FRAME: its sequence
    int64_t value;   // SENT: capture time, recorded server's clock; RESULT: sequence of its light;
                     // CLOCK: server minus recorder, ns
    uint8_t quality; // FRAME: enum gn_msg_quality
};

/** One session. */
struct gn_recording_stream {
    bool is_known;             // its HELLO is there
    bool has_bye;              // it was ended, by either side
    struct gn_msg_hello hello; // without secrets
    int64_t first_ns, last_ns;
    uint64_t sent_bytes, received_bytes;
    uint32_t n_sent[GN_RECORDING_N_TYPES], n_received[GN_RECORDING_N_TYPES]; // by type
    uint32_t n_unreadable; // messages that are none of this protocol's version
};

/** A recording, read. Thread-safety: unsafe. */
struct gn_recording_index {
    struct gn_recording_reader *reader; // owned; for the messages themselves
    struct gn_recording_entry *entries; // [n_entries], owned; by time, then place in the file
    size_t n_entries;
    struct gn_recording_stream *streams; // [n_streams], owned; stream i has number i + 1
    uint32_t n_streams;
    uint64_t n_unknown; // records of a kind that this version does not know
    struct gn_recording_damage damage;
};

/** Reads the whole file once. Returns 0, or a negative errno and a sentence; *out is zeroed then.
 */
GN_MUST_USE int gn_recording_index_read(const char *path, struct gn_recording_index *out,
                                        struct gn_error *out_error);
void gn_recording_index_finish(struct gn_recording_index *index);

/** Fields of FRAME, by gnomon.proto: numbers are never reused. */
#define GN_RECORDING_FRAME_LIGHTING_MIN_SEQUENCE 7
#define GN_RECORDING_FRAME_LIGHTING_WAIT_MS 8

/** Number of a message type's field that holds its capture time; 0: it has none. */
uint32_t gn_recording_get_time_field(uint16_t type);

/**
 * Copies a protobuf header with the top-level integer `field` set to value: where it stands, or
 * behind the others where it is absent. Every other byte stays. out_bytes <= cap. Returns 0,
 * -EBADMSG (not protobuf) or -ENOBUFS.
 */
GN_MUST_USE int gn_recording_set_field(const uint8_t *header, size_t header_bytes, uint32_t field,
                                       uint64_t value, uint8_t *out, size_t cap, size_t *out_bytes);

#endif
