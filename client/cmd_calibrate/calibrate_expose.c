/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A series of exposures of a camera: each set, waited for, and averaged.
 */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_live.h"
#include "client/cmd_calibrate/calibrate_mean.h"
#include "client/cmd_calibrate/calibrate_series.h"
#include "common/clock.h"
#include "common/file.h"

#define DEFAULT_FRAMES 8
/* Sensors take a new exposure one to three pictures after it was set, and do not all say when. */
#define SETTLING 4
/* Pictures after which one with the exposure that was set must have come, where the camera says
 * what each has; and how far off what it says may be. */
#define MAX_WAIT 50
#define SAME_EXPOSURE 0.005
/* How often one exposure is begun, where the camera is lost and comes back meanwhile. */
#define MAX_TRIES 10
/* --exposures auto: none longer; a picture tells something from this span of codes on; the end. */
#define AUTO_MOST_US 1e6
#define AUTO_SPAN 0.03
#define AUTO_CLIPPED 0.5
/* All pictures of a series, bytes. */
#define MAX_BYTES ((size_t)2 << 30)

/* What is to be taken. */
struct plan {
    enum gn_exposure_unit unit;
    bool is_auto;
    int n;
    double values[GN_SERIES_MAX];
};

/* A series under way. */
struct work {
    struct gn_calibrate_series *series;
    const struct gn_program *program;
    struct gn_source *source;
    enum gn_exposure_unit unit;
    int most;           // exposures
    const char *folder; // where pictures are written; NULL: nowhere
    int n_frames;
    int full_scale; // that was asked for; 0: the format's
    bool is_8_bit;
};

static const struct {
    const char *name;
    double us;
} units[] = {{"us", 1}, {"ms", 1e3}, {"s", 1e6}};

/* Takes "ms" and the like at *at; 0 where there is none. */
static double take_unit(const char **at)
{
    for (size_t i = 0; i < GN_ARRAY_LEN(units); i++) {
        size_t n = strlen(units[i].name);
        if (strncmp(*at, units[i].name, n) == 0 && strchr(", ", (*at)[n])) {
            *at += n;
            return units[i].us;
        }
    }
    return 0;
}

static int refuse_list(const char *text, int most, struct gn_error *out_error)
{
    return gn_error_set(out_error, -EINVAL,
                        "--exposures %.80s: right would be up to %d times above 0 with a unit, as "
                        "1,2,4,8ms or 1/60,1/30s, counts without one, or auto",
                        text, most);
}

/* "1,2,4ms": a number without a unit has that of the next one; none at all are counts. */
static int read_plan(const char *text, int most, struct plan *out, struct gn_error *out_error)
{
    double unit_us = 0;
    int n_plain = 0; // numbers at the end that have no unit yet
    *out = (struct plan){.is_auto = strcmp(text, "auto") == 0};
    for (const char *at = text; *at && !out->is_auto;) {
        double value;
        at += strspn(at, ", ");
        if (!*at)
            break;
        if (out->n == most || !gn_calibrate_take_number(&at, &value) || !(value > 0))
            return refuse_list(text, most, out_error);
        unit_us = take_unit(&at);
        if (*at && !strchr(", ", *at))
            return refuse_list(text, most, out_error);
        out->values[out->n++] = value;
        n_plain++;
        for (; unit_us > 0 && n_plain > 0; n_plain--)
            out->values[out->n - n_plain] *= unit_us;
    }
    if (n_plain == out->n && n_plain > 0)
        out->unit = GN_EXPOSURE_COUNTS;
    else if (n_plain > 0 || (out->n == 0 && !out->is_auto))
        return refuse_list(text, most, out_error);
    return 0;
}

static const char *get_unit(const struct work *w)
{
    return w->unit == GN_EXPOSURE_US ? "us" : "counts";
}

/* Waits until pictures have the exposure that was set. Returns 0 or a negative errno. */
static int settle(const struct work *w, double value, struct gn_error *out_error)
{
    int64_t set_ns = gn_clock_get_monotonic_ns();
    double half_ns = w->unit == GN_EXPOSURE_US ? 500 * value : 0, said = 0;
    for (int i = 0, n_since = 0; i < MAX_WAIT && n_since < SETTLING; i++) {
        struct gn_capture capture;
        int got = gn_calibrate_wait(w->program, w->source, &capture, out_error);
        if (got <= 0)
            return got < 0 ? got : -EINTR;
        said = w->unit == GN_EXPOSURE_US ? capture.exposure_us : 0;
        if (said > 0 && fabs(said - value) <= SAME_EXPOSURE * value + 1)
            return 0;
        // Those that began later, and some more.
        n_since += said <= 0 && (double)(capture.time_ns - set_ns) >= half_ns;
    }
    if (said > 0)
        return gn_error_set(out_error, -EIO,
                            "the camera says that its pictures have %g us after %g us were set",
                            said, value);
    return 0;
}

