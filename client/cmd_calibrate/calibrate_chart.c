/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate response, of a colour chart: where it is, what its patches show, what was found.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/calibrate/chart_find.h"
#include "client/calibrate/chart_response.h"
#include "client/calibrate/device_file.h"
#include "client/calibrate/plot.h"
#include "client/cmd_calibrate/calibrate_response.h"
#include "client/vision/boards.h"
#include "common/draw.h"
#include "common/png.h"

/* Codes nearer to the ends than this share of full scale count as clipped. */
#define RAIL 0.01
/* What is less like a chart is none. */
#define LEAST_LIKENESS 0.8

/* The chart in the pictures at hand. */
struct run {
    const struct gn_options *options;
    const struct gn_calibrate_series *series;
    struct gn_image mean; // of all pictures' codes: each patch lies between the rails in some
    struct gn_chart_place place;
    bool is_mono; // by the pictures
    double code_step;
};

static const char *get(const struct run *run, const char *key)
{
    return gn_options_get_string(run->options, NULL, NULL, key);
}

static int read_place(struct run *run, struct gn_error *out_error)
{
    int n = gn_calibrate_read_numbers("corners", get(run, "corners"), 0, 8, run->place.corners,
                                      out_error);
    if (n >= 0 && n != 8)
        n = gn_error_set(out_error, -EINVAL,
                         "--corners: %d numbers; right would be x,y of four "
                         "patch centres, 8 numbers",
                         n);
    for (int i = 0; i < 8 && run->series->format.bayer; i++)
        run->place.corners[i] /= 2;
    return n < 0 ? n : 0;
}

