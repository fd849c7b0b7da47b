/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/v4l2.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/v4l2_stream.h"
#include "common/clock.h"

/** A lost camera is looked for so often. */
#define RETRY_NS (250 * GN_NS_PER_MS)
/** Least time without a picture after which a camera is opened again, and that for the first. */
#define STALL_NS GN_NS_PER_S
#define FIRST_STALL_NS (5 * GN_NS_PER_S)
/** Most of the time from one look for a picture to the next that counts as the camera's silence:
 * the waits of a read and of its reader. Where it was longer this program or the machine stood
 * still. */
#define MOST_SILENCE_NS (2 * GN_SOURCE_WAIT_MS * GN_NS_PER_MS)
/** Frame time where the driver does not say. */
#define DEFAULT_FRAME_NS GN_NS_PER_S
/** A time of the driver may lie so far in the past, and in the future: some compute it. */
#define MAX_AGE_NS (10 * GN_NS_PER_S)
#define MAX_AHEAD_NS (100 * GN_NS_PER_MS)

struct v4l2_source {
    struct gn_source head;
    struct gn_live_options options; // its strings are the next two
    char *pixel_format, *controls;  // owned; may be NULL
    struct gn_v4l2_device device;   // fd -1: lost
    char card[33];                  // of the camera that was opened first
    struct gn_v4l2_layout layout;
    int64_t frame_ns; // 0: unknown
    struct gn_v4l2_stream stream;
    struct gn_v4l2_exposure exposure;
    double asked_us;      // options.exposure_us while the exposure is held
    bool has_picture;     // one has come since this opening
    int64_t looked_ns;    // when one was last looked for; before that, of the opening
    int64_t silent_ns;    // how long none has come
    int64_t given_ns;     // the last picture's time
    int64_t retry_ns;     // when a lost camera is looked for next
    struct gn_error news; // to be told
    struct gn_error said; // the last reason why it does not come back
    bool has_told_time, has_told_fault;
    uint8_t *pixels; // [pixels_bytes], owned
    size_t pixels_bytes;
    struct gn_jpeg *jpeg;
    char name[32];
    struct gn_source_counts counts;
};

static int64_t now_ns(const struct v4l2_source *s)
{
    return s->device.io->now_ns(s->device.io->context);
}

/** Ends streaming and closes the camera. */
static void stop(struct v4l2_source *s)
{
    gn_v4l2_stream_stop(&s->stream);
    gn_v4l2_device_close(&s->device);
    s->head.fd = -1;
}

static bool is_lent(const struct v4l2_source *s)
{
    return s->layout.is_borrowed && gn_v4l2_stream_may_lend(&s->stream);
}

/** Where converted and copied pictures go. */
static int make_room(struct v4l2_source *s, struct gn_error *out_error)
{
    size_t n = is_lent(s)              ? 0
               : s->layout.is_borrowed ? gn_v4l2_stream_get_room(&s->stream)
                                       : s->layout.n_out_bytes;
    if (n <= s->pixels_bytes)
        return 0;
    free(s->pixels);
    s->pixels = malloc(n);
    s->pixels_bytes = s->pixels ? n : 0;
    return s->pixels ? 0 : gn_error_set(out_error, -ENOMEM, "%s: out of memory", s->device.path);
}

/** Opens the camera, sets it and starts it. On failure it is closed. */
static int start(struct v4l2_source *s, const char *path, struct gn_error *out_error)
{
    const struct gn_v4l2_io *io = s->device.io;
    int err = gn_v4l2_device_open(io, path, &s->device, out_error);
    if (!err && s->card[0] && strcmp(s->card, s->device.card) != 0)
        err = gn_error_set(out_error, -ENOTUNIQ, "%s: another camera (%s) is there; waiting for %s",
                           path, s->device.card, s->card);
    if (!err)
        err =
            gn_v4l2_device_set_format(&s->device, &s->options, &s->layout, &s->frame_ns, out_error);
    if (!err)
        err = gn_v4l2_device_set_controls(&s->device, &s->options, out_error);
    if (!err)
        err = gn_v4l2_stream_start(&s->stream, out_error);
    if (!err)
        err = make_room(s, out_error);
    if (err) {
        stop(s);
        return err;
    }
    strcpy(s->card, s->device.card);
    s->options.width = s->layout.width; // when it is back it gives the same pictures
    s->options.height = s->layout.height;
    s->options.pixel_format = s->layout.pixels->name;
    s->head.fd = s->device.fd;
    s->has_picture = false;
    s->silent_ns = 0;
    s->looked_ns = now_ns(s);
    return 0;
}

