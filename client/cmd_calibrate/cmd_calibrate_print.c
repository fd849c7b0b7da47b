/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate print: the board or the marker that other commands look for, to be printed.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "client/calibrate/views.h"
#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_input.h"
#include "client/cmd_calibrate/sheet.h"
#include "client/poses.h"
#include "client/vision/markers.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    {.key = "board",
     .flag = "board",
     .type = GN_OPTION_STRING,
     .value_name = "CxR",
     .help = "A chessboard of so many squares, columns by rows, for gnomon calibrate intrinsics."},
    GN_CALIBRATE_SQUARE_OPTION("Side of its squares."),
    GN_CALIBRATE_CHARUCO_OPTION("With markers of this dictionary in its white squares."),
    {.key = "marker",
     .flag = "marker",
     .type = GN_OPTION_STRING,
     .value_name = "MARKER",
     .help = "One marker, DICT:ID:SIZE as for gnomon view --marker, such as 4x4_50:7:0.08; with "
             "--charuco the side of the board's markers in metres, default 0.7 of the square's."},
    {.key = "markers",
     .flag = "markers",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "The markers of a body of markers.json (docs/frames.md), if it is flat, where they "
             "belong."},
    {.key = "body",
     .flag = "body",
     .type = GN_OPTION_STRING,
     .default_value = GN_BODY_WORLD,
     .value_name = "NAME",
     .help = "With --markers: which body."},
    GN_CALIBRATE_OUT_OPTION("The SVG file; -: standard output. Its sizes are millimetres: print it "
                            "at 100 %, not fitted to the page, as browsers can, and measure the "
                            "line at its foot."),
};

static const struct gn_program program = {
    .name = "gnomon calibrate print",
    .usage = "--board CxR | --marker DICT:ID:SIZE | --markers FILE  --out FILE.svg [OPTION]...",
    .summary = "Draws what gnomon calibrate intrinsics and gnomon view look for, from the same "
               "words that they take.",
    .notes = "Examples:\n"
             "  gnomon calibrate print --board 10x7 --square 0.025 --out board.svg\n"
             "  gnomon calibrate print --board 8x6 --charuco 4x4_50 --square 0.03 \\\n"
             "      --marker 0.022 --out board.svg\n"
             "  gnomon calibrate print --marker 4x4_50:7:0.08 --out marker.svg\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

static bool is_set(const struct gn_options *options, const char *key)
{
    return gn_options_is_set(options, NULL, NULL, key);
}

/** Whether the name says what is written there. */
static bool is_svg(const char *path)
{
    size_t n = strlen(path);
    return strcmp(path, "-") == 0 || (n >= 4 && strcasecmp(path + n - 4, ".svg") == 0);
}

/** What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_options *options)
{
    bool has_board = is_set(options, "board");
    bool has_one = !has_board && is_set(options, "marker");
    if (has_board + has_one + is_set(options, "markers") != 1)
        return "give --board CxR, --marker DICT:ID:SIZE or --markers FILE, one of them";
    if (!has_board &&
        (is_set(options, "charuco") || !gn_options_is_default(options, NULL, NULL, "square")))
        return "--charuco and --square are for --board";
    if (has_board && is_set(options, "marker") && !is_set(options, "charuco"))
        return "a board has markers with --charuco DICTIONARY only; --marker DICT:ID:SIZE is a "
               "sheet of its own";
    if (!is_set(options, "markers") && !gn_options_is_default(options, NULL, NULL, "body"))
        return "--body is for --markers FILE";
    if (!is_svg(gn_options_get_string(options, NULL, NULL, "out")))
        return "--out: what is written is SVG, so give a name that ends in .svg, or - for standard "
               "output; a browser opens it, and prints it at 100 % or to a PDF";
    return NULL;
}

static int print_board(const struct gn_options *options, const char *path,
                       struct gn_sheet_size *out_size, struct gn_error *out_error)
{
    struct gn_board board = {.square_m = gn_options_get_double(options, NULL, NULL, "square"),
                             .is_charuco = is_set(options, "charuco"),
                             .dictionary = gn_options_get_enum(options, NULL, NULL, "charuco")};
    board.marker_m = 0.7 * board.square_m;
    const char *text = gn_options_get_string(options, NULL, NULL, "marker");
    int err = gn_calibrate_parse_board(gn_options_get_string(options, NULL, NULL, "board"), &board,
                                       out_error);
    if (!err && text) {
        char *end = NULL;
        board.marker_m = strtod(text, &end);
        if (end == text || *end)
            err = gn_error_set(out_error, -EINVAL,
                               "--marker %s: with --charuco right would be the side of its markers "
                               "in metres, such as 0.02",
                               text);
    }
    if (!err)
        err = gn_board_check(&board, out_error);
    return err ? err : gn_sheet_write_board(path, &board, out_size, out_error);
}

static int print_body(const struct gn_options *options, const char *path,
                      struct gn_sheet_size *out_size, struct gn_error *out_error)
{
    const char *file = gn_options_get_string(options, NULL, NULL, "markers");
    const char *name = gn_options_get_string(options, NULL, NULL, "body");
    struct gn_bodies bodies = {0};
    struct gn_error why = {0};
    int err = file ? gn_bodies_read_file(file, &bodies, out_error)
                   : gn_bodies_read_text(gn_options_get_string(options, NULL, NULL, "marker"),
                                         &bodies, &why);
    if (!file && err)
        return gn_error_set(out_error, err, "--marker %s", why.text);
    if (!err)
        gn_poses_doubt_sizes(&bodies, file ? file : "--marker");
    int body = err ? -1 : gn_bodies_find(&bodies, name);
    if (!err && body < 0)
        err = gn_error_set(out_error, -EINVAL, "%s: there is no body called \"%s\"", file, name);
    if (!err)
        err = gn_sheet_write_body(path, &bodies, body, out_size, out_error);
    gn_bodies_finish(&bodies);
    return err;
}

int gn_cmd_calibrate_print(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    struct gn_sheet_size size;
    int ret = gn_cmd_load(&program, argc, argv, &options);
    if (ret <= 0)
        return ret == 0 ? 0 : 2;
    const char *misuse = find_misuse(options),
               *path = gn_options_get_string(options, NULL, NULL, "out");
    if (misuse) {
        gn_cmd_fail(&program, misuse);
        gn_options_destroy(&options);
        return 2;
    }
    ret = is_set(options, "board") ? print_board(options, path, &size, &error)
                                   : print_body(options, path, &size, &error);
    if (ret) {
        gn_cmd_fail(&program, error.text);
    } else {
        bool is_a4 = fmin(size.width_mm, size.height_mm) <= 210 &&
                     fmax(size.width_mm, size.height_mm) <= 297;
        bool is_piped = strcmp(path, "-") == 0;
        fprintf(is_piped ? stderr : stdout,
                "%s: %.0f x %.0f mm%s; print it at 100 %%, then measure its line of %d mm\n",
                is_piped ? "standard output" : path, size.width_mm, size.height_mm,
                is_a4 ? "" : ", larger than A4", size.ruler_mm);
    }
    gn_options_destroy(&options);
    return ret ? 1 : 0;
}
