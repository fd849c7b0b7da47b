/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int read_all(int fd, uint8_t *data, size_t size, size_t *out_size)
{
    size_t n = 0;
    while (n < size) {
        ssize_t got = read(fd, data + n, size - n);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return -errno;
        if (got == 0) // it shrank while we read
            break;
        n += (size_t)got;
    }
    *out_size = n;
    return 0;
}

int gn_file_read(const char *path, size_t max_bytes, uint8_t **out_data, size_t *out_size,
                 struct gn_error *out_error)
{
    uint8_t *data = NULL;
    size_t size = 0;
    struct stat st;
    int r = 0;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0 || fstat(fd, &st) < 0) {
        r = gn_error_set(out_error, -errno, "cannot read %s: %s", path, strerror(errno));
        goto out;
    }
    if (!S_ISREG(st.st_mode)) {
        r = gn_error_set(out_error, -EINVAL, "cannot read %s: not a regular file", path);
        goto out;
    }
    if ((uintmax_t)st.st_size > max_bytes) {
        r = gn_error_set(out_error, -EFBIG, "cannot read %s: %jd bytes, at most %zu are taken",
                         path, (intmax_t)st.st_size, max_bytes);
        goto out;
    }
    data = malloc((size_t)st.st_size + 1);
    r = data ? read_all(fd, data, (size_t)st.st_size, &size) : -ENOMEM;
    if (r) {
        gn_error_set(out_error, r, "cannot read %s: %s", path, strerror(-r));
        goto out;
    }
    *out_data = data;
    *out_size = size;
    data = NULL;
out:
    free(data);
    if (fd >= 0)
        close(fd);
    return r;
}

/* Reads until the end or beyond max_bytes. */
static int read_to_end(int fd, size_t max_bytes, char **out_text, size_t *out_size)
{
    char *text = NULL;
    size_t size = 0, capacity = 0;
    ssize_t n = 1;
    while (n != 0 && size <= max_bytes) {
        if (size + 1 >= capacity) { // a byte is left for the NUL
            capacity = capacity == 0 ? 65536 : 2 * capacity;
            char *grown = realloc(text, capacity);
            if (!grown) {
                free(text);
                return -ENOMEM;
            }
            text = grown;
        }
        n = read(fd, text + size, capacity - size - 1);
        if (n < 0 && errno != EINTR) {
            int r = -errno;
            free(text);
            return r;
        }
        size += n > 0 ? (size_t)n : 0;
    }
    text[size] = '\0';
    *out_text = text;
    *out_size = size;
    return 0;
}

int gn_file_read_text(const char *path, size_t max_bytes, char **out_text, size_t *out_size,
                      struct gn_error *out_error)
{
    char *text = NULL;
    size_t size = 0;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return gn_error_set(out_error, -errno, "%s: cannot open: %s", path, strerror(errno));
    int r = read_to_end(fd, max_bytes, &text, &size);
    close(fd);
    if (r)
        return gn_error_set(out_error, r, "%s: cannot read: %s", path, strerror(-r));
    if (size > max_bytes) {
        free(text);
        return gn_error_set(out_error, -EFBIG, "%s: larger than %zu MiB, the most that is read",
                            path, max_bytes >> 20);
    }
    *out_text = text;
    *out_size = size;
    return 0;
}

int gn_file_writer_open(struct gn_file_writer *writer, const char *path, struct gn_error *out_error)
{
    static atomic_uint counter;
    struct stat st;
    int r = 0;
    // Its own short name: a name as long as the file system allows has no room for a suffix.
    const char *slash = strrchr(path, '/');
    int n_dir = slash ? (int)(slash - path) + 1 : 0;
    size_t size = (size_t)n_dir + 64;
    *writer = (struct gn_file_writer){.fd = -1, .path = strdup(path), .temp_path = malloc(size)};
    if (!writer->path || !writer->temp_path) {
        r = gn_error_set(out_error, -ENOMEM, "cannot write %s: out of memory", path);
        goto out;
    }
    // Whoever may write there would put a file in the place of a device.
    if (stat(path, &st) == 0 && !S_ISREG(st.st_mode)) {
        r = gn_error_set(out_error, S_ISDIR(st.st_mode) ? -EISDIR : -EINVAL,
                         "cannot write %s: not a regular file", path);
        goto out;
    }
    do {
        snprintf(writer->temp_path, size, "%.*sgnomon-%ld-%u.tmp", n_dir, path, (long)getpid(),
                 atomic_fetch_add(&counter, 1));
        writer->fd = open(writer->temp_path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } while (writer->fd < 0 && (errno == EEXIST || errno == EINTR));
    if (writer->fd < 0)
        r = gn_error_set(out_error, -errno, "cannot write %s: %s", path, strerror(errno));
out:
    if (r)
        gn_file_writer_abort(writer);
    return r;
}

int gn_file_writer_put(struct gn_file_writer *writer, const void *data, size_t n, uint64_t offset)
{
    const uint8_t *from = data;
    while (n > 0) {
        ssize_t done = pwrite(writer->fd, from, n, (off_t)offset);
        if (done < 0 && errno == EINTR)
            continue;
        if (done < 0)
            return -errno;
        from += done;
        offset += (uint64_t)done;
        n -= (size_t)done;
    }
    return 0;
}

static void finish_writer(struct gn_file_writer *writer)
{
    free(writer->path);
    free(writer->temp_path);
    *writer = (struct gn_file_writer){.fd = -1};
}

int gn_file_writer_commit(struct gn_file_writer *writer, struct gn_error *out_error)
{
    int fd = writer->fd;
    writer->fd = -1;
    if (close(fd) < 0 || rename(writer->temp_path, writer->path) < 0) {
        int r =
            gn_error_set(out_error, -errno, "cannot write %s: %s", writer->path, strerror(errno));
        gn_file_writer_abort(writer);
        return r;
    }
    finish_writer(writer);
    return 0;
}

void gn_file_writer_abort(struct gn_file_writer *writer)
{
    if (writer->fd >= 0)
        close(writer->fd);
    if (writer->temp_path)
        unlink(writer->temp_path);
    finish_writer(writer);
}

int gn_file_write(const char *path, const void *data, size_t n, struct gn_error *out_error)
{
    struct gn_file_writer writer;
    int r = gn_file_writer_open(&writer, path, out_error);
    if (r)
        return r;
    r = gn_file_writer_put(&writer, data, n, 0);
    if (r) {
        gn_error_set(out_error, r, "cannot write %s: %s", path, strerror(-r));
        gn_file_writer_abort(&writer);
        return r;
    }
    return gn_file_writer_commit(&writer, out_error);
}
