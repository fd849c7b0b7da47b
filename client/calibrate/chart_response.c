/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/chart_response.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/compare.h"

#define MAX_CLIPPED 0.02
/* What a patch's code is not known better than, whatever its pixels say: drift of lamp and lens. */
#define LOG_FLOOR 5e-4    // share of full scale
#define LINEAR_FLOOR 2e-3 // share of the code
/* Codes that differ by so many sigmas differ. */
#define SURE_SIGMAS 5
/* Fewer values of a picture say nothing of the picture. */
#define LEAST_VALUES 3

struct fit {
    const struct gn_chart_shot *shots;
    int n, n_channels;
    bool has_times;
    const struct gn_chart_response_options *options;
    struct gn_curve_sample *samples; // [n_samples]
    struct gn_chart_point *points;   // [n_points], sample i is points[point_of[i]]
    int *point_of;
    int n_samples, n_groups;
    double *u; // [n_groups]
};

static double get_sigma(const struct fit *f, const struct gn_chart_patch *patch, int channel)
{
    double step = f->options->code_step / sqrt(12);
    double pixels = hypot(patch->spread[channel], step) / sqrt(patch->n_pixels);
    double floor_code = f->options->model == GN_CURVE_LOG
                            ? LOG_FLOOR
                            : LINEAR_FLOOR * patch->code[channel] + step / 4;
    return hypot(pixels, floor_code);
}

/* How many patches' codes, of those that are not clipped in both, are clearly lower in b. */
static int count_falling(const struct fit *f, const struct gn_chart_shot *a,
                         const struct gn_chart_shot *b, int *out_n)
{
    int n_falling = 0;
    *out_n = 0;
    for (int j = 0; j < GN_CHART_PATCHES; j++)
        for (int c = 0; c < f->n_channels; c++) {
            const struct gn_chart_patch *p = &a->patches[j], *q = &b->patches[j];
            if (p->clipped[c] > MAX_CLIPPED && q->clipped[c] > MAX_CLIPPED)
                continue;
            double noise = hypot(get_sigma(f, p, c), get_sigma(f, q, c));
            n_falling += p->code[c] - q->code[c] > SURE_SIGMAS * noise;
            ++*out_n;
        }
    return n_falling;
}

/* Refuses times in another order than the pictures' codes. */
static int check_order(const struct fit *f, struct gn_error *out_error)
{
    for (int k = 0; k < f->n; k++)
        for (int l = 0; l < f->n; l++) {
            const struct gn_chart_shot *a = &f->shots[k], *b = &f->shots[l];
            int n = 0, n_falling = a->time < b->time ? count_falling(f, a, b, &n) : 0;
            if (n_falling >= LEAST_VALUES && 2 * n_falling > n)
                return gn_error_set(out_error, -EDOM,
                                    "codes fall as the exposure rises: are the times in the "
                                    "pictures' order? %d of %d are lower in %s, exposure %g, than "
                                    "in %s, exposure %g",
                                    n_falling, n, b->name, b->time, a->name, a->time);
        }
    return 0;
}

/* With times, a group is a patch in a channel; without, the greys of a picture in a channel. */
static void add_point(struct fit *f, struct gn_chart_response *out, int k, int j, int c)
{
    const struct gn_chart_patch *patch = &f->shots[k].patches[j];
    struct gn_chart_point *point = &f->points[out->n_points];
    *point = (struct gn_chart_point){.shot = k,
                                     .patch = j,
                                     .channel = c,
                                     .code = patch->code[c],
                                     .spread = patch->spread[c],
                                     .is_clipped = patch->clipped[c] > MAX_CLIPPED};
    out->n_clipped += point->is_clipped;
    if (!point->is_clipped && (f->has_times || j >= GN_CHART_WHITE)) {
        double rho[3];
        gn_chart_get_reflectance(j, rho);
        f->samples[f->n_samples] = (struct gn_curve_sample){
            .code = point->code,
            .offset = f->has_times ? log(f->shots[k].time / f->shots[0].time) : log(rho[1]),
            .group = f->has_times ? j * f->n_channels + c : k * f->n_channels + c,
            .weight = 1 / get_sigma(f, patch, c)};
        f->point_of[f->n_samples++] = out->n_points;
    }
    out->n_points++;
}

/* The channel that stands for all: green, or the only one. */
static int get_main_channel(const struct fit *f)
{
    return f->n_channels == 3 ? 1 : 0;
}

