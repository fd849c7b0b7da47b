/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One number of an encoded message, changed in place. Decoding and encoding again would also write
 * the other fields as our encoder does, and lose those that it does not know.
 */
#include <errno.h>
#include <string.h>

#include "client/recording/index.h"

/** Wire types of protobuf (protobuf.dev/programming-guides/encoding). */
enum { WIRE_VARINT = 0, WIRE_64 = 1, WIRE_BYTES = 2, WIRE_32 = 5 };

/** Reads a varint at *at. Returns 0 or -EBADMSG. */
static int read_varint(const uint8_t *in, size_t n, size_t *at, uint64_t *out)
{
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
        if (*at >= n)
            return -EBADMSG;
        uint8_t byte = in[(*at)++];
        value |= (uint64_t)(byte & 0x7f) << shift;
        if (byte < 0x80) {
            *out = value;
            return 0;
        }
    }
    return -EBADMSG;
}

/** Passes over a value. Returns 0 or -EBADMSG. */
static int skip_value(const uint8_t *in, size_t n, size_t *at, unsigned wire_type)
{
    uint64_t bytes = 0;
    int err = 0;
    if (wire_type == WIRE_VARINT)
        return read_varint(in, n, at, &bytes);
    if (wire_type == WIRE_BYTES)
        err = read_varint(in, n, at, &bytes);
    else if (wire_type == WIRE_64 || wire_type == WIRE_32)
        bytes = wire_type == WIRE_64 ? 8 : 4;
    else
        err = -EBADMSG;
    if (err || bytes > n - *at)
        return -EBADMSG;
    *at += (size_t)bytes;
    return 0;
}

static size_t write_varint(uint8_t out[static 10], uint64_t value)
{
    size_t n = 0;
    for (; value >= 0x80; value >>= 7)
        out[n++] = (uint8_t)(value | 0x80);
    out[n++] = (uint8_t)value;
    return n;
}

int gn_recording_set_field(const uint8_t *header, size_t header_bytes, uint32_t field,
                           uint64_t value, uint8_t *out, size_t cap, size_t *out_bytes)
{
    uint8_t text[20];
    size_t text_bytes = write_varint(text, (uint64_t)field << 3 | WIRE_VARINT);
    text_bytes += write_varint(text + text_bytes, value);
    // The last value of a field counts: the first ones of a repeated one are left out.
    size_t n_out = 0, last_at = SIZE_MAX;
    for (int round = 0; round < 2; round++) {
        for (size_t at = 0, begin = 0; at < header_bytes; begin = at) {
            uint64_t tag = 0;
            int err = read_varint(header, header_bytes, &at, &tag);
            if (!err)
                err = skip_value(header, header_bytes, &at, (unsigned)(tag & 7));
            if (err)
                return err;
            bool is_it = tag == ((uint64_t)field << 3 | WIRE_VARINT);
            if (round == 0) {
                last_at = is_it ? begin : last_at;
                continue;
            }
            if (is_it && begin != last_at)
                continue;
            const uint8_t *from = is_it ? text : header + begin;
            size_t n = is_it ? text_bytes : at - begin;
            if (n > cap - n_out)
                return -ENOBUFS;
            memcpy(out + n_out, from, n);
            n_out += n;
        }
    }
    if (last_at == SIZE_MAX) {
        if (text_bytes > cap - n_out)
            return -ENOBUFS;
        memcpy(out + n_out, text, text_bytes);
        n_out += text_bytes;
    }
    *out_bytes = n_out;
    return 0;
}

uint32_t gn_recording_get_time_field(uint16_t type)
{
    switch (type) {
    case GN_WIRE_ENVIRONMENT_FRAME:
    case GN_WIRE_FRAME:
        return 2; // capture_time_ns
    case GN_WIRE_EMITTER_FRAME:
        return 3; // capture_time_ns
    case GN_WIRE_POSE:
        return 3; // time_ns
    default:
        return 0;
    }
}
