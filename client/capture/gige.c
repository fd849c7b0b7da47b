/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A GigE Vision camera as a live source. A thread of its own, "gn-gige", takes whole pictures from
 * Aravis, keeps the newest, and opens the camera again when it fell silent; the reader's thread
 * converts the picture that it takes. Nothing but the lock's fields is shared.
 */
#include "client/capture/gige.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <arv.h>

#include "client/capture/device_clock.h"
#include "client/capture/gige_device.h"
#include "common/clock.h"
#include "common/thread.h"

/** How long a camera that another client holds is waited for: its heartbeat time, 3 s, and more. */
#define PATIENCE_MS 4000
/** How long the thread waits in one call: for a picture, or for a sign of life. */
#define TICK_US 50000
/** A camera that was just started may take so long for its first picture. */
#define FIRST_PICTURE_NS (2 * GN_NS_PER_S)
/** Least silence before a camera counts as lost: schedulers stall for some tens of ms. */
#define LEAST_SILENCE_NS (100 * GN_NS_PER_MS)
/** Frame time of a camera that does not say its own. */
#define UNKNOWN_FRAME_NS GN_NS_PER_S
/** How often a lost camera is looked for everywhere: it may have another address now. */
#define SEARCH_NS (5 * GN_NS_PER_S)

/** How long the reader waits until the thread begins to set the camera: 5 s. */
#define SETTING_TICKS 100

/** A picture on its way from the thread to the reader. */
struct picture {
    ArvBuffer *buffer; // owned; NULL: none
    int64_t time_ns;
    double exposure_us; // as the camera says with it; 0: it does not
    uint64_t opening;   // of which opening of the camera its buffer is
};

/** What the reader has the thread do with the exposure; the thread writes the answer. */
struct setting {
    enum { SETTING_HOLD, SETTING_SET, SETTING_RESTORE } what;
    enum gn_exposure_unit unit;
    double value;
    struct gn_exposure range; // of HOLD; now: of SET, too
    int err;
    struct gn_error error;
    bool is_done; // guarded by mu
};

struct gige {
    struct gn_source head;
    struct gn_live_options options; // controls are ours, the other strings NULL
    char *controls;                 // owned, may be NULL
    struct gn_thread thread;
    atomic_bool is_ending;
    // What all openings have in common; immutable.
    char id[128];
    const struct gn_pixels_format *format;
    int width, height;
    size_t picture_bytes;
    // owner: gn-gige, once it runs
    struct gn_gige_place place;
    struct gn_gige_device device;
    struct gn_device_clock clock;
    uint64_t frame_id;           // of the last picture; 0: none yet
    struct gn_gige_noted noted;  // of the exposure, while it is held
    struct gn_thread undertaker; // closes what does not answer any more, which takes seconds
    struct gn_gige_device dead;
    // owner: reader
    struct picture held; // what the capture's data lies in
    uint8_t *pixels;     // converted; NULL: never needed
    char name[32];
    // shared
    struct gn_mutex mu;
    struct picture newest; // guarded by mu
    ArvStream *stream;     // guarded by mu: buffers go back to it; NULL while the camera is lost
    uint64_t opening;      // guarded by mu
    struct gn_error news;  // guarded by mu; "": none
    struct setting *asked; // guarded by mu: not begun yet; NULL: none
    struct gn_cond answered;
    struct gn_source_counts counts;      // guarded by mu
    uint64_t stream_lost, stream_resent; // guarded by mu: of the openings before this one
};

/** Gives a buffer back to the stream that it belongs to. */
static void return_buffer_locked(struct gige *s, struct picture *p) GN_REQUIRES(s->mu)
{
    if (p->buffer && s->stream && p->opening == s->opening)
        arv_stream_push_buffer(s->stream, p->buffer);
    else if (p->buffer)
        g_object_unref(p->buffer);
    p->buffer = NULL;
}

static void wake_reader(struct gige *s)
{
    uint64_t one = 1;
    (void)!write(s->head.fd, &one, sizeof(one));
}

static void tell(struct gige *s, const char *text)
{
    gn_mutex_lock(&s->mu);
    gn_error_set(&s->news, 0, "camera %s: %s", s->id, text);
    gn_mutex_unlock(&s->mu);
    wake_reader(s);
}

