/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/temporal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/luminance.h"
#include "server/light/temporal_step.h"

/* Nearer to the raw value than this share of it is there: below what a float can tell. */
static const double share_settled = 1e-7;

/* Light that deviates from what is kept by more than noise does is followed within 100 ms: 90 %
 * take 2.3 time constants. Between the two deviations the rate rises evenly. */
static const double tau_moving = 0.04;
static const double deviation_noise = 0.003, deviation_moving = 0.006;

bool gn_temporal_approach(double *value, double end, double alpha, double scale)
{
    *value += alpha * (end - *value);
    if (fabs(end - *value) > share_settled * scale)
        return false;
    *value = end;
    return true;
}

/* The time constant for what has changed, and the share of the way that it makes. */
static void set_pace(struct gn_temporal_step *s, double deviation)
{
    double slow = 1 / s->tau, fast = fmax(slow, 1 / tau_moving);
    double t = (deviation - deviation_noise) / (deviation_moving - deviation_noise);
    double rate = slow + fmin(fmax(t, 0), 1) * (fast - slow);
    struct gn_temporal_figures *f = &s->out->figures;
    f->tau_ms = 1e3 / rate;
    f->alpha = s->alpha = -expm1(-1e-3 * f->dt_ms * rate);
}

/* What has changed on the map sets the pace of all that is made of it. */
static void find_change(struct gn_temporal_step *s)
{
    const double *before = s->kept->sums, *after = s->input->sums;
    gn_change_find(&s->change, before, after);
    set_pace(s, s->change.deviation);
    for (int i = 0; i < GN_CHANGE_SUMS; i++) {
        double alpha = s->change.is_changed[i] ? 1 : s->alpha;
        s->out->sums[i] = before[i];
        (void)gn_temporal_approach(&s->out->sums[i], after[i], alpha, after[GN_CHANGE_WINDOWS]);
    }
}

/* What takes the frame's values to the power that the filtered light has. */
static void get_factor(const struct gn_temporal *t, const struct gn_temporal_input *input,
                       double out_factor[static 3])
{
    for (int c = 0; c < 3; c++)
        out_factor[c] = input->total[c] > 0 ? t->total[c] / input->total[c] : 1;
}

/* Lights that were left out until now, with the power of the filtered light. */
static void begin_lights(struct gn_temporal *out, const struct gn_temporal_input *input)
{
    double factor[3];
    get_factor(out, input, factor);
    gn_temporal_begin_lights(out, input, factor);
}

/* Values that were left out until now: the same of them. */
static void add_values(struct gn_temporal *out, const struct gn_temporal_input *input)
{
    get_factor(out, input, out->factor);
    for (int i = 0; i < input->n_values; i++)
        out->values[i] = out->factor[i % 3] * input->values[i];
    out->values_share = 1;
    for (int c = 0; c < 3 && input->n_values > 0; c++)
        out->is_settled = out->is_settled && out->factor[c] == 1;
}

static void follow_values(struct gn_temporal_step *s)
{
    const struct gn_temporal_input *input = s->input;
    double scale = 0, alpha = s->change.any ? 1 : s->alpha;
    if (s->kept->input.n_values != input->n_values) {
        add_values(s->out, input);
        return;
    }
    s->out->values_share = alpha;
    for (int i = 0; i < input->n_values; i++)
        scale = fmax(scale, fabs(input->values[i]));
    for (int i = 0; i < input->n_values; i++) {
        s->out->values[i] = s->kept->values[i];
        if (!gn_temporal_approach(&s->out->values[i], input->values[i], alpha, scale))
            s->out->is_settled = false;
    }
}

/* Where the lights do not say what it is. */
static void follow_total(struct gn_temporal_step *s)
{
    double scale = gn_luminance_of_sum(s->input->total);
    for (int k = 0; k < 3; k++) {
        double *total = &s->out->total[k];
        *total = s->kept->total[k];
        if (!gn_temporal_approach(total, s->input->total[k], s->change.any ? 1 : s->alpha, scale))
            s->out->is_settled = false;
    }
}

static int take_step(struct gn_temporal_step *s)
{
    struct gn_temporal *out = s->out;
    out->is_settled = true;
    find_change(s);
    if (s->input->has_lights && s->kept->input.has_lights) {
        int rc = gn_temporal_follow_lights(s);
        if (rc < 0)
            return rc;
        if (gn_temporal_are_lights_settled(out)) // each light is there: their sum is
            memcpy(out->total, s->input->total, sizeof(out->total));
    } else {
        follow_total(s);
        if (s->input->has_lights)
            begin_lights(out, s->input);
    }
    follow_values(s);
    out->is_settled = out->is_settled && gn_temporal_are_lights_settled(out);
    return 0;
}

