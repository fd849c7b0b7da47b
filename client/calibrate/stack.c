/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/stack.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/solve.h"

#define N GN_STACK_CODES
#define MIDDLE 128
/* Codes this near to an end count as clipped where light is read from them. */
#define RAIL 5
/* Most values that Robertson's method looks at; more pixels are thinned out. */
#define MAX_VALUES (1 << 17)
#define MAX_ITERATIONS 200

/* Debevec and Malik's hat, (4): 0 at the rails. */
static double get_hat(int code)
{
    return code < MIDDLE ? code : N - 1 - code;
}

/*
 * Robertson, (15): a bell. Made 0 where noise may have carried clipped light: the method counts a
 * picture by the square of its time, so that such codes would outweigh all others.
 */
static double get_bell(int code)
{
    double t = (code - 127.5) / 127.5;
    bool is_clipped = code < RAIL || code > N - 1 - RAIL;
    return is_clipped ? 0 : (exp(-4 * t * t) - exp(-4)) / (1 - exp(-4));
}

/* Values to fit, [n][pictures]: codes of one channel of one pixel in all pictures. */
struct values {
    uint8_t *codes; // owned
    int n, p;
    double log_time[GN_STACK_MAX_PICTURES];
};

static int check_stack(const struct gn_stack *s, struct gn_error *out_error)
{
    if (s->n < 2 || s->n > GN_STACK_MAX_PICTURES)
        return gn_error_set(out_error, -EINVAL, "an exposure stack has 2 to %d pictures, found %d",
                            GN_STACK_MAX_PICTURES, s->n);
    double low = INFINITY, high = 0;
    for (int k = 0; k < s->n; k++) {
        const struct gn_image8 *a = &s->pictures[0], *b = &s->pictures[k];
        if (!(s->times[k] > 0) || !isfinite(s->times[k]))
            return gn_error_set(out_error, -EINVAL, "picture %d: its time must be above 0", k + 1);
        if (a->width != b->width || a->height != b->height || a->channels != b->channels)
            return gn_error_set(out_error, -EINVAL,
                                "picture %d is %d x %d with %d channels, the first %d x %d with "
                                "%d: all must be of one camera at rest",
                                k + 1, b->width, b->height, b->channels, a->width, a->height,
                                a->channels);
        low = fmin(low, s->times[k]);
        high = fmax(high, s->times[k]);
    }
    if (high < 1.2 * low)
        return gn_error_set(out_error, -EDOM,
                            "the exposure times differ by a factor of %.3g only, which determines "
                            "no curve; right would be steps of 2 over 6 or more pictures",
                            high / low);
    return 0;
}

/* The codes of pixel i, channel c of the stack that are evenly spread over the picture. */
static void take(const struct gn_stack *s, long pixel, int channel, uint8_t *out)
{
    int channels = s->pictures[0].channels;
    for (int k = 0; k < s->n; k++)
        out[k] = s->pictures[k].data[pixel * channels + channel];
}

static int get_colours(const struct gn_stack *s)
{
    return s->pictures[0].channels >= 3 ? 3 : 1;
}

static int start_values(const struct gn_stack *s, long n, struct values *out)
{
    out->p = s->n;
    out->codes = malloc((size_t)n * (size_t)s->n);
    for (int k = 0; k < s->n; k++)
        out->log_time[k] = log(s->times[k] / s->times[0]);
    return out->codes ? 0 : -ENOMEM;
}

/* Pixels for Robertson: every stride-th, all channels. */
static int take_many(const struct gn_stack *s, struct values *out)
{
    long pixels = (long)s->pictures[0].width * s->pictures[0].height;
    int colours = get_colours(s);
    long stride = 1 + pixels * colours * s->n / MAX_VALUES;
    if (start_values(s, (pixels / stride + 1) * colours, out) < 0)
        return -ENOMEM;
    for (long i = 0; i < pixels; i += stride)
        for (int c = 0; c < colours; c++)
            take(s, i, c, out->codes + (size_t)out->n++ * (size_t)s->n);
    return 0;
}