/** Whether a buffer holds the whole picture that was agreed on: nothing of a camera is believed. */
static bool is_whole(const struct gige *s, ArvBuffer *buffer)
{
    if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS)
        return false;
    ArvBufferPayloadType type = arv_buffer_get_payload_type(buffer);
    if (type != ARV_BUFFER_PAYLOAD_TYPE_IMAGE &&
        type != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA)
        return false;
    size_t size = 0;
    const void *data = arv_buffer_get_image_data(buffer, &size);
    return data && size >= s->picture_bytes &&
           arv_buffer_get_image_pixel_format(buffer) == s->format->code &&
           arv_buffer_get_image_width(buffer) == s->width &&
           arv_buffer_get_image_height(buffer) == s->height;
}

/**
 * When the exposure ended: no packet leaves before. Aravis notes g_get_real_time() at the first
 * packet; the camera's clock smooths that (device_clock.h).
 */
static int64_t get_end_ns(struct gige *s, ArvBuffer *buffer)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    int64_t age_ns = gn_clock_get_realtime_ns() - (int64_t)arv_buffer_get_system_timestamp(buffer);
    if (age_ns < 0 || age_ns > GN_NS_PER_S) // the wall clock was set meanwhile
        age_ns = 0;
    return gn_device_clock_map(&s->clock, gn_gige_device_get_stamp(&s->device, buffer),
                               now_ns - age_ns);
}

/** Pictures between the last and this of which not a packet came. Ids count up from 1, those of 16
 * bits begin again after 65535 (GigE Vision 2.0, 24). */
static uint64_t count_gap(struct gige *s, uint64_t id)
{
    uint64_t last = s->frame_id;
    s->frame_id = id;
    if (last == 0 || id == 0)
        return 0;
    if (id <= last && last <= 65535) // it began again
        id += 65535;
    uint64_t gap = id - last - 1;
    return gap < 1000 ? gap : 0; // else it counts in another way
}

/** Takes what Aravis has filled: the newest whole picture replaces an unread one. */
static void take_buffer(struct gige *s, ArvBuffer *buffer)
{
    bool is_good = is_whole(s, buffer);
    struct picture p = {.buffer = buffer};
    if (is_good) { // its time is the middle of the exposure
        p.exposure_us = gn_gige_device_get_exposure(&s->device, buffer);
        double exposure_us = p.exposure_us > 0 ? p.exposure_us : s->device.exposure_us;
        p.time_ns = get_end_ns(s, buffer) - (int64_t)(exposure_us * 500);
    }
    uint64_t n_lost = count_gap(s, arv_buffer_get_frame_id(buffer));
    gn_mutex_lock(&s->mu);
    p.opening = s->opening;
    s->counts.n_lost += n_lost;
    if (is_good) {
        s->counts.n_complete++;
        s->counts.n_skipped += s->newest.buffer != NULL;
        return_buffer_locked(s, &s->newest);
        s->newest = p;
    } else {
        s->counts.n_incomplete++;
        return_buffer_locked(s, &p);
    }
    gn_mutex_unlock(&s->mu);
    if (is_good)
        wake_reader(s);
}

/** Silence after which a camera counts as lost. */
static int64_t get_silence_ns(const struct gn_gige_device *d)
{
    double frame_ns = d->frame_rate_hz > 0 ? 1e9 / d->frame_rate_hz : (double)UNKNOWN_FRAME_NS;
    frame_ns = fmax(frame_ns, d->exposure_us * 1e3);
    return (int64_t)fmin(fmax(GN_SOURCE_MISSING_FRAMES * frame_ns, (double)LEAST_SILENCE_NS), 1e12);
}

/** Adds up what the stream says of its packets. */
static void count_packets_locked(struct gige *s) GN_REQUIRES(s->mu)
{
    guint64 n_resent = 0, n_lost = 0;
    if (s->stream)
        arv_gv_stream_get_statistics(ARV_GV_STREAM(s->stream), &n_resent, &n_lost);
    s->counts.n_resent_packets = s->stream_resent + n_resent;
    s->counts.n_lost_packets = s->stream_lost + n_lost;
}

static void bury(void *context)
{
    gn_gige_device_close(context);
}

/** The camera is silent: lets go of it, in a thread of its own since it does not answer. */
static void lose(struct gige *s)
{
    gn_mutex_lock(&s->mu);
    count_packets_locked(s);
    s->stream_lost = s->counts.n_lost_packets;
    s->stream_resent = s->counts.n_resent_packets;
    s->stream = NULL;
    gn_mutex_unlock(&s->mu);
    gn_thread_join(&s->undertaker);
    s->dead = s->device;
    memset(&s->device, 0, sizeof(s->device));
    if (gn_thread_start(&s->undertaker, "gn-gige-end", bury, &s->dead) < 0)
        bury(&s->dead);
}