/* ln of the unit that the fit's light is in, from the greys' mean against their reflectance. */
static int find_unit(const struct fit *f, double *out_unit, struct gn_error *out_error)
{
    double sum = 0;
    int n = 0, c = get_main_channel(f);
    if (!f->has_times) {
        *out_unit = f->u[c];
        if (isfinite(*out_unit))
            return 0;
        return gn_error_set(out_error, -EDOM,
                            "%s: every grey patch is clipped; the first picture must be one "
                            "exposed as the camera will run",
                            f->shots[0].name);
    }
    for (int j = GN_CHART_WHITE; j < GN_CHART_PATCHES; j++) {
        double rho[3], u = f->u[j * f->n_channels + c];
        gn_chart_get_reflectance(j, rho);
        if (isfinite(u)) {
            sum += u - log(rho[1]);
            n++;
        }
    }
    if (n == 0)
        return gn_error_set(out_error, -EDOM, "every grey patch is clipped in every picture");
    *out_unit = sum / n;
    return 0;
}

/* Without times: a patch's light is the median of what its pictures say. */
static double get_median_light(const struct fit *f, const struct gn_chart_response *r, int patch,
                               int channel)
{
    double values[GN_CHART_MAX_SHOTS];
    int n = 0;
    for (int i = 0; i < r->n_points; i++) {
        const struct gn_chart_point *p = &f->points[i];
        if (p->patch == patch && p->channel == channel && !p->is_clipped &&
            isfinite(r->time[p->shot]))
            values[n++] = gn_curve_decode(&r->curve, p->code) / r->time[p->shot];
    }
    qsort(values, (size_t)n, sizeof(double), gn_compare_doubles);
    return n > 0 ? (values[n / 2] + values[(n - 1) / 2]) / 2 : NAN;
}

static void find_colours(const struct fit *f, double unit, struct gn_chart_response *r)
{
    int c_main = get_main_channel(f);
    for (int k = 0; k < f->n; k++)
        r->time[k] = f->has_times ? f->shots[k].time / f->shots[0].time
                                  : exp(f->u[k * f->n_channels + c_main] - unit);
    for (int j = 0; j < GN_CHART_PATCHES; j++)
        for (int c = 0; c < 3; c++) {
            int channel = c < f->n_channels ? c : 0;
            r->device[3 * j + c] = f->has_times ? exp(f->u[j * f->n_channels + channel] - unit)
                                                : get_median_light(f, r, j, channel);
        }
    for (int i = 0; i < r->n_points; i++) {
        struct gn_chart_point *p = &f->points[i];
        p->light = r->device[3 * p->patch + p->channel] * r->time[p->shot];
        p->error = gn_curve_decode(&r->curve, p->code) / p->light - 1;
        double sigma = hypot(get_sigma(f, &f->shots[p->shot].patches[p->patch], p->channel),
                             f->options->code_step / sqrt(12));
        p->uncertainty = (gn_curve_decode(&r->curve, p->code + sigma) -
                          gn_curve_decode(&r->curve, p->code - sigma)) /
                         (2 * p->light);
        if (p->patch >= GN_CHART_WHITE && !p->is_clipped && !p->is_outlier &&
            p->uncertainty < GN_CHART_SURE)
            r->worst_grey = fmax(r->worst_grey, fabs(p->error));
    }
}

static int fit_all(struct fit *f, struct gn_chart_response *r, struct gn_error *out_error)
{
    for (int k = 0; k < f->n; k++)
        for (int j = 0; j < GN_CHART_PATCHES; j++)
            for (int c = 0; c < f->n_channels; c++)
                add_point(f, r, k, j, c);
    f->n_groups = f->n_channels * (f->has_times ? GN_CHART_PATCHES : f->n);
    if (f->n_samples < 4)
        return gn_error_set(out_error, -EDOM,
                            "%d of %d codes are unclipped: too few; expose so that the chart's "
                            "codes lie between the rails",
                            f->n_samples, r->n_points);
    double unit = 0;
    int err = check_order(f, out_error);
    if (!err)
        err = gn_curve_fit(f->options->model, f->samples, f->n_samples, f->n_groups, f->u,
                           &r->curve, out_error);
    if (!err)
        err = find_unit(f, &unit, out_error);
    if (err)
        return err;
    gn_curve_rescale(&r->curve, exp(unit));
    for (int i = 0; i < f->n_samples; i++) {
        f->points[f->point_of[i]].is_fitted = true;
        f->points[f->point_of[i]].is_outlier = f->samples[i].is_outlier;
    }
    find_colours(f, unit, r);
    if (f->n_channels == 3 && !f->options->has_no_matrix) {
        err = gn_chart_fit_matrix(r->device, f->options->keeps_white, &r->matrix, out_error);
        r->has_matrix = err == 0;
    }
    return err;
}

