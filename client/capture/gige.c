/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A GigE Vision camera as a live source. A thread of its own, "gn-gige", takes whole pictures from
 * Aravis, keeps the newest, and opens the camera again when it fell silent; the reader's thread
 * converts the picture that it takes. Nothing but the lock's fields is shared.
 */
#include "client/capture/gige.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <arv.h>

#include "client/capture/gige_private.h"
#include "common/clock.h"
#include "common/text.h"

/** How long a camera that another client holds is waited for: its heartbeat time, 3 s, and more. */
#define PATIENCE_MS 4000
/** How long the reader waits until the thread begins to set the camera: 5 s. */
#define SETTING_TICKS 100

/** Takes the newest picture, or news, or nothing. As gn_source_read, without waiting. */
static int take_newest(struct gn_gige *s, struct gn_error *out_error)
{
    int got = -EAGAIN;
    uint64_t n;
    (void)!read(s->head.fd, &n, sizeof(n));
    gn_mutex_lock(&s->mu);
    if (s->news.text[0]) {
        gn_error_set(out_error, got, "%s", s->news.text);
        s->news.text[0] = '\0';
        if (s->newest.buffer)
            gn_gige_wake_reader(s);
    } else if (s->newest.buffer) {
        gn_gige_return_buffer_locked(s, &s->held);
        s->held = s->newest;
        s->newest.buffer = NULL;
        got = 1;
    }
    gn_mutex_unlock(&s->mu);
    return got;
}

static int gige_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    struct gn_gige *s = (struct gn_gige *)source;
    struct pollfd wait = {.fd = s->head.fd, .events = POLLIN};
    (void)!poll(&wait, 1, GN_SOURCE_WAIT_MS);
    int got = take_newest(s, out_error);
    if (got != 1)
        return got;
    bool is_8_bit = s->options.is_8_bit;
    size_t size = 0;
    const uint8_t *data = arv_buffer_get_image_data(s->held.buffer, &size);
    int err = gn_pixels_convert(s->format, is_8_bit, s->width, s->height, data, s->pixels);
    if (err == -EDOM)
        return gn_error_set(out_error, err,
                            "camera %s: a picture has codes above those of %s; what it sends is "
                            "not what it says",
                            s->id, s->format->name);
    if (err)
        return gn_error_set(out_error, err, "out of memory");
    enum gn_capture_format format = gn_pixels_get_capture_format(s->format, is_8_bit);
    *out = (struct gn_capture){
        .name = s->name,
        .time_ns = s->held.time_ns,
        .exposure_us = s->held.exposure_us,
        .bits = s->format->bits,
        .width = s->width,
        .height = s->height,
        .format = format,
        .data = s->pixels ? s->pixels : data,
        .data_bytes = gn_pixels_get_capture_bytes(format, s->width, s->height),
    };
    gn_mutex_lock(&s->mu);
    s->counts.n_read++;
    s->counts.read_bytes += out->data_bytes;
    s->counts.copied_bytes += s->pixels ? out->data_bytes : 0;
    snprintf(s->name, sizeof(s->name), "%06llu", (unsigned long long)s->counts.n_read);
    gn_mutex_unlock(&s->mu);
    return 1;
}

static void gige_get_counts(const struct gn_source *source, struct gn_source_counts *out)
{
    // Only the head is const for the reader: the counts are the thread's as well.
    struct gn_gige *s = (struct gn_gige *)(uintptr_t)source;
    gn_mutex_lock(&s->mu);
    gn_gige_count_packets_locked(s);
    *out = s->counts;
    gn_mutex_unlock(&s->mu);
}

/** Has the thread do it, and waits. */
static int ask(struct gn_gige *s, struct gn_gige_setting *setting, struct gn_error *out_error)
{
    gn_mutex_lock(&s->mu);
    s->asked = setting;
    // Waits are counted, not time: this thread is not alone where the machine stood still. What was
    // begun must end: the answer lies here.
    for (int i = 0; !setting->is_done && (i < SETTING_TICKS || s->asked != setting); i++)
        (void)!gn_cond_wait_until(&s->answered, &s->mu,
                                  gn_clock_get_monotonic_ns() + GN_GIGE_TICK_US * GN_NS_PER_US);
    bool is_done = setting->is_done;
    s->asked = NULL;
    gn_mutex_unlock(&s->mu);
    if (!is_done)
        return gn_error_set(out_error, -ENODEV, "camera %s: it is lost, and cannot be set", s->id);
    return setting->err ? gn_error_set(out_error, setting->err, "%s", setting->error.text) : 0;
}

static int gige_hold_exposure(struct gn_source *source, enum gn_exposure_unit unit,
                              struct gn_exposure *out, struct gn_error *out_error)
{
    struct gn_gige_setting setting = {.what = GN_GIGE_HOLD, .unit = unit};
    int err = ask((struct gn_gige *)source, &setting, out_error);
    if (!err)
        *out = setting.range;
    return err;
}

