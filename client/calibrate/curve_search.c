/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/curve_search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_STEPS 60
/* Search of ln c, in units where c + x = 1 gives the mean code. */
#define GRID_LOW (-40.0)
#define GRID_STEP 0.5
/* Below this share of the variance of the fit, a c makes no difference (three sigma). */
#define C_SIGNIFICANCE 9.0

double gn_curve_predict(const struct gn_curve_work *f, const double theta[2], double x)
{
    if (f->model == GN_CURVE_LINEAR)
        return theta[0] + x;
    return f->anchor + theta[0] * log(theta[1] + x);
}

double gn_curve_get_light(const struct gn_curve_sample *s, const double *u)
{
    return exp(fmin(fmax(s->offset + u[s->group], -300), 300));
}

static double get_cost(const struct gn_curve_work *f, const double theta[2], const double *u)
{
    double cost = 0;
    for (int i = 0; i < f->n; i++) {
        const struct gn_curve_sample *s = &f->samples[i];
        double r =
            f->weight[i] > 0
                ? f->weight[i] * (s->code - gn_curve_predict(f, theta, gn_curve_get_light(s, u)))
                : 0;
        cost += r * r;
    }
    return isfinite(cost) ? cost : INFINITY;
}

/* Residuals and derivatives of one sample: theta's to columns[2]. */
static void differentiate(struct gn_curve_work *f, int i, double columns[2])
{
    const struct gn_curve_sample *s = &f->samples[i];
    double x = gn_curve_get_light(s, f->u), w = f->weight[i];
    if (f->model == GN_CURVE_LINEAR) {
        columns[0] = w;
        columns[1] = 0;
        f->slope[i] = w * x;
    } else {
        columns[0] = w * log(f->theta[1] + x);
        columns[1] = w * f->theta[0] / (f->theta[1] + x);
        f->slope[i] = w * f->theta[0] * x / (f->theta[1] + x);
    }
    f->residual[i] = w * (s->code - gn_curve_predict(f, f->theta, x));
}

/* Takes a group's direction out of what[first .. last) with that stride; returns its share. */
static double eliminate(const struct gn_curve_work *f, int group, double *what, int stride,
                        double norm2)
{
    double dot = 0;
    for (int k = f->first[group]; k < f->first[group + 1]; k++)
        dot += f->slope[f->order[k]] * what[f->order[k] * stride];
    double share = norm2 > 0 ? dot / norm2 : 0;
    for (int k = f->first[group]; k < f->first[group + 1]; k++)
        what[f->order[k] * stride] -= share * f->slope[f->order[k]];
    return share;
}

void gn_curve_linearise(struct gn_curve_work *f)
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
static double get_group_share(const struct gn_curve_work *f, int group, const double step[2])
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
static double solve_one(const struct gn_curve_work *f)
{
    double dot = 0, norm2 = 0;
    for (int i = 0; i < f->n; i++) {
        dot += f->rows[2 * i] * f->residual[i];
        norm2 += f->rows[2 * i] * f->rows[2 * i];
    }
    return norm2 > 0 ? dot / norm2 : 0;
}

/* Gauss-Newton with halving over theta[0] and u; c stands still. Returns the cost. */
static double refine(struct gn_curve_work *f)
{
    double cost = get_cost(f, f->theta, f->u);
    for (int step = 0; step < MAX_STEPS; step++) {
        gn_curve_linearise(f);
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
static double try_c(struct gn_curve_work *f, double log_c)
{
    f->theta[1] = exp(log_c);
    return refine(f);
}

bool gn_curve_start(struct gn_curve_work *f)
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
static double search_golden(struct gn_curve_work *f, double low, double high)
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

double gn_curve_search(struct gn_curve_work *f, int n_free, bool *out_is_c_seen)
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
