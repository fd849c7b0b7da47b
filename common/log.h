/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The log: lines with a time, a level and a topic, on stderr. Once a program has called
 * gn_log_start, threads only put lines into a bounded lock-free ring, and the log thread writes
 * them: no thread waits for the disk or the terminal. Before that, and after gn_log_stop, lines are
 * written directly. State is per process: one stderr, one filter.
 */
#ifndef GN_COMMON_LOG_H
#define GN_COMMON_LOG_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "proto/attr.h"

/** What a level means is its consequence. */
enum gn_log_level {
    GN_LOG_ERROR = 0, // a client or a frame is lost
    GN_LOG_WARN = 1,  // we go on; someone should look
    GN_LOG_INFO = 2,  // start, stop, connect: what an operator wants in the journal
    GN_LOG_DEBUG = 3, // events: what a developer asks for on a running site
    GN_LOG_TRACE = 4, // single frames and messages
    GN_LOG_LEVEL_COUNT
};

/** A file's topic; made by GN_LOG_TOPIC. */
struct gn_log_topic {
    const char *name;
    atomic_uint state; // atomic: cached level and the filter's generation it was looked up in
};

/** Once per file, at its head: GN_LOG_TOPIC("net.session"); */
#define GN_LOG_TOPIC(topic_name)                                                                   \
    static struct gn_log_topic gn_log_topic_here __attribute__((unused)) = {.name = (topic_name)}

/** gn_log(GN_LOG_WARN, "what, where, why: %s", why). One line; cut at 900 bytes. Thread-safe. */
#define gn_log(level, ...)                                                                         \
    do {                                                                                           \
        if (gn_log_is_on(&gn_log_topic_here, (level)))                                             \
            gn_log_write(&gn_log_topic_here, (level), __VA_ARGS__);                                \
    } while (0)

/** As gn_log, for what a peer can cause: through a struct gn_log_limiter. */
#define gn_log_limited(limiter, level, ...)                                                        \
    do {                                                                                           \
        if (gn_log_is_on(&gn_log_topic_here, (level)) &&                                           \
            gn_log_limiter_allow((limiter), &gn_log_topic_here, (level)))                          \
            gn_log_write(&gn_log_topic_here, (level), __VA_ARGS__);                                \
    } while (0)

/** Whether lines of that topic and level are written. Thread-safety: safe, lock-free. */
bool gn_log_is_on(struct gn_log_topic *topic, enum gn_log_level level);

/** Writes regardless of the filter; use gn_log. */
void gn_log_write(const struct gn_log_topic *topic, enum gn_log_level level, const char *format,
                  ...) GN_PRINTF(3, 4);

/**
 * Sets the filter: comma-separated LEVEL or TOPIC:LEVEL, where LEVEL is E, W, I, D, T or its word,
 * and TOPIC may hold * and ?; the last match wins: "W,net.*:D". NULL: the environment's GN_LOG, or
 * INFO where it is unset. Returns 0, or -EINVAL and a sentence in *out_error; then nothing changes.
 * Thread-safety: unsafe; call it before threads start. Without a call the first line sets GN_LOG,
 * a bad one being said once and ignored.
 */
GN_MUST_USE int gn_log_set_filter(const char *filter, struct gn_error *out_error);

/** Where lines go; default 2, stderr. Borrowed. Thread-safety: unsafe; not while started. */
void gn_log_set_fd(int fd);

/** Starts the log thread. Returns 0, -EALREADY, or -EAGAIN (lines then go on directly). */
GN_MUST_USE int gn_log_start(void);

/** Writes what the ring holds and ends the log thread. Call it when other threads have ended. */
void gn_log_stop(void);

/** Lines lost since the start because the ring was full. The log says so too. */
uint64_t gn_log_get_lost_count(void);

/** At most `burst` lines per `interval_ns`; zero: 5 lines per 10 s. Thread-safety: safe. */
struct gn_log_limiter {
    uint32_t burst;
    int64_t interval_ns;
    atomic_llong window_start_ns; // atomic: the thread that moves it opens the window
    atomic_uint n_lines;          // atomic: lines asked for in this window
};

/**
 * True where one more line may be written. The first line of a window is preceded by a line that
 * says how many were held back before.
 */
bool gn_log_limiter_allow(struct gn_log_limiter *limiter, const struct gn_log_topic *topic,
                          enum gn_log_level level);

#endif
