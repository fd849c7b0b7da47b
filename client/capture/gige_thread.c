/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The thread that takes whole pictures from Aravis, keeps the newest, and opens the camera again
 * when it is lost. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <arv.h>

#include "client/capture/gige_private.h"
#include "common/clock.h"

/** A camera that was just started may take so long for its first picture. */
#define FIRST_PICTURE_NS (2 * GN_NS_PER_S)
/** Least silence before a camera counts as lost: opening it again takes about as long. */
#define LEAST_SILENCE_NS (500 * GN_NS_PER_MS)
/** Longest exposure that is believed: an hour. */
#define MAX_EXPOSURE_US 3.6e9
/** Frame time of a camera that does not say its own. */
#define UNKNOWN_FRAME_NS GN_NS_PER_S
/** So many pictures in a row that are not whole are worth a word. */
#define MANY_BAD 10
/** How often a lost camera is looked for everywhere: it may have another address now. */
#define SEARCH_NS (5 * GN_NS_PER_S)

/** Gives a buffer back to the stream that it belongs to. */
void gn_gige_return_buffer_locked(struct gn_gige *s, struct gn_gige_picture *p)
{
    if (p->buffer && s->stream && p->opening == s->opening)
        arv_stream_push_buffer(s->stream, p->buffer);
    else if (p->buffer)
        g_object_unref(p->buffer);
    p->buffer = NULL;
}

void gn_gige_wake_reader(struct gn_gige *s)
{
    uint64_t one = 1;
    (void)!write(s->head.fd, &one, sizeof(one));
}

static void tell(struct gn_gige *s, const char *text)
{
    gn_mutex_lock(&s->mu);
    gn_error_set(&s->news, 0, "camera %s: %s", s->id, text);
    gn_mutex_unlock(&s->mu);
    gn_gige_wake_reader(s);
}

/** Whether a buffer holds the whole picture that was agreed on: nothing of a camera is believed. */
static bool is_whole(const struct gn_gige *s, ArvBuffer *buffer)
{
    if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS)
        return false;
    ArvBufferPayloadType type = arv_buffer_get_payload_type(buffer);
    if (type != ARV_BUFFER_PAYLOAD_TYPE_IMAGE &&
        type != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA)
        return false;
    size_t size = 0;
    const void *data = arv_buffer_get_image_data(buffer, &size);
    // Aravis adds up what packets say that they hold, also beyond the buffer, and would look for
    // chunks there.
    return data && size >= s->picture_bytes && size <= s->device.payload_bytes &&
           arv_buffer_get_image_pixel_format(buffer) == s->format->code &&
           arv_buffer_get_image_width(buffer) == s->width &&
           arv_buffer_get_image_height(buffer) == s->height;
}

/**
 * When the exposure ended: no packet leaves before. Aravis notes g_get_real_time() at the first
 * packet; the camera's clock smooths that (device_clock.h).
 */
static int64_t get_end_ns(struct gn_gige *s, ArvBuffer *buffer)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    int64_t age_ns = gn_clock_get_realtime_ns() - (int64_t)arv_buffer_get_system_timestamp(buffer);
    if (age_ns < 0 || age_ns > GN_NS_PER_S) // the wall clock was set meanwhile
        age_ns = 0;
    return gn_device_clock_map(&s->clock, gn_gige_device_get_stamp(&s->device, buffer),
                               now_ns - age_ns);
}

/** The middle of the exposure; its end where that would be before the picture before it, which was
 * over by then: an exposure time that was just set holds from a later picture on, or is a lie. */
static int64_t get_middle_ns(struct gn_gige *s, ArvBuffer *buffer, double said_us)
{
    double exposure_us = said_us > 0 ? said_us : s->device.exposure_us;
    int64_t end_ns = get_end_ns(s, buffer);
    int64_t middle_ns = end_ns - (int64_t)(500 * fmin(fmax(exposure_us, 0), MAX_EXPOSURE_US));
    s->given_ns = middle_ns > s->given_ns ? middle_ns : end_ns;
    return s->given_ns;
}

/** Pictures between the last and this of which not a packet came. Ids count up from 1, those of 16
 * bits begin again after 65535 (GigE Vision 2.0, 24). */
static uint64_t count_gap(struct gn_gige *s, uint64_t id)
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

/** Says once what is wrong with pictures that come and cannot be used. */
static void tell_fault(struct gn_gige *s, ArvBuffer *buffer)
{
    char text[256];
    if (s->has_told_fault)
        return;
    if (arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS) {
        size_t n_bytes = 0;
        (void)arv_buffer_get_data(buffer, &n_bytes);
        snprintf(
            text, sizeof(text),
            "its pictures are no longer %dx%d %s in %zu bytes, as was set, but %dx%d of format "
            "0x%08x in %zu; such are counted as incomplete and not used",
            s->width, s->height, s->format->name, s->device.payload_bytes,
            arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer),
            arv_buffer_get_image_pixel_format(buffer), n_bytes);
    } else if (s->n_bad >= MANY_BAD && gn_clock_get_monotonic_ns() - s->whole_ns > FIRST_PICTURE_NS)
        snprintf(text, sizeof(text),
                 "none of the last %d pictures is whole: packets get lost (docs/capture.md, "
                 "\"Losses\", says what helps)",
                 s->n_bad);
    else
        return;
    s->has_told_fault = true;
    tell(s, text);
}

