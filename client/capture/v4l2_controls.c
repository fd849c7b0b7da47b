/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Exposure, gain, white balance and whatever else a camera of V4L2 lets one set. */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/v4l2_device.h"
#include "proto/attr.h"

/** Most controls that are asked for: a driver may never end its list. */
#define MAX_CONTROLS 512
/** Unit of V4L2_CID_EXPOSURE_ABSOLUTE, us. */
#define EXPOSURE_UNIT_US 100

/** The control's name as words joined by '_', as v4l2-ctl has it: "Exposure, Auto" is
 * exposure_auto. */
static void make_name(const struct v4l2_queryctrl *q, char out[static 33])
{
    size_t n = 0;
    for (size_t i = 0; i < sizeof(q->name) && q->name[i]; i++) {
        unsigned char c = q->name[i];
        if (isalnum(c))
            out[n++] = (char)tolower(c);
        else if (n && out[n - 1] != '_')
            out[n++] = '_';
    }
    while (n && out[n - 1] == '_')
        n--;
    out[n] = '\0';
}

/** Whether it is one number that may be set. */
static bool is_settable(const struct v4l2_queryctrl *q)
{
    bool is_number = q->type == V4L2_CTRL_TYPE_INTEGER || q->type == V4L2_CTRL_TYPE_BOOLEAN ||
                     q->type == V4L2_CTRL_TYPE_MENU || q->type == V4L2_CTRL_TYPE_INTEGER_MENU;
    return is_number && !(q->flags & (V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_READ_ONLY));
}

/** The first control after *q, which begins zeroed, that can be set. */
static bool get_next(const struct gn_v4l2_device *d, struct v4l2_queryctrl *q)
{
    for (int i = 0; i < MAX_CONTROLS; i++) {
        uint32_t last = q->id;
        *q = (struct v4l2_queryctrl){.id = last | V4L2_CTRL_FLAG_NEXT_CTRL};
        if (gn_v4l2_device_call(d, VIDIOC_QUERYCTRL, q) != 0 || q->id <= last)
            return false;
        if (is_settable(q))
            return true;
    }
    return false;
}

/** By its number; false where the camera does not have it. */
static bool find_control(const struct gn_v4l2_device *d, uint32_t id, struct v4l2_queryctrl *out)
{
    *out = (struct v4l2_queryctrl){.id = id};
    return gn_v4l2_device_call(d, VIDIOC_QUERYCTRL, out) == 0 && is_settable(out);
}

void gn_v4l2_device_list_controls(const struct gn_v4l2_device *device, gn_v4l2_word_fn word,
                                  void *context)
{
    struct v4l2_queryctrl q = {0};
    for (int i = 0; i < MAX_CONTROLS && get_next(device, &q); i++) {
        char name[33], text[128];
        struct v4l2_control c = {.id = q.id};
        make_name(&q, name);
        if (gn_v4l2_device_call(device, VIDIOC_G_CTRL, &c) == 0)
            snprintf(text, sizeof(text), "%s=%d (%d to %d)", name, c.value, q.minimum, q.maximum);
        else
            snprintf(text, sizeof(text), "%s (%d to %d)", name, q.minimum, q.maximum);
        word(context, text);
    }
}

/** "no exposure time can be set; it has ...". */
static int refuse(const struct gn_v4l2_device *d, const char *what, struct gn_error *out_error)
{
    struct gn_v4l2_words words = {0};
    struct v4l2_queryctrl q = {0};
    for (int i = 0; i < MAX_CONTROLS && get_next(d, &q); i++) {
        char name[33];
        make_name(&q, name);
        gn_v4l2_words_add(&words, name);
    }
    return gn_error_set(out_error, -EINVAL, "%s (%s): %s; it has %s", d->path, d->card, what,
                        words.n ? words.text : "no controls");
}

/** Sets a control that is there, and sees whether it took. */
static int set_value(const struct gn_v4l2_device *d, const struct v4l2_queryctrl *q, double value,
                     struct gn_error *out_error)
{
    char name[33];
    make_name(q, name);
    if (!(value >= q->minimum && value <= q->maximum) || value != floor(value))
        return gn_error_set(out_error, -EINVAL,
                            "%s (%s): %s %g is no whole number in [%d, %d], which it takes",
                            d->path, d->card, name, value, q->minimum, q->maximum);
    struct v4l2_control c = {.id = q->id, .value = (int32_t)value};
    int err = gn_v4l2_device_call(d, VIDIOC_S_CTRL, &c);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): %s cannot be set now: %s", d->path, d->card,
                            name, strerror(-err));
    c = (struct v4l2_control){.id = q->id};
    if (gn_v4l2_device_call(d, VIDIOC_G_CTRL, &c) == 0 && c.value != (int32_t)value)
        return gn_error_set(out_error, -EINVAL, "%s (%s): %s was set to %g and is %d%s", d->path,
                            d->card, name, value, c.value, q->step > 1 ? "; it goes in steps" : "");
    return 0;
}

