/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Files whole: read into memory up to a bound, and written so that a file is complete or absent
 * (temporary file in the same folder, then rename), whenever the program ends. Nothing is synced:
 * a machine that loses power may lose more.
 */
#ifndef GN_COMMON_FILE_H
#define GN_COMMON_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "proto/attr.h"

/**
 * Reads the regular file at path into memory that the caller frees. Returns 0, or a negative errno
 * and a sentence: -EFBIG where it is longer than max_bytes, -EINVAL where it is no regular file (it
 * never waits on a pipe or device), whatever open and read say. An empty file gives a size of 0 and
 * a buffer all the same.
 */
GN_MUST_USE int gn_file_read(const char *path, size_t max_bytes, uint8_t **out_data,
                             size_t *out_size, struct gn_error *out_error);

/**
 * Reads what path gives up to its end, also a pipe's, which tells no size and is waited for. The
 * caller frees the text; a NUL stands after its last byte, and may stand in it. max_bytes: whole
 * MiB. Returns 0, or a negative errno and a sentence that begins with the path: -EFBIG where it is
 * longer, -ENOMEM, whatever open and read say.
 */
GN_MUST_USE int gn_file_read_text(const char *path, size_t max_bytes, char **out_text,
                                  size_t *out_size, struct gn_error *out_error);

/** A file being written. Thread-safety: unsafe. Between open and commit or abort. */
struct gn_file_writer {
    int fd;
    char *path;      // owned
    char *temp_path; // owned
};

/** Opens a temporary file beside path, where there is nothing yet or a regular file. Returns 0 or a
 * negative errno and a sentence. */
GN_MUST_USE int gn_file_writer_open(struct gn_file_writer *writer, const char *path,
                                    struct gn_error *out_error);
/** Writes n bytes at offset. Returns 0 or a negative errno. */
GN_MUST_USE int gn_file_writer_put(struct gn_file_writer *writer, const void *data, size_t n,
                                   uint64_t offset);
/** Renames the file to its path and ends the writer; on failure as gn_file_writer_abort. */
GN_MUST_USE int gn_file_writer_commit(struct gn_file_writer *writer, struct gn_error *out_error);
/** Removes the temporary file and ends the writer. A writer that has ended is fine. */
void gn_file_writer_abort(struct gn_file_writer *writer);

/** Writes n bytes to path, all or nothing. Returns 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_file_write(const char *path, const void *data, size_t n,
                              struct gn_error *out_error);

#endif
