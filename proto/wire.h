/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Messages of the wire: the table of all types, encoding and decoding with every value checked.
 * The structs (struct gn_msg_hello, ...) are plain and bounded; they are generated from
 * gnomon.proto, which documents each field. What gn_wire_decode() lets through is finite, in range
 * and consistent with the payload's length.
 */
#ifndef GN_PROTO_WIRE_H
#define GN_PROTO_WIRE_H

#include <stddef.h>
#include <stdint.h>

#include "proto/attr.h"
#include "proto/envelope.h"
#include "proto/gnomon.pb.h"
#include "proto/limits.h"

/** Type numbers of the envelope. */
enum gn_wire_type {
    GN_WIRE_HELLO = 1,
    GN_WIRE_WELCOME = 2,
    GN_WIRE_REDIRECT = 3,
    GN_WIRE_ERROR = 4,
    GN_WIRE_BYE = 5,
    GN_WIRE_PING = 6,
    GN_WIRE_PONG = 7,
    GN_WIRE_ENVIRONMENT_FRAME = 16,
    GN_WIRE_POSE = 17,
    GN_WIRE_CAMERA = 18,
    GN_WIRE_FRAME = 19,
    GN_WIRE_EMITTER_FRAME = 20,
    GN_WIRE_RESULT = 32,
    GN_WIRE_DROPPED = 33,
    GN_WIRE_LIGHTING_STATE = 34,
    GN_WIRE_STATISTICS = 35,
};

/** Who may send a type. */
enum gn_wire_direction {
    GN_WIRE_TO_SERVER = 1,
    GN_WIRE_TO_CLIENT = 2,
    GN_WIRE_BOTH_WAYS = 3,
};

/** One row of the table of types. */
struct gn_wire_info {
    enum gn_wire_type type;
    enum gn_wire_direction direction;
    const char *name;           // as in PROTOCOL.md: "ENVIRONMENT_FRAME"
    const pb_msgdesc_t *fields; // nanopb's descriptor of the header
    size_t struct_bytes;        // sizeof the struct gn_msg_...
    uint32_t max_header_bytes;
    uint32_t max_payload_bytes;
};

/** Space for any message. */
union gn_wire_message {
    struct gn_msg_hello hello;
    struct gn_msg_welcome welcome;
    struct gn_msg_redirect redirect;
    struct gn_msg_error error;
    struct gn_msg_bye bye;
    struct gn_msg_ping ping;
    struct gn_msg_pong pong;
    struct gn_msg_environment_frame environment_frame;
    struct gn_msg_pose pose;
    struct gn_msg_camera camera;
    struct gn_msg_frame frame;
    struct gn_msg_emitter_frame emitter_frame;
    struct gn_msg_result result;
    struct gn_msg_dropped dropped;
    struct gn_msg_lighting_state lighting_state;
    struct gn_msg_statistics statistics;
};

/** Why a message was refused: one line with message and field, fit for an ERROR's sentence. */
struct gn_wire_fault {
    char text[192];
};

/** Longest envelope and header that we write; other encoders may write more, up to the limits. */
#define GN_WIRE_HEAD_BYTES 3072

/** The row of a type, or NULL where there is no such type. Thread-safety: safe. */
const struct gn_wire_info *gn_wire_get_info(uint16_t type);

/** Row i of the table, i = 0, 1, ...; NULL behind the last. Thread-safety: safe. */
const struct gn_wire_info *gn_wire_get_row(size_t i);

/**
 * Check a message and write its envelope and header; the payload (payload_bytes long) follows them
 * on the wire. msg: the struct gn_msg_... of that type. buf: GN_WIRE_HEAD_BYTES are always enough.
 *
 * Returns 0, -ENOMSG (no such type), -EDOM (a value out of range or not finite, or one that does
 * not fit the payload), -EMSGSIZE (payload over the type's limit) or -ENOBUFS (cap too small).
 * out_fault may be NULL. Thread-safety: safe.
 */
GN_MUST_USE int gn_wire_encode(uint16_t type, const void *msg, uint32_t payload_bytes, uint8_t *buf,
                               size_t cap, size_t *out_len, struct gn_wire_fault *out_fault);

/**
 * Decode and check a header, and fill in the defaults that gnomon.proto names: an absent matrix
 * becomes the identity, an absent response LINEAR (SRGB for a camera), a scale of 0 becomes 1,
 * centre, radius and theta_max of a projection their values, jpeg_quality 90, result_format RGB8.
 * payload_bytes: as the envelope has it. out_msg: the struct gn_msg_... of that type, or a union
 * gn_wire_message.
 *
 * Returns 0, -ENOMSG (no such type), -EBADMSG (not the protobuf of this type, or a field over its
 * bound) or -EDOM (a value out of range or not finite, or one that does not fit the payload); then
 * out_msg holds garbage and out_fault (may be NULL) the reason. Thread-safety: safe.
 */
GN_MUST_USE int gn_wire_decode(uint16_t type, const uint8_t *header, size_t header_bytes,
                               uint32_t payload_bytes, void *out_msg,
                               struct gn_wire_fault *out_fault);

/** The ERROR code for what gn_envelope_decode(), gn_wire_decode() and gn_conn_read() return.
 * Thread-safety: safe. */
enum gn_msg_error_code gn_wire_get_error_code(int err);

/** A sentence for each code or reason, and for numbers that are none. Never NULL. Thread-safety:
 * safe. */
const char *gn_wire_get_error_text(enum gn_msg_error_code code);
const char *gn_wire_get_drop_text(enum gn_msg_drop_reason reason);
const char *gn_wire_get_bye_text(enum gn_msg_bye_reason reason);

/**
 * Copy text into a string field: cut at a whole UTF-8 character to fit, anything that a peer would
 * refuse (control characters, broken UTF-8) replaced by '?'. cap >= 1: size of the field.
 * Thread-safety: safe.
 */
void gn_wire_set_string(char *out, size_t cap, const char *text);

/** Bytes of one pixel, or 0 for JPEG, EXR, NONE and numbers that are no format. Thread-safety:
 * safe. */
size_t gn_wire_get_pixel_bytes(enum gn_msg_pixel_format format);
size_t gn_wire_get_picture_bytes(enum gn_msg_picture_format format);

#endif
