/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The response of an 8-bit camera from pictures of one still scene at several exposure times, as a
 * table of the light of each code, and the radiance that the stack shows. The scale of the light is
 * free; code 128 gets what it has in sRGB, 0.2159, so that the table of an sRGB camera is sRGB's.
 * Sources: Debevec and Malik, SIGGRAPH 1997; Robertson, Borman and Stevenson, Journal of Electronic
 * Imaging 12(2), 2003. Thread-safety of all functions: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_STACK_H
#define GN_CLIENT_CALIBRATE_STACK_H

#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

#define GN_STACK_CODES 256
#define GN_STACK_MAX_PICTURES 32
/** The light of code 128. */
#define GN_STACK_MIDDLE 0.21586050

enum gn_stack_method { GN_STACK_DEBEVEC = 0, GN_STACK_ROBERTSON };

/** The same scene in n pictures of the same size and 3 or 1 channels. */
struct gn_stack {
    const struct gn_image8 *pictures; // [n], borrowed
    const double *times;              // [n], any unit, > 0
    int n;                            // [2, GN_STACK_MAX_PICTURES]
};

struct gn_stack_options {
    enum gn_stack_method method;
    double smoothness; // Debevec: lambda, (0, 1e6]; 0: 50
    int samples;       // Debevec: pixels used, [32, 4096]; 0: 512
};

struct gn_stack_response {
    float table[GN_STACK_CODES]; // never falls, >= 0
    double rms;                  // of ln of the light of a pixel between pictures, weighted
    int first_code, last_code;   // seen often enough to be sure of
    int iterations;              // Robertson
};

/**
 * One curve for all channels. Returns 0, -EINVAL (times, sizes), -EDOM (the pictures do not
 * determine a curve: the same exposure, too few codes seen, codes that fall), -ENOMEM, and a
 * sentence.
 */
GN_MUST_USE int gn_stack_fit(const struct gn_stack *stack, const struct gn_stack_options *options,
                             struct gn_stack_response *out, struct gn_error *out_error);

/**
 * The radiance of the scene: the weighted mean of table[code] / time over the pictures, weight a
 * hat that is 0 within 5 codes of the ends; where all are clipped the shortest or longest one's.
 * image: of the pictures' size and channels, initialised here; the caller finishes it. times
 * relative to the first. Returns 0, -EINVAL or -ENOMEM.
 */
GN_MUST_USE int gn_stack_merge(const struct gn_stack *stack, const float table[static 256],
                               struct gn_image *out_image, struct gn_error *out_error);

#endif
