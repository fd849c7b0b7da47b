/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/device_clock.h"

#include "common/clock.h"

#define SPAN_NS (2 * GN_NS_PER_S)
#define MAX_JUMP_NS GN_NS_PER_S

/** The time by the two clocks alone. */
static int64_t map(struct gn_device_clock *c, uint64_t device_ns, int64_t arrival_ns)
{
    if (device_ns == 0 || device_ns > INT64_MAX / 2) {
        c->is_known = false;
        return arrival_ns;
    }
    int64_t device = (int64_t)device_ns, offset = arrival_ns - device;
    int64_t best = c->offsets[0] < c->offsets[1] ? c->offsets[0] : c->offsets[1];
    if (!c->is_known || device <= c->device_ns || offset - best > MAX_JUMP_NS) {
        c->is_known = true;
        c->device_ns = device;
        c->since_ns = arrival_ns;
        c->offsets[0] = c->offsets[1] = offset;
        return arrival_ns;
    }
    c->device_ns = device;
    if (arrival_ns - c->since_ns > SPAN_NS) {
        c->since_ns = arrival_ns;
        c->offsets[1] = c->offsets[0];
        c->offsets[0] = offset;
    } else if (offset < c->offsets[0]) {
        c->offsets[0] = offset;
    }
    best = c->offsets[0] < c->offsets[1] ? c->offsets[0] : c->offsets[1];
    return device + best;
}

int64_t gn_device_clock_map(struct gn_device_clock *clock, uint64_t device_ns, int64_t arrival_ns)
{
    int64_t time_ns = map(clock, device_ns, arrival_ns);
    if (time_ns <= clock->last_ns)
        time_ns = clock->last_ns + 1;
    clock->last_ns = time_ns;
    return time_ns;
}
