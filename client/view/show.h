/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon view --window: what comes back, shown as it comes, with keys for what is seen and kept.
 * gn_show_pump is called between any two waits; it draws where something has changed and never
 * waits itself. Thread-safety: owner thread, the process's main thread.
 */
#ifndef GN_CLIENT_VIEW_SHOW_H
#define GN_CLIENT_VIEW_SHOW_H

#include <stdbool.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "client/lib/gnomon.h"
#include "common/error.h"
#include "common/pose.h"
#include "proto/attr.h"

/** Longest wait between two calls of gn_show_pump for a window that answers at once, ms. */
#define GN_SHOW_TICK_MS 15

struct gn_show_options {
    int width, height; // of the pictures, px
    const char *dir;   // for screenshots and recordings, which exists; NULL: the working folder
    bool no_virtual;   // at first
    bool no_shadow;    // at first
};

enum gn_show_state {
    GN_SHOW_LIVE = 0,
    GN_SHOW_WAITING, // for something that is to be expected
    GN_SHOW_TROUBLE, // stands out
};

/** What the command has counted. */
struct gn_show_counts {
    long n_sent, n_results, n_dropped, n_lost;
    const struct gn_source_counts *source; // borrowed for the call; NULL: no camera
};

struct gn_show;

/** Opens the window, which is seen from the first pump on. Returns 0, or a negative errno and a
 * sentence: -ENODEV (no display), -ENOSYS (built without windows), -ENOMEM. options->dir is
 * borrowed until close. */
GN_MUST_USE int gn_show_open(const struct gn_show_options *options, struct gn_show **out_show,
                             struct gn_error *out_error);
/** Ends a recording, too. NULL-safe; nulls *show. */
void gn_show_close(struct gn_show **show);

/** The room that shows in the title. Copied. */
void gn_show_set_room(struct gn_show *show, const char *room);

/** Takes keys and draws. False: the person wants to end. */
bool gn_show_pump(struct gn_show *show);

/** What the next frame shall ask for. */
void gn_show_set_wishes(const struct gn_show *show, struct gn_msg_frame *frame);

/** The pose of the frame that was sent last. */
void gn_show_put_pose(struct gn_show *show, const struct gn_pose *world_from_camera);
void gn_show_put_counts(struct gn_show *show, const struct gn_show_counts *counts);
/** The first view of a result. What cannot be shown is said in the window. */
void gn_show_take_result(struct gn_show *show, const struct gn_msg_result *result,
                         const uint8_t *payload, double latency_ms);
void gn_show_take_dropped(struct gn_show *show, const char *why);
void gn_show_take_light(struct gn_show *show, const struct gn_msg_lighting_state *state,
                        const uint8_t *payload, size_t payload_bytes);

/** Until the next call, in the title and at the foot; sentence: "" where all is well. */
void gn_show_set_state(struct gn_show *show, enum gn_show_state state, const char *sentence);

#endif
