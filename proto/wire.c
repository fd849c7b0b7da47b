/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "proto/wire.h"

#include <assert.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <pb_decode.h>
#include <pb_encode.h>

#include "proto/wire_internal.h"

// X(NAME, name, who sends, header at most, payload at most). A peer's encoder may write longer
// headers than ours: other orders, unpacked arrays, fields of later versions.
#define TYPES(X)                                                                                   \
    X(HELLO, hello, TO_SERVER, 2048, 0)                                                            \
    X(WELCOME, welcome, TO_CLIENT, 1024, 0)                                                        \
    X(REDIRECT, redirect, TO_CLIENT, 1024, 0)                                                      \
    X(ERROR, error, BOTH_WAYS, 2048, 0)                                                            \
    X(BYE, bye, BOTH_WAYS, 1024, 0)                                                                \
    X(PING, ping, BOTH_WAYS, 256, 0)                                                               \
    X(PONG, pong, BOTH_WAYS, 256, 0)                                                               \
    X(ENVIRONMENT_FRAME, environment_frame, TO_SERVER, 2048, GN_LIMIT_ENVIRONMENT_BYTES)           \
    X(POSE, pose, TO_SERVER, 1024, 0)                                                              \
    X(CAMERA, camera, TO_SERVER, 1024, 0)                                                          \
    X(FRAME, frame, TO_SERVER, 4096, GN_LIMIT_FRAME_BYTES)                                         \
    X(EMITTER_FRAME, emitter_frame, TO_SERVER, 1024, GN_LIMIT_EMITTER_BYTES)                       \
    X(RESULT, result, TO_CLIENT, GN_LIMIT_HEADER_BYTES, GN_LIMIT_RESULT_BYTES)                     \
    X(DROPPED, dropped, TO_CLIENT, 1024, 0)                                                        \
    X(LIGHTING_STATE, lighting_state, TO_CLIENT, 2048, GN_LIMIT_LIGHTING_BYTES)                    \
    X(STATISTICS, statistics, TO_CLIENT, 1024, 0)

#define ROW(NAME, name, way, max_header, max_payload)                                              \
    {GN_WIRE_##NAME, GN_WIRE_##way, #NAME, GN_MSG_##NAME##_FIELDS, sizeof(struct gn_msg_##name),   \
     max_header,     max_payload},
static const struct gn_wire_info table[] = {TYPES(ROW)};

// What we write is within what we take, and fits in the space that wire.h promises.
#define FITS(NAME, name, way, max_header, max_payload)                                             \
    static_assert(GN_MSG_##NAME##_SIZE <= (max_header) && (max_header) <= GN_LIMIT_HEADER_BYTES && \
                      GN_ENVELOPE_BYTES + GN_MSG_##NAME##_SIZE <= GN_WIRE_HEAD_BYTES,              \
                  #NAME);
TYPES(FITS)

const struct gn_wire_info *gn_wire_get_row(size_t i)
{
    return i < GN_ARRAY_LEN(table) ? &table[i] : NULL;
}

const struct gn_wire_info *gn_wire_get_info(uint16_t type)
{
    for (size_t i = 0; i < GN_ARRAY_LEN(table); i++)
        if (table[i].type == type)
            return &table[i];
    return NULL;
}

GN_PRINTF(3, 0)
static int refuse_as(int err, struct gn_wire_fault *fault, const char *format, va_list args)
{
    if (fault)
        vsnprintf(fault->text, sizeof(fault->text), format, args);
    return err;
}

int gn_wire_refuse(struct gn_wire_fault *fault, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    int err = refuse_as(-EDOM, fault, format, args);
    va_end(args);
    return err;
}

GN_PRINTF(3, 4) static int refuse(int err, struct gn_wire_fault *fault, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    refuse_as(err, fault, format, args);
    va_end(args);
    return err;
}

int gn_wire_encode(uint16_t type, const void *msg, uint32_t payload_bytes, uint8_t *buf, size_t cap,
                   size_t *out_len, struct gn_wire_fault *out_fault)
{
    const struct gn_wire_info *info = gn_wire_get_info(type);
    if (!info)
        return refuse(-ENOMSG, out_fault, "no message has type %u", type);
    if (payload_bytes > info->max_payload_bytes)
        return refuse(-EMSGSIZE, out_fault, "%s: payload of %u bytes, at most %u are allowed",
                      info->name, payload_bytes, info->max_payload_bytes);
    int err = gn_wire_walk(info, msg, out_fault);
    if (!err)
        err = gn_wire_check(type, msg, payload_bytes, out_fault);
    if (err)
        return err;

    if (cap < GN_ENVELOPE_BYTES)
        return refuse(-ENOBUFS, out_fault, "%s: no room for the envelope", info->name);
    pb_ostream_t stream = pb_ostream_from_buffer(buf + GN_ENVELOPE_BYTES, cap - GN_ENVELOPE_BYTES);
    if (!pb_encode(&stream, info->fields, msg))
        return refuse(-ENOBUFS, out_fault, "%s: no room for the header: %s", info->name,
                      PB_GET_ERROR(&stream));
    struct gn_envelope envelope = {
        .version = GN_PROTO_VERSION_MAX,
        .type = type,
        .header_bytes = (uint32_t)stream.bytes_written,
        .payload_bytes = payload_bytes,
    };
    gn_envelope_encode(&envelope, buf);
    *out_len = GN_ENVELOPE_BYTES + stream.bytes_written;
    return 0;
}

int gn_wire_decode(uint16_t type, const uint8_t *header, size_t header_bytes,
                   uint32_t payload_bytes, void *out_msg, struct gn_wire_fault *out_fault)
{
    const struct gn_wire_info *info = gn_wire_get_info(type);
    if (!info)
        return refuse(-ENOMSG, out_fault, "no message has type %u", type);
    memset(out_msg, 0, info->struct_bytes);
    pb_istream_t stream = pb_istream_from_buffer(header, header_bytes);
    if (!pb_decode(&stream, info->fields, out_msg))
        return refuse(-EBADMSG, out_fault, "%s: header of %zu bytes cannot be decoded: %s",
                      info->name, header_bytes, PB_GET_ERROR(&stream));
    int err = gn_wire_walk(info, out_msg, out_fault);
    if (!err)
        err = gn_wire_check(type, out_msg, payload_bytes, out_fault);
    if (!err)
        gn_wire_set_defaults(type, out_msg);
    return err;
}