/* Adds a picture to the mean; the camera and the chart are at rest. */
static int add_to_mean(struct run *run, const struct gn_image *image, const char *name,
                       struct gn_error *out_error)
{
    struct gn_image *mean = &run->mean;
    int n = run->series->n;
    if (!mean->data && gn_image_init(mean, image->width, image->height, image->channels) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    if (mean->width != image->width || mean->height != image->height ||
        mean->channels != image->channels)
        return gn_error_set(out_error, -EINVAL,
                            "%s: %d x %d in %d channels, but the first picture is %d x %d in %d",
                            name, image->width, image->height, image->channels, mean->width,
                            mean->height, mean->channels);
    for (long i = 0; i < (long)image->width * image->height * image->channels; i++)
        mean->data[i] += image->data[i] / (float)n;
    return 0;
}

static int make_mean(struct run *run, struct gn_error *out_error)
{
    int err = 0;
    for (int k = 0; !err && k < run->series->n; k++) {
        struct gn_image image = {0};
        err = gn_calibrate_series_read(run->series, k, &image, &run->code_step, out_error);
        if (!err)
            err = add_to_mean(run, &image, run->series->names[k], out_error);
        gn_image_finish(&image);
    }
    run->is_mono = run->mean.channels == 1;
    return err;
}

/* OpenCV's word, where it is like a chart. Errors count as not found: there is another way. */
static bool find_by_opencv(const struct gn_image *image, struct gn_chart_place *out_place)
{
    struct gn_image8 shades = {0};
    struct gn_chart_place place;
    struct gn_error nothing = {0};
    bool is_found = gn_calibrate_stretch(image, &shades) == 0 &&
                    gn_vision_find_chart(shades.data, shades.width, shades.height, place.corners,
                                         &nothing) == 1 &&
                    gn_chart_orient(image, &place) > LEAST_LIKENESS;
    gn_image8_finish(&shades);
    if (is_found)
        *out_place = place;
    return is_found;
}

/* OpenCV compares colours: under light of one band it takes a gray picture only. The grid of the
 * patches does where it sees none, or is not in the build. */
static int find_place(struct run *run, struct gn_error *out_error)
{
    struct gn_image gray = {0};
    const char *by = "OpenCV";
    int ret = 1;
    if (!find_by_opencv(&run->mean, &run->place)) {
        if (gn_calibrate_make_gray(&run->mean, &gray) < 0)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
        if (!find_by_opencv(&gray, &run->place)) {
            by = "its grid";
            ret = gn_chart_find(&run->mean, &run->place, out_error);
        }
        gn_image_finish(&gray);
    }
    if (ret < 0)
        return ret;
    if (ret == 0)
        return gn_error_set(out_error, -EDOM,
                            "the pictures show no colour chart that could be found; say where it "
                            "is with --corners (centres of the patches dark skin, bluish green, "
                            "black, white)");
    const double *c = run->place.corners;
    int m = run->series->format.bayer ? 2 : 1;
    printf("chart found by %s; its corner patches: --corners "
           "%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f\n",
           by, m * c[0], m * c[1], m * c[2], m * c[3], m * c[4], m * c[5], m * c[6], m * c[7]);
    return 0;
}

/* Refuses a place that the user gave and that is none, or another way round. */
static int check_place(const struct run *run, struct gn_error *out_error)
{
    struct gn_chart_place turned = run->place;
    double likeness = gn_chart_orient(&run->mean, &turned);
    if (likeness < LEAST_LIKENESS && gn_options_get_bool(run->options, NULL, NULL, "matrix"))
        return gn_error_set(out_error, -EDOM,
                            "what lies at --corners is no colour chart (rank correlation with its "
                            "greys and colours %.2f at best, above %.1f is right)",
                            likeness, LEAST_LIKENESS);
    if (likeness >= LEAST_LIKENESS && memcmp(&turned, &run->place, sizeof(turned)) != 0)
        return gn_error_set(out_error, -EDOM,
                            "the chart lies another way: --corners are the centres of the patches "
                            "dark skin, bluish green, black and white, in this order");
    return 0;
}

static int measure(const struct run *run, struct gn_chart_shot *shots, struct gn_error *out_error)
{
    int err = 0;
    for (int k = 0; !err && k < run->series->n; k++) {
        const char *name = run->series->names[k];
        struct gn_image image = {0};
        struct gn_error why = {0};
        shots[k] = (struct gn_chart_shot){
            .name = name, .time = run->series->has_times ? run->series->times[k] : 0};
        err = gn_calibrate_series_read(run->series, k, &image, NULL, out_error);
        if (!err) {
            err = gn_chart_measure(&image, &run->place, RAIL, shots[k].patches, &why);
            if (err)
                gn_error_set(out_error, err, "%s: %s", name, why.text);
        }
        gn_image_finish(&image);
    }
    return err;
}

static void print_points(const struct gn_chart_shot *shots, int n,
                         const struct gn_chart_response *r)
{
    for (int k = 0; k < n; k++) {
        int used = 0, clipped = 0, n_values = 0;
        for (int i = 0; i < r->n_points; i++) {
            n_values += r->points[i].shot == k;
            clipped += r->points[i].shot == k && r->points[i].is_clipped;
        }
        double error = gn_chart_response_get_error(r, k, &used);
        printf("%s: exposure %.4g, %d of %d codes clipped; ", shots[k].name, r->time[k], clipped,
               n_values);
        if (used > 0)
            printf("error %.2f %% RMS over %d sure to %.0f %%\n", 100 * error, used,
                   100 * GN_CHART_SURE);
        else
            printf("no code fine enough to be sure to %.0f %%\n", 100 * GN_CHART_SURE);
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

/* The mean of the pictures, each patch ringed where it is measured. */
static int draw_place(const struct run *run, const char *path, struct gn_error *out_error)
{
    static const struct gn_ink ink = {255, 0, 255};
    struct gn_image8 picture = {0};
    if (gn_calibrate_stretch(&run->mean, &picture) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    for (int j = 0; j < GN_CHART_PATCHES; j++) {
        double corners[8];
        gn_chart_get_outline(&run->place, j, corners);
        for (int i = 0; i < 4; i++)
            gn_draw_line(&picture, corners + 2 * i, corners + 2 * ((i + 1) % 4), ink);
        if (j == 0) // dark skin: crossed
            gn_draw_line(&picture, corners, corners + 4, ink);
    }
    int err = gn_png_write_file(path, &picture, out_error);
    gn_image8_finish(&picture);
    return err;
}

static int write_results(const struct run *run, const struct gn_chart_response *r,
                         struct gn_error *out_error)
{
    int err = get(run, "plot") ? gn_plot_chart(get(run, "plot"), r, out_error) : 0;
    if (err)
        return err;
    json_t *found = json_pack("{s:o}", "response", gn_device_file_make_curve(&r->curve));
    if (found && r->has_matrix)
        json_object_set_new(found, "to_rec709",
                            gn_device_file_make_numbers(r->matrix.to_rec709, 9));
    return gn_device_file_update(get(run, "out"), found, out_error);
}

int gn_calibrate_chart(const struct gn_options *options, const struct gn_calibrate_series *series,
                       struct gn_error *out_error)
{
    static struct gn_chart_shot shots[GN_CHART_MAX_SHOTS];
    struct run run = {.options = options, .series = series};
    struct gn_chart_response response = {.n_points = 0};
    enum gn_curve_model model =
        (enum gn_curve_model)gn_options_get_enum(options, NULL, NULL, "model");
    bool is_given = get(&run, "corners");
    int err = is_given ? read_place(&run, out_error) : 0;
    if (!err)
        err = make_mean(&run, out_error);
    if (!err && !is_given)
        err = find_place(&run, out_error);
    if (!err && get(&run, "picture"))
        err = draw_place(&run, get(&run, "picture"), out_error);
    if (!err)
        err = measure(&run, shots, out_error);
    if (!err && is_given)
        err = check_place(&run, out_error);
    struct gn_chart_response_options fit = {.model = model,
                                            .is_mono = run.is_mono,
                                            .has_no_matrix =
                                                !gn_options_get_bool(options, NULL, NULL, "matrix"),
                                            .keeps_white = true,
                                            .code_step = run.code_step};
    if (!err)
        err = gn_chart_response_fit(shots, series->n, &fit, &response, out_error);
    if (!err) {
        print_points(shots, series->n, &response);
        print_results(&response);
        err = gn_chart_response_check(shots, series->n, &response, out_error);
    }
    if (!err)
        err = write_results(&run, &response, out_error);
    gn_chart_response_finish(&response);
    gn_image_finish(&run.mean);
    return err;
}
