/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The two clocks: monotonic for intervals and deadlines, realtime for what people and other
 * machines read. Nanoseconds in int64_t: 292 years.
 */
#ifndef GN_COMMON_CLOCK_H
#define GN_COMMON_CLOCK_H

#include <stdint.h>

#define GN_NS_PER_US INT64_C(1000)
#define GN_NS_PER_MS INT64_C(1000000)
#define GN_NS_PER_S INT64_C(1000000000)

/** Nanoseconds of CLOCK_MONOTONIC; compare only on one machine since one boot. Thread-safety: safe.
 */
int64_t gn_clock_get_monotonic_ns(void);

/** Nanoseconds since 1970 UTC; may jump. Thread-safety: safe. */
int64_t gn_clock_get_realtime_ns(void);

/**
 * Milliseconds from one time to another; negative where to is the earlier. Any two values may be
 * given, also those that a peer made up: nothing overflows. Thread-safety: safe.
 */
double gn_clock_get_ms_between(int64_t from_ns, int64_t to_ns);

#endif
