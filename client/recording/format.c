/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/recording/format.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include <zlib.h>

/** Begins like PNG's: a transfer that takes it for text, or cuts bit 7, shows at once. */
static const uint8_t file_magic[8] = {0x89, 'G', 'N', 'R', '\r', '\n', 0x1a, '\n'};
const uint8_t gn_recording_head_magic[4] = {0xf3, 'r', 'e', 'c'};

/** Little-endian, so that its first byte is 0x0d. */
#define BYTE_ORDER_MARK UINT32_C(0x0a0b0c0d)

static void put(uint8_t *out, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        out[i] = (uint8_t)(value >> (8 * i));
}

static uint64_t get(const uint8_t *in, int bytes)
{
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++)
        value |= (uint64_t)in[i] << (8 * i);
    return value;
}

uint32_t gn_recording_crc(uint32_t crc, const void *data, size_t bytes)
{
    return bytes ? (uint32_t)crc32_z(crc, data, bytes) : crc;
}

void gn_recording_header_encode(const struct gn_recording_header *header,
                                uint8_t out[static GN_RECORDING_STATE_OFFSET])
{
    memcpy(out, file_magic, sizeof(file_magic));
    put(out + 8, BYTE_ORDER_MARK, 4);
    put(out + 12, GN_RECORDING_VERSION, 2);
    put(out + 14, GN_RECORDING_HEADER_BYTES, 2);
    memcpy(out + 16, header->boot_id, GN_RECORDING_BOOT_BYTES);
    put(out + 32, (uint64_t)header->begin_ns, 8);
    put(out + 40, (uint64_t)header->realtime_ns, 8);
    put(out + 48, 0, 4);
    put(out + 52, gn_recording_crc(0, out, 52), 4);
}

int gn_recording_header_decode(const uint8_t in[static GN_RECORDING_STATE_OFFSET],
                               struct gn_recording_header *out, uint16_t *out_header_bytes,
                               const char **out_reason)
{
    uint64_t version = get(in + 12, 2), header_bytes = get(in + 14, 2);
    *out_reason = NULL;
    if (memcmp(in, file_magic, sizeof(file_magic)) != 0)
        *out_reason = "no recording: it does not begin as one does";
    else if (get(in + 8, 4) == UINT32_C(0x0d0c0b0a))
        *out_reason = "a recording with its bytes in another order than little-endian";
    else if (get(in + 8, 4) != BYTE_ORDER_MARK)
        *out_reason = "no recording: its mark of byte order is none";
    else if (version != GN_RECORDING_VERSION)
        *out_reason = "a recording of another version of the format; this program knows version 1";
    else if (get(in + 52, 4) != gn_recording_crc(0, in, 52) ||
             header_bytes < GN_RECORDING_HEADER_BYTES)
        *out_reason = "a recording whose header is damaged";
    if (*out_reason)
        return -EBADMSG;
    memcpy(out->boot_id, in + 16, GN_RECORDING_BOOT_BYTES);
    out->begin_ns = (int64_t)get(in + 32, 8);
    out->realtime_ns = (int64_t)get(in + 40, 8);
    *out_header_bytes = (uint16_t)header_bytes;
    return 0;
}

void gn_recording_state_encode(const struct gn_recording_state *state,
                               uint8_t out[static GN_RECORDING_STATE_BYTES])
{
    put(out, state->end_bytes, 8);
    put(out + 8, state->n_streams, 4);
    put(out + 12, gn_recording_crc(0, out, 12), 4);
}

int gn_recording_state_decode(const uint8_t in[static GN_RECORDING_STATE_BYTES],
                              struct gn_recording_state *out)
{
    if (get(in + 12, 4) != gn_recording_crc(0, in, 12))
        return -EBADMSG;
    out->end_bytes = get(in, 8);
    out->n_streams = (uint32_t)get(in + 8, 4);
    return 0;
}

void gn_recording_head_encode(const struct gn_recording_head *head,
                              uint8_t out[static GN_RECORDING_HEAD_BYTES])
{
    memcpy(out, gn_recording_head_magic, sizeof(gn_recording_head_magic));
    put(out + 4, head->kind, 2);
    put(out + 6, 0, 2);
    put(out + 8, head->stream, 4);
    put(out + 12, head->bytes, 4);
    put(out + 16, (uint64_t)head->time_ns, 8);
    put(out + 24, head->body_crc, 4);
    put(out + 28, gn_recording_crc(0, out, 28), 4);
}

int gn_recording_head_decode(const uint8_t in[static GN_RECORDING_HEAD_BYTES],
                             struct gn_recording_head *out)
{
    if (memcmp(in, gn_recording_head_magic, sizeof(gn_recording_head_magic)) != 0 ||
        get(in + 28, 4) != gn_recording_crc(0, in, 28))
        return -EBADMSG;
    out->kind = (uint16_t)get(in + 4, 2);
    out->stream = (uint32_t)get(in + 8, 4);
    out->bytes = (uint32_t)get(in + 12, 4);
    out->time_ns = (int64_t)get(in + 16, 8);
    out->body_crc = (uint32_t)get(in + 24, 4);
    bool is_sane = out->stream >= 1 && out->stream <= GN_RECORDING_MAX_STREAMS &&
                   out->bytes <= GN_RECORDING_MAX_BODY_BYTES && out->time_ns >= 0 &&
                   out->time_ns <= INT64_MAX / 4;
    return is_sane ? 0 : -EBADMSG;
}

int gn_recording_read(int fd, void *out, size_t bytes, uint64_t offset)
{
    uint8_t *to = out;
    while (bytes > 0) {
        ssize_t n = pread(fd, to, bytes, (off_t)offset);
        if (n == 0)
            return -ENODATA;
        if (n < 0 && errno != EINTR)
            return -errno;
        if (n > 0) {
            to += n;
            bytes -= (size_t)n;
            offset += (uint64_t)n;
        }
    }
    return 0;
}
