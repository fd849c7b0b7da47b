/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/temporal.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/luminance.h"

/* A light whose direction jumps further than this does not turn: it fades out here, in there. */
static const double cos_jump = 0.866025403784439; // 30 degrees
/* A fading light below this share of all light goes, its power to the nearest light that stays. */
static const double share_gone = 1e-3;
/* Where none stays: below this share of what it had. */
static const double share_black = 1e-6;
/* Nearer to the raw value than this share of it is there: below what a float can tell. */
static const double share_settled = 1e-7;

/* Light that deviates from what is kept by more than noise does is followed within 100 ms: 90 %
 * take 2.3 time constants. Between the two deviations the rate rises evenly. */
static const double tau_moving = 0.04;
static const double deviation_noise = 0.003, deviation_moving = 0.006;

static double get_length(const double v[static 3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* The light as the map has it: 1 - |mean direction| = (1 - cos angular_radius) / 2. */
static void set_raw(struct gn_temporal_light *light, const struct gn_light *raw)
{
    double c = cos(0.5 * (double)raw->angular_radius), mean = c * c;
    *light = (struct gn_temporal_light){.raw = *raw};
    for (int k = 0; k < 3; k++)
        light->irradiance[k] = (double)raw->irradiance[k];
    double luminance = gn_luminance_of_sum(light->irradiance);
    for (int k = 0; k < 3; k++)
        light->moment[k] = luminance * mean * (double)raw->dir_world[k];
}

/* Where it is: unit. */
static void get_direction(const struct gn_temporal_light *light, double out_dir[static 3])
{
    double length = get_length(light->moment);
    bool is_known = length > 1e-9 * gn_luminance_of_sum(light->irradiance);
    for (int k = 0; k < 3; k++)
        out_dir[k] = is_known ? light->moment[k] / length : (double)light->raw.dir_world[k];
}

static void scale_light(struct gn_temporal_light *light, double factor)
{
    for (int k = 0; k < 3; k++) {
        light->irradiance[k] *= factor;
        light->moment[k] *= factor;
    }
}

/* Moves a value by alpha of its way; where it is nearly there, to the end. */
static bool approach(double *value, double end, double alpha, double scale)
{
    *value += alpha * (end - *value);
    if (fabs(end - *value) > share_settled * scale)
        return false;
    *value = end;
    return true;
}

/* The place of a light in a list, by its id. */
struct named {
    uint64_t id;
    int place;
};

static int compare_named(const void *a, const void *b)
{
    const struct named *x = a, *y = b;
    if (x->id != y->id)
        return x->id < y->id ? -1 : 1;
    return x->place - y->place;
}

/* Everything that the parts of one step share. */
struct step {
    const struct gn_temporal *kept;
    const struct gn_temporal_input *input;
    struct gn_temporal *out; // being filled
    double tau, alpha;
    struct gn_change change;
    struct named *names;         // [kept + input]
    int *next_of_kept, *kept_of; // [kept], [input]: the other one's place, -1: none
};

/* Which of the frame's lights are which of those kept. */
static void match_lights(struct step *s)
{
    int n_kept = s->kept->n_lights, n_raw = s->input->n_lights;
    struct named *kept = s->names, *raw = s->names + n_kept;
    for (int i = 0; i < n_kept; i++) {
        kept[i] = (struct named){s->kept->lights[i].raw.id, i};
        s->next_of_kept[i] = -1;
    }
    for (int i = 0; i < n_raw; i++) {
        raw[i] = (struct named){s->input->lights[i].id, i};
        s->kept_of[i] = -1;
    }
    qsort(kept, (size_t)n_kept, sizeof(*kept), compare_named);
    qsort(raw, (size_t)n_raw, sizeof(*raw), compare_named);
    for (int i = 0, j = 0; i < n_kept && j < n_raw;) {
        if (kept[i].id == 0 || kept[i].id < raw[j].id) {
            i++;
        } else if (raw[j].id < kept[i].id) {
            j++;
        } else {
            s->next_of_kept[kept[i].place] = raw[j].place;
            s->kept_of[raw[j++].place] = kept[i++].place;
        }
    }
}

/* The time constant for what has changed, and the share of the way that it makes. */
static void set_pace(struct step *s, double deviation)
{
    double slow = 1 / s->tau, fast = fmax(slow, 1 / tau_moving);
    double t = (deviation - deviation_noise) / (deviation_moving - deviation_noise);
    double rate = slow + fmin(fmax(t, 0), 1) * (fast - slow);
    struct gn_temporal_figures *f = &s->out->figures;
    f->tau_ms = 1e3 / rate;
    f->alpha = s->alpha = -expm1(-1e-3 * f->dt_ms * rate);
}

/* What has changed on the map sets the pace of all that is made of it. */
static void find_change(struct step *s)
{
    const double *before = s->kept->sums, *after = s->input->sums;
    gn_change_find(&s->change, before, after);
    set_pace(s, s->change.deviation);
    for (int i = 0; i < GN_CHANGE_SUMS; i++) {
        double alpha = s->change.is_changed[i] ? 1 : s->alpha;
        s->out->sums[i] = before[i];
        (void)approach(&s->out->sums[i], after[i], alpha, after[GN_CHANGE_WINDOWS]);
    }
}

/* The light takes its end value at once; the total with it. */
static void snap(struct step *s, struct gn_temporal_light *light,
                 const struct gn_temporal_light *end)
{
    for (int k = 0; k < 3; k++)
        s->out->total[k] += end->irradiance[k] - light->irradiance[k];
    *light = *end;
    s->out->figures.n_snaps++;
}

static void add(struct step *s, const struct gn_temporal_light *light)
{
    s->out->lights[s->out->n_lights++] = *light;
    s->out->figures.n_fading += light->fading_from > 0;
}

/* A light that the map has no more, or not there. */
static void fade(struct step *s, const struct gn_temporal_light *kept, bool is_new)
{
    struct gn_temporal_light light = *kept, gone = {0};
    double dir[3];
    get_direction(kept, dir);
    s->out->figures.n_deaths += is_new;
    if (is_new)
        light.fading_from = fmax(gn_luminance_of_sum(kept->irradiance), DBL_MIN);
    scale_light(&light, 1 - s->alpha);
    if (gn_change_has(&s->change, dir))
        snap(s, &light, &gone);
    else
        add(s, &light);
}

/* A light of the frame; kept: what it was, or NULL. */
static void follow(struct step *s, const struct gn_light *raw, const struct gn_temporal_light *kept)
{
    struct gn_temporal_light end, light;
    double end_dir[3], dir[3];
    set_raw(&end, raw);
    get_direction(&end, end_dir);
    if (kept) {
        get_direction(kept, dir);
        double c = dir[0] * end_dir[0] + dir[1] * end_dir[1] + dir[2] * end_dir[2];
        if (c < cos_jump) {
            struct gn_temporal_light left = *kept;
            left.raw.id = 0;
            fade(s, &left, !(kept->fading_from > 0));
            kept = NULL;
        }
    }
    light = end;
    if (kept) {
        double scale = gn_luminance_of_sum(end.irradiance);
        memcpy(light.irradiance, kept->irradiance, sizeof(light.irradiance));
        memcpy(light.moment, kept->moment, sizeof(light.moment));
        for (int k = 0; k < 3; k++) {
            (void)approach(&light.irradiance[k], end.irradiance[k], s->alpha, scale);
            (void)approach(&light.moment[k], end.moment[k], s->alpha, scale);
        }
    } else {
        scale_light(&light, s->alpha);
        s->out->figures.n_births++;
    }
    if (gn_change_has(&s->change, end_dir))
        snap(s, &light, &end);
    add(s, &light);
}

/* Gives a fading light's power to the nearest light that stays; where none does, it is gone. */
static void bequeath(struct gn_temporal *t, const struct gn_temporal_light *gone)
{
    struct gn_temporal_light *heir = NULL;
    double dir[3], other[3], best = -2;
    get_direction(gone, dir);
    for (int i = 0; i < t->n_lights; i++) {
        struct gn_temporal_light *light = &t->lights[i];
        if (light->fading_from != 0 || !(gn_luminance_of_sum(light->irradiance) > 0))
            continue;
        get_direction(light, other);
        double c = dir[0] * other[0] + dir[1] * other[1] + dir[2] * other[2];
        if (c > best) {
            best = c;
            heir = light;
        }
    }
    // The power, not the place: nothing that stays is moved by what goes.
    double factor =
        heir ? 1 + gn_luminance_of_sum(gone->irradiance) / gn_luminance_of_sum(heir->irradiance)
             : 0;
    for (int k = 0; k < 3; k++) {
        if (heir) {
            heir->irradiance[k] += gone->irradiance[k];
            heir->moment[k] *= factor;
        } else {
            t->total[k] -= gone->irradiance[k];
        }
    }
}

static int compare_lights(const void *a, const void *b)
{
    const struct gn_temporal_light *x = a, *y = b;
    double lx = gn_luminance_of_sum(x->irradiance), ly = gn_luminance_of_sum(y->irradiance);
    if (lx != ly)
        return lx > ly ? -1 : 1;
    if ((x->fading_from > 0) != (y->fading_from > 0))
        return x->fading_from > 0 ? 1 : -1;
    return (x->raw.id > y->raw.id) - (x->raw.id < y->raw.id);
}

/* Lets fading lights go that are too weak, or too many: more than there are lights that stay, or
 * than the bound has room for. The brightest come first. */
static void prune(struct gn_temporal *t)
{
    int n_staying = t->n_lights - t->figures.n_fading, n = 0, n_fading = 0;
    int bound = GN_LIGHTS_MAX - n_staying;
    if (n_staying > 0 && n_staying < bound)
        bound = n_staying;
    double floor = share_gone * gn_luminance_of_sum(t->total);
    for (int i = 0; i < t->n_lights; i++) {
        struct gn_temporal_light *light = &t->lights[i];
        if (light->fading_from == 0)
            continue;
        double weak = n_staying > 0 ? floor : share_black * light->fading_from;
        if (gn_luminance_of_sum(light->irradiance) > weak && n_fading < bound) {
            n_fading++;
            continue;
        }
        light->fading_from = -1; // no heir of others
        bequeath(t, light);
    }
    for (int i = 0; i < t->n_lights; i++) {
        if (t->lights[i].fading_from >= 0)
            t->lights[n++] = t->lights[i];
    }
    t->n_lights = n;
    t->figures.n_fading = n_fading;
}

static bool is_light_settled(const struct gn_temporal_light *light)
{
    struct gn_temporal_light end;
    set_raw(&end, &light->raw);
    return light->fading_from == 0 &&
           memcmp(light->irradiance, end.irradiance, sizeof(end.irradiance)) == 0 &&
           memcmp(light->moment, end.moment, sizeof(end.moment)) == 0;
}

/* What takes the frame's values to the power that the filtered light has. */
static void get_factor(const struct gn_temporal *t, const struct gn_temporal_input *input,
                       double out_factor[static 3])
{
    for (int c = 0; c < 3; c++)
        out_factor[c] = input->total[c] > 0 ? t->total[c] / input->total[c] : 1;
}

/* Lights that were left out until now: those of the frame, with the power of the filtered light. */
static void add_lights(struct gn_temporal *out, const struct gn_temporal_input *input)
{
    double factor[3];
    get_factor(out, input, factor);
    for (int i = 0; i < input->n_lights; i++) {
        struct gn_temporal_light *light = &out->lights[i];
        set_raw(light, &input->lights[i]);
        double luminance = gn_luminance_of_sum(light->irradiance);
        for (int c = 0; c < 3; c++)
            light->irradiance[c] *= factor[c];
        double ratio = luminance > 0 ? gn_luminance_of_sum(light->irradiance) / luminance : 1;
        for (int c = 0; c < 3; c++)
            light->moment[c] *= ratio;
    }
    out->n_lights = input->n_lights;
    qsort(out->lights, (size_t)out->n_lights, sizeof(*out->lights), compare_lights);
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

static void follow_values(struct step *s)
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
        if (!approach(&s->out->values[i], input->values[i], alpha, scale))
            s->out->is_settled = false;
    }
}

static void follow_lights(struct step *s)
{
    struct gn_temporal *out = s->out;
    match_lights(s);
    for (int k = 0; k < 3; k++)
        out->total[k] = s->kept->total[k] + s->alpha * (s->input->total[k] - s->kept->total[k]);
    for (int i = 0; i < s->input->n_lights; i++) {
        int kept = s->kept_of[i];
        follow(s, &s->input->lights[i], kept < 0 ? NULL : &s->kept->lights[kept]);
    }
    for (int i = 0; i < s->kept->n_lights; i++) {
        if (s->next_of_kept[i] < 0)
            fade(s, &s->kept->lights[i], s->kept->lights[i].fading_from == 0);
    }
    qsort(out->lights, (size_t)out->n_lights, sizeof(*out->lights), compare_lights);
    prune(out);
}

/* Where the lights do not say what it is. */
static void follow_total(struct step *s)
{
    double scale = gn_luminance_of_sum(s->input->total);
    for (int k = 0; k < 3; k++) {
        double *total = &s->out->total[k];
        *total = s->kept->total[k];
        if (!approach(total, s->input->total[k], s->change.any ? 1 : s->alpha, scale))
            s->out->is_settled = false;
    }
}

static bool are_lights_settled(const struct gn_temporal *t)
{
    for (int i = 0; i < t->n_lights; i++)
        if (!is_light_settled(&t->lights[i]))
            return false;
    return true;
}

static int take_step(struct step *s)
{
    size_t n_kept = (size_t)s->kept->n_lights, n_raw = (size_t)s->input->n_lights;
    struct gn_temporal *out = s->out;
    s->names = malloc((n_kept + n_raw) * (sizeof(*s->names) + sizeof(int)) + 1);
    if (!s->names)
        return -ENOMEM;
    s->next_of_kept = (int *)(s->names + n_kept + n_raw);
    s->kept_of = s->next_of_kept + n_kept;
    out->is_settled = true;
    find_change(s);
    if (s->input->has_lights && s->kept->input.has_lights) {
        follow_lights(s);
        if (are_lights_settled(out)) // each light is there: their sum is
            memcpy(out->total, s->input->total, sizeof(out->total));
    } else {
        follow_total(s);
        if (s->input->has_lights)
            add_lights(out, s->input);
    }
    follow_values(s);
    out->is_settled = out->is_settled && are_lights_settled(out);
    free(s->names);
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
        set_raw(&out->lights[i], &input->lights[i]);
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
        add_lights(out, input);
    if (kept->input.n_values != input->n_values) {
        out->input.n_values = input->n_values;
        memcpy(out->input.values, input->values, sizeof(out->input.values));
        add_values(out, input);
    }
    out->is_settled = out->is_settled && are_lights_settled(out);
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
        struct step step = {.kept = kept, .input = input, .out = out, .tau = tau};
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

void gn_temporal_get_light(const struct gn_temporal *temporal, int i, struct gn_light *out_light)
{
    const struct gn_temporal_light *light = &temporal->lights[i];
    *out_light = light->raw;
    if (is_light_settled(light))
        return;
    double dir[3], luminance = gn_luminance_of_sum(light->irradiance);
    get_direction(light, dir);
    for (int k = 0; k < 3; k++) {
        out_light->dir_world[k] = (float)dir[k];
        out_light->irradiance[k] = (float)light->irradiance[k];
    }
    double spread = luminance > 0 ? 1 - get_length(light->moment) / luminance : 0;
    if (light->raw.angular_radius > 0 && spread > 0)
        out_light->angular_radius = (float)(2 * asin(fmin(sqrt(spread), 1)));
}