/** Sets it where the camera has it. */
static int set_if_there(const struct gn_v4l2_device *d, uint32_t id, int value,
                        struct gn_error *out_error)
{
    struct v4l2_queryctrl q;
    return find_control(d, id, &q) ? set_value(d, &q, value, out_error) : 0;
}

static int set_exposure(const struct gn_v4l2_device *d, double exposure_us,
                        struct gn_error *out_error)
{
    struct v4l2_queryctrl q;
    int err = set_if_there(d, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL, out_error);
    if (!err) // or the camera lowers its rate in the dark
        err = set_if_there(d, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, out_error);
    if (err)
        return err;
    if (!find_control(d, V4L2_CID_EXPOSURE_ABSOLUTE, &q))
        return refuse(d, "no exposure time can be set", out_error);
    double units = exposure_us / EXPOSURE_UNIT_US;
    if (!(units >= q.minimum - 0.5 && units <= q.maximum + 0.5))
        return gn_error_set(out_error, -EINVAL,
                            "%s (%s): exposure %g us is not in [%g, %g] us, which it takes in "
                            "steps of %d us",
                            d->path, d->card, exposure_us, 1.0 * EXPOSURE_UNIT_US * q.minimum,
                            1.0 * EXPOSURE_UNIT_US * q.maximum, EXPOSURE_UNIT_US);
    return set_value(d, &q, fmin(fmax(round(units), q.minimum), q.maximum), out_error);
}

static int set_gain(const struct gn_v4l2_device *d, double gain, struct gn_error *out_error)
{
    struct v4l2_queryctrl q;
    int err = set_if_there(d, V4L2_CID_AUTOGAIN, 0, out_error);
    if (err)
        return err;
    if (!find_control(d, V4L2_CID_GAIN, &q) && !find_control(d, V4L2_CID_ANALOGUE_GAIN, &q))
        return refuse(d, "no gain can be set", out_error);
    return set_value(d, &q, gain, out_error);
}

static int lock_white_balance(const struct gn_v4l2_device *d, struct gn_error *out_error)
{
    struct v4l2_queryctrl q;
    if (!find_control(d, V4L2_CID_AUTO_WHITE_BALANCE, &q))
        return refuse(d, "no automatic white balance that could be locked", out_error);
    return set_value(d, &q, 0, out_error);
}

/** "name=value" of --controls. */
static int set_named(const struct gn_v4l2_device *d, const char *text, size_t n,
                     struct gn_error *out_error)
{
    char pair[96], what[128], *end = NULL;
    snprintf(pair, sizeof(pair), "%.*s", (int)n, text);
    char *value = strchr(pair, '=');
    double number = 0;
    if (value) {
        *value++ = '\0';
        number = strtod(value, &end);
    }
    if (n >= sizeof(pair) || !value || end == value || *end)
        return gn_error_set(out_error, -EINVAL,
                            "control '%.64s': right would be NAME=NUMBER, such as gain=10", text);
    struct v4l2_queryctrl q = {0};
    for (int i = 0; i < MAX_CONTROLS && get_next(d, &q); i++) {
        char name[33];
        make_name(&q, name);
        if (strcmp(name, pair) == 0)
            return set_value(d, &q, number, out_error);
    }
    snprintf(what, sizeof(what), "no control '%.40s'", pair);
    return refuse(d, what, out_error);
}

int gn_v4l2_device_set_controls(const struct gn_v4l2_device *device,
                                const struct gn_live_options *options, struct gn_error *out_error)
{
    int err = 0;
    if (options->exposure_us > 0)
        err = set_exposure(device, options->exposure_us, out_error);
    if (!err && options->has_gain)
        err = set_gain(device, options->gain, out_error);
    if (!err && options->is_white_balance_locked)
        err = lock_white_balance(device, out_error);
    const char *next = options->controls;
    while (!err && next && *next) {
        size_t n = strcspn(next, ",");
        err = set_named(device, next, n, out_error);
        next += n + (next[n] == ',');
    }
    return err;
}

/** Notes what a control is, where the camera has it, and sets it. */
static int change(const struct gn_v4l2_device *d, struct gn_v4l2_exposure *exposure, uint32_t id,
                  int32_t value, struct gn_error *out_error)
{
    struct v4l2_queryctrl q;
    struct v4l2_control c = {.id = id};
    if (!find_control(d, id, &q) || gn_v4l2_device_call(d, VIDIOC_G_CTRL, &c) != 0 ||
        c.value == value)
        return 0;
    exposure->noted[exposure->n_noted].id = id;
    exposure->noted[exposure->n_noted++].value = c.value;
    return set_value(d, &q, value, out_error);
}

