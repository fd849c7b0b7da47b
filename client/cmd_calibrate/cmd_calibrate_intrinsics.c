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

#include "client/calibrate/device_file.h"
#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_collect.h"
#include "client/cmd_calibrate/calibrate_input.h"
#include "client/feature.h"
#include "client/poses.h"
#include "client/vision/boards.h"
#include "client/vision/markers.h"
#include "common/png.h"
#include "proto/attr.h"

#define DEFAULT_VIEWS 15

static const struct gn_option option_table[] = {
    {.key = "files",
     .flag = "files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "The pictures: a folder, a file or a pattern as 'shots/*.png'; all of one size, focus "
             "and zoom as later in use."},
    GN_CALIBRATE_LIVE_OPTIONS,
    {.key = "views",
     .flag = "views",
     .type = GN_OPTION_INT,
     .min = GN_VIEWS_MIN,
     .max = GN_BOARD_MAX_VIEWS,
     .value_name = "N",
     .help = "Camera or video: end with so many views, each of the board at rest and other than "
             "all before; default 15. Ctrl-C ends with those that are there."},
    GN_CALIBRATE_KEEP_OPTION("Camera or video: write the pictures of the views to this new folder, "
                             "as PNG; --files DIR then gives the same result again."),
    {.key = "board",
     .flag = "board",
     .type = GN_OPTION_STRING,
     .value_name = "CxR",
     .is_required = true,
     .help = "Squares of the board, columns by rows, the outermost too: 10x7 has 9 x 6 inner "
             "corners."},
    GN_CALIBRATE_SQUARE_OPTION("Side of a square. The intrinsics do not depend on it."),
    GN_CALIBRATE_CHARUCO_OPTION(
        "The board is a ChArUco board with markers of this dictionary, as OpenCV 4.6 draws it; it "
        "may be seen in part. Without: a plain chessboard, seen whole."),
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
    GN_CALIBRATE_OUT_OPTION("camera.json; what else it says stays."),
    GN_CALIBRATE_PICTURE_OPTION(
        "A PNG of where corners were seen (blue) and of their errors (red, 50 times as long); "
        "parts of the picture without corners are pink."),
};

