/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/temporal_step.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"

/* A light whose direction jumps further than this does not turn: it fades out here, in there. */
static const double cos_jump = 0.866025403784439; // 30 degrees
/* A fading light below this share of all light goes, its power to the nearest light that stays. */
static const double share_gone = 1e-3;
/* Where none stays: below this share of what it had. */
static const double share_black = 1e-6;
static double get_length(const double v[static 3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

void gn_temporal_set_raw(struct gn_temporal_light *light, const struct gn_light *raw)
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

/* Which of the frame's lights are which of those kept: the place of each one's other, -1: none. */
static void match_lights(const struct gn_temporal_step *s, struct named *names, int *next_of_kept,
                         int *kept_of)
{
    int n_kept = s->kept->n_lights, n_raw = s->input->n_lights;
    struct named *kept = names, *raw = names + n_kept;
    for (int i = 0; i < n_kept; i++) {
        kept[i] = (struct named){s->kept->lights[i].raw.id, i};
        next_of_kept[i] = -1;
    }
    for (int i = 0; i < n_raw; i++) {
        raw[i] = (struct named){s->input->lights[i].id, i};
        kept_of[i] = -1;
    }
    qsort(kept, (size_t)n_kept, sizeof(*kept), compare_named);
    qsort(raw, (size_t)n_raw, sizeof(*raw), compare_named);
    for (int i = 0, j = 0; i < n_kept && j < n_raw;) {
        if (kept[i].id == 0 || kept[i].id < raw[j].id) {
            i++;
        } else if (raw[j].id < kept[i].id) {
            j++;
        } else {
            next_of_kept[kept[i].place] = raw[j].place;
            kept_of[raw[j++].place] = kept[i++].place;
        }
    }
}

/* The light takes its end value at once; the total with it. */
static void snap(struct gn_temporal_step *s, struct gn_temporal_light *light,
                 const struct gn_temporal_light *end)
{
    for (int k = 0; k < 3; k++)
        s->out->total[k] += end->irradiance[k] - light->irradiance[k];
    *light = *end;
    s->out->figures.n_snaps++;
}

static void add(struct gn_temporal_step *s, const struct gn_temporal_light *light)
{
    s->out->lights[s->out->n_lights++] = *light;
    s->out->figures.n_fading += light->fading_from > 0;
}

/* A light that the map has no more, or not there. */
static void fade(struct gn_temporal_step *s, const struct gn_temporal_light *kept, bool is_new)
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
static void follow(struct gn_temporal_step *s, const struct gn_light *raw,
                   const struct gn_temporal_light *kept)
{
    struct gn_temporal_light end, light;
    double end_dir[3], dir[3];
    gn_temporal_set_raw(&end, raw);
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
            (void)gn_temporal_approach(&light.irradiance[k], end.irradiance[k], s->alpha, scale);
            (void)gn_temporal_approach(&light.moment[k], end.moment[k], s->alpha, scale);
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
    gn_temporal_set_raw(&end, &light->raw);
    return light->fading_from == 0 &&
           memcmp(light->irradiance, end.irradiance, sizeof(end.irradiance)) == 0 &&
           memcmp(light->moment, end.moment, sizeof(end.moment)) == 0;
}

bool gn_temporal_are_lights_settled(const struct gn_temporal *t)
{
    for (int i = 0; i < t->n_lights; i++)
        if (!is_light_settled(&t->lights[i]))
            return false;
    return true;
}

void gn_temporal_begin_lights(struct gn_temporal *out, const struct gn_temporal_input *input,
                              const double factor[static 3])
{
    for (int i = 0; i < input->n_lights; i++) {
        struct gn_temporal_light *light = &out->lights[i];
        gn_temporal_set_raw(light, &input->lights[i]);
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

int gn_temporal_follow_lights(struct gn_temporal_step *s)
{
    size_t n_kept = (size_t)s->kept->n_lights, n_raw = (size_t)s->input->n_lights;
    struct gn_temporal *out = s->out;
    struct named *names = malloc((n_kept + n_raw) * (sizeof(*names) + sizeof(int)) + 1);
    if (!names)
        return -ENOMEM;
    int *next_of_kept = (int *)(names + n_kept + n_raw);
    int *kept_of = next_of_kept + n_kept;
    match_lights(s, names, next_of_kept, kept_of);
    for (int k = 0; k < 3; k++)
        out->total[k] = s->kept->total[k] + s->alpha * (s->input->total[k] - s->kept->total[k]);
    for (int i = 0; i < s->input->n_lights; i++) {
        int kept = kept_of[i];
        follow(s, &s->input->lights[i], kept < 0 ? NULL : &s->kept->lights[kept]);
    }
    for (int i = 0; i < s->kept->n_lights; i++) {
        if (next_of_kept[i] < 0)
            fade(s, &s->kept->lights[i], s->kept->lights[i].fading_from == 0);
    }
    qsort(out->lights, (size_t)out->n_lights, sizeof(*out->lights), compare_lights);
    prune(out);
    free(names);
    return 0;
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