static int gige_set_exposure(struct gn_source *source, double value, double *out_value,
                             struct gn_error *out_error)
{
    struct gn_gige_setting setting = {.what = GN_GIGE_SET, .value = value};
    int err = ask((struct gn_gige *)source, &setting, out_error);
    if (!err)
        *out_value = setting.range.now;
    return err;
}

static int gige_restore_exposure(struct gn_source *source, struct gn_error *out_error)
{
    struct gn_gige_setting setting = {.what = GN_GIGE_RESTORE};
    return ask((struct gn_gige *)source, &setting, out_error);
}

static void gige_close(struct gn_source *source)
{
    struct gn_gige *s = (struct gn_gige *)source;
    atomic_store(&s->is_ending, true);
    gn_thread_join(&s->thread);
    gn_thread_join(&s->undertaker);
    gn_mutex_lock(&s->mu);
    s->stream = NULL; // buffers are freed, not returned
    gn_gige_return_buffer_locked(s, &s->held);
    gn_gige_return_buffer_locked(s, &s->newest);
    gn_mutex_unlock(&s->mu);
    gn_gige_device_close(&s->device);
    gn_cond_finish(&s->answered);
    gn_mutex_finish(&s->mu);
    if (s->head.fd >= 0)
        close(s->head.fd);
    free(s->pixels);
    free(s->controls);
    free(s);
}

static const struct gn_source_ops gige_ops = {.read = gige_read,
                                              .get_counts = gige_get_counts,
                                              .hold_exposure = gige_hold_exposure,
                                              .set_exposure = gige_set_exposure,
                                              .restore_exposure = gige_restore_exposure,
                                              .close = gige_close};

/** What reading needs of memory, once the picture's size is known. */
static int prepare(struct gn_gige *s, struct gn_error *out_error)
{
    bool is_8_bit = s->options.is_8_bit;
    snprintf(s->id, sizeof(s->id), "%s", s->place.id);
    s->format = s->device.format;
    s->width = s->device.width;
    s->height = s->device.height;
    s->picture_bytes = s->device.picture_bytes;
    size_t bytes = gn_pixels_get_capture_bytes(gn_pixels_get_capture_format(s->format, is_8_bit),
                                               s->width, s->height);
    if (!gn_pixels_is_same(s->format, is_8_bit)) {
        s->pixels = malloc(bytes);
        if (!s->pixels)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
    }
    gn_gige_begin_opening(s);
    if (gn_thread_start(&s->thread, "gn-gige", gn_gige_run, s) < 0)
        return gn_error_set(out_error, -EAGAIN, "camera %s: cannot start its thread", s->id);
    return 0;
}

int gn_gige_open(const struct gn_live_options *options, struct gn_source **out_source,
                 struct gn_error *out_error)
{
    *out_source = NULL;
    struct gn_gige *s = calloc(1, sizeof(*s));
    bool has_mutex = s && gn_mutex_init(&s->mu) == 0;
    if (!has_mutex || gn_cond_init(&s->answered) < 0) {
        if (has_mutex)
            gn_mutex_finish(&s->mu);
        free(s);
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    }
    s->head = (struct gn_source){
        .ops = &gige_ops, .is_live = true, .fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
    s->options = *options;
    s->options.id = s->options.pixel_format = NULL; // borrowed for this call only
    s->options.controls = s->controls = options->controls ? strdup(options->controls) : NULL;
    int err = s->head.fd < 0 ? -errno : options->controls && !s->controls ? -ENOMEM : 0;
    if (err)
        gn_error_set(out_error, err, "%s", strerror(-err));
    else
        err = gn_gige_place_find(options->id, &s->place, out_error);
    if (!err)
        err = gn_gige_device_open(&s->place, options, PATIENCE_MS, &s->device, out_error);
    if (!err)
        err = prepare(s, out_error);
    if (err) {
        gige_close(&s->head);
        return err;
    }
    *out_source = &s->head;
    return 0;
}

int gn_gige_find(gn_gige_found_fn found, void *context)
{
    ArvInterface *gv = arv_gv_interface_get_instance();
    arv_interface_update_device_list(gv);
    unsigned n = arv_interface_get_n_devices(gv);
    for (unsigned i = 0; i < n; i++) {
        const char *words[3] = {arv_interface_get_device_id(gv, i),
                                arv_interface_get_device_model(gv, i),
                                arv_interface_get_device_address(gv, i)};
        char clean[3][256];
        for (int k = 0; k < 3; k++) {
            snprintf(clean[k], sizeof(clean[k]), "%s", words[k] ? words[k] : "?");
            gn_text_clean(clean[k]);
        }
        found(context, clean[0], clean[1], clean[2]);
    }
    return (int)n;
}