/* Takes the frame as it is. */
static void start(const struct gn_temporal_input *input, struct gn_temporal *out)
{
    out->figures.verdict = GN_TEMPORAL_START;
    out->figures.alpha = 1;
    out->values_share = 1;
    out->is_settled = true;
    memcpy(out->total, input->total, sizeof(out->total));
    memcpy(out->sums, input->sums, sizeof(out->sums));
    memcpy(out->values, input->values, sizeof(out->values));
    out->n_lights = input->n_lights;
    for (int i = 0; i < input->n_lights; i++)
        gn_temporal_set_raw(&out->lights[i], &input->lights[i]);
}

int gn_temporal_complete(const struct gn_temporal *kept, const struct gn_temporal_input *input,
                         struct gn_temporal **out_temporal)
{
    bool keeps_lights = input->has_lights && kept->input.has_lights;
    size_t n_kept = keeps_lights ? (size_t)kept->n_lights : 0;
    size_t n = n_kept + (keeps_lights ? 0 : (size_t)input->n_lights);
    struct gn_temporal *out = malloc(sizeof(*out) + n * sizeof(out->lights[0]));
    *out_temporal = out;
    if (!out)
        return -ENOMEM;
    memcpy(out, kept, sizeof(*out) + n_kept * sizeof(out->lights[0]));
    out->n_lights = (int)n_kept;
    out->input.has_lights = input->has_lights;
    if (input->has_lights && !keeps_lights)
        begin_lights(out, input);
    if (kept->input.n_values != input->n_values) {
        out->input.n_values = input->n_values;
        memcpy(out->input.values, input->values, sizeof(out->input.values));
        add_values(out, input);
    }
    out->is_settled = out->is_settled && gn_temporal_are_lights_settled(out);
    return 0;
}

/* Nothing moves; a frame counts. */
static int hold(const struct gn_temporal *kept, const struct gn_temporal_input *input,
                struct gn_temporal **out_temporal)
{
    int rc = gn_temporal_complete(kept, input, out_temporal);
    struct gn_temporal *out = *out_temporal;
    if (rc < 0)
        return rc;
    out->figures = (struct gn_temporal_figures){
        .verdict = GN_TEMPORAL_HOLD,
        .n_fading = out->n_lights > 0 ? kept->figures.n_fading : 0,
    };
    out->n_held++;
    if (kept->input.n_values == input->n_values)
        out->values_share = 0;
    return 0;
}

int gn_temporal_follow(const struct gn_temporal *kept, const struct gn_temporal_input *input,
                       double tau, struct gn_temporal **out_temporal)
{
    double dt_ms = kept ? gn_clock_get_ms_between(kept->input.time_ns, input->time_ns) : 0;
    bool is_near = kept && fabs(dt_ms) <= GN_TEMPORAL_GAP_MS;
    if (is_near && !(dt_ms > 0) && kept->n_held < GN_TEMPORAL_HOLDS_MAX)
        return hold(kept, input, out_temporal);
    *out_temporal = NULL;
    size_t n = (size_t)input->n_lights + (is_near ? 2 * (size_t)kept->n_lights : 0);
    struct gn_temporal *out = calloc(1, sizeof(*out) + n * sizeof(out->lights[0]));
    if (!out)
        return -ENOMEM;
    out->input = *input;
    out->input.lights = NULL;
    for (int c = 0; c < 3; c++)
        out->factor[c] = 1;
    int rc = 0;
    if (!is_near || !(dt_ms > 0)) {
        start(input, out);
    } else {
        out->figures.verdict = GN_TEMPORAL_FOLLOW;
        out->figures.dt_ms = dt_ms;
        struct gn_temporal_step step = {.kept = kept, .input = input, .out = out, .tau = tau};
        rc = take_step(&step);
    }
    if (rc < 0) {
        free(out);
        return rc;
    }
    *out_temporal = out;
    return 0;
}

int gn_temporal_follow_same(const struct gn_temporal *kept, int64_t time_ns, double tau,
                            struct gn_temporal **out_temporal)
{
    struct gn_light *lights = malloc((size_t)kept->n_lights * sizeof(*lights) + 1);
    struct gn_temporal_input input = kept->input;
    *out_temporal = NULL;
    if (!lights)
        return -ENOMEM;
    input.time_ns = time_ns;
    input.lights = lights;
    input.n_lights = 0;
    for (int i = 0; i < kept->n_lights; i++) {
        if (kept->lights[i].fading_from == 0)
            lights[input.n_lights++] = kept->lights[i].raw;
    }
    int rc = gn_temporal_follow(kept, &input, tau, out_temporal);
    free(lights);
    return rc;
}
