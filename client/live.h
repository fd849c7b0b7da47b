/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Cameras on the command line: the options that every command which takes live pictures has, and
 * the source that they name.
 */
#ifndef GN_CLIENT_LIVE_H
#define GN_CLIENT_LIVE_H

#include <stdbool.h>
#include <stdio.h>

#include "client/capture/source.h"
#include "common/options.h"

/** Rows of the option table that every command which can read a camera has; with
 * GN_LIVE_EXPOSURE_OPTION, where the command does not set the exposure itself. */
#define GN_LIVE_OPTIONS                                                                            \
    {.key = "gige",                                                                                \
     .flag = "gige",                                                                               \
     .type = GN_OPTION_STRING,                                                                     \
     .value_name = "ID",                                                                           \
     .help = "A GigE Vision camera, by its id (gnomon doctor lists them), serial number or "       \
             "address; any: the first that is found."},                                            \
        {.key = "v4l2",                                                                            \
         .flag = "v4l2",                                                                           \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "DEVICE",                                                                   \
         .help = "A camera of the Linux kernel, such as /dev/video0 (gnomon doctor lists them "    \
                 "and what they offer); any: the first."},                                         \
        {.key = "frame-size",                                                                      \
         .flag = "frame-size",                                                                     \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "WxH",                                                                      \
         .help = "Size of the camera's pictures, such as 640x480; without it what the camera "     \
                 "is set to, or what camera.json says."},                                          \
        {.key = "frame-rate",                                                                      \
         .flag = "frame-rate",                                                                     \
         .type = GN_OPTION_DOUBLE,                                                                 \
         .min = 0.01,                                                                              \
         .max = 10000,                                                                             \
         .value_name = "HZ",                                                                       \
         .help = "Pictures per second that the camera takes."},                                    \
        {.key = "gain",                                                                            \
         .flag = "gain",                                                                           \
         .type = GN_OPTION_DOUBLE,                                                                 \
         .min = -1e6,                                                                              \
         .max = 1e6,                                                                               \
         .value_name = "G",                                                                        \
         .help = "The camera's gain in its own unit (dB with GigE); its automatic is then "        \
                 "off."},                                                                          \
        {.key = "lock-white-balance",                                                              \
         .flag = "lock-white-balance",                                                             \
         .type = GN_OPTION_BOOL,                                                                   \
         .help = "The camera's automatic white balance is off."},                                  \
        {.key = "controls",                                                                        \
         .flag = "controls",                                                                       \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "NAME=N,...",                                                               \
         .help = "Any other settings of the camera, by its own names."},                           \
    {                                                                                              \
        .key = "pixel-format", .flag = "pixel-format", .type = GN_OPTION_STRING,                   \
        .value_name = "NAME",                                                                      \
        .help = "The camera's own name of a pixel format, such as Mono12p or YUYV; without it "    \
                "the one "                                                                         \
                "that tells most."                                                                 \
    }

#define GN_LIVE_EXPOSURE_OPTION                                                                    \
    {                                                                                              \
        .key = "exposure-us", .flag = "exposure-us", .type = GN_OPTION_DOUBLE, .min = 1,           \
        .max = 1e8, .value_name = "US",                                                            \
        .help = "The camera's exposure time in microseconds; its automatic is then off."           \
    }

/** How many cameras are named on the command line: 0 or 1 in a sound one. */
int gn_live_count_asked(const struct gn_options *options);

/** What is wrong with the options of GN_LIVE_OPTIONS together; NULL: nothing. */
const char *gn_live_find_misuse(const struct gn_options *options);

/**
 * Opens the camera that is named, which must be one. wanted: what the command needs of it; size,
 * rate, exposure, gain and format come from the options where these say them. Returns 0, or a
 * negative errno and a sentence; -ENOSYS where the build has no such cameras.
 */
GN_MUST_USE int gn_live_open(const struct gn_options *options, const struct gn_live_options *wanted,
                             struct gn_source **out_source, struct gn_error *out_error);

/** One line about what a live source has counted. */
void gn_live_print_counts(const struct gn_source *source, FILE *out);

#endif
