/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Whether an environment frame shows the same light as the last one of its probe that was worked
 * on, within the sensor's noise. Compared with what was worked on, not with what was seen last:
 * light that drifts is followed once it has drifted further than the noise.
 */
#ifndef GN_SERVER_ROOM_SAME_FRAME_H
#define GN_SERVER_ROOM_SAME_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/attr.h"
#include "server/room/probes.h"

/** How far each code of an integer format may be off. */
struct gn_code_bounds {
    uint16_t low, high;
};

/** The frame that was worked on. Zeroed: none. Owner thread: the light thread. */
struct gn_worked_frame {
    struct gn_environment_job job; // owned reference to its payload
    double noise;                  // that the bounds are for
    int n_codes;                   // 0: no bounds made
    struct gn_code_bounds *bounds; // [n_codes], owned
};

/** Keeps the job, a reference to its payload with it. */
void gn_worked_frame_keep(struct gn_worked_frame *worked, const struct gn_environment_job *job);
/** A zeroed one is fine. */
void gn_worked_frame_finish(struct gn_worked_frame *worked);

/**
 * True where all but sequence, capture time and exposure time agree and each texel's channels do:
 * the linear value that the response gives them differs by at most noise [0, 0.1] of what it was
 * (before the matrix). Of floats, half floats, 12-bit and 16-bit codes only; RGB8, JPEG and EXR,
 * and all formats at noise 0, must agree to the byte. Where there is no memory the answer is false.
 */
bool gn_worked_frame_is_same(struct gn_worked_frame *worked, const struct gn_environment_job *job,
                             double noise);

#endif
