/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate intrinsics: focal length, centre and distortion from pictures of a board.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "client/calibrate/device_file.h"
#include "client/calibrate/views.h"
#include "client/calibrate_input.h"
#include "client/cmd.h"
#include "client/feature.h"
#include "client/vision/boards.h"
#include "client/vision/markers.h"
#include "common/png.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    {.key = "files",
     .flag = "files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .is_required = true,
     .help = "The pictures: a folder, a file or a pattern as 'shots/*.png'; all of one size, focus "
             "and zoom as later in use."},
    {.key = "board",
     .flag = "board",
     .type = GN_OPTION_STRING,
     .value_name = "CxR",
     .is_required = true,
     .help = "Squares of the board, columns by rows, the outermost too: 10x7 has 9 x 6 inner "
             "corners."},
    {.key = "square",
     .flag = "square",
     .type = GN_OPTION_DOUBLE,
     .min = 1e-4,
     .max = 10,
     .default_value = "0.025",
     .value_name = "METRES",
     .help = "Side of a square. The intrinsics do not depend on it."},
    {.key = "charuco",
     .flag = "charuco",
     .type = GN_OPTION_ENUM,
     .choices = GN_MARKER_DICTIONARIES,
     .value_name = "DICTIONARY",
     .help = "The board is a ChArUco board with markers of this dictionary, as OpenCV 4.6 draws "
             "it; it may be seen in part. Without: a plain chessboard, seen whole."},
    {.key = "marker",
     .flag = "marker",
     .type = GN_OPTION_DOUBLE,
     .min = 1e-4,
     .max = 10,
     .value_name = "METRES",
     .help = "ChArUco: side of a marker. Default 0.7 of the square's."},
    {.key = "square-pixels",
     .flag = "square-pixels",
     .type = GN_OPTION_BOOL,
     .help = "fx = fy, which holds for nearly all sensors and steadies a fit of few views."},
    {.key = "max-error",
     .flag = "max-error",
     .type = GN_OPTION_DOUBLE,
     .min = 0.01,
     .max = 100,
     .default_value = "1",
     .value_name = "PX",
     .help = "Refuse a fit whose corners lie off by more (RMS)."},
    {.key = "out",
     .flag = "out",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .is_required = true,
     .help = "camera.json; what else it says stays."},
    {.key = "picture",
     .flag = "picture",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "A PNG of where corners were seen (blue) and of their errors (red, 50 times as long); "
             "parts of the picture without corners are pink."},
};

