/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate response: what light a code stands for.
 */
#include <errno.h>

#include "client/calibrate/chart_response.h"
#include "client/calibrate/stack.h"
#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_response.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    {.key = "chart",
     .flag = "chart",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "Pictures of a 24-patch colour chart (ColorChecker Classic) at several exposures, "
             "camera and chart at rest, in the order of their names. The first is the one exposed "
             "as the camera will run: a perfect white in it becomes linear 1."},
    {.key = "stack",
     .flag = "stack",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "Instead: 8-bit pictures of any still scene at several exposure times. The response "
             "becomes a table of 256 values."},
    GN_LIVE_OPTIONS,
    {.key = "live",
     .flag = "live",
     .type = GN_OPTION_ENUM,
     .choices = "chart|stack",
     .help = "Camera: what it sees, the chart (default), or as for --stack any still scene."},
    GN_CALIBRATE_SERIES_OPTIONS,
    {.key = "times",
     .flag = "times",
     .type = GN_OPTION_STRING,
     .value_name = "LIST",
     .help = "Exposure times in the pictures' order, in any one unit but without it: "
             "1/60,1/30,0.25 or a file with them. A chart on a log sensor does without; they are "
             "then found from its greys."},
    {.key = "model",
     .flag = "model",
     .type = GN_OPTION_ENUM,
     .choices = "log|linear",
     .default_value = "log",
     .help = "Chart: the sensor. log: code = a + b ln(c + light); linear: code = dark + light."},
    {.key = "method",
     .flag = "method",
     .type = GN_OPTION_ENUM,
     .choices = "debevec|robertson",
     .default_value = "debevec",
     .help = "Stack: Debevec and Malik 1997, or Robertson et al. 2003."},
    {.key = "as",
     .flag = "as",
     .type = GN_OPTION_ENUM,
     .choices = "table|gamma|srgb",
     .default_value = "table",
     .help = "Stack: what is written. gnomon probe and gnomon-render take the table; camera frames "
             "(gnomon view) travel with gamma or srgb only: their distance from the table is told, "
             "and refused above 10 %."},
    {.key = "corners",
     .flag = "corners",
     .type = GN_OPTION_STRING,
     .value_name = "LIST",
     .help = "Chart: x,y of the centres of the patches dark skin, bluish green, black, white, in "
             "px. Without, the chart is looked for."},
    GN_CALIBRATE_FULL_SCALE_OPTION(
        "Largest code: 4095 for 12-bit sensors; default 65535 of 16-bit files, and that of its "
        "pixel format of a camera."),
    {.key = "bits",
     .flag = "bits",
     .type = GN_OPTION_INT,
     .min = 8,
     .max = 16,
     .value_name = "N",
     .help = "Bits of the sensor's codes, where 16-bit files hold finer ones: means of pictures."},
    {.key = "bayer",
     .flag = "bayer",
     .type = GN_OPTION_ENUM,
     .choices = "rggb|grbg|gbrg|bggr",
     .help = "Gray files are a mosaic, beginning so at the top left; --corners are in its pixels."},
    {.key = "matrix",
     .flag = "matrix",
     .type = GN_OPTION_BOOL,
     .default_value = "true",
     .help = "Chart: fit the colour matrix, too. --no-matrix under coloured light, and where the "
             "camera's own is not to change."},
    GN_CALIBRATE_OUT_OPTION("camera.json or probe.json; what else it says stays."),
    {.key = "plot",
     .flag = "plot",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Chart: an SVG of how far each patch lies off."},
    GN_CALIBRATE_PICTURE_OPTION(
        "Chart: a PNG of where its patches are measured, dark skin crossed."),
    {.key = "radiance",
     .flag = "radiance",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Stack: the scene's radiance as EXR, in the units of the first picture."},
};

static const struct gn_program program = {
    .name = "gnomon calibrate response",
    .usage = "--chart PATTERN | --stack PATTERN | --gige ID | --v4l2 DEVICE --out FILE "
             "[OPTION]...",
    .summary = "Measures what light the codes of a camera or probe stand for, from pictures of one "
               "still scene at several exposures, its gain and white balance locked.",
    .notes = "Examples:\n"
             "  gnomon calibrate response --chart 'shots/*.png' --full-scale 4095 \\\n"
             "      --out probe.json --plot residuals.svg\n"
             "  gnomon calibrate response --stack 'stack/*.jpg' \\\n"
             "      --times 1/60,1/30,1/15,1/8,1/4 --out probe.json\n"
             "  gnomon calibrate response --gige any --exposures 4,0.25,1,16,64ms \\\n"
             "      --keep shots --out probe.json --plot residuals.svg --picture found.png\n"
             "  gnomon calibrate response --v4l2 any --live stack --exposures auto \\\n"
             "      --out probe.json\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

static bool has(const struct gn_options *options, const char *key)
{
    return gn_options_is_set(options, NULL, NULL, key);
}

static bool is_stack(const struct gn_options *options)
{
    return has(options, "stack") || (gn_live_count_asked(options) > 0 &&
                                     gn_options_get_enum(options, NULL, NULL, "live") == 1);
}

/* An option that would be ignored; NULL: none. */
static const char *find_ignored(const struct gn_options *options)
{
    static const char *const chart[] = {"corners", "full-scale", "bits", "bayer",
                                        "model",   "matrix",     "plot", "picture"};
    static const char *const stack[] = {"method", "as", "radiance"};
    for (size_t i = 0; is_stack(options) && i < GN_ARRAY_LEN(chart); i++)
        if (!gn_options_is_default(options, NULL, NULL, chart[i]))
            return chart[i];
    for (size_t i = 0; !is_stack(options) && i < GN_ARRAY_LEN(stack); i++)
        if (!gn_options_is_default(options, NULL, NULL, stack[i]))
            return stack[i];
    return NULL;
}

/* What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_options *options)
{
    int n_cameras = gn_live_count_asked(options);
    const char *misuse = gn_live_find_misuse(options);
    if (misuse)
        return misuse;
    if (has(options, "chart") + has(options, "stack") + n_cameras != 1)
        return "give --chart PATTERN, --stack PATTERN or a camera (--gige ID, --v4l2 DEVICE), one "
               "of them";
    if (n_cameras && !has(options, "exposures"))
        return "a camera needs --exposures, such as 4,1,2,8,16ms or auto";
    if (n_cameras && has(options, "times"))
        return "a camera's exposures are those of --exposures: no --times";
    if (n_cameras && has(options, "bayer"))
        return "--bayer is for files; a camera's own mosaic is interpolated";
    if (!n_cameras && (has(options, "live") || has(options, "exposures") ||
                       has(options, "frames") || has(options, "keep")))
        return "--live, --exposures, --frames and --keep are for cameras, and none is named";
    if (!n_cameras && !has(options, "times") && is_stack(options))
        return "--stack needs --times";
    if (!n_cameras && !has(options, "times") &&
        gn_options_get_enum(options, NULL, NULL, "model") == GN_CURVE_LINEAR)
        return "--model linear needs --times";
    return NULL;
}

static int check_options(const struct gn_options *options, struct gn_error *out_error)
{
    const char *misuse = find_misuse(options), *ignored = find_ignored(options);
    if (misuse)
        return gn_error_set(out_error, -EINVAL, "%s", misuse);
    if (ignored)
        return gn_error_set(out_error, -EINVAL, "--%s is for %s", ignored,
                            is_stack(options) ? "charts, not for a stack"
                                              : "stacks, not for a chart");
    return 0;
}

static int calibrate(const struct gn_options *options, struct gn_calibrate_series *series,
                     struct gn_error *out_error)
{
    bool is_live = gn_live_count_asked(options) > 0;
    bool has_stack = is_stack(options);
    int err;
    series->format = (struct gn_calibrate_format){
        .full_scale16 = gn_options_get_int(options, NULL, NULL, "full-scale"),
        .bayer = gn_options_get_string(options, NULL, NULL, "bayer")};
    int most = has_stack ? GN_STACK_MAX_PICTURES : GN_CHART_MAX_SHOTS;
    if (is_live)
        err = gn_calibrate_series_take(series, &program, options, has_stack, most, out_error);
    else
        err = gn_calibrate_series_list(
            series, gn_options_get_string(options, NULL, NULL, has_stack ? "stack" : "chart"), most,
            gn_options_get_string(options, NULL, NULL, "times"), out_error);
    if (err)
        return err;
    if (has(options, "bits"))
        series->bits = (int)gn_options_get_int(options, NULL, NULL, "bits");
    return has_stack ? gn_calibrate_stack(options, series, out_error)
                     : gn_calibrate_chart(options, series, out_error);
}

int gn_cmd_calibrate_response(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    struct gn_calibrate_series series = {.n = 0};
    int ret = gn_cmd_load(&program, argc, argv, &options);
    if (ret <= 0)
        return ret == 0 ? 0 : 2;
    int misused = check_options(options, &error);
    ret = misused ? misused : calibrate(options, &series, &error);
    gn_calibrate_series_finish(&series);
    gn_options_destroy(&options);
    if (ret)
        gn_cmd_fail(&program, error.text);
    return misused ? 2 : ret ? 1 : 0;
}
