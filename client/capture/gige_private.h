/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A GigE Vision source: what its reader (gige.c) and its thread (gige_thread.c) share.
 */
#ifndef GN_CLIENT_CAPTURE_GIGE_PRIVATE_H
#define GN_CLIENT_CAPTURE_GIGE_PRIVATE_H

#include <stdatomic.h>

#include "client/capture/device_clock.h"
#include "client/capture/gige_device.h"
#include "common/thread.h"

/** How long the thread waits in one call: for a picture, or for a sign of life. */
#define GN_GIGE_TICK_US 50000

/** A picture on its way from the thread to the reader. */
struct gn_gige_picture {
    struct _ArvBuffer *buffer; // ArvBuffer, owned; NULL: none
    int64_t time_ns;
    double exposure_us; // as the camera says with it; 0: it does not
    uint64_t opening;   // of which opening of the camera its buffer is
};

/** What the reader has the thread do with the exposure; the thread writes the answer. */
struct gn_gige_setting {
    enum { GN_GIGE_HOLD, GN_GIGE_SET, GN_GIGE_RESTORE } what;
    enum gn_exposure_unit unit;
    double value;
    struct gn_exposure range; // of HOLD; now: of SET, too
    int err;
    struct gn_error error;
    bool is_done; // guarded by mu
};

struct gn_gige {
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
    const char *lost_why;        // why the camera was lost; NULL: it is not
    bool has_begun;              // since this opening a picture came, whole or not
    bool has_told_fault;         // since then: what is wrong with them
    int n_bad;                   // pictures in a row that were not whole
    int64_t whole_ns;            // when the last whole one came, or the opening was
    struct gn_gige_noted noted;  // of the exposure, while it is held
    double asked_us;             // options.exposure_us, likewise
    int64_t given_ns;            // the last whole picture's time
    struct gn_thread undertaker; // closes what does not answer any more, which takes seconds
    struct gn_gige_device dead;
    // owner: reader
    struct gn_gige_picture held; // what the capture's data lies in
    uint8_t *pixels;             // converted; NULL: never needed
    char name[32];
    // shared
    struct gn_mutex mu;
    struct gn_gige_picture newest; // guarded by mu
    struct _ArvStream *stream;     // guarded by mu: where buffers go back; NULL while it is lost
    uint64_t opening;              // guarded by mu
    struct gn_error news;          // guarded by mu; "": none
    struct gn_gige_setting *asked; // guarded by mu: not begun yet; NULL: none
    struct gn_cond answered;
    struct gn_source_counts counts;      // guarded by mu
    uint64_t stream_lost, stream_resent; // guarded by mu: of the openings before this one
};

/** Gives a buffer back to the stream that it belongs to. */
void gn_gige_return_buffer_locked(struct gn_gige *s, struct gn_gige_picture *p) GN_REQUIRES(s->mu);

/** Adds up what the stream says of its packets. */
void gn_gige_count_packets_locked(struct gn_gige *s) GN_REQUIRES(s->mu);

/** Lets the reader's poll() return. */
void gn_gige_wake_reader(struct gn_gige *s);

/** Makes the device that was just opened the one whose pictures are read. */
void gn_gige_begin_opening(struct gn_gige *s);

/** The thread "gn-gige"; context: struct gn_gige. Ends when is_ending is set. */
void gn_gige_run(void *context);

#endif