static const struct gn_program program = {
    .name = "gnomon calibrate intrinsics",
    .usage = "--files PATTERN --board CxR --out camera.json [OPTION]...",
    .summary = "Measures a camera's lens from 10 to 20 pictures of a flat board, tilted 20 to 45 "
               "degrees in all ways, near enough that it reaches the picture's corners in some.",
    .notes = "Example:\n"
             "  gnomon calibrate intrinsics --files 'shots/*.png' --board 10x7 \\\n"
             "      --out camera.json --picture coverage.png\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

struct run {
    struct gn_board board;
    struct gn_file_list list;
    struct gn_board_view views[GN_BOARD_MAX_VIEWS];
    struct gn_board_corner *corners[GN_BOARD_MAX_VIEWS]; // [n_views], owned
    double *residuals[GN_BOARD_MAX_VIEWS];               // [n_views], owned
    int entry[GN_BOARD_MAX_VIEWS];                       // of the list
    int n_views;
    int width, height;
    struct gn_intrinsics intrinsics;
};

static int read_board(const struct gn_options *options, struct gn_board *out,
                      struct gn_error *out_error)
{
    const char *text = gn_options_get_string(options, NULL, NULL, "board");
    char rest;
    if (sscanf(text, "%3dx%3d%c", &out->columns, &out->rows, &rest) != 2)
        return gn_error_set(out_error, -EINVAL,
                            "--board %s: right would be squares as COLUMNSxROWS, for example 10x7",
                            text);
    out->square_m = gn_options_get_double(options, NULL, NULL, "square");
    out->is_charuco = gn_options_is_set(options, NULL, NULL, "charuco");
    out->dictionary = gn_options_get_enum(options, NULL, NULL, "charuco");
    bool has_marker = gn_options_is_set(options, NULL, NULL, "marker");
    out->marker_m =
        has_marker ? gn_options_get_double(options, NULL, NULL, "marker") : 0.7 * out->square_m;
    return gn_board_check(out, out_error);
}

/* Adds a view where the picture shows enough of the board. */
static int look(struct run *run, int entry, struct gn_board_corner *found,
                struct gn_error *out_error)
{
    const char *path = run->list.entries[entry].path;
    struct gn_image image = {0};
    struct gn_image8 gray = {0};
    int n = 0;
    int err = gn_calibrate_read(path, &(struct gn_calibrate_format){0}, &image, NULL, out_error);
    if (!err && run->width == 0) {
        run->width = image.width;
        run->height = image.height;
    }
    if (!err && (image.width != run->width || image.height != run->height))
        err = gn_error_set(out_error, -EINVAL,
                           "%s: %d x %d, but the first picture is %d x %d: all must be of one "
                           "camera in one mode",
                           path, image.width, image.height, run->width, run->height);
    if (!err && gn_calibrate_stretch_gray(&image, &gray) < 0)
        err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = gn_board_find(&run->board, gray.data, gray.width, gray.height, found, &n, out_error);
    gn_image_finish(&image);
    gn_image8_finish(&gray);
    if (err || n < 8) {
        if (!err)
            printf("%s: no board (%d corners)\n", path, n);
        return err;
    }
    printf("%s: %d corners\n", path, n);
    int v = run->n_views;
    run->corners[v] = malloc((size_t)n * sizeof(*found));
    run->residuals[v] = calloc(2 * (size_t)n, sizeof(double));
    run->n_views++;
    if (!run->corners[v] || !run->residuals[v])
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    memcpy(run->corners[v], found, (size_t)n * sizeof(*found));
    run->views[v] =
        (struct gn_board_view){.corners = run->corners[v], .n = n, .residuals = run->residuals[v]};
    run->entry[v] = entry;
    return 0;
}

static int look_all(struct run *run, const char *pattern, struct gn_error *out_error)
{
    int err = gn_file_list_find(pattern, 1, &run->list, out_error);
    struct gn_board_corner *found = calloc(GN_BOARD_MAX_CORNERS, sizeof(*found));
    if (!err && !found)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err && run->list.n_entries > GN_BOARD_MAX_VIEWS)
        err = gn_error_set(out_error, -EINVAL, "%s: %d pictures, at most %d are taken", pattern,
                           run->list.n_entries, GN_BOARD_MAX_VIEWS);
    for (int i = 0; !err && i < run->list.n_entries; i++)
        err = look(run, i, found, out_error);
    free(found);
    return err;
}

static void print_results(const struct run *run, const struct gn_views_figures *figures)
{
    static const char *const names[9] = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
    const struct gn_intrinsics *in = &run->intrinsics;
    double values[9] = {in->fx, in->fy, in->cx, in->cy};
    memcpy(values + 4, in->distortion, sizeof(in->distortion));
    for (int v = 0; v < run->n_views; v++) {
        double worst = 0;
        for (int i = 0; i < run->views[v].n; i++)
            worst = fmax(worst, hypot(run->residuals[v][2 * i], run->residuals[v][2 * i + 1]));
        printf("%s: error %.3f px RMS, worst %.3f px, tilted %.0f degrees%s\n",
               run->list.entries[run->entry[v]].path, run->views[v].rms_px, worst,
               57.29577951308232 * acos(fmin(fabs(run->views[v].board_normal[2]), 1)),
               run->views[v].rms_px > 2.5 * in->rms_px ? "  <- far above the others, look at it"
                                                       : "");
    }
    for (int i = 0; i < 9; i++)
        printf("%s %.6g +- %.2g\n", names[i], values[i], in->deviation[i]);
    printf("error %.3f px RMS over %d views; corners in %.0f %% of the picture\n", in->rms_px,
           run->n_views, 100 * figures->coverage);
}

