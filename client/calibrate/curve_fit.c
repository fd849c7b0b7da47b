/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/curve_fit.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/solve.h"

#define MAX_STEPS 60
/* Search of ln c, in units where c + x = 1 gives the mean code. */
#define GRID_LOW (-40.0)
#define GRID_STEP 0.5
/* Below this share of the variance of the fit, a c makes no difference (three sigma). */
#define C_SIGNIFICANCE 9.0
#define MAX_B_ERROR 0.05

/*
 * One fit. Its units: the log curve goes through the mean code at c + x = 1, the linear one has
 * b = 1; the groups' factors take up the rest, so that light has no free scale.
 */
struct fit {
    enum gn_curve_model model;
    struct gn_curve_sample *samples;
    int n, n_groups;
    int *order;     // [n], samples by group
    int *first;     // [n_groups + 1], where each begins in order
    double *weight; // [n], with the robust part
    double *u;      // [n_groups]
    double *trial_u, *step_u;
    double *rows;     // [n][2], columns of theta after elimination
    double *kept;     // [n][2], the same before
    double *residual; // [n]
    double *slope;    // [n], d code / d u, weighted
    double anchor;    // the mean code
    double theta[2];  // LOG: b, c; LINEAR: a
};

static double predict(const struct fit *f, const double theta[2], double x)
{
    if (f->model == GN_CURVE_LINEAR)
        return theta[0] + x;
    return f->anchor + theta[0] * log(theta[1] + x);
}

static double get_light(const struct gn_curve_sample *s, const double *u)
{
    return exp(fmin(fmax(s->offset + u[s->group], -300), 300));
}

static double get_cost(const struct fit *f, const double theta[2], const double *u)
{
    double cost = 0;
    for (int i = 0; i < f->n; i++) {
        const struct gn_curve_sample *s = &f->samples[i];
        double r =
            f->weight[i] > 0 ? f->weight[i] * (s->code - predict(f, theta, get_light(s, u))) : 0;
        cost += r * r;
    }
    return isfinite(cost) ? cost : INFINITY;
}

/* Residuals and derivatives of one sample: theta's to columns[2]. */
static void differentiate(struct fit *f, int i, double columns[2])
{
    const struct gn_curve_sample *s = &f->samples[i];
    double x = get_light(s, f->u), w = f->weight[i];
    if (f->model == GN_CURVE_LINEAR) {
        columns[0] = w;
        columns[1] = 0;
        f->slope[i] = w * x;
    } else {
        columns[0] = w * log(f->theta[1] + x);
        columns[1] = w * f->theta[0] / (f->theta[1] + x);
        f->slope[i] = w * f->theta[0] * x / (f->theta[1] + x);
    }
    f->residual[i] = w * (s->code - predict(f, f->theta, x));
}

/* Takes a group's direction out of what[first .. last) with that stride; returns its share. */
static double eliminate(const struct fit *f, int group, double *what, int stride, double norm2)
{
    double dot = 0;
    for (int k = f->first[group]; k < f->first[group + 1]; k++)
        dot += f->slope[f->order[k]] * what[f->order[k] * stride];
    double share = norm2 > 0 ? dot / norm2 : 0;
    for (int k = f->first[group]; k < f->first[group + 1]; k++)
        what[f->order[k] * stride] -= share * f->slope[f->order[k]];
    return share;
}

/*
 * Linearises at theta and u: rows[n][2] and residual[n] with the groups eliminated (each has one
 * column of its own and no sample has two, so this is exact). step_u gets the step of each group
 * for theta standing still, kept the columns before.
 */
static void linearise(struct fit *f)
{
    for (int i = 0; i < f->n; i++) {
        differentiate(f, i, f->rows + 2 * i);
        memcpy(f->kept + 2 * i, f->rows + 2 * i, 2 * sizeof(double));
    }
    for (int g = 0; g < f->n_groups; g++) {
        double norm2 = 0;
        for (int k = f->first[g]; k < f->first[g + 1]; k++)
            norm2 += f->slope[f->order[k]] * f->slope[f->order[k]];
        eliminate(f, g, f->rows, 2, norm2);
        eliminate(f, g, f->rows + 1, 2, norm2);
        f->step_u[g] = eliminate(f, g, f->residual, 1, norm2);
    }
}

/* What moving theta by step changes in a group's own step. */
static double get_group_share(const struct fit *f, int group, const double step[2])
{
    double dot = 0, norm2 = 0;
    for (int k = f->first[group]; k < f->first[group + 1]; k++) {
        int i = f->order[k];
        dot += f->slope[i] * (step[0] * f->kept[2 * i] + step[1] * f->kept[2 * i + 1]);
        norm2 += f->slope[i] * f->slope[i];
    }
    return norm2 > 0 ? dot / norm2 : 0;
}

