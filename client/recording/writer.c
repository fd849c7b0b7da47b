/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include "client/recording/format.h"
#include "client/recording/recording.h"
#include "common/clock.h"

#define BOOT_ID_PATH "/proc/sys/kernel/random/boot_id"
#define MAX_PARTS 4

struct gn_recording_writer {
    int fd;
    char *path; // owned
    uint64_t max_bytes;
    struct gn_recording_header header;
    struct gn_recording_state state; // as this writer saw or made it last
    uint32_t stream;                 // 0: not begun
};

/** The number that the kernel drew at this machine's start. */
static int read_boot_id(uint8_t out[static GN_RECORDING_BOOT_BYTES])
{
    FILE *f = fopen(BOOT_ID_PATH, "re");
    char text[64];
    bool is_read = f && fgets(text, sizeof(text), f);
    if (f)
        fclose(f);
    int n = 0;
    for (const char *c = text; is_read && *c && n < 2 * GN_RECORDING_BOOT_BYTES; c++) {
        const char *digits = "0123456789abcdef", *digit = strchr(digits, *c);
        if (!digit)
            continue;
        out[n / 2] = (uint8_t)(out[n / 2] << 4 | (digit - digits));
        n++;
    }
    return n == 2 * GN_RECORDING_BOOT_BYTES ? 0 : -EIO;
}

/** flock(2), but not for ever: a process that is stopped may hold it. */
static int lock(const struct gn_recording_writer *w)
{
    int64_t deadline_ns = gn_clock_get_monotonic_ns() + GN_RECORDING_LOCK_MS * GN_NS_PER_MS;
    while (flock(w->fd, LOCK_EX | LOCK_NB) != 0) {
        if (errno != EWOULDBLOCK && errno != EINTR)
            return -errno;
        if (gn_clock_get_monotonic_ns() > deadline_ns)
            return -ETIMEDOUT;
        nanosleep(&(struct timespec){.tv_nsec = 200000}, NULL);
    }
    return 0;
}

static void unlock(const struct gn_recording_writer *w)
{
    flock(w->fd, LOCK_UN);
}

/** Writes to the last byte. Returns 0 or a negative errno. Changes the parts. */
static int write_parts(int fd, struct iovec *parts, int n_parts, uint64_t offset)
{
    if (lseek(fd, (off_t)offset, SEEK_SET) < 0)
        return -errno;
    while (n_parts > 0) {
        if (parts->iov_len == 0) {
            parts++;
            n_parts--;
            continue;
        }
        ssize_t n = writev(fd, parts, n_parts);
        if (n < 0 && errno != EINTR)
            return -errno;
        if (n == 0)
            return -ENOSPC;
        for (size_t left = n > 0 ? (size_t)n : 0; left > 0;) {
            size_t step = left < parts->iov_len ? left : parts->iov_len;
            parts->iov_base = (uint8_t *)parts->iov_base + step;
            parts->iov_len -= step;
            left -= step;
            if (parts->iov_len == 0) {
                parts++;
                n_parts--;
            }
        }
    }
    return 0;
}

static int write_state(const struct gn_recording_writer *w, const struct gn_recording_state *state)
{
    uint8_t bytes[GN_RECORDING_STATE_BYTES];
    gn_recording_state_encode(state, bytes);
    struct iovec part = {bytes, sizeof(bytes)};
    return write_parts(w->fd, &part, 1, GN_RECORDING_STATE_OFFSET);
}

/** Where the file ends now; others may have written. The caller holds the lock. */
static int read_state_locked(struct gn_recording_writer *w, struct gn_error *out_error)
{
    uint8_t bytes[GN_RECORDING_STATE_BYTES];
    struct gn_recording_state state;
    int err = gn_recording_read(w->fd, bytes, sizeof(bytes), GN_RECORDING_STATE_OFFSET);
    if (!err)
        err = gn_recording_state_decode(bytes, &state);
    struct stat st;
    if (!err && fstat(w->fd, &st) != 0)
        err = -errno;
    if (!err &&
        (state.end_bytes < GN_RECORDING_HEADER_BYTES || state.end_bytes > (uint64_t)st.st_size ||
         state.end_bytes < w->state.end_bytes || state.n_streams > GN_RECORDING_MAX_STREAMS))
        err = -EBADMSG;
    if (err == -EBADMSG || err == -ENODATA)
        return gn_error_set(out_error, -EBADMSG,
                            "%s: damaged, or changed by another program: its header does not fit "
                            "its %lld bytes",
                            w->path, (long long)st.st_size);
    if (err)
        return gn_error_set(out_error, err, "%s: %s", w->path, strerror(-err));
    w->state = state;
    return 0;
}