/*
 * Pixels for Debevec: spread over the picture by the golden ratio and over the light by taking no
 * more of any mean code than others need: in the order drawn, a pixel is taken where its sum of
 * codes falls into a bin (of 64) that is not yet full.
 */
static int take_few(const struct gn_stack *s, int wanted, struct values *out)
{
    enum { BINS = 64 };
    long pixels = (long)s->pictures[0].width * s->pictures[0].height;
    int colours = get_colours(s), in_bin[BINS] = {0}, share = wanted / BINS + 1;
    if (start_values(s, wanted + 1, out) < 0)
        return -ENOMEM;
    for (int pass = 1; pass <= 8; pass *= 2) {
        double at = 0.5;
        for (long i = 0; i < 40L * wanted && out->n < wanted; i++) {
            uint8_t *codes = out->codes + (size_t)out->n * (size_t)s->n;
            at = fmod(at + 0.6180339887498949 + 1e-7 * pass, 1);
            take(s, (long)(at * (double)pixels), (int)(i % colours), codes);
            int sum = 0, inside = 0;
            for (int k = 0; k < s->n; k++) {
                sum += codes[k];
                inside += codes[k] > 4 && codes[k] < 251;
            }
            int bin = sum * BINS / (N * s->n);
            if (inside >= 2 && in_bin[bin] < share * pass) {
                in_bin[bin]++;
                out->n++;
            }
        }
    }
    return 0;
}

/*
 * The rows of one pixel, ln E eliminated: w (g(z_j) - mean of g) = w (ln t_j - mean of ln t), the
 * means weighted by w^2. Returns the number of rows.
 */
static int add_pixel(const struct values *v, int i, double *a, double *b)
{
    const uint8_t *z = v->codes + (size_t)i * (size_t)v->p;
    double sum = 0, mean_t = 0;
    for (int j = 0; j < v->p; j++) {
        double w = get_hat(z[j]) / MIDDLE;
        sum += w * w;
        mean_t += w * w * v->log_time[j];
    }
    if (!(sum > 0))
        return 0;
    mean_t /= sum;
    int n = 0;
    for (int j = 0; j < v->p; j++) {
        double w = get_hat(z[j]) / MIDDLE, *row = a + (size_t)n * N;
        if (!(w > 0))
            continue;
        for (int k = 0; k < v->p; k++) {
            double wk = get_hat(z[k]) / MIDDLE;
            row[z[k]] -= w * wk * wk / sum;
        }
        row[z[j]] += w;
        b[n++] = w * (v->log_time[j] - mean_t);
    }
    return n;
}

/* (3) of Debevec and Malik, the pixels eliminated, by QR. g[256] = ln of the light of a code. */
static int fit_debevec(const struct values *v, double smoothness, double *g,
                       struct gn_error *out_error)
{
    int rows = v->n * v->p + N - 1, m = 0;
    double *a = calloc((size_t)rows * N, sizeof(*a));
    double *b = calloc((size_t)rows, sizeof(*b));
    int err = a && b ? 0 : gn_error_set(out_error, -ENOMEM, "out of memory");
    for (int i = 0; !err && i < v->n; i++)
        m += add_pixel(v, i, a + (size_t)m * N, b + m);
    for (int z = 1; !err && z < N - 1; z++, m++) {
        double w = sqrt(smoothness) * fmax(get_hat(z), 1) / MIDDLE;
        a[(size_t)m * N + (size_t)z - 1] = w;
        a[(size_t)m * N + (size_t)z] = -2 * w;
        a[(size_t)m * N + (size_t)z + 1] = w;
    }
    if (!err) {
        a[(size_t)m++ * N + MIDDLE] = 1;
        if (gn_solve_least_squares(a, b, m, N, g) < 0)
            err = gn_error_set(out_error, -EDOM,
                               "the codes of the stack determine no curve: too many are clipped, "
                               "or the scene is too even");
    }
    free(a);
    free(b);
    return err;
}

/*
 * The light of a value by the curve so far: (7) of Robertson et al., but for noise that grows with
 * the light, as photons' and lamps' does, where theirs is the same at all codes: the weights lose
 * their square of the time, and long exposures that noise keeps from clipping their say.
 */
