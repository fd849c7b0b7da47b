/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A V4L2 driver in memory: honest until a test makes it lie. Its clock stands still but for
 * waiting.
 */
#ifndef GN_TESTS_UNIT_V4L2_FAKE_H
#define GN_TESTS_UNIT_V4L2_FAKE_H

#include <stdbool.h>

#include <linux/videodev2.h>

#include "client/capture/v4l2_io.h"

enum { GN_FAKE_BUFFERS = 40, GN_FAKE_CONTROLS = 8 };

/** A control and its value. */
struct gn_fake_control {
    struct v4l2_queryctrl query; // id 0: end of the list
    int value;
};

/** The driver. Caller's memory. */
struct gn_fake {
    struct gn_v4l2_io io;
    bool is_gone;            // unplugged
    const char *driver;      // what it calls itself
    const char *card;        // and the camera
    const uint32_t *formats; // 0 at the end
    uint32_t width, height;  // of pictures now
    uint32_t max_width;      // sizes offered: 320x240 and up to this, times 4:3
    struct v4l2_pix_format pix;
    uint32_t interval_ms;
    struct gn_fake_control controls[GN_FAKE_CONTROLS];
    int64_t now_ns;
    /* What a test makes of it. */
    int fail_open, fail_format, fail_buffers, fail_dequeue; // negative errnos
    int wait_events;                                        // added to what poll() tells
    void (*bend_format)(struct v4l2_pix_format *pix);
    uint32_t n_given; // buffers granted; 0: as many as asked
    uint32_t length;  // of a buffer as it is said; 0: the truth
    bool is_endless;  // lists and filled buffers have no end
    bool has_event;
    bool is_silent; // about its rates
    /* What the tests look at. */
    int n_open, n_mapped, n_opened, n_streaming;
    uint8_t *memory[GN_FAKE_BUFFERS]; // of exactly pix.sizeimage bytes
    bool is_queued[GN_FAKE_BUFFERS];
    struct v4l2_buffer filled[GN_FAKE_BUFFERS]; // in order
    int n_filled;
};

/** A camera named "Fake" with YUYV, 640x480 at 25 Hz, an exposure time and a gain. */
void gn_fake_init(struct gn_fake *fake);
/** Frees its memory; everything must have been closed. */
void gn_fake_finish(struct gn_fake *fake);

/**
 * Fills a queued buffer with the byte value (or with n bytes of data), taken now. Returns what the
 * test may bend before it is read.
 */
struct v4l2_buffer *gn_fake_fill(struct gn_fake *fake, uint32_t sequence, int value);

/** The control with that number. */
struct gn_fake_control *gn_fake_get_control(struct gn_fake *fake, uint32_t id);
/** Adds one to the end of the list. */
struct gn_fake_control *gn_fake_add_control(struct gn_fake *fake, uint32_t id, const char *name,
                                            int minimum, int maximum, int value);

#endif
