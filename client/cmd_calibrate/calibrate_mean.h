/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The mean of some pictures of a camera or video, and how they differ from one another.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_MEAN_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_MEAN_H

#include <stdint.h>

#include "client/cmd_calibrate/calibrate_live.h"
#include "common/error.h"
#include "common/image.h"
#include "common/image_file.h"
#include "proto/attr.h"

/** All-zero: none. End it with _finish. */
struct gn_calibrate_mean {
    int n;
    int width, height, channels;
    int full_scale; // largest code
    int bits;       // of the camera's codes
    struct gn_image_file last;
    uint32_t *sums;      // [height][width][channels], codes of all pictures
    double noise;        // deviation of a code from picture to picture
    double unsteadiness; // largest mean code of a picture less the smallest
};

/**
 * Takes n pictures, [1, 10000]. full_scale16: 0, or the largest code of 16-bit pictures where that
 * is not the one of their format. *out is zeroed on failure. Returns 0, -EINTR at the end of a
 * video or on Ctrl-C, or another negative errno, and a sentence.
 */
GN_MUST_USE int gn_calibrate_mean_take(const struct gn_program *program, struct gn_source *source,
                                       int n, int full_scale16, struct gn_calibrate_mean *out,
                                       struct gn_error *out_error);

/**
 * The mean as codes: rounded to 8 bits where is_8_bit and the pictures have these, else in 16 bits,
 * finer than the pictures' by the largest whole number that these hold; *out_full_scale: of it.
 * Returns 0 or -ENOMEM; the caller finishes *out.
 */
GN_MUST_USE int gn_calibrate_mean_get_codes(const struct gn_calibrate_mean *mean, bool is_8_bit,
                                            struct gn_image_file *out, int *out_full_scale);

/** The mean as shares of full scale. Returns 0 or -ENOMEM; the caller finishes *out. */
GN_MUST_USE int gn_calibrate_mean_get_floats(const struct gn_calibrate_mean *mean,
                                             struct gn_image *out);

/** What its codes look like, by some thousands of them: from the 1st to the 99th percentile as a
 * share of full scale, and the share that is clipped at the bright end. */
void gn_calibrate_mean_describe(const struct gn_calibrate_mean *mean, double *out_span,
                                double *out_clipped);

/** NULL-safe; zeroes *mean. */
void gn_calibrate_mean_finish(struct gn_calibrate_mean *mean);

#endif