static double get_light(const struct values *v, int i, const double *curve, const double *times)
{
    const uint8_t *z = v->codes + (size_t)i * (size_t)v->p;
    double above = 0, below = 0;
    for (int j = 0; j < v->p; j++) {
        double w = get_bell(z[j]);
        above += w * curve[z[j]] / times[j];
        below += w;
    }
    return below > 0 ? above / below : -1;
}

/* One round of (8) and (10): new light of each code, normalised. Returns the largest change. */
static double improve_robertson(const struct values *v, const double *times, double *curve)
{
    double sum[N] = {0}, count[N] = {0}, change = 0;
    for (int i = 0; i < v->n; i++) {
        const uint8_t *z = v->codes + (size_t)i * (size_t)v->p;
        double x = get_light(v, i, curve, times);
        for (int j = 0; j < v->p && x > 0; j++) {
            sum[z[j]] += times[j] * x;
            count[z[j]]++;
        }
    }
    double middle = count[MIDDLE] > 0 ? sum[MIDDLE] / count[MIDDLE] : curve[MIDDLE];
    for (int z = 0; z < N; z++) {
        double now = count[z] > 0 ? sum[z] / count[z] / middle : curve[z] / curve[MIDDLE];
        if (z > 8 && z < N - 8)
            change = fmax(change, fabs(now - curve[z]) / fmax(now, 1e-9));
        curve[z] = now;
    }
    return change;
}

/* From g, Debevec's: the iteration creeps, and from a straight line it would take hundreds of
 * rounds more. */
static int fit_robertson(const struct values *v, double *g, int *out_iterations,
                         struct gn_error *out_error)
{
    double curve[N], times[GN_STACK_MAX_PICTURES], change = 1;
    for (int j = 0; j < v->p; j++)
        times[j] = exp(v->log_time[j]);
    for (int z = 0; z < N; z++)
        curve[z] = exp(g[z] - g[MIDDLE]);
    int i = 0;
    for (; i < MAX_ITERATIONS && change > 1e-6; i++)
        change = improve_robertson(v, times, curve);
    *out_iterations = i;
    for (int z = 0; z < N; z++)
        g[z] = log(fmax(curve[z], 1e-12));
    if (!isfinite(change))
        return gn_error_set(out_error, -EDOM, "the codes of the stack determine no curve");
    return 0;
}

/* How often each code is seen, and the range of those seen often enough. */
static int find_range(const struct values *v, struct gn_stack_response *out,
                      struct gn_error *out_error)
{
    long count[N] = {0};
    for (size_t i = 0; i < (size_t)v->n * (size_t)v->p; i++)
        count[v->codes[i]]++;
    int seen = 0;
    out->first_code = -1;
    for (int z = 1; z < N - 1; z++) {
        if (count[z] == 0)
            continue;
        seen++;
        out->first_code = out->first_code < 0 ? z : out->first_code;
        out->last_code = z;
    }
    if (seen < 64)
        return gn_error_set(out_error, -EDOM,
                            "the stack shows %d codes between the rails, at least 64 are needed: "
                            "take a scene with more shades, or exposures in smaller steps",
                            seen);
    return 0;
}

/* Isotonic regression (pool adjacent violators; Barlow et al. 1972) of g, equal weights. */
static void make_rising(double *g)
{
    int size[N], n = 0;
    double mean[N];
    for (int z = 0; z < N; z++) {
        mean[n] = g[z];
        size[n++] = 1;
        while (n > 1 && mean[n - 1] < mean[n - 2]) {
            int both = size[n - 1] + size[n - 2];
            mean[n - 2] = (mean[n - 1] * size[n - 1] + mean[n - 2] * size[n - 2]) / both;
            size[n - 2] = both;
            n--;
        }
    }
    int z = 0;
    for (int k = 0; k < n; k++)
        for (int i = 0; i < size[k]; i++)
            g[z++] = mean[k];
}

