/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * pthreads, wrapped so that clang checks who holds which lock (-Wthread-safety) and so that every
 * wait has a monotonic deadline. No recursive locks; lock order: docs/threads.md.
 */
#ifndef GN_COMMON_THREAD_H
#define GN_COMMON_THREAD_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "proto/attr.h"

/** A mutex. A function that needs it held says GN_REQUIRES(q->mu). Thread-safety: safe. */
struct GN_CAPABILITY("mutex") gn_mutex {
    pthread_mutex_t pthread;
};

/** Returns 0 or a negative errno. */
GN_MUST_USE int gn_mutex_init(struct gn_mutex *mutex);
/** The mutex must be unlocked. */
void gn_mutex_finish(struct gn_mutex *mutex);
void gn_mutex_lock(struct gn_mutex *mutex) GN_ACQUIRE(mutex);
void gn_mutex_unlock(struct gn_mutex *mutex) GN_RELEASE(mutex);

/** A condition variable on CLOCK_MONOTONIC. Thread-safety: safe. */
struct gn_cond {
    pthread_cond_t pthread;
};

/** Returns 0 or a negative errno. */
GN_MUST_USE int gn_cond_init(struct gn_cond *cond);
/** Nobody may be waiting. */
void gn_cond_finish(struct gn_cond *cond);
/** Wakes one waiter. */
void gn_cond_signal(struct gn_cond *cond);
/** Wakes all waiters. */
void gn_cond_broadcast(struct gn_cond *cond);
/** Waits without a deadline; may wake for no reason: loop on the state. */
void gn_cond_wait(struct gn_cond *cond, struct gn_mutex *mutex) GN_REQUIRES(mutex);
/**
 * Waits until woken or until deadline_ns of gn_clock_get_monotonic_ns. False once the deadline has
 * passed; a deadline in the past returns false without sleeping. May wake for no reason.
 */
bool gn_cond_wait_until(struct gn_cond *cond, struct gn_mutex *mutex, int64_t deadline_ns)
    GN_REQUIRES(mutex);

typedef void (*gn_thread_fn)(void *context);

/** A thread. Caller's memory, which must stay until gn_thread_join. Owner: who started it. */
struct gn_thread {
    pthread_t pthread;
    gn_thread_fn fn;
    void *context;
    char name[16]; // NUL-terminated; longer names are cut (the kernel's limit)
    bool is_started;
};

/**
 * Starts fn(context) in a thread that debuggers and top show as `name`. All signals are blocked in
 * it: they are for the main thread. Returns 0 or -EAGAIN; *thread is zeroed on failure.
 */
GN_MUST_USE int gn_thread_start(struct gn_thread *thread, const char *name, gn_thread_fn fn,
                                void *context);
/** Waits for the thread's end. A zeroed or joined thread is fine. */
void gn_thread_join(struct gn_thread *thread);

/** Number of processors that this process may run on; >= 1. */
int gn_thread_get_cpu_count(void);

#endif
