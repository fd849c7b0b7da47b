/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The pictures of one scene at several exposures that gnomon calibrate response works on: files, or
 * a camera's, which are treated as if they had been written to files and read from there.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_SERIES_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_SERIES_H

#include <stdbool.h>

#include "client/capture/file.h"
#include "client/cmd_calibrate/calibrate_input.h"
#include "client/live.h"
#include "common/error.h"
#include "common/image_file.h"
#include "proto/attr.h"

#define GN_SERIES_MAX 64

/** All-zero: empty. Thread-safety: unsafe. */
struct gn_calibrate_series {
    int n;
    char *names[GN_SERIES_MAX];  // owned
    double times[GN_SERIES_MAX]; // any unit, > 0
    bool has_times;
    struct gn_calibrate_format format;
    int bits; // of the camera's codes, where files hold them finer; 0: they do not
    struct gn_image_file
        *taken; // [GN_SERIES_MAX], of a camera, owned; NULL: files, read when needed
};

/**
 * Lists files. times_text: --times, or NULL. Returns 0, or a negative errno and a sentence. The
 * caller finishes *series in any case.
 */
GN_MUST_USE int gn_calibrate_series_list(struct gn_calibrate_series *series, const char *pattern,
                                         int most, const char *times_text,
                                         struct gn_error *out_error);

/** Rows of the option table that gn_calibrate_series_take reads, beside GN_LIVE_OPTIONS. */
#define GN_CALIBRATE_SERIES_OPTIONS                                                                \
    {.key = "exposures",                                                                           \
     .flag = "exposures",                                                                          \
     .type = GN_OPTION_STRING,                                                                     \
     .value_name = "LIST",                                                                         \
     .help = "Camera: the exposures to take, as 4,1,2,8,16ms or 1/60,1/30,1/15s; without a unit "  \
             "they are counts of a camera that counts lines. auto: the one it has now, then from " \
             "its shortest on, doubled until half the picture is clipped. What the camera says "   \
             "that it took counts. Its own settings are put back in the end."},                    \
        GN_CALIBRATE_FRAMES_OPTION(                                                                \
            "Camera: pictures at each exposure, whose mean is taken; default 8."),                 \
        GN_CALIBRATE_KEEP_OPTION("Camera: write the pictures to this new folder as PNG, and "      \
                                 "times.txt; they give the same result again.")

/**
 * Takes the pictures from the camera that the options name, and says on stdout how far it is.
 * is_8_bit: 8 bits are what is wanted; most: exposures, [1, GN_SERIES_MAX]. The camera's exposure
 * and what was automatic are put back whatever happens. Returns 0, or a negative errno and a
 * sentence: -EINTR on Ctrl-C, -ENOTSUP where the exposure cannot be set. The caller finishes
 * *series in any case.
 */
GN_MUST_USE int gn_calibrate_series_take(struct gn_calibrate_series *series,
                                         const struct gn_program *program,
                                         const struct gn_options *options, bool is_8_bit, int most,
                                         struct gn_error *out_error);

/** Picture k as gn_calibrate_read has it. The caller finishes *out_image. */
GN_MUST_USE int gn_calibrate_series_read(const struct gn_calibrate_series *series, int k,
                                         struct gn_image *out_image, double *out_code_step,
                                         struct gn_error *out_error);

/** Picture k as codes of 8 bits; -EINVAL and a sentence where it has other. Each once. The caller
 * finishes *out_image. */
GN_MUST_USE int gn_calibrate_series_get_codes8(struct gn_calibrate_series *series, int k,
                                               struct gn_image8 *out_image,
                                               struct gn_error *out_error);

/** NULL-safe; zeroes *series. */
void gn_calibrate_series_finish(struct gn_calibrate_series *series);

#endif
