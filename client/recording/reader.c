/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/recording/format.h"
#include "client/recording/recording.h"

/** Bytes that are looked through at once for the next head after damage. */
#define SEARCH_BYTES 65536

struct gn_recording_reader {
    int fd;
    char *path; // owned
    struct gn_recording_header header;
    uint64_t file_bytes;
    uint64_t end_bytes; // no record goes beyond
    uint64_t offset;    // of the next record
    struct gn_recording_damage damage;
    uint8_t *body; // owned
    size_t body_cap;
};

/** Reads the header, and where the records end. */
static int read_header(struct gn_recording_reader *r, struct gn_error *out_error)
{
    uint8_t bytes[GN_RECORDING_HEADER_BYTES];
    uint16_t header_bytes = 0;
    const char *reason = "no recording: it is too short";
    int err = gn_recording_read(r->fd, bytes, sizeof(bytes), 0);
    if (!err)
        err = gn_recording_header_decode(bytes, &r->header, &header_bytes, &reason);
    if (err == -ENODATA || err == -EBADMSG)
        return gn_error_set(out_error, -EBADMSG, "%s: %s", r->path, reason);
    if (err)
        return gn_error_set(out_error, err, "%s: %s", r->path, strerror(-err));
    r->offset = header_bytes < r->file_bytes ? header_bytes : r->file_bytes;
    r->end_bytes = r->file_bytes;
    struct gn_recording_state state;
    if (gn_recording_state_decode(bytes + GN_RECORDING_STATE_OFFSET, &state) < 0 ||
        state.end_bytes < r->offset) {
        r->damage.n_damaged++;
        r->damage.damaged_bytes += GN_RECORDING_STATE_BYTES;
    } else if (state.end_bytes > r->file_bytes) {
        r->damage.missing_bytes = state.end_bytes - r->file_bytes;
    } else {
        r->damage.tail_bytes = r->file_bytes - state.end_bytes;
        r->end_bytes = state.end_bytes;
    }
    return 0;
}