/** The first picture of an opening: the camera is there. */
static void begin_pictures(struct gn_gige *s)
{
    s->has_begun = true;
    if (!s->lost_why)
        return;
    s->lost_why = NULL;
    gn_mutex_lock(&s->mu);
    s->counts.n_reopened++;
    gn_mutex_unlock(&s->mu);
    tell(s, "back");
}

/** Takes what Aravis has filled: the newest whole picture replaces an unread one. */
static void take_buffer(struct gn_gige *s, ArvBuffer *buffer)
{
    bool is_good = is_whole(s, buffer);
    struct gn_gige_picture p = {.buffer = buffer};
    if (is_good) {
        p.exposure_us = gn_gige_device_get_exposure(&s->device, buffer);
        p.time_ns = get_middle_ns(s, buffer, p.exposure_us);
    }
    uint64_t n_lost = count_gap(s, arv_buffer_get_frame_id(buffer));
    if (!s->has_begun)
        begin_pictures(s);
    s->n_bad = is_good ? 0 : s->n_bad + 1;
    if (is_good)
        s->whole_ns = gn_clock_get_monotonic_ns();
    else
        tell_fault(s, buffer);
    gn_mutex_lock(&s->mu);
    p.opening = s->opening;
    s->counts.n_lost += n_lost;
    if (is_good) {
        s->counts.n_complete++;
        s->counts.n_skipped += s->newest.buffer != NULL;
        gn_gige_return_buffer_locked(s, &s->newest);
        s->newest = p;
    } else {
        s->counts.n_incomplete++;
        gn_gige_return_buffer_locked(s, &p);
    }
    gn_mutex_unlock(&s->mu);
    if (is_good)
        gn_gige_wake_reader(s);
}

/** Silence after which a camera counts as lost. */
static int64_t get_silence_ns(const struct gn_gige *s)
{
    const struct gn_gige_device *d = &s->device;
    int64_t least_ns = s->has_begun ? LEAST_SILENCE_NS : FIRST_PICTURE_NS;
    double frame_ns = d->frame_rate_hz > 0 ? 1e9 / d->frame_rate_hz : (double)UNKNOWN_FRAME_NS;
    frame_ns = fmax(frame_ns, d->exposure_us * 1e3);
    return (int64_t)fmin(fmax(GN_SOURCE_MISSING_FRAMES * frame_ns, (double)least_ns), 1e13);
}

/** Adds up what the stream says of its packets. */
void gn_gige_count_packets_locked(struct gn_gige *s)
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

/** Lets go of the camera; in a thread of its own where it does not answer any more. */
static void lose(struct gn_gige *s)
{
    gn_mutex_lock(&s->mu);
    gn_gige_count_packets_locked(s);
    s->stream_lost = s->counts.n_lost_packets;
    s->stream_resent = s->counts.n_resent_packets;
    s->stream = NULL;
    gn_mutex_unlock(&s->mu);
    gn_thread_join(&s->undertaker);
    s->dead = s->device;
    memset(&s->device, 0, sizeof(s->device));
    // One that answers must know that it is free before it is opened again.
    if (gn_gige_place_answers(&s->place) ||
        gn_thread_start(&s->undertaker, "gn-gige-end", bury, &s->dead) < 0)
        bury(&s->dead);
}

/** Says why the camera is given up, where that is news. */
static void tell_lost(struct gn_gige *s, const char *why, int64_t silent_ns)
{
    char text[256];
    if (s->lost_why != why) {
        snprintf(text, sizeof(text), "lost: no picture for %.2f s%s", (double)silent_ns * 1e-9,
                 why);
        tell(s, text);
    }
    s->lost_why = why;
}

/** One more look: a camera that just answers may have been kept from its pictures as well. */
static bool has_picture_now(const struct gn_gige *s, bool answers)
{
    gint n_empty = 0, n_filled = 0;
    if (answers)
        g_usleep(GN_GIGE_TICK_US);
    arv_stream_get_n_buffers(s->device.stream, &n_empty, &n_filled);
    return n_filled > 0;
}

/**
 * Whether a camera that has been silent for so long is to be given up. One that waits for triggers
 * may be silent for ever: its heartbeat tells. *limit_ns: the silence that it may keep, which grows
 * where an automatic exposure has grown.
 */