/** Does what the reader asks for. Returns whether something was asked. */
static bool answer_setting(struct gige *s)
{
    gn_mutex_lock(&s->mu);
    struct setting *asked = s->asked;
    s->asked = NULL;
    gn_mutex_unlock(&s->mu);
    if (!asked)
        return false;
    if (asked->what == SETTING_HOLD)
        asked->err = gn_gige_exposure_hold(&s->device, s->id, asked->unit, &s->noted, &asked->range,
                                           &asked->error);
    else if (asked->what == SETTING_SET)
        asked->err =
            gn_gige_exposure_set(&s->device, s->id, asked->value, &asked->range.now, &asked->error);
    else
        asked->err = gn_gige_exposure_restore(&s->device, s->id, &s->noted, &asked->error);
    if (asked->what == SETTING_SET && !asked->err)
        s->options.exposure_us = asked->range.now; // what it has when it was lost and is back
    gn_mutex_lock(&s->mu);
    asked->is_done = true;
    gn_cond_signal(&s->answered);
    gn_mutex_unlock(&s->mu);
    return true;
}

/** Reads pictures until the camera is silent or the source ends. */
static void stream_pictures(struct gige *s)
{
    int64_t limit_ns = get_silence_ns(&s->device), silent_ns = 0;
    int64_t left_ns = limit_ns > FIRST_PICTURE_NS ? limit_ns : FIRST_PICTURE_NS;
    while (!atomic_load(&s->is_ending)) {
        if (answer_setting(s)) { // the picture that is on its way may be as long as the one before
            int64_t before_ns = limit_ns;
            limit_ns = get_silence_ns(&s->device);
            left_ns = limit_ns > before_ns ? limit_ns : before_ns;
            silent_ns = 0;
        }
        int64_t begin_ns = gn_clock_get_monotonic_ns();
        ArvBuffer *buffer = arv_stream_timeout_pop_buffer(s->device.stream, TICK_US);
        int64_t waited_ns = gn_clock_get_monotonic_ns() - begin_ns;
        if (buffer) {
            take_buffer(s, buffer);
            silent_ns = 0;
            left_ns = limit_ns;
            continue;
        }
        // Where we were stopped ourselves for longer, the camera is not to blame.
        silent_ns += waited_ns < 2 * TICK_US * GN_NS_PER_US ? waited_ns : TICK_US * GN_NS_PER_US;
        if (silent_ns > left_ns) {
            char text[128];
            snprintf(text, sizeof(text), "lost: no picture for %.2f s; waiting for it to come back",
                     (double)left_ns * 1e-9);
            tell(s, text);
            return;
        }
    }
}

/** Publishes a camera that was opened. */
static void begin_opening(struct gige *s)
{
    memset(&s->clock, 0, sizeof(s->clock));
    s->frame_id = 0;
    gn_mutex_lock(&s->mu);
    s->opening++;
    s->stream = s->device.stream;
    gn_mutex_unlock(&s->mu);
}

/** Tries once; the camera has just answered. */
static bool reopen(struct gige *s, struct gn_error *error)
{
    struct gn_live_options options = s->options;
    struct gn_gige_device device = {0};
    options.width = s->width; // whatever it was set to: a camera that was switched off forgets
    options.height = s->height;
    options.pixel_format = s->format->name;
    if (gn_gige_device_open(&s->place, &options, 0, &device, error) < 0)
        return false;
    s->device = device;
    begin_opening(s);
    return true;
}

/** Waits for the camera's return. */
static void wait_for_camera(struct gige *s)
{
    struct gn_error error = {0};
    char said[sizeof(error.text)] = "";
    int64_t search_ns = gn_clock_get_monotonic_ns() + SEARCH_NS;
    while (!atomic_load(&s->is_ending)) {
        bool is_there = gn_gige_place_answers(&s->place);
        if (!is_there && gn_clock_get_monotonic_ns() > search_ns) {
            struct gn_gige_place place = {0};
            is_there = gn_gige_place_find(s->id, &place, &error) == 0;
            if (is_there)
                s->place = place;
            search_ns = gn_clock_get_monotonic_ns() + SEARCH_NS;
        }
        if (is_there && reopen(s, &error)) {
            gn_mutex_lock(&s->mu);
            s->counts.n_reopened++;
            gn_mutex_unlock(&s->mu);
            tell(s, "back");
            return;
        }
        // Why a camera that answers cannot be used is said once.
        if (is_there && strcmp(said, error.text) != 0) {
            snprintf(said, sizeof(said), "%s", error.text);
            tell(s, strstr(error.text, ": ") ? strstr(error.text, ": ") + 2 : error.text);
        }
        g_usleep(TICK_US);
    }
}

