/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/device_clock.h"

#include "common/clock.h"

#define SPAN_NS (2 * GN_NS_PER_S)
#define MAX_JUMP_NS GN_NS_PER_S

int64_t gn_device_clock_map(struct gn_device_clock *clock, uint64_t device_ns, int64_t arrival_ns)
{
    struct gn_device_clock *c = clock;
    if (device_ns == 0 || device_ns > INT64_MAX / 2) {
        c->is_known = false;
        return arrival_ns;
    }
    int64_t device = (int64_t)device_ns, offset = arrival_ns - device;
    int64_t best = c->offsets[0] < c->offsets[1] ? c->offsets[0] : c->offsets[1];
    if (!c->is_known || device <= c->device_ns || offset - best > MAX_JUMP_NS ||
        best - offset > MAX_JUMP_NS) {
        *c = (struct gn_device_clock){true, device, arrival_ns, {offset, offset}};
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
