/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * From a camera's own clock to CLOCK_MONOTONIC, with nothing but the arrival of its pictures.
 */
#ifndef GN_CLIENT_CAPTURE_DEVICE_CLOCK_H
#define GN_CLIENT_CAPTURE_DEVICE_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

/** Zero it before use, and again when the camera was opened again. Thread-safety: unsafe. */
struct gn_device_clock {
    bool is_known;
    int64_t device_ns;  // of the last picture
    int64_t last_ns;    // what it was mapped to
    int64_t since_ns;   // own clock: when the first of the next two began to be measured
    int64_t offsets[2]; // least arrival minus device time: now, and in the span before
};

/**
 * When a picture with this time of the camera's clock would have arrived without delay, own clock.
 *   time = device + min over the last 2 to 4 s of (arrival - device)
 * The delays of a network only ever add, so the least seen is the nearest to the truth: jitter
 * goes, and what stays is the least delay itself and the drift of the clocks within 4 s (0.4 ms at
 * 100 ppm). A device time that is absent (0), does not rise, or jumps by more than a second against
 * ours begins anew, with the arrival itself. The result is never after the arrival, at most a
 * second before it, and always after the one before: where the first pictures came late, those that
 * follow stay just behind them until the least delay has caught up.
 */
int64_t gn_device_clock_map(struct gn_device_clock *clock, uint64_t device_ns, int64_t arrival_ns);

#endif