/* The step of theta[0] by least squares, one column; 0 where it has none left. */
static double solve_one(const struct fit *f)
{
    double dot = 0, norm2 = 0;
    for (int i = 0; i < f->n; i++) {
        dot += f->rows[2 * i] * f->residual[i];
        norm2 += f->rows[2 * i] * f->rows[2 * i];
    }
    return norm2 > 0 ? dot / norm2 : 0;
}

/* Gauss-Newton with halving over theta[0] and u; c stands still. Returns the cost. */
static double refine(struct fit *f)
{
    double cost = get_cost(f, f->theta, f->u);
    for (int step = 0; step < MAX_STEPS; step++) {
        linearise(f);
        double move[2] = {solve_one(f), 0}, share = 1;
        double trial[2], trial_cost = INFINITY;
        for (int halving = 0; halving < 30; halving++, share *= 0.5) {
            trial[0] = f->theta[0] + share * move[0];
            trial[1] = f->theta[1];
            for (int g = 0; g < f->n_groups; g++) {
                double du = f->step_u[g] - get_group_share(f, g, move);
                f->trial_u[g] = f->u[g] + share * fmin(fmax(du, -3), 3);
            }
            bool is_rising = f->model == GN_CURVE_LINEAR || trial[0] > 0;
            trial_cost = is_rising ? get_cost(f, trial, f->trial_u) : INFINITY;
            if (trial_cost < cost)
                break;
        }
        if (!(trial_cost < cost))
            break;
        double gain = cost - trial_cost;
        f->theta[0] = trial[0];
        memcpy(f->u, f->trial_u, (size_t)f->n_groups * sizeof(double));
        cost = trial_cost;
        if (gain <= 1e-10 * cost)
            break;
    }
    return cost;
}

/* The cost at ln c, from where the fit stands. */
static double try_c(struct fit *f, double log_c)
{
    f->theta[1] = exp(log_c);
    return refine(f);
}

/* A line through ln of the light, c = 0: b of the samples' own offsets, then u. */
static bool start(struct fit *f)
{
    double codes = 0, n = 0, xy = 0, xx = 0;
    for (int i = 0; i < f->n; i++) {
        codes += f->weight[i] > 0 ? f->samples[i].code : 0;
        n += f->weight[i] > 0;
    }
    f->anchor = n > 0 ? codes / n : 0;
    for (int g = 0; g < f->n_groups; g++) {
        double mean_x = 0, mean_y = 0, sum = 0;
        for (int k = f->first[g]; k < f->first[g + 1]; k++) {
            int i = f->order[k];
            double w = f->weight[i];
            double x = f->samples[i].offset;
            sum += w;
            mean_x += w * (f->model == GN_CURVE_LINEAR ? exp(x) : x);
            mean_y += w * f->samples[i].code;
        }
        f->step_u[g] = sum > 0 ? mean_x / sum : 0;
        f->trial_u[g] = sum > 0 ? mean_y / sum : 0;
        for (int k = f->first[g]; k < f->first[g + 1]; k++) {
            int i = f->order[k];
            double x = f->samples[i].offset - f->step_u[g], y = f->samples[i].code - f->trial_u[g];
            xy += f->weight[i] * x * y;
            xx += f->weight[i] * x * x;
        }
    }
    if (!(xx > 0) || !(xy > 0))
        return false;
    f->theta[0] = f->model == GN_CURVE_LINEAR ? 0 : xy / xx;
    f->theta[1] = 0;
    for (int g = 0; g < f->n_groups; g++) {
        double y = f->trial_u[g];
        f->u[g] = f->model == GN_CURVE_LINEAR ? log(fmax(y, 1e-6) / fmax(f->step_u[g], 1e-30))
                                              : (y - f->anchor) / f->theta[0] - f->step_u[g];
    }
    return true;
}

/* Golden section for ln c in [low, high]; leaves the fit at the best. */
static double search_golden(struct fit *f, double low, double high)
{
    const double ratio = 0.6180339887498949;
    double a = high - ratio * (high - low), b = low + ratio * (high - low);
    double at_a = try_c(f, a), at_b = try_c(f, b);
    while (high - low > 1e-4) {
        if (at_a < at_b) {
            high = b;
            b = a;
            at_b = at_a;
            a = high - ratio * (high - low);
            at_a = try_c(f, a);
        } else {
            low = a;
            a = b;
            at_a = at_b;
            b = low + ratio * (high - low);
            at_b = try_c(f, b);
        }
    }
    return try_c(f, (low + high) / 2);
}

