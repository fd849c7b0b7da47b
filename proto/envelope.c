/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "proto/envelope.h"

#include <errno.h>
#include <string.h>

#include "proto/limits.h"
#include "proto/wire.h"

static const uint8_t magic[4] = {'G', 'N', 'O', 'M'};

static void put_u32(uint8_t *out, uint32_t v)
{
    for (int i = 0; i < 4; i++)
        out[i] = (uint8_t)(v >> (8 * i));
}

static uint32_t get_u32(const uint8_t *in)
{
    return in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
}

void gn_envelope_encode(const struct gn_envelope *envelope, uint8_t out[static GN_ENVELOPE_BYTES])
{
    memcpy(out, magic, sizeof(magic));
    out[4] = envelope->version;
    out[5] = envelope->flags;
    out[6] = (uint8_t)envelope->type;
    out[7] = (uint8_t)(envelope->type >> 8);
    put_u32(out + 8, envelope->stream);
    put_u32(out + 12, envelope->header_bytes);
    put_u32(out + 16, envelope->payload_bytes);
}

int gn_envelope_decode(const uint8_t in[static GN_ENVELOPE_BYTES], struct gn_envelope *out_envelope)
{
    if (memcmp(in, magic, sizeof(magic)) != 0)
        return -EBADMSG;
    struct gn_envelope e = {
        .version = in[4],
        .flags = in[5],
        .type = (uint16_t)(in[6] | in[7] << 8),
        .stream = get_u32(in + 8),
        .header_bytes = get_u32(in + 12),
        .payload_bytes = get_u32(in + 16),
    };
    *out_envelope = e;
    // ERROR keeps its shape in all versions, so that it can say which versions there are.
    if (e.type != GN_WIRE_ERROR &&
        (e.version < GN_PROTO_VERSION_MIN || e.version > GN_PROTO_VERSION_MAX))
        return -EPROTONOSUPPORT;
    if (e.flags != 0 || e.stream != 0)
        return -EPROTO;
    const struct gn_wire_info *info = gn_wire_get_info(e.type);
    if (!info)
        return -ENOMSG;
    if (e.header_bytes > info->max_header_bytes || e.payload_bytes > info->max_payload_bytes)
        return -EMSGSIZE;
    return 0;
}