static int open_file(struct gn_recording_reader *r, const char *path, struct gn_error *out_error)
{
    struct stat st;
    r->path = strdup(path);
    if (!r->path)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    r->fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (r->fd < 0 || fstat(r->fd, &st) != 0)
        return gn_error_set(out_error, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return gn_error_set(out_error, -EINVAL, "%s: no file; a recording is one", path);
    r->file_bytes = (uint64_t)st.st_size;
    return read_header(r, out_error);
}

int gn_recording_reader_open(const char *path, struct gn_recording_reader **out,
                             struct gn_error *out_error)
{
    *out = NULL;
    struct gn_recording_reader *r = calloc(1, sizeof(*r));
    if (!r)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    r->fd = -1;
    int err = open_file(r, path, out_error);
    if (err)
        gn_recording_reader_close(&r);
    *out = r;
    return err;
}

/** Finds the next head behind r->offset, or the end. Returns 0 or a negative errno. */
static int search_head(struct gn_recording_reader *r)
{
    uint8_t block[SEARCH_BYTES];
    struct gn_recording_head head;
    uint64_t at = r->offset + 1;
    while (at + GN_RECORDING_HEAD_BYTES <= r->end_bytes) {
        uint64_t left = r->end_bytes - at;
        size_t n = left < sizeof(block) ? (size_t)left : sizeof(block);
        int err = gn_recording_read(r->fd, block, n, at);
        if (err)
            return err;
        for (size_t i = 0; i + GN_RECORDING_HEAD_BYTES <= n; i++) {
            if (block[i] == gn_recording_head_magic[0] &&
                gn_recording_head_decode(block + i, &head) == 0) {
                r->offset = at + i;
                return 0;
            }
        }
        at += n - GN_RECORDING_HEAD_BYTES + 1;
    }
    r->offset = r->end_bytes;
    return 0;
}

/** Reads the body of the head at r->offset. Returns 0, -EBADMSG where it is damaged, or another
 * negative errno. */
static int read_body(struct gn_recording_reader *r, const struct gn_recording_head *head)
{
    if (head->bytes > r->body_cap) {
        uint8_t *body = realloc(r->body, head->bytes);
        if (!body)
            return -ENOMEM;
        r->body = body;
        r->body_cap = head->bytes;
    }
    int err = gn_recording_read(r->fd, r->body, head->bytes, r->offset + GN_RECORDING_HEAD_BYTES);
    if (err)
        return err;
    return gn_recording_crc(0, r->body, head->bytes) == head->body_crc ? 0 : -EBADMSG;
}

/** The record at r->offset. Returns 1; 0 where something else is there, which is passed over and
 * counted; or a negative errno. */
static int read_record(struct gn_recording_reader *r, struct gn_recording_record *out)
{
    uint64_t at = r->offset, left = r->end_bytes - at;
    uint8_t bytes[GN_RECORDING_HEAD_BYTES];
    struct gn_recording_head head = {0};
    int err = 0;
    bool is_head = false;
    if (left >= sizeof(bytes)) {
        err = gn_recording_read(r->fd, bytes, sizeof(bytes), at);
        is_head = !err && gn_recording_head_decode(bytes, &head) == 0;
    }
    if (err)
        return err;
    uint64_t whole = sizeof(bytes) + head.bytes;
    if (left < sizeof(bytes) || (is_head && whole > left)) {
        r->damage.tail_bytes += left;
        r->offset = r->end_bytes;
        return 0;
    }
    if (!is_head) {
        err = search_head(r);
        r->damage.n_damaged++;
        r->damage.damaged_bytes += r->offset - at;
        return err;
    }
    err = read_body(r, &head);
    r->offset = at + whole;
    if (err == -EBADMSG) {
        r->damage.n_damaged++;
        r->damage.damaged_bytes += whole;
        return 0;
    }
    if (err)
        return err;
    *out = (struct gn_recording_record){.kind = head.kind,
                                        .stream = head.stream,
                                        .time_ns = head.time_ns,
                                        .offset = at + sizeof(bytes),
                                        .bytes = head.bytes,
                                        .body = r->body};
    return 1;
}

int gn_recording_reader_next(struct gn_recording_reader *reader, struct gn_recording_record *out,
                             struct gn_error *out_error)
{
    struct gn_recording_reader *r = reader;
    while (r->offset < r->end_bytes) {
        int got = read_record(r, out);
        if (got < 0)
            return gn_error_set(out_error, got, "%s: %s", r->path, strerror(-got));
        if (got > 0)
            return 1;
    }
    return 0;
}

int gn_recording_reader_load(const struct gn_recording_reader *reader, uint64_t offset,
                             size_t bytes, uint8_t *out, struct gn_error *out_error)
{
    int err = gn_recording_read(reader->fd, out, bytes, offset);
    return err ? gn_error_set(out_error, err, "%s: %s", reader->path,
                              err == -ENODATA ? "became shorter while it was read" : strerror(-err))
               : 0;
}

struct gn_recording_damage gn_recording_reader_get_damage(const struct gn_recording_reader *reader)
{
    return reader->damage;
}

uint64_t gn_recording_reader_get_bytes(const struct gn_recording_reader *reader)
{
    return reader->file_bytes;
}

int64_t gn_recording_reader_get_realtime_ns(const struct gn_recording_reader *reader)
{
    return reader->header.realtime_ns;
}

int64_t gn_recording_reader_get_begin_ns(const struct gn_recording_reader *reader)
{
    return reader->header.begin_ns;
}

void gn_recording_reader_close(struct gn_recording_reader **reader)
{
    if (!reader || !*reader)
        return;
    struct gn_recording_reader *r = *reader;
    *reader = NULL;
    if (r->fd >= 0)
        close(r->fd);
    free(r->body);
    free(r->path);
    free(r);
}