/* Variable projection; sets *out_is_c_seen. Returns the cost. */
static double search(struct fit *f, int n_free, bool *out_is_c_seen)
{
    *out_is_c_seen = false;
    f->theta[1] = 0;
    double without = refine(f);
    if (f->model == GN_CURVE_LINEAR)
        return without;
    double b = f->theta[0], best = INFINITY, best_log_c = GRID_LOW;
    double *saved = malloc((size_t)f->n_groups * sizeof(*saved));
    if (!saved)
        return INFINITY;
    memcpy(saved, f->u, (size_t)f->n_groups * sizeof(*saved));
    for (double log_c = GRID_LOW; log_c <= 2; log_c += GRID_STEP) {
        double cost = try_c(f, log_c);
        if (cost < best) {
            best = cost;
            best_log_c = log_c;
        }
    }
    f->theta[0] = b;
    memcpy(f->u, saved, (size_t)f->n_groups * sizeof(*saved));
    best = search_golden(f, best_log_c - GRID_STEP, best_log_c + GRID_STEP);
    double variance = best / (n_free > 0 ? n_free : 1);
    *out_is_c_seen = without - best > C_SIGNIFICANCE * variance;
    if (!*out_is_c_seen) {
        f->theta[0] = b;
        f->theta[1] = 0;
        memcpy(f->u, saved, (size_t)f->n_groups * sizeof(*saved));
        best = refine(f);
    }
    free(saved);
    return best;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The robust deviation of the residuals: 1.4826 times the median of their sizes. */
static double get_spread(struct fit *f)
{
    int n = 0;
    for (int i = 0; i < f->n; i++) {
        const struct gn_curve_sample *s = &f->samples[i];
        if (s->weight > 0)
            f->slope[n++] = s->weight * fabs(s->code - predict(f, f->theta, get_light(s, f->u)));
    }
    qsort(f->slope, (size_t)n, sizeof(double), compare_doubles);
    return n > 0 ? 1.4826 * f->slope[n / 2] : 0;
}

/* Weights for the next round: Huber's (k 1.345) while the curve is rough, then Tukey's (k 4.685);
 * efficiency 95 % for normal noise (Holland and Welsch 1977). */
static void reweight(struct fit *f, bool is_tukey)
{
    double spread = fmax(get_spread(f), 1e-9);
    for (int i = 0; i < f->n; i++) {
        struct gn_curve_sample *s = &f->samples[i];
        if (!(s->weight > 0))
            continue;
        double r = s->weight * fabs(s->code - predict(f, f->theta, get_light(s, f->u))) / spread;
        double t = r / 4.685;
        double robust = is_tukey ? (t < 1 ? (1 - t * t) : 0) : (r > 1.345 ? sqrt(1.345 / r) : 1);
        f->weight[i] = s->weight * robust;
        s->is_outlier = is_tukey && robust == 0;
    }
}

/* Each group's factor as the median of what its samples say by the curve so far: of those that are
 * wrong, less than half of a group, none moves it. */
static void centre_groups(struct fit *f)
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
        qsort(f->rows, (size_t)n, sizeof(double), compare_doubles);
        if (n > 0)
            f->u[g] = (f->rows[n / 2] + f->rows[(n - 1) / 2]) / 2;
    }
}

static int sort_groups(struct fit *f)
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

static int allocate(struct fit *f)
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

static void finish(struct fit *f)
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
static int count_free(const struct fit *f, int *out_used)
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
static void judge(struct fit *f, int n_theta, double cost, int n_free, struct gn_curve *out)
{
    linearise(f);
    double norm[2] = {0}, s[2], v[4];
    for (int i = 0; i < f->n; i++)
        for (int j = 0; j < n_theta; j++)
            norm[j] = hypot(norm[j], f->kept[2 * i + j]);
    for (int i = 0; i < f->n; i++) // packed in place: row i is read before it is written
        for (int j = 0; j < n_theta; j++)
            f->rows[i * n_theta + j] = f->rows[2 * i + j] / norm[j];
    out->condition = INFINITY;
    out->b_error = INFINITY;
    if (gn_solve_svd(f->rows, f->n, n_theta, s, v) < 0 || !(s[n_theta - 1] > 0))
        return;
    double sigma = sqrt(cost / (n_free > 0 ? n_free : 1)), error[2] = {0};
    for (int j = 0; j < n_theta; j++)
        for (int k = 0; k < n_theta; k++)
            error[j] = hypot(error[j], v[j * n_theta + k] / s[k] * sigma / norm[j]);
    out->condition = 1 / s[n_theta - 1];
    out->b_error = f->model == GN_CURVE_LOG ? error[0] / f->theta[0] : 0;
    out->c_error = error[1];
}

static int report(struct fit *f, double cost, bool is_c_seen, struct gn_curve *out,
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
        double r = s->code - predict(f, f->theta, get_light(s, f->u));
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

static int run(struct fit *f, struct gn_curve *out, struct gn_error *out_error)
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
    if (!start(f))
        return gn_error_set(out_error, -EDOM,
                            "one exposure alone, or codes that fall as light rises, determine no "
                            "curve: take several exposures, and check their times");
    bool is_c_seen = false;
    double cost = 0;
    for (int round = 0; round < 7; round++) {
        cost = search(f, count_free(f, &used), &is_c_seen);
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
    struct fit f = {.model = model, .samples = samples, .n = n, .n_groups = n_groups};
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

double gn_curve_encode(const struct gn_curve *curve, double x)
{
    if (curve->model == GN_CURVE_LINEAR)
        return curve->a + curve->b * x;
    return curve->a + curve->b * log(curve->c + x);
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
