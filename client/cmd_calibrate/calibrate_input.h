/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the commands of `gnomon calibrate` share: lists of pictures, of numbers, and the commands
 * themselves.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_INPUT_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_INPUT_H

#include <stdbool.h>

#include "client/capture/file.h"
#include "client/vision/boards.h"
#include "common/error.h"
#include "common/image.h"
#include "common/image_file.h"
#include "proto/attr.h"

/** argv[0] is the command's name. Each returns the process's exit status. */
int gn_cmd_calibrate_print(int argc, char *const argv[]);
int gn_cmd_calibrate_intrinsics(int argc, char *const argv[]);
int gn_cmd_calibrate_response(int argc, char *const argv[]);
int gn_cmd_calibrate_probe(int argc, char *const argv[]);

/** Rows of the option tables that several of them have; help: what each does with it. */
#define GN_CALIBRATE_OUT_OPTION(help_text)                                                         \
    {                                                                                              \
        .key = "out", .flag = "out", .type = GN_OPTION_STRING, .value_name = "FILE",               \
        .is_required = true, .help = help_text                                                     \
    }
#define GN_CALIBRATE_PICTURE_OPTION(help_text)                                                     \
    {                                                                                              \
        .key = "picture", .flag = "picture", .type = GN_OPTION_STRING, .value_name = "FILE",       \
        .help = help_text                                                                          \
    }
#define GN_CALIBRATE_FRAMES_OPTION(help_text)                                                      \
    {                                                                                              \
        .key = "frames", .flag = "frames", .type = GN_OPTION_INT, .min = 1, .max = 10000,          \
        .value_name = "N", .help = help_text                                                       \
    }
#define GN_CALIBRATE_KEEP_OPTION(help_text)                                                        \
    {                                                                                              \
        .key = "keep", .flag = "keep", .type = GN_OPTION_STRING, .value_name = "DIR",              \
        .help = help_text                                                                          \
    }

#define GN_CALIBRATE_FULL_SCALE_OPTION(help_text)                                                  \
    {                                                                                              \
        .key = "full-scale", .flag = "full-scale", .type = GN_OPTION_INT, .min = 255,              \
        .max = 65535, .value_name = "CODE", .help = help_text                                      \
    }
#define GN_CALIBRATE_SQUARE_OPTION(help_text)                                                      \
    {                                                                                              \
        .key = "square", .flag = "square", .type = GN_OPTION_DOUBLE, .min = 1e-4, .max = 10,       \
        .default_value = "0.025", .value_name = "METRES", .help = help_text                        \
    }
#define GN_CALIBRATE_CHARUCO_OPTION(help_text)                                                     \
    {                                                                                              \
        .key = "charuco", .flag = "charuco", .type = GN_OPTION_ENUM,                               \
        .choices = GN_MARKER_DICTIONARIES, .value_name = "DICTIONARY", .help = help_text           \
    }

/** How codes of files become floats in [0, 1]. */
struct gn_calibrate_format {
    int full_scale16;  // largest code of 16-bit files, 0: 65535
    const char *bayer; // NULL, or "rggb", "grbg", "gbrg", "bggr": gray files are a mosaic
};

/**
 * Reads a picture as codes over full scale, 1 or 3 channels; a mosaic becomes RGB of half the size,
 * each of its squares of four one pixel. *out_code_step (may be NULL): the distance of codes, 0
 * where the file holds linear light. The caller finishes *out_image. Returns 0, or a negative errno
 * and a sentence.
 */
GN_MUST_USE int gn_calibrate_read(const char *path, const struct gn_calibrate_format *format,
                                  struct gn_image *out_image, double *out_code_step,
                                  struct gn_error *out_error);

/** The same of a picture that is in memory, name what it is called in sentences. */
GN_MUST_USE int gn_calibrate_convert(const char *name, const struct gn_image_file *file,
                                     const struct gn_calibrate_format *format,
                                     struct gn_image *out_image, double *out_code_step,
                                     struct gn_error *out_error);

/**
 * Shades of 8 bits, RGB, in which things can be found whatever the exposure: from the 1st to the
 * 99th percentile. Returns 0 or -ENOMEM; the caller finishes *out_image.
 */
GN_MUST_USE int gn_calibrate_stretch(const struct gn_image *image, struct gn_image8 *out_image);
/** The same in gray. */
GN_MUST_USE int gn_calibrate_stretch_gray(const struct gn_image *image,
                                          struct gn_image8 *out_image);

/** The mean of the channels, in one. Returns 0 or -ENOMEM; the caller finishes *out_image. */
GN_MUST_USE int gn_calibrate_make_gray(const struct gn_image *image, struct gn_image *out_image);

/** Sets columns and rows from "10x7", text of --board. Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_calibrate_parse_board(const char *text, struct gn_board *board,
                                         struct gn_error *out_error);

/** One number or fraction, as 1/60, at *at, which moves on. False where there is none. */
bool gn_calibrate_take_number(const char **at, double *out);

/**
 * Numbers separated by commas or white space, fractions as 1/60; text is the list itself or the
 * name of a file with it ('#' begins a comment). Exactly n, or n 0: up to capacity. Returns how
 * many, or -EINVAL and a sentence.
 */
GN_MUST_USE int gn_calibrate_read_numbers(const char *option, const char *text, int n, int capacity,
                                          double *out_values, struct gn_error *out_error);

#endif
