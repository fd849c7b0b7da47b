/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/curve_fit.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/curve_search.h"
#include "client/calibrate/solve.h"
#include "common/compare.h"

#define MAX_B_ERROR 0.05

/* The robust deviation of the residuals: 1.4826 times the median of their sizes. */
static double get_spread(struct gn_curve_work *f)
{
    int n = 0;
    for (int i = 0; i < f->n; i++) {
        const struct gn_curve_sample *s = &f->samples[i];
        if (s->weight > 0)
            f->slope[n++] =
                s->weight *
                fabs(s->code - gn_curve_predict(f, f->theta, gn_curve_get_light(s, f->u)));
    }
    qsort(f->slope, (size_t)n, sizeof(double), gn_compare_doubles);
    return n > 0 ? 1.4826 * f->slope[n / 2] : 0;
}

/* Weights for the next round: Huber's (k 1.345) while the curve is rough, then Tukey's (k 4.685);
 * efficiency 95 % for normal noise (Holland and Welsch 1977). */
static void reweight(struct gn_curve_work *f, bool is_tukey)
{
    double spread = fmax(get_spread(f), 1e-9);
    for (int i = 0; i < f->n; i++) {
        struct gn_curve_sample *s = &f->samples[i];
        if (!(s->weight > 0))
            continue;
        double r = s->weight *
                   fabs(s->code - gn_curve_predict(f, f->theta, gn_curve_get_light(s, f->u))) /
                   spread;
        double t = r / 4.685;
        double robust = is_tukey ? (t < 1 ? (1 - t * t) : 0) : (r > 1.345 ? sqrt(1.345 / r) : 1);
        f->weight[i] = s->weight * robust;
        s->is_outlier = is_tukey && robust == 0;
    }
}

/* Each group's factor as the median of what its samples say by the curve so far: of those that are
 * wrong, less than half of a group, none moves it. */
static void centre_groups(struct gn_curve_work *f)
{
    for (int g = 0; g < f->n_groups; g++) {
        int n = 0;
        for (int k = f->first[g]; k < f->first[g + 1]; k++) {
            const struct gn_curve_sample *s = &f->samples[f->order[k]];
            double x = f->model == GN_CURVE_LINEAR
                           ? s->code - f->theta[0]
                           : exp((s->code - f->anchor) / f->theta[0]) - f->theta[1];
            if (s->weight > 0 && x > 0)
                f->rows[n++] = log(x) - s->offset;
        }
        qsort(f->rows, (size_t)n, sizeof(double), gn_compare_doubles);
        if (n > 0)
            f->u[g] = (f->rows[n / 2] + f->rows[(n - 1) / 2]) / 2;
    }
}

static int sort_groups(struct gn_curve_work *f)
{
    for (int i = 0; i < f->n; i++)
        f->first[f->samples[i].group + 1]++;
    for (int g = 0; g < f->n_groups; g++)
        f->first[g + 1] += f->first[g];
    int *next = malloc((size_t)f->n_groups * sizeof(*next));
    if (!next)
        return -ENOMEM;
    memcpy(next, f->first, (size_t)f->n_groups * sizeof(*next));
    for (int i = 0; i < f->n; i++)
        f->order[next[f->samples[i].group]++] = i;
    free(next);
    return 0;
}

static int allocate(struct gn_curve_work *f)
{
    size_t n = (size_t)f->n, g = (size_t)f->n_groups;
    f->order = malloc(n * sizeof(*f->order));
    f->first = calloc(g + 1, sizeof(*f->first));
    f->weight = malloc(n * sizeof(double));
    f->rows = malloc(2 * n * sizeof(double));
    f->kept = malloc(2 * n * sizeof(double));
    f->residual = malloc(n * sizeof(double));
    f->slope = malloc(n * sizeof(double));
    f->u = calloc(g, sizeof(double));
    f->trial_u = calloc(g, sizeof(double));
    f->step_u = calloc(g, sizeof(double));
    bool ok = f->order && f->first && f->weight && f->rows && f->kept && f->residual && f->slope &&
              f->u && f->trial_u && f->step_u;
    return ok ? sort_groups(f) : -ENOMEM;
}

static void finish(struct gn_curve_work *f)
{
    free(f->order);
    free(f->first);
    free(f->weight);
    free(f->rows);
    free(f->kept);
    free(f->residual);
    free(f->slope);
    free(f->u);
    free(f->trial_u);
    free(f->step_u);
}

/* Samples used, and how many more than unknowns. */
static int count_free(const struct gn_curve_work *f, int *out_used)
{
    int used = 0, n_free = f->model == GN_CURVE_LOG ? -2 : -1;
    for (int g = 0; g < f->n_groups; g++) {
        int here = 0;
        for (int k = f->first[g]; k < f->first[g + 1]; k++)
            here += f->weight[f->order[k]] > 0;
        used += here;
        n_free += here > 0 ? here - 1 : 0;
    }
    *out_used = used;
    return n_free;
}

/*
 * Condition and standard errors at the solution: the columns of theta scaled to length 1, then the
 * groups eliminated; what is left of them, at its smallest, is one over the condition.
 */
static void judge(struct gn_curve_work *f, int n_theta, double cost, int n_free,
                  struct gn_curve *out)
{
    gn_curve_linearise(f);
    double norm[2], s[2], v[4];
    for (int j = 0; j < n_theta; j++)
        norm[j] = gn_solve_get_length(f->kept + j, f->n, 2);
    double *packed = f->kept; // norm has what is wanted of it
    for (int j = 0; j < n_theta; j++)
        for (int i = 0; i < f->n; i++)
            packed[i * n_theta + j] = f->rows[2 * i + j] / norm[j];
    out->condition = INFINITY;
    out->b_error = INFINITY;
    if (gn_solve_svd(packed, f->n, n_theta, s, v) < 0 || !(s[n_theta - 1] > 0))
        return;
    double sigma = sqrt(cost / (n_free > 0 ? n_free : 1)), error[2] = {0};
    for (int j = 0; j < n_theta; j++)
        for (int k = 0; k < n_theta; k++)
            error[j] = hypot(error[j], v[j * n_theta + k] / s[k] * sigma / norm[j]);
    out->condition = 1 / s[n_theta - 1];
    out->b_error = f->model == GN_CURVE_LOG ? error[0] / f->theta[0] : 0;
    out->c_error = error[1];
}

