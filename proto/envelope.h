/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The 20 bytes before every message, little-endian: magic "GNOM", then the fields of struct
 * gn_envelope in their order and size, without padding. Pure: no memory, no I/O.
 */
#ifndef GN_PROTO_ENVELOPE_H
#define GN_PROTO_ENVELOPE_H

#include <stdint.h>

#include "proto/attr.h"

#define GN_ENVELOPE_BYTES 20

struct gn_envelope {
    uint8_t version;
    uint8_t flags;          // 0 in version 1
    uint16_t type;          // enum gn_wire_type
    uint32_t stream;        // 0 in version 1
    uint32_t header_bytes;  // protobuf header that follows
    uint32_t payload_bytes; // raw payload after the header
};

/**
 * Write the 20 bytes. Nothing is checked: gn_wire_encode() does that.
 * Thread-safety: safe.
 */
void gn_envelope_encode(const struct gn_envelope *envelope, uint8_t out[static GN_ENVELOPE_BYTES]);

/**
 * Read the 20 bytes and check them against the limits of the message's type.
 *
 * Returns 0, or
 *   -EBADMSG          wrong magic: not our protocol, or out of step (out_envelope untouched)
 *   -EPROTONOSUPPORT  a version that we do not speak; ERROR is let through in any version
 *   -EPROTO           flags or stream not 0
 *   -ENOMSG           unknown type
 *   -EMSGSIZE         header or payload longer than the type's limit
 * In all but the first case out_envelope says what was read. Thread-safety: safe.
 */
GN_MUST_USE int gn_envelope_decode(const uint8_t in[static GN_ENVELOPE_BYTES],
                                   struct gn_envelope *out_envelope);

#endif