static int name_picture(struct work *w, double value, struct gn_error *out_error)
{
    char name[4096];
    struct gn_calibrate_series *s = w->series;
    int n = w->folder ? snprintf(name, sizeof(name), "%s/exposure-%02d.png", w->folder, s->n + 1)
                      : snprintf(name, sizeof(name), "%g %s", value, get_unit(w));
    if (n < 0 || (size_t)n >= sizeof(name))
        return gn_error_set(out_error, -ENAMETOOLONG, "--keep: the folder's name is too long");
    free(s->names[s->n]);
    s->names[s->n] = strdup(name);
    return s->names[s->n] ? 0 : gn_error_set(out_error, -ENOMEM, "out of memory");
}

/* Adds a mean to the series, and to the folder. */
static int keep(struct work *w, const struct gn_calibrate_mean *mean, double value,
                struct gn_error *out_error)
{
    struct gn_calibrate_series *s = w->series;
    size_t n_bytes = 2 * (size_t)mean->width * (size_t)mean->height * (size_t)mean->channels;
    if (n_bytes * (size_t)(s->n + 1) > MAX_BYTES)
        return gn_error_set(out_error, -ENOMEM,
                            "more than %zu MiB of pictures: take fewer exposures, or a smaller "
                            "--frame-size",
                            MAX_BYTES >> 20);
    if (gn_calibrate_mean_get_codes(mean, w->is_8_bit, &s->taken[s->n], &s->format.full_scale16) <
        0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->bits = mean->bits;
    int err = name_picture(w, value, out_error);
    if (!err && w->folder)
        err = gn_calibrate_write(s->names[s->n], &s->taken[s->n], out_error);
    if (!err)
        s->times[s->n++] = value;
    return err;
}

static uint64_t count_reopened(const struct work *w)
{
    struct gn_source_counts counts;
    gn_source_get_counts(w->source, &counts);
    return counts.n_reopened;
}

static int take_once(const struct work *w, double asked, double *out_value,
                     struct gn_calibrate_mean *mean, struct gn_error *out_error)
{
    int err = gn_source_set_exposure(w->source, asked, out_value, out_error);
    if (!err && !(*out_value > 0 && isfinite(*out_value)))
        err = gn_error_set(out_error, -EIO,
                           "the camera says that it took %g %s where %g were set; an exposure is "
                           "above 0",
                           *out_value, get_unit(w), asked);
    if (!err)
        err = settle(w, *out_value, out_error);
    return err ? err
               : gn_calibrate_mean_take(w->program, w->source, w->n_frames, w->full_scale, mean,
                                        out_error);
}

/* The mean of pictures of which each has the exposure: a camera that was lost meanwhile may have
 * forgotten it. Returns how many times it was begun, or a negative errno. */
static int take(const struct work *w, double asked, double *out_value,
                struct gn_calibrate_mean *mean, struct gn_error *out_error)
{
    for (int i = 1; i <= MAX_TRIES; i++) {
        uint64_t n_reopened = count_reopened(w);
        int err = take_once(w, asked, out_value, mean, out_error);
        if (err)
            return err;
        if (count_reopened(w) == n_reopened)
            return i;
        gn_calibrate_mean_finish(mean);
    }
    return gn_error_set(out_error, -EIO, "the camera was lost and came back in each of %d tries",
                        MAX_TRIES);
}

/* One exposure. least_span: a picture whose codes span less is not kept. */
static int shoot(struct work *w, double asked, double least_span, double *out_clipped,
                 struct gn_error *out_error)
{
    struct gn_calibrate_mean mean = {0};
    double value = 0, span = 0;
    int err = 0, n_tries = take(w, asked, &value, &mean, out_error);
    if (n_tries < 0)
        return n_tries;
    gn_calibrate_mean_describe(&mean, &span, out_clipped);
    printf("%g %s", value, get_unit(w));
    if (fabs(value - asked) > 1e-6 * asked)
        printf(" (asked %g)", asked);
    if (w->n_frames > 1)
        printf(": mean of %d, noise %.2f codes of %d, level steady to %.2f", w->n_frames,
               mean.noise, mean.full_scale, mean.unsteadiness);
    if (n_tries > 1)
        printf("; taken %d times, as the camera was lost", n_tries);
    printf("; %.1f %% clipped%s\n", 100 * *out_clipped,
           span < least_span ? "; too dark, left out" : "");
    fflush(stdout);
    if (span >= least_span)
        err = keep(w, &mean, value, out_error);
    gn_calibrate_mean_finish(&mean);
    return err;
}

/* The exposure that the camera had, then all from its shortest on. */
static int shoot_doubling(struct work *w, const struct gn_exposure *range,
                          struct gn_error *out_error)
{
    double clipped = 0;
    double most = w->unit == GN_EXPOSURE_US ? fmin(range->most, AUTO_MOST_US) : range->most;
    int err = shoot(w, fmin(fmax(range->now, range->least), range->most), 0, &clipped, out_error);
    clipped = 0;
    for (double value = fmax(range->least, 1);
         !err && value <= most && clipped < AUTO_CLIPPED && w->series->n < w->most; value *= 2)
        err = shoot(w, value, AUTO_SPAN, &clipped, out_error);
    return err;
}

static int shoot_all(struct work *w, const struct plan *plan, const struct gn_exposure *range,
                     struct gn_error *out_error)
{
    double clipped;
    int err = 0;
    if (plan->is_auto)
        return shoot_doubling(w, range, out_error);
    for (int i = 0; i < plan->n; i++) // before the first minute has gone by
        if (!(plan->values[i] >= range->least * 0.999 && plan->values[i] <= range->most * 1.001))
            return gn_error_set(
                out_error, -ERANGE,
                "--exposures: %g %s is not in [%g, %g] %s, which the camera takes "
                "now%s",
                plan->values[i], get_unit(w), range->least, range->most, get_unit(w),
                plan->values[i] > range->most ? "; a lower --frame-rate may allow longer ones"
                                              : "");
    for (int i = 0; !err && i < plan->n; i++) {
        printf("exposure %d of %d: ", i + 1, plan->n);
        fflush(stdout);
        err = shoot(w, plan->values[i], 0, &clipped, out_error);
        if (err) // what stderr says begins on a line of its own
            printf("\n");
    }
    return err;
}

/* Everything at the camera whose settings are held. */
static int expose(struct work *w, struct plan *plan, struct gn_error *out_error)
{
    struct gn_exposure range = {0};
    struct gn_error why = {0};
    int err = gn_source_hold_exposure(w->source, plan->unit, &range, out_error);
    if (err == -ENOTSUP && plan->is_auto) { // a camera that counts, or none at all
        plan->unit = GN_EXPOSURE_COUNTS;
        if (gn_source_hold_exposure(w->source, plan->unit, &range, &why) == 0)
            err = 0;
    }
    if (err)
        return err;
    w->unit = plan->unit;
    err = shoot_all(w, plan, &range, out_error);
    if (err == -EINTR)
        gn_error_set(out_error, err,
                     "interrupted after %d exposures; the result's file is as it was",
                     w->series->n);
    int err_back = gn_source_restore_exposure(w->source, &why);
    struct gn_error back = {0};
    if (err_back)
        gn_error_set(&back, err_back, "the camera's settings are not all put back: %s", why.text);
    if (err_back && err)
        gn_cmd_fail(w->program, back.text);
    else if (err_back)
        err = gn_error_set(out_error, err_back, "%s", back.text);
    return err;
}

/* times.txt, and how to calibrate from what was written. */
static int write_times(const struct work *w, struct gn_error *out_error)
{
    const struct gn_calibrate_series *s = w->series;
    char *text = NULL, path[4096];
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    for (int k = 0; k < s->n; k++)
        fprintf(out, "%.17g # %s, %s\n", s->times[k], get_unit(w), strrchr(s->names[k], '/') + 1);
    fclose(out);
    int n = snprintf(path, sizeof(path), "%s/times.txt", w->folder);
    int err = n < 0 || (size_t)n >= sizeof(path)
                  ? gn_error_set(out_error, -ENAMETOOLONG, "--keep: the folder's name is too long")
                  : gn_file_write(path, text, size, out_error);
    free(text);
    if (!err && w->is_8_bit)
        printf("written; again by --stack '%s' --times '%s'\n", w->folder, path);
    else if (!err)
        printf("written; again by --chart '%s' --times '%s' --full-scale %d --bits %d\n", w->folder,
               path, s->format.full_scale16, s->bits);
    return err;
}

int gn_calibrate_series_take(struct gn_calibrate_series *series, const struct gn_program *program,
                             const struct gn_options *options, bool is_8_bit, int most,
                             struct gn_error *out_error)
{
    struct plan plan;
    struct work w = {.series = series,
                     .program = program,
                     .folder = gn_options_get_string(options, NULL, NULL, "keep"),
                     .n_frames = DEFAULT_FRAMES,
                     .full_scale = gn_options_get_int(options, NULL, NULL, "full-scale"),
                     .most = most,
                     .is_8_bit = is_8_bit};
    if (gn_options_is_set(options, NULL, NULL, "frames"))
        w.n_frames = (int)gn_options_get_int(options, NULL, NULL, "frames");
    int err =
        read_plan(gn_options_get_string(options, NULL, NULL, "exposures"), most, &plan, out_error);
    series->taken = calloc(GN_SERIES_MAX, sizeof(*series->taken));
    if (!err && !series->taken)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err && w.folder)
        err = gn_calibrate_make_folder("keep", w.folder, out_error);
    gn_cmd_catch_signals();
    if (!err)
        err = gn_live_open(options, &(struct gn_live_options){.is_8_bit = is_8_bit}, &w.source,
                           out_error);
    if (!err) {
        err = expose(&w, &plan, out_error);
        if (!err)
            gn_live_print_counts(w.source, stdout);
    }
    gn_source_close(&w.source);
    if (!err && w.folder)
        err = write_times(&w, out_error);
    series->has_times = true;
    return err;
}
