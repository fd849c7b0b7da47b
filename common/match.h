/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What a camera does to a picture besides mapping it: its noise and its blur, so that virtual
 * pixels can be given the same; and which of its properties are matched at all. docs/frames.md,
 * "Matching the camera". Thread-safety of all functions: safe.
 */
#ifndef GN_COMMON_MATCH_H
#define GN_COMMON_MATCH_H

#include <stdbool.h>

#include "proto/attr.h"
#include "proto/limits.h"

struct gn_camera;

/** Largest standard deviation of a point spread, px. */
#define GN_MATCH_MAX_BLUR_PX GN_LIMIT_BLUR_PX

/**
 * Noise and blur. A value; all 0: none.
 * Noise is white in space and time, normal, and in the camera's linear values x (1: the code 1
 * decoded, before matrix and scale) has the variance slope x + offset: photons, and the sensor
 * itself (Foi et al., IEEE Trans. Image Processing 17(10), 2008).
 * Blur is a normal point spread of lens and sensor besides the pixel's own square.
 */
struct gn_match {
    double noise_slope[3];  // R, G, B; [0, 1]
    double noise_offset[3]; // R, G, B; [0, 1]
    double blur_px;         // standard deviation, [0, GN_MATCH_MAX_BLUR_PX]
};

/** Checks ranges. Returns 0, or -EINVAL and a sentence (static string) in *out_reason (may be
 * NULL). */
GN_MUST_USE int gn_match_check(const struct gn_match *match, const char **out_reason);

/** True where any channel has noise. */
bool gn_match_has_noise(const struct gn_match *match);

/** What of a camera can be matched: bits of a set, in the order of GN_MATCH_NAMES. */
enum gn_match_part {
    GN_MATCH_EXPOSURE = 1 << 0,      // scale
    GN_MATCH_WHITE_BALANCE = 1 << 1, // to_rec709
    GN_MATCH_RESPONSE = 1 << 2,      // the curve
    GN_MATCH_DISTORTION = 1 << 3,
    GN_MATCH_NOISE = 1 << 4,
    GN_MATCH_BLUR = 1 << 5,
    GN_MATCH_ALL = (1 << 6) - 1,
};
#define GN_MATCH_NAMES "exposure|white-balance|response|distortion|noise|blur"

/** Takes from the camera what is not in the set of parts, as if nobody had said it: scale 1, no
 * matrix, sRGB, no distortion, no noise, no blur. */
void gn_match_keep(unsigned parts, struct gn_camera *camera);

#endif