static int write_results(const struct run *run, const struct gn_options *options,
                         struct gn_error *out_error)
{
    const struct gn_intrinsics *in = &run->intrinsics;
    const char *picture = gn_options_get_string(options, NULL, NULL, "picture");
    if (picture) {
        struct gn_image8 drawn = {0};
        int err = gn_views_draw(run->views, run->n_views, run->width, run->height, 50, &drawn);
        if (err)
            gn_error_set(out_error, err, "%s: out of memory", picture);
        else
            err = gn_png_write_file(picture, &drawn, out_error);
        gn_image8_finish(&drawn);
        if (err)
            return err;
    }
    double k[4] = {in->fx, in->fy, in->cx, in->cy};
    json_t *numbers = gn_device_file_make_numbers(k, 4);
    json_t *found =
        json_pack("{s:i, s:i, s:O, s:O, s:O, s:O, s:o}", "width", run->width, "height", run->height,
                  "fx", json_array_get(numbers, 0), "fy", json_array_get(numbers, 1), "cx",
                  json_array_get(numbers, 2), "cy", json_array_get(numbers, 3), "distortion",
                  gn_device_file_make_numbers(in->distortion, 5));
    json_decref(numbers);
    const char *path = gn_options_get_string(options, NULL, NULL, "out");
    if (found && access(path, F_OK) != 0) {
        // Where the camera is markers or a tracker say; until then it looks down at the marker.
        static const double above[16] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0.5, 0, 0, 0, 1};
        json_object_set_new(found, "world_from_camera", gn_device_file_make_numbers(above, 16));
        printf("%s: new; its world_from_camera, half a metre above the marker, is a stand-in for "
               "what markers or a tracker say\n",
               path);
    }
    return gn_device_file_update(path, found, out_error);
}

static int calibrate(struct run *run, const struct gn_options *options, struct gn_error *out_error)
{
    struct gn_views_figures figures = {0};
    if (!gn_vision_is_built())
        return gn_feature_refuse(GN_FEATURE_VISION, out_error);
    int err = read_board(options, &run->board, out_error);
    if (!err)
        err = look_all(run, gn_options_get_string(options, NULL, NULL, "files"), out_error);
    if (!err)
        err =
            gn_views_check(run->views, run->n_views, run->width, run->height, &figures, out_error);
    if (!err)
        err = gn_intrinsics_solve(&run->board, run->views, run->n_views, run->width, run->height,
                                  gn_options_get_bool(options, NULL, NULL, "square-pixels"),
                                  &run->intrinsics, out_error);
    if (!err) {
        print_results(run, &figures);
        err = gn_views_judge(&run->intrinsics, run->width,
                             gn_options_get_double(options, NULL, NULL, "max-error"), out_error);
    }
    return err ? err : write_results(run, options, out_error);
}

int gn_cmd_calibrate_intrinsics(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    int ret = gn_cmd_load(&program, argc, argv, &options);
    if (ret <= 0)
        return ret == 0 ? 0 : 2;
    struct run *run = calloc(1, sizeof(*run));
    ret = run ? calibrate(run, options, &error) : gn_error_set(&error, -ENOMEM, "out of memory");
    for (int v = 0; run && v < run->n_views; v++) {
        free(run->corners[v]);
        free(run->residuals[v]);
    }
    if (run)
        gn_file_list_finish(&run->list);
    free(run);
    gn_options_destroy(&options);
    return ret ? gn_cmd_fail(&program, error.text) : 0;
}