/** What would change the picture by itself. */
static int switch_off(const struct gn_v4l2_device *d, struct gn_v4l2_exposure *exposure,
                      struct gn_error *out_error)
{
    static const struct {
        uint32_t id;
        int32_t value;
    } automatics[] = {{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
                      {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0},
                      {V4L2_CID_AUTOGAIN, 0},
                      {V4L2_CID_AUTO_WHITE_BALANCE, 0}};
    int err = 0;
    for (size_t i = 0; !err && i < GN_ARRAY_LEN(automatics); i++)
        err = change(d, exposure, automatics[i].id, automatics[i].value, out_error);
    return err;
}

int gn_v4l2_exposure_hold(const struct gn_v4l2_device *device, enum gn_exposure_unit unit,
                          struct gn_v4l2_exposure *exposure, struct gn_exposure *out,
                          struct gn_error *out_error)
{
    struct gn_v4l2_exposure held = {.unit_us = unit == GN_EXPOSURE_US ? EXPOSURE_UNIT_US : 0};
    struct v4l2_queryctrl q;
    held.id = unit == GN_EXPOSURE_US ? V4L2_CID_EXPOSURE_ABSOLUTE : V4L2_CID_EXPOSURE;
    if (!find_control(device, held.id, &q)) {
        bool has_other = find_control(
            device, unit == GN_EXPOSURE_US ? V4L2_CID_EXPOSURE : V4L2_CID_EXPOSURE_ABSOLUTE, &q);
        (void)!refuse(device,
                      !has_other ? "no exposure can be set"
                      : unit == GN_EXPOSURE_US
                          ? "it counts its exposure: no times can be set"
                          : "its exposure is set by times, not by counts: give a unit, as 4,1,16ms",
                      out_error);
        return -ENOTSUP;
    }
    struct v4l2_control c = {.id = held.id};
    int err = switch_off(device, &held, out_error);
    if (!err && gn_v4l2_device_call(device, VIDIOC_G_CTRL, &c) != 0)
        c.value = q.minimum; // write-only: nothing to put back
    else if (!err) {
        held.noted[held.n_noted].id = held.id;
        held.noted[held.n_noted++].value = c.value;
    }
    if (err) {
        (void)!gn_v4l2_exposure_restore(device, &held, NULL);
        return err;
    }
    double scale = held.unit_us > 0 ? held.unit_us : 1;
    *out = (struct gn_exposure){scale * c.value, scale * q.minimum, scale * q.maximum};
    *exposure = held;
    return 0;
}

int gn_v4l2_exposure_set(const struct gn_v4l2_device *device,
                         const struct gn_v4l2_exposure *exposure, double value, double *out_value,
                         struct gn_error *out_error)
{
    struct v4l2_queryctrl q;
    double scale = exposure->unit_us > 0 ? exposure->unit_us : 1;
    const char *unit = exposure->unit_us > 0 ? " us" : "";
    struct gn_v4l2_exposure again = {0};
    // Where the camera was lost and is back they may be on again.
    int err = switch_off(device, &again, out_error);
    if (err)
        return err;
    if (!find_control(device, exposure->id, &q))
        return gn_error_set(out_error, -EIO, "%s (%s): its exposure cannot be set any more",
                            device->path, device->card);
    if (!(value >= scale * (q.minimum - 0.5) && value <= scale * (q.maximum + 0.5)))
        return gn_error_set(
            out_error, -ERANGE, "%s (%s): exposure %g%s is not in [%g, %g]%s, which it takes",
            device->path, device->card, value, unit, scale * q.minimum, scale * q.maximum, unit);
    double nearest = fmin(fmax(round(value / scale), q.minimum), q.maximum);
    struct v4l2_control c = {.id = q.id, .value = (int32_t)nearest};
    err = gn_v4l2_device_call(device, VIDIOC_S_CTRL, &c);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): exposure %g%s cannot be set: %s",
                            device->path, device->card, value, unit, strerror(-err));
    (void)gn_v4l2_device_call(device, VIDIOC_G_CTRL, &c); // what it took, where it says
    *out_value = scale * c.value;
    return 0;
}

int gn_v4l2_exposure_restore(const struct gn_v4l2_device *device, struct gn_v4l2_exposure *exposure,
                             struct gn_error *out_error)
{
    int first = 0;
    while (exposure->n_noted > 0) { // the exposure before its automatic, or it is not taken
        struct v4l2_queryctrl q;
        int i = --exposure->n_noted;
        struct gn_error why = {0};
        struct v4l2_control c = {.id = exposure->noted[i].id, .value = exposure->noted[i].value};
        int err;
        if (!find_control(device, c.id, &q))
            err =
                gn_error_set(&why, -EIO, "%s (%s): it does not answer", device->path, device->card);
        else if (c.id != exposure->id)
            err = set_value(device, &q, c.value, &why);
        else if ((err = gn_v4l2_device_call(device, VIDIOC_S_CTRL, &c)) < 0)
            // An automatic may have come to what cannot be set: the nearest is taken.
            gn_error_set(&why, err, "%s (%s): its exposure cannot be put back: %s", device->path,
                         device->card, strerror(-err));
        if (err && !first)
            first = gn_error_set(out_error, err, "%s", why.text);
    }
    exposure->id = 0;
    return first;
}
