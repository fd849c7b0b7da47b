/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/clock.h"

#include <time.h>

static int64_t get_ns(clockid_t clock)
{
    struct timespec now = {0};
    clock_gettime(clock, &now); // cannot fail: both clocks are mandatory here
    return (int64_t)now.tv_sec * GN_NS_PER_S + now.tv_nsec;
}

int64_t gn_clock_get_monotonic_ns(void)
{
    return get_ns(CLOCK_MONOTONIC);
}

int64_t gn_clock_get_realtime_ns(void)
{
    return get_ns(CLOCK_REALTIME);
}

double gn_clock_get_ms_between(int64_t from_ns, int64_t to_ns)
{
    int64_t difference_ns;
    if (!__builtin_sub_overflow(to_ns, from_ns, &difference_ns))
        return (double)difference_ns * 1e-6;
    return ((double)to_ns - (double)from_ns) * 1e-6;
}
