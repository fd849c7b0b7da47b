/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The bytes of a recording, for those that write and read it: docs/recording.md, "The file". */
#ifndef GN_CLIENT_RECORDING_FORMAT_H
#define GN_CLIENT_RECORDING_FORMAT_H

#include "client/recording/recording.h"

#define GN_RECORDING_BOOT_BYTES 16
/** Where the part of the header begins that changes while the file grows, and its bytes. */
#define GN_RECORDING_STATE_OFFSET 56
#define GN_RECORDING_STATE_BYTES 16

/** The part of the header that stays. */
struct gn_recording_header {
    uint8_t boot_id[GN_RECORDING_BOOT_BYTES]; // of the machine's start since which times count
    int64_t begin_ns;                         // CLOCK_MONOTONIC
    int64_t realtime_ns;                      // the same moment, since 1970
};

/** The part that changes. */
struct gn_recording_state {
    uint64_t end_bytes; // where the last whole record ends
    uint32_t n_streams;
};

/** A record's head. */
struct gn_recording_head {
    uint16_t kind;
    uint32_t stream;
    uint32_t bytes; // of the body
    int64_t time_ns;
    uint32_t body_crc;
};

void gn_recording_header_encode(const struct gn_recording_header *header,
                                uint8_t out[static GN_RECORDING_STATE_OFFSET]);
/** Returns 0, or -EBADMSG and what is wrong, fit to follow the file's name. */
GN_MUST_USE int gn_recording_header_decode(const uint8_t in[static GN_RECORDING_STATE_OFFSET],
                                           struct gn_recording_header *out,
                                           uint16_t *out_header_bytes, const char **out_reason);

void gn_recording_state_encode(const struct gn_recording_state *state,
                               uint8_t out[static GN_RECORDING_STATE_BYTES]);
/** Returns 0, or -EBADMSG. */
GN_MUST_USE int gn_recording_state_decode(const uint8_t in[static GN_RECORDING_STATE_BYTES],
                                          struct gn_recording_state *out);

void gn_recording_head_encode(const struct gn_recording_head *head,
                              uint8_t out[static GN_RECORDING_HEAD_BYTES]);
/** Returns 0, or -EBADMSG: these bytes are no head. */
GN_MUST_USE int gn_recording_head_decode(const uint8_t in[static GN_RECORDING_HEAD_BYTES],
                                         struct gn_recording_head *out);
/** The four bytes that a head begins with. */
extern const uint8_t gn_recording_head_magic[4];

/** CRC-32 (ISO 3309, as zlib has it) of some more bytes; begin with 0. */
uint32_t gn_recording_crc(uint32_t crc, const void *data, size_t bytes);

/** pread to the last byte. Returns 0, -ENODATA where the file ends before, or the errno. */
GN_MUST_USE int gn_recording_read(int fd, void *out, size_t bytes, uint64_t offset);

#endif
