/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Attribute macros, for every folder. They live in proto because it is the lowest layer.
 * Thread-safety annotations are checked by clang (-Wthread-safety) and vanish under gcc.
 */
#ifndef GN_PROTO_ATTR_H
#define GN_PROTO_ATTR_H

/** The result may not be ignored. */
#define GN_MUST_USE __attribute__((warn_unused_result))

/** printf checking: format_index and first_arg_index count from 1. */
#define GN_PRINTF(format_index, first_arg_index)                                                   \
    __attribute__((format(printf, format_index, first_arg_index)))

#if defined(__clang__)
#define GN_CAPABILITY(name) __attribute__((capability(name)))
#define GN_REQUIRES(mu) __attribute__((requires_capability(mu)))
#define GN_ACQUIRE(...) __attribute__((acquire_capability(__VA_ARGS__)))
#define GN_RELEASE(...) __attribute__((release_capability(__VA_ARGS__)))
#define GN_NO_THREAD_SAFETY_ANALYSIS __attribute__((no_thread_safety_analysis))
#else
#define GN_CAPABILITY(name)
#define GN_REQUIRES(mu)
#define GN_ACQUIRE(...)
#define GN_RELEASE(...)
#define GN_NO_THREAD_SAFETY_ANALYSIS
#endif

/** Number of elements of an array (not of a pointer). */
#define GN_ARRAY_LEN(a) (sizeof(a) / sizeof((a)[0]))

#endif