/** The caller holds the lock. */
static int begin_file_locked(struct gn_recording_writer *w, struct gn_error *out_error)
{
    uint8_t bytes[GN_RECORDING_HEADER_BYTES] = {0};
    w->header.begin_ns = gn_clock_get_monotonic_ns();
    w->header.realtime_ns = gn_clock_get_realtime_ns();
    w->state = (struct gn_recording_state){.end_bytes = GN_RECORDING_HEADER_BYTES};
    gn_recording_header_encode(&w->header, bytes);
    gn_recording_state_encode(&w->state, bytes + GN_RECORDING_STATE_OFFSET);
    struct iovec part = {bytes, sizeof(bytes)};
    int err = write_parts(w->fd, &part, 1, 0);
    if (err)
        (void)!ftruncate(w->fd, 0);
    return err ? gn_error_set(out_error, err, "%s: %s", w->path, strerror(-err)) : 0;
}

/** Takes part in a recording that is there. The caller holds the lock. */
static int join_file_locked(struct gn_recording_writer *w, struct gn_error *out_error)
{
    uint8_t bytes[GN_RECORDING_STATE_OFFSET];
    struct gn_recording_header header = {0};
    uint16_t header_bytes = 0;
    const char *reason = "no recording: it is too short";
    int err = gn_recording_read(w->fd, bytes, sizeof(bytes), 0);
    if (!err)
        err = gn_recording_header_decode(bytes, &header, &header_bytes, &reason);
    if (err && err != -ENODATA && err != -EBADMSG)
        return gn_error_set(out_error, err, "%s: %s", w->path, strerror(-err));
    if (err)
        return gn_error_set(out_error, -EEXIST, "%s: will not be overwritten: it is %s", w->path,
                            reason);
    if (memcmp(header.boot_id, w->header.boot_id, sizeof(header.boot_id)) != 0)
        return gn_error_set(out_error, -EEXIST,
                            "%s: a recording of another machine, or from before this one's last "
                            "start: its times are not ours; give another file",
                            w->path);
    w->header = header;
    return read_state_locked(w, out_error);
}

static int open_file(struct gn_recording_writer *w, const char *path, struct gn_error *out_error)
{
    struct stat st;
    w->path = strdup(path);
    if (!w->path)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    // O_NONBLOCK: what is no file is not waited for.
    w->fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0666);
    if (w->fd < 0 || fstat(w->fd, &st) != 0)
        return gn_error_set(out_error, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return gn_error_set(out_error, -EINVAL, "%s: no file; a recording is one", path);
    if (read_boot_id(w->header.boot_id) < 0)
        return gn_error_set(out_error, -EIO, "%s: cannot be read: a recording needs it",
                            BOOT_ID_PATH);
    int err = lock(w);
    if (err)
        return gn_error_set(out_error, err, "%s: cannot be locked: %s", path, strerror(-err));
    if (fstat(w->fd, &st) != 0)
        err = gn_error_set(out_error, -errno, "%s: %s", path, strerror(errno));
    else if (st.st_size == 0)
        err = begin_file_locked(w, out_error);
    else
        err = join_file_locked(w, out_error);
    unlock(w);
    return err;
}

int gn_recording_writer_open(const char *path, uint64_t max_bytes, struct gn_recording_writer **out,
                             struct gn_error *out_error)
{
    *out = NULL;
    struct gn_recording_writer *w = calloc(1, sizeof(*w));
    if (!w)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    w->fd = -1;
    w->max_bytes = max_bytes ? max_bytes : GN_RECORDING_DEFAULT_MAX_BYTES;
    int err = open_file(w, path, out_error);
    if (err)
        gn_recording_writer_close(&w);
    *out = w;
    return err;
}