static void run(void *context)
{
    struct gige *s = context;
    while (!atomic_load(&s->is_ending)) {
        stream_pictures(s);
        if (atomic_load(&s->is_ending))
            break;
        lose(s);
        wait_for_camera(s);
    }
}

/** Takes the newest picture, or news, or nothing. As gn_source_read, without waiting. */
static int take_newest(struct gige *s, struct gn_error *out_error)
{
    int got = -EAGAIN;
    uint64_t n;
    (void)!read(s->head.fd, &n, sizeof(n));
    gn_mutex_lock(&s->mu);
    if (s->news.text[0]) {
        gn_error_set(out_error, got, "%s", s->news.text);
        s->news.text[0] = '\0';
        if (s->newest.buffer)
            wake_reader(s);
    } else if (s->newest.buffer) {
        return_buffer_locked(s, &s->held);
        s->held = s->newest;
        s->newest.buffer = NULL;
        got = 1;
    }
    gn_mutex_unlock(&s->mu);
    return got;
}

static int gige_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    struct gige *s = (struct gige *)source;
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
    struct gige *s = (struct gige *)(uintptr_t)source;
    gn_mutex_lock(&s->mu);
    count_packets_locked(s);
    *out = s->counts;
    gn_mutex_unlock(&s->mu);
}

/** Has the thread do it, and waits. */
static int ask(struct gige *s, struct setting *setting, struct gn_error *out_error)
{
    gn_mutex_lock(&s->mu);
    s->asked = setting;
    // Waits are counted, not time: this thread is not alone where the machine stood still. What was
    // begun must end: the answer lies here.
    for (int i = 0; !setting->is_done && (i < SETTING_TICKS || s->asked != setting); i++)
        (void)!gn_cond_wait_until(&s->answered, &s->mu,
                                  gn_clock_get_monotonic_ns() + TICK_US * GN_NS_PER_US);
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
    struct setting setting = {.what = SETTING_HOLD, .unit = unit};
    int err = ask((struct gige *)source, &setting, out_error);
    if (!err)
        *out = setting.range;
    return err;
}

static int gige_set_exposure(struct gn_source *source, double value, double *out_value,
                             struct gn_error *out_error)
{
    struct setting setting = {.what = SETTING_SET, .value = value};
    int err = ask((struct gige *)source, &setting, out_error);
    if (!err)
        *out_value = setting.range.now;
    return err;
}

static int gige_restore_exposure(struct gn_source *source, struct gn_error *out_error)
{
    struct setting setting = {.what = SETTING_RESTORE};
    return ask((struct gige *)source, &setting, out_error);
}

static void gige_close(struct gn_source *source)
{
    struct gige *s = (struct gige *)source;
    atomic_store(&s->is_ending, true);
    gn_thread_join(&s->thread);
    gn_thread_join(&s->undertaker);
    gn_mutex_lock(&s->mu);
    s->stream = NULL; // buffers are freed, not returned
    return_buffer_locked(s, &s->held);
    return_buffer_locked(s, &s->newest);
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
static int prepare(struct gige *s, struct gn_error *out_error)
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
    begin_opening(s);
    if (gn_thread_start(&s->thread, "gn-gige", run, s) < 0)
        return gn_error_set(out_error, -EAGAIN, "camera %s: cannot start its thread", s->id);
    return 0;
}

int gn_gige_open(const struct gn_live_options *options, struct gn_source **out_source,
                 struct gn_error *out_error)
{
    *out_source = NULL;
    struct gige *s = calloc(1, sizeof(*s));
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
        const char *id = arv_interface_get_device_id(gv, i);
        const char *model = arv_interface_get_device_model(gv, i);
        const char *address = arv_interface_get_device_address(gv, i);
        found(context, id ? id : "?", model ? model : "?", address ? address : "?");
    }
    return (int)n;
}
