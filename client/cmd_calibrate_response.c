/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate response: what light a code stands for.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/chart_response.h"
#include "client/calibrate/device_file.h"
#include "client/calibrate/draw.h"
#include "client/calibrate/stack.h"
#include "client/calibrate_input.h"
#include "client/cmd.h"
#include "client/vision/boards.h"
#include "common/exr.h"
#include "common/image_file.h"
#include "proto/attr.h"

/* Codes nearer to the ends than this share of full scale count as clipped. */
#define RAIL 0.01

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
    {.key = "times",
     .flag = "times",
     .type = GN_OPTION_STRING,
     .value_name = "LIST",
     .help = "Exposure times in the pictures' order, any unit: 1/60,1/30,0.25 or a file with them. "
             "A chart on a log sensor does without; they are then found from its greys."},
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
             "px. Without, OpenCV looks for the chart."},
    {.key = "full-scale",
     .flag = "full-scale",
     .type = GN_OPTION_INT,
     .min = 255,
     .max = 65535,
     .default_value = "65535",
     .value_name = "CODE",
     .help = "Largest code of 16-bit files: 4095 for 12-bit sensors."},
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
    {.key = "out",
     .flag = "out",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .is_required = true,
     .help = "camera.json or probe.json; what else it says stays."},
    {.key = "plot",
     .flag = "plot",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Chart: an SVG of how far each patch lies off."},
    {.key = "radiance",
     .flag = "radiance",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Stack: the scene's radiance as EXR, in the units of the first picture."},
};

static const struct gn_program program = {
    .name = "gnomon calibrate response",
    .usage = "--chart PATTERN|--stack PATTERN --out FILE [OPTION]...",
    .summary = "Measures what light the codes of a camera or probe stand for. Lock its exposure, "
               "gain and white balance first.",
    .notes = "Examples:\n"
             "  gnomon calibrate response --chart 'shots/*.png' --full-scale 4095 \\\n"
             "      --out probe.json --plot residuals.svg\n"
             "  gnomon calibrate response --stack 'stack/*.jpg' \\\n"
             "      --times 1/60,1/30,1/15,1/8,1/4 --out probe.json\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

struct run {
    const struct gn_options *options;
    struct gn_file_list list;
    struct gn_calibrate_format format;
    double times[GN_CHART_MAX_SHOTS];
    bool has_times;
    struct gn_chart_place place;
    bool has_place;
    bool is_mono; // by the pictures
    double code_step;
};

static const char *get(const struct run *run, const char *key)
{
    return gn_options_get_string(run->options, NULL, NULL, key);
}

static int list_pictures(struct run *run, const char *pattern, int max, struct gn_error *out_error)
{
    int err = gn_file_list_find(pattern, 1, &run->list, out_error);
    int n = run->list.n_entries;
    if (!err && n > max)
        err = gn_error_set(out_error, -EINVAL, "%s: %d pictures, at most %d are taken", pattern, n,
                           max);
    if (!err && get(run, "times")) {
        err = gn_calibrate_read_numbers("times", get(run, "times"), n, GN_CHART_MAX_SHOTS,
                                        run->times, out_error);
        run->has_times = err == n;
        err = err < 0 ? err : 0;
    }
    for (int k = 0; !err && run->has_times && k < n; k++)
        if (!(run->times[k] > 0))
            err =
                gn_error_set(out_error, -EINVAL, "--times: %g for %s; an exposure time is above 0",
                             run->times[k], run->list.entries[k].path);
    return err;
}

static int read_place(struct run *run, struct gn_error *out_error)
{
    if (!get(run, "corners"))
        return 0;
    int n = gn_calibrate_read_numbers("corners", get(run, "corners"), 0, 8, run->place.corners,
                                      out_error);
    if (n >= 0 && n != 8)
        n = gn_error_set(out_error, -EINVAL,
                         "--corners: %d numbers; right would be x,y of four "
                         "patch centres, 8 numbers",
                         n);
    for (int i = 0; i < 8 && run->format.bayer; i++)
        run->place.corners[i] /= 2;
    run->has_place = n == 8;
    return n < 0 ? n : 0;
}

/* Looks in the pictures one after another, the middle one first, until one shows the chart. */
static int find_place(struct run *run, struct gn_error *out_error)
{
    int n = run->list.n_entries;
    for (int i = 0; i < n && !run->has_place; i++) {
        int k = (n / 2 + (i % 2 ? (i + 1) / 2 : n - i / 2)) % n;
        struct gn_image image = {0};
        struct gn_image8 shades = {0};
        int ret =
            gn_calibrate_read(run->list.entries[k].path, &run->format, &image, NULL, out_error);
        if (ret == 0 && gn_calibrate_stretch(&image, &shades) < 0)
            ret = gn_error_set(out_error, -ENOMEM, "out of memory");
        if (ret == 0)
            ret = gn_vision_find_chart(shades.data, shades.width, shades.height, run->place.corners,
                                       out_error);
        run->has_place = ret == 1 && gn_chart_orient(&image, &run->place) > 0.8;
        if (run->has_place) {
            const double *c = run->place.corners;
            int m = run->format.bayer ? 2 : 1;
            printf("chart found in %s; its corner patches: --corners "
                   "%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f\n",
                   run->list.entries[k].path, m * c[0], m * c[1], m * c[2], m * c[3], m * c[4],
                   m * c[5], m * c[6], m * c[7]);
        }
        gn_image_finish(&image);
        gn_image8_finish(&shades);
        if (ret < 0)
            return ret;
    }
    if (!run->has_place)
        return gn_error_set(out_error, -EDOM,
                            "no picture shows a colour chart that could be found; say where it is "
                            "with --corners (centres of the patches dark skin, bluish green, "
                            "black, white)");
    return 0;
}

static int measure(struct run *run, struct gn_chart_shot *shots, struct gn_error *out_error)
{
    int err = 0;
    bool is_turned = false; // where the chart is seen best
    double best = -1;
    for (int k = 0; !err && k < run->list.n_entries; k++) {
        const char *path = run->list.entries[k].path;
        struct gn_image image = {0};
        struct gn_error why = {0};
        err = gn_calibrate_read(path, &run->format, &image, &run->code_step, out_error);
        if (err)
            break;
        run->is_mono = image.channels == 1;
        shots[k] = (struct gn_chart_shot){.name = path, .time = run->has_times ? run->times[k] : 0};
        err = gn_chart_measure(&image, &run->place, RAIL, shots[k].patches, &why);
        struct gn_chart_place as_it_lies = run->place;
        double fit = err ? -1 : gn_chart_orient(&image, &as_it_lies);
        if (fit > best) {
            best = fit;
            is_turned = memcmp(&as_it_lies, &run->place, sizeof(as_it_lies)) != 0;
        }
        if (err)
            gn_error_set(out_error, err, "%s: %s", path, why.text);
        gn_image_finish(&image);
    }
    if (!err && best < 0.8 && gn_options_get_bool(run->options, NULL, NULL, "matrix"))
        err = gn_error_set(out_error, -EDOM,
                           "what lies at --corners is no colour chart (rank correlation with its "
                           "greys and colours %.2f at best, above 0.8 is right)",
                           best);
    if (!err && best >= 0.8 && is_turned)
        err = gn_error_set(out_error, -EDOM,
                           "the chart lies another way: --corners are the centres of the patches "
                           "dark skin, bluish green, black and white, in this order");
    return err;
}

static void print_points(const struct gn_chart_shot *shots, int n,
                         const struct gn_chart_response *r)
{
    for (int k = 0; k < n; k++) {
        int used = 0, clipped = 0, n_values = 0;
        double sum = 0;
        for (int i = 0; i < r->n_points; i++) {
            const struct gn_chart_point *p = &r->points[i];
            if (p->shot != k)
                continue;
            n_values++;
            clipped += p->is_clipped;
            bool is_sure = !p->is_clipped && !p->is_outlier && p->uncertainty < GN_CHART_SURE;
            used += is_sure;
            sum += is_sure ? p->error * p->error : 0;
        }
        printf("%s: exposure %.4g, %d of %d codes clipped; error %.2f %% RMS over %d sure to %.0f "
               "%%\n",
               shots[k].name, r->time[k], clipped, n_values,
               100 * sqrt(sum / (used > 0 ? used : 1)), used, 100 * GN_CHART_SURE);
    }
    for (int i = 0; i < r->n_points; i++) {
        const struct gn_chart_point *p = &r->points[i];
        if (p->is_outlier && isfinite(p->error))
            printf("  left out: %s, patch %d (%s), channel %d: %+.1f %% off\n", shots[p->shot].name,
                   p->patch + 1, gn_chart_get_name(p->patch), p->channel, 100 * p->error);
    }
}

static void print_results(const struct gn_chart_response *r)
{
    const struct gn_curve *c = &r->curve;
    if (c->model == GN_CURVE_LOG)
        printf("code = %.6f + %.6f ln(%.4g + light); b +- %.2f %%, c %s\n", c->a, c->b, c->c,
               100 * c->b_error, c->is_c_seen ? "seen" : "too small to be seen: taken as 0");
    else
        printf("code = %.6f + %.6f light\n", c->a, c->b);
    printf("condition number %.1f (at most %.0f), %d values used, %d outliers, %d clipped, worst "
           "grey %.2f %% off\n",
           c->condition, GN_CURVE_MAX_CONDITION, c->n_used, c->n_outliers, r->n_clipped,
           100 * r->worst_grey);
    if (!r->has_matrix)
        return;
    printf("matrix to Rec.709: condition number %.1f (at most %.0f), error %.1f %% RMS\n",
           r->matrix.condition, GN_CHART_MAX_CONDITION, 100 * r->matrix.rms);
    for (int j = 0; j < GN_CHART_PATCHES; j++) {
        printf("  %2d %-13s ", j + 1, gn_chart_get_name(j));
        if (isfinite(r->matrix.error[j]))
            printf("%5.1f %%%s\n", 100 * r->matrix.error[j],
                   r->matrix.is_outlier[j] ? "  left out" : "");
        else
            printf("clipped in every picture\n");
    }
}

static int write_chart(const struct run *run, const struct gn_chart_response *r,
                       struct gn_error *out_error)
{
    if (get(run, "plot")) {
        int err = gn_draw_chart_plot(get(run, "plot"), r, out_error);
        if (err)
            return err;
    }
    json_t *found = json_pack("{s:o}", "response", gn_device_file_make_curve(&r->curve));
    if (found && r->has_matrix)
        json_object_set_new(found, "to_rec709",
                            gn_device_file_make_numbers(r->matrix.to_rec709, 9));
    return gn_device_file_update(get(run, "out"), found, out_error);
}

static int run_chart(struct run *run, struct gn_error *out_error)
{
    static struct gn_chart_shot shots[GN_CHART_MAX_SHOTS];
    struct gn_chart_response response = {.n_points = 0};
    enum gn_curve_model model =
        (enum gn_curve_model)gn_options_get_enum(run->options, NULL, NULL, "model");
    int err = list_pictures(run, get(run, "chart"), GN_CHART_MAX_SHOTS, out_error);
    if (!err && model == GN_CURVE_LINEAR && !run->has_times)
        err = gn_error_set(out_error, -EINVAL, "--model linear needs --times");
    if (!err)
        err = read_place(run, out_error);
    if (!err && !run->has_place)
        err = find_place(run, out_error);
    if (!err)
        err = measure(run, shots, out_error);
    struct gn_chart_response_options options = {
        .model = model,
        .is_mono = run->is_mono,
        .has_no_matrix = !gn_options_get_bool(run->options, NULL, NULL, "matrix"),
        .keeps_white = true,
        .code_step = run->code_step};
    if (!err)
        err = gn_chart_response_fit(shots, run->list.n_entries, &options, &response, out_error);
    if (!err) {
        print_points(shots, run->list.n_entries, &response);
        print_results(&response);
        err = write_chart(run, &response, out_error);
    }
    gn_chart_response_finish(&response);
    return err;
}

static int read_stack(struct run *run, struct gn_image8 *pictures, struct gn_error *out_error)
{
    for (int k = 0; k < run->list.n_entries; k++) {
        const char *path = run->list.entries[k].path;
        struct gn_image_file file = {.kind = GN_IMAGE_LINEAR};
        int err = gn_image_read_file(path, &file, out_error);
        if (!err && file.kind != GN_IMAGE_CODES8)
            err = gn_error_set(out_error, -EINVAL,
                               "%s: a stack is of 8-bit pictures, PNG or JPEG; for other sensors "
                               "take a chart",
                               path);
        if (!err) {
            pictures[k] = file.codes8;
            file.codes8 = (struct gn_image8){0};
        }
        gn_image_file_finish(&file);
        if (err)
            return err;
        printf("%s: %d x %d, time %g\n", path, pictures[k].width, pictures[k].height,
               run->times[k]);
    }
    return 0;
}

/*
 * The formula in place of the table: gamma by least squares in ln over the codes seen, from 10 to
 * 245; srgb as it is. Returns it and its distance from the table, RMS in ln, up to a factor.
 */
static struct gn_response approximate(const struct gn_stack_response *r, bool is_gamma,
                                      double *out_rms)
{
    struct gn_response formula = {.type = is_gamma ? GN_RESPONSE_GAMMA : GN_RESPONSE_SRGB};
    int low = r->first_code > 10 ? r->first_code : 10,
        high = r->last_code < 245 ? r->last_code : 245;
    double mean[2] = {0}, xy = 0, xx = 0, square = 0, sum = 0;
    for (int z = low; z <= high; z++) {
        mean[0] += log(z / 255.0) / (high - low + 1);
        mean[1] += log(fmax((double)r->table[z], 1e-9)) / (high - low + 1);
    }
    for (int z = low; z <= high; z++) {
        double x = log(z / 255.0) - mean[0];
        xy += x * (log(fmax((double)r->table[z], 1e-9)) - mean[1]);
        xx += x * x;
    }
    formula.gamma = fmin(fmax(xx > 0 ? xy / xx : 1, 0.1), 10);
    for (int z = low; z <= high; z++) {
        double by_formula = (double)gn_response_decode(&formula, (float)z / 255);
        double d = log(fmax((double)r->table[z], 1e-9)) - log(by_formula);
        sum += d / (high - low + 1);
        square += d * d / (high - low + 1);
    }
    *out_rms = sqrt(fmax(square - sum * sum, 0));
    return formula;
}

static json_t *make_stack_response(const struct run *run, const struct gn_stack_response *r,
                                   struct gn_error *out_error)
{
    double table[GN_STACK_CODES], rms;
    int as = gn_options_get_enum(run->options, NULL, NULL, "as");
    if (as == 0) {
        for (int z = 0; z < GN_STACK_CODES; z++)
            table[z] = (double)r->table[z];
        return json_pack("{s:s, s:o}", "type", "table", "table",
                         gn_device_file_make_numbers(table, GN_STACK_CODES));
    }
    struct gn_response formula = approximate(r, as == 1, &rms);
    const char *name = gn_response_get_name(formula.type);
    printf("%s lies off the table by %.1f %% RMS over codes 10 to 245\n", name, 100 * rms);
    if (rms > 0.1) {
        gn_error_set(out_error, -EDOM,
                     "%s lies off the measured response by %.0f %%, at most 10 %% is right; write "
                     "the table, or take another --as",
                     name, 100 * rms);
        return NULL;
    }
    return as == 1 ? json_pack("{s:s, s:f}", "type", name, "gamma", formula.gamma)
                   : json_pack("{s:s}", "type", name);
}

static int write_stack(const struct run *run, const struct gn_stack *stack,
                       const struct gn_stack_response *r, struct gn_error *out_error)
{
    printf("codes %d to %d seen; pictures agree on the light within %.2f %% RMS\n", r->first_code,
           r->last_code, 100 * r->rms);
    if (get(run, "radiance")) {
        struct gn_image merged = {0};
        int err = gn_stack_merge(stack, r->table, &merged, out_error);
        struct gn_exr_channel channels[3] = {{.name = "R"}, {.name = "G"}, {.name = "B"}};
        channels[0].name = merged.channels == 1 ? "Y" : "R";
        for (int c = 0; c < merged.channels; c++) {
            channels[c].data = merged.data + c;
            channels[c].stride = merged.channels;
        }
        if (!err)
            err = gn_exr_write_file(get(run, "radiance"), merged.width, merged.height, channels,
                                    merged.channels, out_error);
        gn_image_finish(&merged);
        if (err)
            return err;
    }
    json_t *response = make_stack_response(run, r, out_error);
    if (!response)
        return -EDOM;
    return gn_device_file_update(get(run, "out"), json_pack("{s:o}", "response", response),
                                 out_error);
}

static int run_stack(struct run *run, struct gn_error *out_error)
{
    struct gn_image8 pictures[GN_STACK_MAX_PICTURES] = {{0}};
    struct gn_stack_response response = {{0}};
    int err = list_pictures(run, get(run, "stack"), GN_STACK_MAX_PICTURES, out_error);
    if (!err && !run->has_times)
        err = gn_error_set(out_error, -EINVAL, "--stack needs --times");
    if (!err)
        err = read_stack(run, pictures, out_error);
    struct gn_stack stack = {pictures, run->times, run->list.n_entries};
    struct gn_stack_options options = {
        .method = (enum gn_stack_method)gn_options_get_enum(run->options, NULL, NULL, "method")};
    if (!err)
        err = gn_stack_fit(&stack, &options, &response, out_error);
    if (!err)
        err = write_stack(run, &stack, &response, out_error);
    for (int k = 0; k < GN_STACK_MAX_PICTURES; k++)
        gn_image8_finish(&pictures[k]);
    return err;
}

int gn_cmd_calibrate_response(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    int ret = gn_cmd_load(&program, argc, argv, &options);
    if (ret <= 0)
        return ret == 0 ? 0 : 2;
    struct run run = {
        .options = options,
        .format = {.full_scale16 = gn_options_get_int(options, NULL, NULL, "full-scale"),
                   .bayer = gn_options_get_string(options, NULL, NULL, "bayer")}};
    bool has_chart = gn_options_is_set(options, NULL, NULL, "chart");
    if (has_chart == gn_options_is_set(options, NULL, NULL, "stack"))
        ret = gn_error_set(&error, -EINVAL, "give --chart PATTERN or --stack PATTERN, one of them");
    else
        ret = has_chart ? run_chart(&run, &error) : run_stack(&run, &error);
    gn_file_list_finish(&run.list);
    gn_options_destroy(&options);
    return ret ? gn_cmd_fail(&program, error.text) : 0;
}
