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
                            "%s (%s): exposure %g us is not in [%d, %d] us, which it takes in "
                            "steps of %d us",
                            d->path, d->card, exposure_us, q.minimum * EXPOSURE_UNIT_US,
                            q.maximum * EXPOSURE_UNIT_US, EXPOSURE_UNIT_US);
    return set_value(d, &q, round(units), out_error);
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