/* How well the pictures agree on the light: deviation of g - ln t about each pixel's mean. */
static double find_rms(const struct values *v, const double *g)
{
    double above = 0, below = 0;
    for (int i = 0; i < v->n; i++) {
        const uint8_t *z = v->codes + (size_t)i * (size_t)v->p;
        double sum = 0, mean = 0;
        for (int j = 0; j < v->p; j++) {
            double w = get_hat(z[j]);
            sum += w;
            mean += w * (g[z[j]] - v->log_time[j]);
        }
        for (int j = 0; j < v->p && sum > 0; j++) {
            double w = get_hat(z[j]), d = g[z[j]] - v->log_time[j] - mean / sum;
            above += w * d * d;
            below += w;
        }
    }
    return below > 0 ? sqrt(above / below) : 0;
}

static int finish_table(const struct values *v, double *g, struct gn_stack_response *out,
                        struct gn_error *out_error)
{
    if (!(g[200] > g[50]))
        return gn_error_set(out_error, -EDOM,
                            "codes fall as the exposure rises: are the times in the pictures' "
                            "order?");
    make_rising(g);
    out->rms = find_rms(v, g);
    for (int z = 0; z < N; z++)
        out->table[z] = (float)(GN_STACK_MIDDLE * exp(g[z] - g[MIDDLE]));
    // The dark rail stands for all that is darker: none.
    out->table[0] = 0;
    return 0;
}

int gn_stack_fit(const struct gn_stack *stack, const struct gn_stack_options *options,
                 struct gn_stack_response *out, struct gn_error *out_error)
{
    struct gn_stack_response response = {{0}};
    struct values few = {NULL}, many = {NULL}, *v = &few;
    double g[N], smoothness = options->smoothness > 0 ? options->smoothness : 50;
    int err = check_stack(stack, out_error);
    if (err)
        return err;
    err = take_few(stack, options->samples > 0 ? options->samples : 512, &few);
    if (!err && options->method == GN_STACK_ROBERTSON) {
        err = take_many(stack, &many);
        v = &many;
    }
    if (err)
        gn_error_set(out_error, err, "out of memory");
    if (!err)
        err = find_range(v, &response, out_error);
    if (!err)
        err = fit_debevec(&few, smoothness, g, out_error);
    if (!err && v == &many)
        err = fit_robertson(&many, g, &response.iterations, out_error);
    if (!err)
        err = finish_table(v, g, &response, out_error);
    free(few.codes);
    free(many.codes);
    if (!err)
        *out = response;
    return err;
}

int gn_stack_merge(const struct gn_stack *stack, const float table[static 256],
                   struct gn_image *out_image, struct gn_error *out_error)
{
    memset(out_image, 0, sizeof(*out_image));
    int err = check_stack(stack, out_error), colours = get_colours(stack);
    if (err)
        return err;
    err = gn_image_init(out_image, stack->pictures[0].width, stack->pictures[0].height, colours);
    if (err)
        return gn_error_set(out_error, err, "out of memory");
    int shortest = 0, longest = 0;
    for (int k = 1; k < stack->n; k++) {
        shortest = stack->times[k] < stack->times[shortest] ? k : shortest;
        longest = stack->times[k] > stack->times[longest] ? k : longest;
    }
    long pixels = (long)out_image->width * out_image->height;
    for (long i = 0; i < pixels * colours; i++) {
        uint8_t z[GN_STACK_MAX_PICTURES] = {0};
        double above = 0, below = 0;
        take(stack, i / colours, (int)(i % colours), z);
        for (int k = 0; k < stack->n; k++) {
            // Noise carries clipped light a few codes into the range: the hat is 0 there, too.
            double w = fmax(get_hat(z[k]) - RAIL, 0);
            above += w * (double)table[z[k]] * stack->times[0] / stack->times[k];
            below += w;
        }
        int k = z[shortest] >= MIDDLE ? shortest : longest;
        out_image->data[i] = below > 0
                                 ? (float)(above / below)
                                 : (float)((double)table[z[k]] * stack->times[0] / stack->times[k]);
    }
    return 0;
}