static const struct gn_program program = {
    .name = "gnomon calibrate intrinsics",
    .usage = "--files PATTERN | --video FILE | --gige ID | --v4l2 DEVICE "
             "--board CxR --out camera.json [OPTION]...",
    .summary = "Measures a camera's lens from 10 to 20 pictures of a flat board, tilted 20 to 45 "
               "degrees in all ways, near enough that it reaches the picture's corners in some.",
    .notes = "Examples:\n"
             "  gnomon calibrate intrinsics --files 'shots/*.png' --board 10x7 \\\n"
             "      --out camera.json --picture coverage.png\n"
             "  gnomon calibrate intrinsics --gige any --board 10x7 --keep shots \\\n"
             "      --out camera.json\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

struct run {
    struct gn_calibrate_views set;
    struct gn_intrinsics intrinsics;
};

static int read_board(const struct gn_options *options, struct gn_board *out,
                      struct gn_error *out_error)
{
    int err = gn_calibrate_parse_board(gn_options_get_string(options, NULL, NULL, "board"), out,
                                       out_error);
    if (err)
        return err;
    out->square_m = gn_options_get_double(options, NULL, NULL, "square");
    out->is_charuco = gn_options_is_set(options, NULL, NULL, "charuco");
    out->dictionary = gn_options_get_enum(options, NULL, NULL, "charuco");
    bool has_marker = gn_options_is_set(options, NULL, NULL, "marker");
    out->marker_m =
        has_marker ? gn_options_get_double(options, NULL, NULL, "marker") : 0.7 * out->square_m;
    return gn_board_check(out, out_error);
}

static int look_all(struct run *run, const struct gn_options *options, struct gn_error *out_error)
{
    static struct gn_board_corner found[GN_BOARD_MAX_CORNERS];
    const char *pattern = gn_options_get_string(options, NULL, NULL, "files");
    struct gn_file_list list = {0};
    int err = gn_file_list_find(pattern, 1, &list, out_error);
    if (!err && list.n_entries > GN_BOARD_MAX_VIEWS)
        err = gn_error_set(out_error, -EINVAL, "%s: %d pictures, at most %d are taken", pattern,
                           list.n_entries, GN_BOARD_MAX_VIEWS);
    for (int i = 0; !err && i < list.n_entries; i++) {
        const char *path = list.entries[i].path;
        struct gn_image image = {0};
        int n = 0;
        err = gn_calibrate_read(path, &(struct gn_calibrate_format){0}, &image, NULL, out_error);
        if (!err)
            err = gn_calibrate_views_look(&run->set, path, &image, found, &n, out_error);
        if (err)
            break;
        if (n < GN_CALIBRATE_MIN_CORNERS)
            printf("%s: no board (%d corners)%s\n", path, n,
                   run->set.board.is_charuco ? "" : "; a chessboard must be whole in the picture");
        else
            printf("%s: %d corners\n", path, n);
        if (n >= GN_CALIBRATE_MIN_CORNERS)
            err = gn_calibrate_views_add(&run->set, path, found, n, out_error);
    }
    gn_file_list_finish(&list);
    return err;
}

static int collect(struct run *run, const struct gn_options *options, struct gn_error *out_error)
{
    int n = gn_options_is_set(options, NULL, NULL, "views")
                ? (int)gn_options_get_int(options, NULL, NULL, "views")
                : DEFAULT_VIEWS;
    return gn_calibrate_views_collect(&run->set, &program, options, n,
                                      gn_options_get_string(options, NULL, NULL, "keep"),
                                      out_error);
}

static const char *find_misuse(const struct gn_options *options)
{
    const char *misuse = gn_calibrate_find_misuse(options);
    if (!misuse && gn_options_is_set(options, NULL, NULL, "marker") &&
        !gn_options_is_set(options, NULL, NULL, "charuco"))
        misuse = "--marker is for --charuco DICTIONARY: a plain chessboard has no markers";
    if (!misuse && !gn_calibrate_is_live(options) &&
        (gn_options_is_set(options, NULL, NULL, "views") ||
         gn_options_is_set(options, NULL, NULL, "keep")))
        misuse = "--views and --keep are for cameras and videos; of files all are taken";
    return misuse;
}

static void print_results(const struct run *run, const struct gn_views_figures *figures)
{
    static const char *const names[9] = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
    const struct gn_intrinsics *in = &run->intrinsics;
    double values[9] = {in->fx, in->fy, in->cx, in->cy};
    memcpy(values + 4, in->distortion, sizeof(in->distortion));
    for (int v = 0; v < run->set.n_views; v++) {
        double worst = 0;
        for (int i = 0; i < run->set.views[v].n; i++)
            worst =
                fmax(worst, hypot(run->set.residuals[v][2 * i], run->set.residuals[v][2 * i + 1]));
        printf("%s: error %.3f px RMS, worst %.3f px, tilted %.0f degrees%s\n", run->set.names[v],
               run->set.views[v].rms_px, worst,
               57.29577951308232 * acos(fmin(fabs(run->set.views[v].board_normal[2]), 1)),
               run->set.views[v].rms_px > 2.5 * in->rms_px ? "  <- far above the others, look at it"
                                                           : "");
    }
    for (int i = 0; i < 9; i++)
        printf("%s %.6g +- %.2g\n", names[i], values[i], in->deviation[i]);
    printf("error %.3f px RMS over %d views; corners in %.0f %% of the picture\n", in->rms_px,
           run->set.n_views, 100 * figures->coverage);
}

static int write_results(const struct run *run, const struct gn_options *options,
                         struct gn_error *out_error)
{
    const struct gn_intrinsics *in = &run->intrinsics;
    const char *picture = gn_options_get_string(options, NULL, NULL, "picture");
    if (picture) {
        struct gn_image8 drawn = {0};
        int err = gn_views_draw(run->set.views, run->set.n_views, run->set.width, run->set.height,
                                50, &drawn);
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
    json_t *found = json_pack("{s:i, s:i, s:O, s:O, s:O, s:O, s:o}", "width", run->set.width,
                              "height", run->set.height, "fx", json_array_get(numbers, 0), "fy",
                              json_array_get(numbers, 1), "cx", json_array_get(numbers, 2), "cy",
                              json_array_get(numbers, 3), "distortion",
                              gn_device_file_make_numbers(in->distortion, 5));
    json_decref(numbers);
    const char *path = gn_options_get_string(options, NULL, NULL, "out");
    struct gn_camera camera;
    bool has_place = false;
    int err = gn_device_file_update(path, found, out_error);
    if (!err)
        err = gn_poses_read_camera(path, &camera, &has_place, out_error);
    if (!err && !has_place)
        printf("%s: where the camera is it does not say: gnomon view finds that by --marker or "
               "--markers; of a camera at rest add its world_from_camera\n",
               path);
    return err;
}

static int calibrate(struct run *run, const struct gn_options *options, struct gn_error *out_error)
{
    struct gn_views_figures figures = {0};
    if (!gn_vision_is_built())
        return gn_feature_refuse(GN_FEATURE_VISION, out_error);
    int err = read_board(options, &run->set.board, out_error);
    if (!err)
        err = gn_calibrate_is_live(options) ? collect(run, options, out_error)
                                            : look_all(run, options, out_error);
    if (!err)
        err = gn_views_check(run->set.views, run->set.n_views, run->set.width, run->set.height,
                             &figures, out_error);
    if (err && run->set.n_views == 0 && run->set.hint[0])
        gn_error_set(out_error, err, "%s", run->set.hint);
    if (!err)
        err = gn_intrinsics_solve(
            &run->set.board, run->set.views, run->set.n_views, run->set.width, run->set.height,
            gn_options_get_bool(options, NULL, NULL, "square-pixels"), &run->intrinsics, out_error);
    if (!err) {
        print_results(run, &figures);
        err = gn_views_judge(&run->intrinsics, run->set.width,
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
    const char *misuse = find_misuse(options);
    if (misuse) {
        gn_cmd_fail(&program, misuse);
        gn_options_destroy(&options);
        return 2;
    }
    struct run *run = calloc(1, sizeof(*run));
    ret = run ? calibrate(run, options, &error) : gn_error_set(&error, -ENOMEM, "out of memory");
    if (run)
        gn_calibrate_views_finish(&run->set);
    free(run);
    gn_options_destroy(&options);
    return ret ? gn_cmd_fail(&program, error.text) : 0;
}
