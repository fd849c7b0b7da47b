/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate response, of an exposure stack: the table, or the formula in its place.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "client/calibrate/device_file.h"
#include "client/calibrate/stack.h"
#include "client/cmd_calibrate/calibrate_response.h"
#include "common/exr.h"
#include "common/response.h"

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

static json_t *make_response(const struct gn_options *options, const struct gn_stack_response *r,
                             struct gn_error *out_error)
{
    double table[GN_STACK_CODES], rms;
    int as = gn_options_get_enum(options, NULL, NULL, "as");
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

static int write_results(const struct gn_options *options, const struct gn_stack *stack,
                         const struct gn_stack_response *r, struct gn_error *out_error)
{
    printf("codes %d to %d seen; pictures agree on the light within %.2f %% RMS\n", r->first_code,
           r->last_code, 100 * r->rms);
    const char *path = gn_options_get_string(options, NULL, NULL, "radiance");
    if (path) {
        struct gn_image merged = {0};
        int err = gn_stack_merge(stack, r->table, &merged, out_error);
        struct gn_exr_channel channels[3] = {{.name = "R"}, {.name = "G"}, {.name = "B"}};
        channels[0].name = merged.channels == 1 ? "Y" : "R";
        for (int c = 0; c < merged.channels; c++) {
            channels[c].data = merged.data + c;
            channels[c].stride = merged.channels;
        }
        if (!err)
            err = gn_exr_write_file(path, merged.width, merged.height, channels, merged.channels,
                                    out_error);
        gn_image_finish(&merged);
        if (err)
            return err;
    }
    json_t *response = make_response(options, r, out_error);
    if (!response)
        return -EDOM;
    return gn_device_file_update(gn_options_get_string(options, NULL, NULL, "out"),
                                 json_pack("{s:o}", "response", response), out_error);
}

int gn_calibrate_stack(const struct gn_options *options, struct gn_calibrate_series *series,
                       struct gn_error *out_error)
{
    struct gn_image8 pictures[GN_STACK_MAX_PICTURES] = {{0}};
    struct gn_stack_response response = {{0}};
    int err = 0;
    for (int k = 0; !err && k < series->n; k++) {
        err = gn_calibrate_series_get_codes8(series, k, &pictures[k], out_error);
        if (!err)
            printf("%s: %d x %d, time %g\n", series->names[k], pictures[k].width,
                   pictures[k].height, series->times[k]);
    }
    struct gn_stack stack = {pictures, series->times, series->n};
    struct gn_stack_options fit = {
        .method = (enum gn_stack_method)gn_options_get_enum(options, NULL, NULL, "method")};
    if (!err)
        err = gn_stack_fit(&stack, &fit, &response, out_error);
    if (!err)
        err = write_results(options, &stack, &response, out_error);
    for (int k = 0; k < GN_STACK_MAX_PICTURES; k++)
        gn_image8_finish(&pictures[k]);
    return err;
}