static bool is_lost(struct gn_gige *s, int64_t silent_ns, int64_t *limit_ns)
{
    static const char silent[] = "; waiting for it to come back";
    static const char gone[] = "; it restarted or answers no more; waiting for it to come back";
    static const char kept_away[] = ", and not a packet of one, though it answers: a firewall, or "
                                    "packets too large for the network? Trying again";
    bool is_ours = gn_gige_device_is_ours(&s->device);
    if (is_ours && (s->device.is_triggered || silent_ns <= *limit_ns))
        return false;
    bool answers = is_ours && gn_gige_place_answers(&s->place);
    if (answers) {
        gn_gige_device_read_exposure(&s->device);
        *limit_ns = get_silence_ns(s);
        if (silent_ns <= *limit_ns)
            return false;
    }
    if (is_ours && has_picture_now(s, answers))
        return false;
    bool is_kept_away = answers && gn_gige_device_count_packets(&s->device) == 0;
    tell_lost(s, !is_ours ? gone : is_kept_away ? kept_away : silent, silent_ns);
    return true;
}

/** Does what the reader asks for. Returns whether something was asked. */
static bool answer_setting(struct gn_gige *s)
{
    gn_mutex_lock(&s->mu);
    struct gn_gige_setting *asked = s->asked;
    s->asked = NULL;
    gn_mutex_unlock(&s->mu);
    if (!asked)
        return false;
    bool was_held = s->noted.is_held;
    if (asked->what == GN_GIGE_HOLD)
        asked->err = gn_gige_exposure_hold(&s->device, s->id, asked->unit, &s->noted, &asked->range,
                                           &asked->error);
    else if (asked->what == GN_GIGE_SET)
        asked->err =
            gn_gige_exposure_set(&s->device, s->id, asked->value, &asked->range.now, &asked->error);
    else
        asked->err = gn_gige_exposure_restore(&s->device, s->id, &s->noted, &asked->error);
    if (asked->what == GN_GIGE_HOLD && !asked->err)
        s->asked_us = s->options.exposure_us;
    else if (asked->what == GN_GIGE_SET && !asked->err)
        s->options.exposure_us = asked->range.now; // what it has when it was lost and is back
    else if (asked->what == GN_GIGE_RESTORE && was_held)
        s->options.exposure_us = s->asked_us;
    gn_mutex_lock(&s->mu);
    asked->is_done = true;
    gn_cond_signal(&s->answered);
    gn_mutex_unlock(&s->mu);
    return true;
}

/** Reads pictures until the camera is lost or the source ends. */
static void stream_pictures(struct gn_gige *s)
{
    int64_t limit_ns = get_silence_ns(s);
    int64_t silent_ns = 0; // ticks that ran out while all that had come was read
    while (!atomic_load(&s->is_ending)) {
        if (answer_setting(s)) { // the picture that is on its way may be as long as the one before
            int64_t after_ns = get_silence_ns(s);
            limit_ns = after_ns > limit_ns ? after_ns : limit_ns;
            silent_ns = 0;
        }
        ArvBuffer *buffer = arv_stream_timeout_pop_buffer(s->device.stream, GN_GIGE_TICK_US);
        if (buffer) {
            take_buffer(s, buffer);
            silent_ns = 0;
            limit_ns = get_silence_ns(s);
            continue;
        }
        // Each counts as one, however late this thread went on: the machine may stand still.
        if (gn_gige_device_has_read_all(&s->device))
            silent_ns += GN_GIGE_TICK_US * GN_NS_PER_US;
        if (is_lost(s, silent_ns, &limit_ns))
            return;
    }
}

/** Publishes a camera that was opened. */
void gn_gige_begin_opening(struct gn_gige *s)
{
    memset(&s->clock, 0, sizeof(s->clock));
    s->frame_id = 0;
    s->has_begun = s->has_told_fault = false;
    s->n_bad = 0;
    s->whole_ns = gn_clock_get_monotonic_ns();
    gn_mutex_lock(&s->mu);
    s->opening++;
    s->stream = s->device.stream;
    gn_mutex_unlock(&s->mu);
}

/** Tries once; the camera has just answered. */
static bool reopen(struct gn_gige *s, struct gn_error *error)
{
    struct gn_live_options options = s->options;
    struct gn_gige_device device = {0};
    options.width = s->width; // whatever it was set to: a camera that was switched off forgets
    options.height = s->height;
    options.pixel_format = s->format->name;
    if (gn_gige_device_open(&s->place, &options, 0, &device, error) < 0)
        return false;
    s->device = device;
    gn_gige_begin_opening(s);
    return true;
}

/** Waits until the camera can be opened again. */
static void wait_for_camera(struct gn_gige *s)
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
        if (is_there && reopen(s, &error))
            return;
        // Why a camera that answers cannot be used is said once.
        if (is_there && strcmp(said, error.text) != 0) {
            snprintf(said, sizeof(said), "%s", error.text);
            tell(s, strstr(error.text, ": ") ? strstr(error.text, ": ") + 2 : error.text);
        }
        g_usleep(GN_GIGE_TICK_US);
    }
}

void gn_gige_run(void *context)
{
    struct gn_gige *s = context;
    while (!atomic_load(&s->is_ending)) {
        stream_pictures(s);
        if (atomic_load(&s->is_ending))
            break;
        lose(s);
        wait_for_camera(s);
    }
}