/** Gives the camera up for now. */
static void lose(struct v4l2_source *s, const char *why)
{
    gn_error_set(&s->news, 0, "%s (%s): %s; it is opened again when it is back", s->device.path,
                 s->device.card, why);
    s->said.text[0] = '\0';
    stop(s);
    s->retry_ns = now_ns(s); // at once: it may only have changed
}

/** The middle of the exposure, where its length was set: drivers stamp its beginning or its end.
 * The stamp itself where that would be later than now, or before the picture before: an exposure
 * that was just set holds from a later picture on. */
static int64_t move_to_middle(const struct v4l2_source *s, const struct v4l2_buffer *b, int64_t t,
                              int64_t now)
{
    int64_t half_ns = (int64_t)(s->options.exposure_us * 500);
    bool is_start = (b->flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    int64_t middle = is_start ? t + half_ns : t - half_ns;
    return middle >= s->given_ns && middle <= now ? middle : t;
}

/** When the picture was taken: the driver's time where it is one of CLOCK_MONOTONIC, neither before
 * the picture that was given last nor later than now. */
static int64_t get_time_ns(struct v4l2_source *s, const struct v4l2_buffer *b)
{
    int64_t now = now_ns(s), sec = b->timestamp.tv_sec, usec = b->timestamp.tv_usec;
    bool is_monotonic =
        (b->flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    if (is_monotonic && sec >= 0 && sec < INT64_MAX / GN_NS_PER_S && usec >= 0 && usec < 1000000) {
        int64_t t = sec * GN_NS_PER_S + usec * GN_NS_PER_US;
        int64_t middle = move_to_middle(s, b, t < now ? t : now, now);
        if (t >= now - MAX_AGE_NS && t <= now + MAX_AHEAD_NS && middle >= s->given_ns)
            return middle;
    }
    if (!s->has_told_time)
        gn_error_set(&s->news, 0,
                     "%s (%s): the driver gives no time of the monotonic clock, or one that goes "
                     "back; such a picture's time is when it is read",
                     s->device.path, s->device.card);
    s->has_told_time = true;
    return now;
}

/** The capture of a whole picture, converted or copied where it must be. */
static void give(struct v4l2_source *s, const struct gn_v4l2_picture *p, struct gn_capture *out)
{
    const uint8_t *data = p->data;
    size_t n_bytes = s->layout.format == GN_CAPTURE_JPEG ? p->n_bytes : s->layout.n_out_bytes;
    s->counts.n_read++;
    s->counts.read_bytes += n_bytes;
    if (!is_lent(s)) {
        if (s->layout.is_borrowed)
            memcpy(s->pixels, data, n_bytes);
        else
            gn_v4l2_convert(&s->layout, data, s->pixels);
        s->counts.copied_bytes += n_bytes;
        data = s->pixels;
        // The driver may fill it again at once. Where it is gone, the next picture tells.
        (void)!gn_v4l2_stream_release(&s->stream);
    }
    snprintf(s->name, sizeof(s->name), "frame%06" PRIu64, s->counts.n_read);
    *out = (struct gn_capture){
        .name = s->name,
        .time_ns = get_time_ns(s, &p->info),
        .width = s->layout.width,
        .height = s->layout.height,
        .bits = s->layout.pixels->depth,
        .format = s->layout.format,
        .data = data,
        .data_bytes = n_bytes,
    };
    s->given_ns = out->time_ns;
    s->has_picture = true;
    s->silent_ns = 0;
    s->looked_ns = now_ns(s);
}

/** Hands out what there is to tell. Returns -EAGAIN. */
static int tell(struct v4l2_source *s, struct gn_error *out_error)
{
    if (s->news.text[0])
        gn_error_set(out_error, -EAGAIN, "%s", s->news.text);
    s->news.text[0] = '\0';
    return -EAGAIN;
}

/** Looks for a lost camera. */
static int look_for(struct v4l2_source *s, struct gn_error *out_error)
{
    struct gn_error why = {0};
    char path[sizeof(s->device.path)];
    if (now_ns(s) < s->retry_ns) {
        (void)s->device.io->wait(s->device.io->context, -1, GN_SOURCE_WAIT_MS);
        return tell(s, out_error);
    }
    strcpy(path, s->device.path);
    int err = start(s, path, &why);
    s->retry_ns = now_ns(s) + RETRY_NS;
    if (!err) {
        s->counts.n_reopened++;
        gn_error_set(&s->news, 0, "%s (%s): is back", s->device.path, s->device.card);
    } else if (err != -ENODEV && strcmp(why.text, s->said.text) != 0) {
        s->said = s->news = why;
    }
    return tell(s, out_error);
}

/** A look that found nothing: whether no picture has come for so long that the camera should be
 * opened again. */
static bool is_stalled(struct v4l2_source *s)
{
    int64_t now = now_ns(s), since_ns = now - s->looked_ns;
    s->looked_ns = now;
    s->silent_ns += since_ns < MOST_SILENCE_NS ? since_ns : MOST_SILENCE_NS;
    int64_t frame_ns = s->frame_ns ? s->frame_ns : DEFAULT_FRAME_NS;
    int64_t exposure_ns = (int64_t)(s->options.exposure_us * 1e3);
    int64_t limit_ns = GN_SOURCE_MISSING_FRAMES * (frame_ns > exposure_ns ? frame_ns : exposure_ns);
    int64_t least_ns = s->has_picture ? STALL_NS : FIRST_STALL_NS;
    return s->silent_ns > (limit_ns > least_ns ? limit_ns : least_ns);
}

/** Whether the driver says that what comes in is no longer what was set. */
static bool has_changed(const struct v4l2_source *s)
{
    struct v4l2_event event = {0};
    return gn_v4l2_device_call(&s->device, VIDIOC_DQEVENT, &event) == 0 &&
           event.type == V4L2_EVENT_SOURCE_CHANGE;
}

/** Waits for a picture. As gn_v4l2_stream_take, -ESTALE where another kind of picture comes. */
static int wait_for_picture(struct v4l2_source *s, struct gn_v4l2_picture *out)
{
    int events = s->device.io->wait(s->device.io->context, s->device.fd, GN_SOURCE_WAIT_MS);
    if (events < 0)
        return events;
    if ((events & POLLPRI) && has_changed(s))
        return -ESTALE;
    int got = gn_v4l2_stream_take(&s->stream, out);
    // An error that taking does not explain: the camera is gone all the same.
    return got == 0 && (events & (POLLERR | POLLHUP | POLLNVAL)) ? -ENODEV : got;
}

/** What is done without a picture: the camera given up, or nothing. */
static int go_without(struct v4l2_source *s, int got, struct gn_error *out_error)
{
    if (got == -EPROTO) {
        gn_error_set(out_error, got, "%s (%s): the driver returns a buffer that it does not have",
                     s->device.path, s->device.card);
        stop(s);
        return got;
    }
    if (got == 0 && is_stalled(s))
        lose(s, "no picture comes any more");
    else if (got < 0)
        lose(s, got == -ENODEV   ? "unplugged"
                : got == -ESTALE ? "its pictures have changed"
                                 : strerror(-got));
    return tell(s, out_error);
}

static int v4l2_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    struct v4l2_source *s = (struct v4l2_source *)source;
    struct gn_v4l2_picture picture;
    if (s->news.text[0])
        return tell(s, out_error);
    if (s->device.fd < 0)
        return look_for(s, out_error);
    int got = gn_v4l2_stream_release(&s->stream);
    if (!got)
        got = gn_v4l2_stream_take(&s->stream, &picture);
    if (!got)
        got = wait_for_picture(s, &picture);
    if (s->stream.fault && !s->has_told_fault) {
        gn_error_set(&s->news, 0, "%s (%s): a buffer %s; such are counted and not sent",
                     s->device.path, s->device.card, s->stream.fault);
        s->has_told_fault = true;
    }
    if (got <= 0)
        return go_without(s, got, out_error);
    give(s, &picture, out);
    return 1;
}

static void v4l2_get_counts(const struct gn_source *source, struct gn_source_counts *out)
{
    *out = ((const struct v4l2_source *)source)->counts;
}

/** A camera that is away cannot be set. */
static int check_there(const struct v4l2_source *s, struct gn_error *out_error)
{
    return s->device.fd >= 0 ? 0
                             : gn_error_set(out_error, -ENODEV, "%s (%s): it is lost",
                                            s->device.path, s->device.card);
}

static int v4l2_hold_exposure(struct gn_source *source, enum gn_exposure_unit unit,
                              struct gn_exposure *out, struct gn_error *out_error)
{
    struct v4l2_source *s = (struct v4l2_source *)source;
    int err = check_there(s, out_error);
    if (!err)
        err = gn_v4l2_exposure_hold(&s->device, unit, &s->exposure, out, out_error);
    if (!err)
        s->asked_us = s->options.exposure_us;
    return err;
}

static int v4l2_set_exposure(struct gn_source *source, double value, double *out_value,
                             struct gn_error *out_error)
{
    struct v4l2_source *s = (struct v4l2_source *)source;
    int err = check_there(s, out_error);
    if (!err)
        err = gn_v4l2_exposure_set(&s->device, &s->exposure, value, out_value, out_error);
    if (!err && s->exposure.unit_us > 0)
        s->options.exposure_us = *out_value; // what it has when it was lost and is back
    return err;
}

static int v4l2_restore_exposure(struct gn_source *source, struct gn_error *out_error)
{
    struct v4l2_source *s = (struct v4l2_source *)source;
    if (s->exposure.n_noted == 0)
        return 0;
    int err = check_there(s, out_error);
    if (err)
        return err;
    s->options.exposure_us = s->asked_us;
    return gn_v4l2_exposure_restore(&s->device, &s->exposure, out_error);
}

static void v4l2_close(struct gn_source *source)
{
    struct v4l2_source *s = (struct v4l2_source *)source;
    stop(s);
    gn_jpeg_destroy(&s->jpeg);
    free(s->pixel_format);
    free(s->controls);
    free(s->pixels);
    free(s);
}

static const struct gn_source_ops v4l2_ops = {.read = v4l2_read,
                                              .get_counts = v4l2_get_counts,
                                              .hold_exposure = v4l2_hold_exposure,
                                              .set_exposure = v4l2_set_exposure,
                                              .restore_exposure = v4l2_restore_exposure,
                                              .close = v4l2_close};

/** A copy of text, which may be NULL. */
static int keep(const char *text, char **out)
{
    *out = text ? strdup(text) : NULL;
    return text && !*out ? -ENOMEM : 0;
}

/** Starts the first camera that can be. */
static int start_any(struct v4l2_source *s, struct gn_error *out_error)
{
    int err = -ENODEV;
    struct gn_error first = {0}; // why a camera that is there cannot
    for (int i = 0; err && i < GN_V4L2_MAX_NODES; i++) {
        char path[32];
        struct gn_error why = {0};
        snprintf(path, sizeof(path), "/dev/video%d", i);
        err = start(s, path, &why);
        if (err && err != -ENODEV && !first.text[0])
            first = why;
    }
    if (err)
        gn_error_set(out_error, err, "%s",
                     first.text[0] ? first.text : "no /dev/video* of this machine captures video");
    return err;
}

int gn_v4l2_open_through(const struct gn_v4l2_io *io, const struct gn_live_options *options,
                         struct gn_source **out_source, struct gn_error *out_error)
{
    *out_source = NULL;
    struct v4l2_source *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", options->id);
    s->head = (struct gn_source){.ops = &v4l2_ops, .is_live = true, .fd = -1};
    s->device = (struct gn_v4l2_device){.io = io, .fd = -1};
    s->options = *options;
    int err = keep(options->pixel_format, &s->pixel_format);
    if (!err)
        err = keep(options->controls, &s->controls);
    if (!err)
        err = gn_jpeg_create(&s->jpeg);
    s->options.id = NULL;
    s->options.pixel_format = s->pixel_format;
    s->options.controls = s->controls;
    s->stream = (struct gn_v4l2_stream){
        .device = &s->device, .layout = &s->layout, .jpeg = s->jpeg, .counts = &s->counts};
    if (err)
        gn_error_set(out_error, err, "%s: out of memory", options->id);
    else if (strcmp(options->id, "any") == 0)
        err = start_any(s, out_error);
    else
        err = start(s, options->id, out_error);
    if (err) {
        v4l2_close(&s->head);
        return err;
    }
    *out_source = &s->head;
    return 0;
}

int gn_v4l2_open(const struct gn_live_options *options, struct gn_source **out_source,
                 struct gn_error *out_error)
{
    return gn_v4l2_open_through(&gn_v4l2_kernel, options, out_source, out_error);
}
