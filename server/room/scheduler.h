/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Which frame a room renders next. Each viewer has one slot where the latest frame wins; slots take
 * turns. Pure: no threads, no clock, no memory but its own, so that tests give it any time.
 */
#ifndef GN_SERVER_ROOM_SCHEDULER_H
#define GN_SERVER_ROOM_SCHEDULER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/camera.h"
#include "proto/attr.h"
#include "server/room/mailbox.h"

/** Most viewers of a room. */
#define GN_ROOM_MAX_VIEWERS 64

/** One frame with all that its rendering needs. A value that owns payload and answer. */
struct gn_frame_job {
    struct gn_msg_frame frame;
    struct gn_camera cameras[GN_LIMIT_VIEWS]; // of the views, posed
    struct gn_buf *payload;                   // may be NULL: no pictures
    struct gn_note *answer; // taken before the frame is: an accepted frame can always be answered
    int64_t received_ns;    // when its last byte was read
    bool has_waited;        // gn_scheduler_take could have taken it but for its light
};

enum gn_scheduler_verdict {
    GN_SCHEDULER_NOTHING, // no frame may go now
    GN_SCHEDULER_RENDER,
    GN_SCHEDULER_NO_LIGHT, // its wait is over and there is no light at all: to be dropped
};

/** What is known of the light when a frame is to be chosen. */
struct gn_scheduler_light {
    bool is_there;
    uint64_t sequence;
    bool is_behind; // a newer one is on its way, of a frame that rested while nobody looked
};

/** Thread-safety: unsafe. */
struct gn_scheduler;

GN_MUST_USE int gn_scheduler_create(struct gn_scheduler **out_scheduler);
/** No frame may be left inside. NULL-safe; nulls *scheduler. */
void gn_scheduler_destroy(struct gn_scheduler **scheduler);

/** A slot for a viewer. Returns its index, or -EUSERS where all are taken. */
GN_MUST_USE int gn_scheduler_add(struct gn_scheduler *scheduler);
/** Gives the slot up; true: an unread frame was in it and is now in *out_job, the caller's. */
bool gn_scheduler_remove(struct gn_scheduler *scheduler, int slot, struct gn_frame_job *out_job);

/** Puts a frame in; true: it replaced an unread one, now in *out_superseded, the caller's. */
bool gn_scheduler_put(struct gn_scheduler *scheduler, int slot, const struct gn_frame_job *job,
                      struct gn_frame_job *out_superseded);

/**
 * Takes the next frame in turn whose light is there or whose wait is over. With NOTHING,
 * *out_deadline_ns is when a wait ends (INT64_MAX: none), else *out_job is the caller's.
 */
enum gn_scheduler_verdict gn_scheduler_take(struct gn_scheduler *scheduler, int64_t now_ns,
                                            struct gn_scheduler_light light,
                                            struct gn_frame_job *out_job, int64_t *out_deadline_ns);

#endif
