/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures for `gnomon calibrate` from cameras and videos: the same as if they had been written to
 * files and read from there.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_LIVE_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_LIVE_H

#include <stdbool.h>

#include "client/feed.h"
#include "common/error.h"
#include "common/image_file.h"
#include "proto/attr.h"

/** Rows of the option table that every command has which takes such pictures. */
#define GN_CALIBRATE_LIVE_OPTIONS GN_FEED_VIDEO_OPTION, GN_LIVE_OPTIONS, GN_LIVE_EXPOSURE_OPTION

/** Whether a video or a camera is named. */
bool gn_calibrate_is_live(const struct gn_options *options);

/** What is wrong with --files and GN_CALIBRATE_LIVE_OPTIONS together; NULL: nothing. */
const char *gn_calibrate_find_misuse(const struct gn_options *options);

/**
 * Opens the video or camera that is named, with all the bits that it has. wanted: as of
 * gn_live_open. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_calibrate_open(const struct gn_options *options,
                                  const struct gn_live_options *wanted,
                                  struct gn_source **out_source, struct gn_error *out_error);

/**
 * Waits for the next picture as it is captured; news of the camera go to stderr. Returns 1, 0 at
 * the end of a video or on Ctrl-C (see gn_cmd_catch_signals), or a negative errno and a sentence.
 */
GN_MUST_USE int gn_calibrate_wait(const struct gn_program *program, struct gn_source *source,
                                  struct gn_capture *out, struct gn_error *out_error);

/** A capture's codes. *out_full_scale: the largest code of 16-bit pictures, untouched by others.
 * The caller finishes *out. Returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_calibrate_decode(const struct gn_capture *capture, struct gn_image_file *out,
                                    int *out_full_scale, struct gn_error *out_error);

/**
 * Waits for the next picture; news of the camera go to stderr. *out_full_scale: the largest code of
 * 16-bit pictures. The caller finishes *out. Returns 1, 0 at the end of a video or on Ctrl-C (see
 * gn_cmd_catch_signals), or a negative errno and a sentence.
 */
GN_MUST_USE int gn_calibrate_take(const struct gn_program *program, struct gn_source *source,
                                  struct gn_image_file *out, int *out_full_scale,
                                  struct gn_error *out_error);

/**
 * The mean of n pictures, codes over full scale as gn_calibrate_read has them. full_scale16: 0, or
 * the largest code of 16-bit pictures where that is not the one of their format. Returns 0, or a
 * negative errno and a sentence: -EINTR where fewer came. The caller finishes *out_image.
 */
GN_MUST_USE int gn_calibrate_take_mean(const struct gn_program *program, struct gn_source *source,
                                       int n, int full_scale16, struct gn_image *out_image,
                                       double *out_code_step, struct gn_error *out_error);

/** Makes the folder where there is none. Returns 0, or a negative errno and a sentence: -EEXIST
 * where it has pictures already. */
GN_MUST_USE int gn_calibrate_make_folder(const char *option, const char *path,
                                         struct gn_error *out_error);

/** Writes codes as PNG, as many bits as they have. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_calibrate_write(const char *path, const struct gn_image_file *picture,
                                   struct gn_error *out_error);

#endif
