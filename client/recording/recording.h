/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Recordings: every message of one or more sessions, with its time, in one file
 * (docs/recording.md). Several processes of one machine may write one file at the same time. A
 * record is in the file whole or not at all, whichever of them is killed and when.
 */
#ifndef GN_CLIENT_RECORDING_RECORDING_H
#define GN_CLIENT_RECORDING_RECORDING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "proto/attr.h"

#define GN_RECORDING_VERSION 1
/** Bytes of the file's header and of a record's head, as version 1 has them. */
#define GN_RECORDING_HEADER_BYTES 80
#define GN_RECORDING_HEAD_BYTES 32
/** Longest body: a message of the wire whose header and payload are as long as any may be. */
#define GN_RECORDING_MAX_BODY_BYTES (20u + 16384u + (64u << 20))
/** Most streams of one file. */
#define GN_RECORDING_MAX_STREAMS 1024
/** Bytes that a file grows to where nobody says another bound. */
#define GN_RECORDING_DEFAULT_MAX_BYTES (UINT64_C(4) << 30)
/** How long a writer waits for another one to get out of its way. */
#define GN_RECORDING_LOCK_MS 2000

/** What a record holds. A reader passes over numbers that it does not know. */
enum gn_recording_kind {
    GN_RECORDING_STREAM = 1,   // a session begins; body: its HELLO, without secrets
    GN_RECORDING_SENT = 2,     // body: a message that the client sent
    GN_RECORDING_RECEIVED = 3, // body: a message that the server sent
    GN_RECORDING_CLOCK = 4,    // body: int64, the server's clock minus the recorder's, ns
};

/** A part of a record's body. */
struct gn_recording_part {
    const void *data;
    size_t bytes;
};

/** One stream being written. Thread-safety: unsafe; other processes may write the same file. */
struct gn_recording_writer;

/**
 * Opens the file for one more stream. Where there is none, or an empty one, a recording begins;
 * where there is one of this version, begun since this machine's last start, the stream is added to
 * it. max_bytes: the file grows no further; 0: the default. Returns 0, or a negative errno and a
 * sentence; *out is NULL then.
 */
GN_MUST_USE int gn_recording_writer_open(const char *path, uint64_t max_bytes,
                                         struct gn_recording_writer **out,
                                         struct gn_error *out_error);

/**
 * Appends a record; time_ns is CLOCK_MONOTONIC's. The first of a stream is a GN_RECORDING_STREAM.
 * Returns 0, or a negative errno and a sentence (disk full, -EFBIG at max_bytes, -ETIMEDOUT where
 * another process holds the file): nothing of the record is in the file then, and what was before
 * it can be read.
 */
GN_MUST_USE int gn_recording_writer_put(struct gn_recording_writer *writer,
                                        enum gn_recording_kind kind, int64_t time_ns,
                                        const struct gn_recording_part *parts, int n_parts,
                                        struct gn_error *out_error);

/** The number of this writer's stream, from 1 on; and the file's size. */
uint32_t gn_recording_writer_get_stream(const struct gn_recording_writer *writer);
uint64_t gn_recording_writer_get_bytes(const struct gn_recording_writer *writer);

/** NULL-safe; nulls *writer. */
void gn_recording_writer_close(struct gn_recording_writer **writer);

/** A record. */
struct gn_recording_record {
    uint16_t kind; // an enum gn_recording_kind, or one of a later version
    uint32_t stream;
    int64_t time_ns;     // since the recording began, >= 0
    uint64_t offset;     // of the body in the file
    uint32_t bytes;      // of the body
    const uint8_t *body; // borrowed until the next call with this reader
};

/** What a reader has found to be wrong so far. */
struct gn_recording_damage {
    uint64_t n_damaged;     // places where something is not as it was written
    uint64_t damaged_bytes; // that were left out there
    uint64_t tail_bytes;    // of a last record that was not written to its end
    uint64_t missing_bytes; // that the file had once, and has no more
};

/** A recording that is read. Thread-safety: unsafe. */
struct gn_recording_reader;

/**
 * Opens a recording and checks its header. Returns 0, or a negative errno and a sentence: what is
 * no recording, has another byte order or a later version is refused. *out is NULL then.
 */
GN_MUST_USE int gn_recording_reader_open(const char *path, struct gn_recording_reader **out,
                                         struct gn_error *out_error);

/**
 * The next whole record, in the order of the file. What is damaged is passed over and counted.
 * Memory is taken for a body only where the file holds as many bytes. Returns 1, 0 at the end, or a
 * negative errno and a sentence.
 */
GN_MUST_USE int gn_recording_reader_next(struct gn_recording_reader *reader,
                                         struct gn_recording_record *out,
                                         struct gn_error *out_error);

/** Reads bytes of a body that gn_recording_reader_next has found. Returns 0, or a negative errno
 * and a sentence. */
GN_MUST_USE int gn_recording_reader_load(const struct gn_recording_reader *reader, uint64_t offset,
                                         size_t bytes, uint8_t *out, struct gn_error *out_error);

/** After the last record: all the damage. */
struct gn_recording_damage gn_recording_reader_get_damage(const struct gn_recording_reader *reader);
/** Bytes of the file, and when the recording began, ns since 1970. */
uint64_t gn_recording_reader_get_bytes(const struct gn_recording_reader *reader);
int64_t gn_recording_reader_get_realtime_ns(const struct gn_recording_reader *reader);
/** CLOCK_MONOTONIC, of the machine that recorded, when it began. */
int64_t gn_recording_reader_get_begin_ns(const struct gn_recording_reader *reader);

/** NULL-safe; nulls *reader. */
void gn_recording_reader_close(struct gn_recording_reader **reader);

#endif