static int check(const struct gn_chart_shot *shots, int n, struct gn_error *out_error)
{
    if (n < 2)
        return gn_error_set(out_error, -EDOM,
                            "%d picture of the chart determines no curve: one exposure alone "
                            "cannot tell the chart's light from the camera's response; right "
                            "would be 4 or more exposures",
                            n);
    if (n > GN_CHART_MAX_SHOTS)
        return gn_error_set(out_error, -EINVAL, "%d pictures of the chart, at most %d are taken", n,
                            GN_CHART_MAX_SHOTS);
    for (int k = 0; k < n; k++)
        if (!(shots[k].time >= 0 && isfinite(shots[k].time)) ||
            (shots[k].time > 0) != (shots[0].time > 0))
            return gn_error_set(out_error, -EINVAL,
                                "%s: its exposure time must be above 0, and known for all "
                                "pictures or for none",
                                shots[k].name);
    return 0;
}

int gn_chart_response_fit(const struct gn_chart_shot *shots, int n,
                          const struct gn_chart_response_options *options,
                          struct gn_chart_response *out, struct gn_error *out_error)
{
    memset(out, 0, sizeof(*out));
    int err = check(shots, n, out_error);
    if (err)
        return err;
    struct fit f = {.shots = shots,
                    .n = n,
                    .n_channels = options->is_mono ? 1 : 3,
                    .has_times = shots[0].time > 0,
                    .options = options};
    size_t n_all = (size_t)n * GN_CHART_PATCHES * (size_t)f.n_channels;
    struct gn_chart_response r = {.n_points = 0};
    f.samples = calloc(n_all, sizeof(*f.samples));
    f.points = calloc(n_all, sizeof(*f.points));
    f.point_of = calloc(n_all, sizeof(*f.point_of));
    f.u = calloc(n_all, sizeof(*f.u));
    if (f.samples && f.points && f.point_of && f.u)
        err = fit_all(&f, &r, out_error);
    else
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    free(f.samples);
    free(f.point_of);
    free(f.u);
    r.points = f.points;
    if (err)
        gn_chart_response_finish(&r);
    *out = r;
    return err;
}

double gn_chart_response_get_error(const struct gn_chart_response *response, int shot, int *out_n)
{
    double sum = 0;
    *out_n = 0;
    for (int i = 0; i < response->n_points; i++) {
        const struct gn_chart_point *p = &response->points[i];
        if (p->shot == shot && !p->is_clipped && !p->is_outlier && p->uncertainty < GN_CHART_SURE) {
            sum += p->error * p->error;
            ++*out_n;
        }
    }
    return *out_n > 0 ? sqrt(sum / *out_n) : 0;
}

/* The picture's values that the curve was fitted to, and those found off it. */
static int count_fitted(const struct gn_chart_response *response, int shot, int *out_n_outliers)
{
    int n = 0;
    *out_n_outliers = 0;
    for (int i = 0; i < response->n_points; i++) {
        const struct gn_chart_point *p = &response->points[i];
        n += p->shot == shot && p->is_fitted;
        *out_n_outliers += p->shot == shot && p->is_outlier;
    }
    return n;
}

int gn_chart_response_check(const struct gn_chart_shot *shots, int n,
                            const struct gn_chart_response *response, struct gn_error *out_error)
{
    static const char right[] = "right would be one chart at rest in steady light, gain and white "
                                "balance locked, and times in the pictures' order";
    const struct gn_curve *curve = &response->curve;
    int worst = 0, most = -1;
    for (int k = 0; k < n; k++) {
        int n_outliers, n_sure, n_fitted = count_fitted(response, k, &n_outliers);
        double error = gn_chart_response_get_error(response, k, &n_sure);
        if (n_fitted >= LEAST_VALUES && 2 * n_outliers > n_fitted)
            return gn_error_set(out_error, -EDOM,
                                "%d of the %d values of %s are off the other pictures' curve; %s",
                                n_outliers, n_fitted, shots[k].name, right);
        if (n_sure >= LEAST_VALUES && error > GN_CHART_MAX_SHOT_ERROR)
            return gn_error_set(out_error, -EDOM,
                                "%s lies %.1f %% RMS off the curve, at most %g %% is right; %s",
                                shots[k].name, 100 * error, 100 * GN_CHART_MAX_SHOT_ERROR, right);
        if (n_outliers > most) {
            most = n_outliers;
            worst = k;
        }
    }
    if (2 * curve->n_outliers > curve->n_used)
        return gn_error_set(out_error, -EDOM,
                            "%d of %d values lie on no common curve, %d of them of %s; at most a "
                            "third is right; %s",
                            curve->n_outliers, curve->n_outliers + curve->n_used, most,
                            shots[worst].name, right);
    return 0;
}

void gn_chart_response_finish(struct gn_chart_response *response)
{
    if (!response)
        return;
    free(response->points);
    memset(response, 0, sizeof(*response));
}