static int report(struct gn_curve_work *f, double cost, bool is_c_seen, struct gn_curve *out,
                  struct gn_error *out_error)
{
    struct gn_curve curve = {.model = f->model};
    int n_free = count_free(f, &curve.n_used);
    if (n_free < 1)
        return gn_error_set(out_error, -EDOM,
                            "%d usable codes are too few for a curve: every patch must be seen "
                            "unclipped in at least two exposures",
                            curve.n_used);
    judge(f, f->model == GN_CURVE_LOG && is_c_seen ? 2 : 1, cost, n_free, &curve);
    bool is_log = f->model == GN_CURVE_LOG;
    curve.a = is_log ? f->anchor : f->theta[0];
    curve.b = is_log ? f->theta[0] : 1;
    curve.c = is_log && is_c_seen ? f->theta[1] : 0;
    curve.is_c_seen = is_c_seen;
    double sum = 0;
    for (int i = 0; i < f->n; i++) {
        const struct gn_curve_sample *s = &f->samples[i];
        curve.n_outliers += s->is_outlier;
        double r = s->code - gn_curve_predict(f, f->theta, gn_curve_get_light(s, f->u));
        sum += f->weight[i] > 0 ? r * r : 0;
    }
    curve.rms = sqrt(sum / curve.n_used);
    if (!(curve.condition <= GN_CURVE_MAX_CONDITION))
        return gn_error_set(
            out_error, -EDOM,
            "these exposures do not determine the curve (condition number %.3g, at most %g is "
            "right): they are too much alike, or%s; take exposures that span the light to be "
            "measured, in steps of a factor of 4 or less",
            curve.condition, GN_CURVE_MAX_CONDITION,
            is_log ? " the codes rise in proportion to light, which is a linear sensor"
                   : " every patch is clipped in all but one");
    if (is_log && !(curve.b_error <= MAX_B_ERROR))
        return gn_error_set(out_error, -EDOM,
                            "the gain of the log curve is uncertain by %.0f %%, at most %.0f %% is "
                            "right: take more exposures, further apart",
                            100 * curve.b_error, 100 * MAX_B_ERROR);
    *out = curve;
    return 0;
}

static int run(struct gn_curve_work *f, struct gn_curve *out, struct gn_error *out_error)
{
    for (int i = 0; i < f->n; i++) {
        f->weight[i] = f->samples[i].weight;
        f->samples[i].is_outlier = false;
    }
    int used = 0, n_free = count_free(f, &used);
    if (n_free < 1)
        return gn_error_set(out_error, -EDOM,
                            "%d usable codes are too few for a curve: every patch must be seen "
                            "unclipped in at least two exposures",
                            used);
    if (!gn_curve_start(f))
        return gn_error_set(out_error, -EDOM,
                            "one exposure alone, or codes that fall as light rises, determine no "
                            "curve: take several exposures, and check their times");
    bool is_c_seen = false;
    double cost = 0;
    for (int round = 0; round < 7; round++) {
        cost = gn_curve_search(f, count_free(f, &used), &is_c_seen);
        if (!isfinite(cost))
            return gn_error_set(out_error, -EDOM, "the fit of the curve left the finite numbers");
        if (round == 1)
            centre_groups(f);
        if (round < 6)
            reweight(f, round >= 1);
    }
    return report(f, cost, is_c_seen, out, out_error);
}

int gn_curve_fit(enum gn_curve_model model, struct gn_curve_sample *samples, int n, int n_groups,
                 double *out_u, struct gn_curve *out_curve, struct gn_error *out_error)
{
    if (n < 1 || n_groups < 1 || n > 1 << 20 || n_groups > 1 << 20)
        return gn_error_set(out_error, -EINVAL, "a curve needs codes, found %d", n);
    for (int i = 0; i < n; i++)
        if (!isfinite(samples[i].code) || !isfinite(samples[i].offset) || samples[i].group < 0 ||
            samples[i].group >= n_groups || !(samples[i].weight >= 0))
            return gn_error_set(out_error, -EINVAL, "sample %d of the curve is not a number", i);
    struct gn_curve_work f = {.model = model, .samples = samples, .n = n, .n_groups = n_groups};
    int err = allocate(&f);
    if (err)
        gn_error_set(out_error, err, "out of memory");
    else
        err = run(&f, out_curve, out_error);
    for (int g = 0; !err && g < n_groups; g++) {
        double w = 0;
        for (int k = f.first[g]; k < f.first[g + 1]; k++)
            w += f.weight[f.order[k]];
        out_u[g] = w > 0 ? f.u[g] : NAN;
    }
    finish(&f);
    return err;
}

double gn_curve_decode(const struct gn_curve *curve, double code)
{
    if (curve->model == GN_CURVE_LINEAR)
        return fmax((code - curve->a) / curve->b, 0);
    return fmax(exp((code - curve->a) / curve->b) - curve->c, 0);
}

void gn_curve_rescale(struct gn_curve *curve, double factor)
{
    if (curve->model == GN_CURVE_LINEAR) {
        curve->b *= factor;
        return;
    }
    curve->a += curve->b * log(factor);
    curve->c /= factor;
    curve->c_error /= factor;
}