/** Writes one record behind the last. The caller holds the lock. */
static int put_locked(struct gn_recording_writer *w, const uint8_t *head, struct iovec *parts,
                      int n_parts, uint64_t bytes, uint32_t n_streams, struct gn_error *out_error)
{
    struct gn_recording_state state = {w->state.end_bytes + bytes, n_streams};
    if (state.end_bytes > w->max_bytes)
        return gn_error_set(out_error, -EFBIG,
                            "%s: the recording ends here: it may grow to %llu MiB", w->path,
                            (unsigned long long)(w->max_bytes >> 20));
    parts[0] = (struct iovec){(uint8_t *)(uintptr_t)head, GN_RECORDING_HEAD_BYTES};
    int err = write_parts(w->fd, parts, n_parts, w->state.end_bytes);
    if (!err)
        err = write_state(w, &state);
    if (!err) {
        w->state = state;
        return 0;
    }
    // Half a record gives its room back; should that fail, the next writer writes over it.
    (void)!ftruncate(w->fd, (off_t)w->state.end_bytes);
    return gn_error_set(out_error, err, "%s: the recording ends here: %s", w->path, strerror(-err));
}

int gn_recording_writer_put(struct gn_recording_writer *writer, enum gn_recording_kind kind,
                            int64_t time_ns, const struct gn_recording_part *parts, int n_parts,
                            struct gn_error *out_error)
{
    struct gn_recording_writer *w = writer;
    struct iovec io[1 + MAX_PARTS];
    uint64_t bytes = 0;
    uint32_t crc = 0;
    if (n_parts > MAX_PARTS)
        return gn_error_set(out_error, -EINVAL, "%s: a record of %d parts", w->path, n_parts);
    for (int i = 0; i < n_parts; i++) {
        io[1 + i] = (struct iovec){(uint8_t *)(uintptr_t)parts[i].data, parts[i].bytes};
        bytes += parts[i].bytes;
        crc = gn_recording_crc(crc, parts[i].data, parts[i].bytes);
    }
    if (bytes > GN_RECORDING_MAX_BODY_BYTES)
        return gn_error_set(out_error, -EMSGSIZE, "%s: a message of %llu bytes", w->path,
                            (unsigned long long)bytes);
    int err = lock(w);
    if (err)
        return gn_error_set(out_error, err,
                            "%s: the recording ends here: another process holds it (%s)", w->path,
                            strerror(-err));
    err = read_state_locked(w, out_error);
    uint32_t n_streams = w->state.n_streams + (w->stream == 0);
    uint32_t stream = w->stream ? w->stream : n_streams;
    if (!err && stream > GN_RECORDING_MAX_STREAMS)
        err = gn_error_set(out_error, -E2BIG, "%s: holds %d streams already: give another file",
                           w->path, GN_RECORDING_MAX_STREAMS);
    if (!err) {
        int64_t since_ns = time_ns - w->header.begin_ns;
        const struct gn_recording_head head = {.kind = (uint16_t)kind,
                                               .stream = stream,
                                               .bytes = (uint32_t)bytes,
                                               .time_ns = since_ns > 0 ? since_ns : 0,
                                               .body_crc = crc};
        uint8_t head_bytes[GN_RECORDING_HEAD_BYTES];
        gn_recording_head_encode(&head, head_bytes);
        err = put_locked(w, head_bytes, io, 1 + n_parts, sizeof(head_bytes) + bytes, n_streams,
                         out_error);
    }
    if (!err)
        w->stream = stream;
    unlock(w);
    return err;
}

uint32_t gn_recording_writer_get_stream(const struct gn_recording_writer *writer)
{
    return writer->stream;
}

uint64_t gn_recording_writer_get_bytes(const struct gn_recording_writer *writer)
{
    return writer->state.end_bytes;
}

void gn_recording_writer_close(struct gn_recording_writer **writer)
{
    if (!writer || !*writer)
        return;
    struct gn_recording_writer *w = *writer;
    *writer = NULL;
    if (w->fd >= 0)
        close(w->fd);
    free(w->path);
    free(w);
}
