/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One frame from picture to result: decode, render, composite, encode. Owner: the render thread.
 */
#ifndef GN_SERVER_ROOM_FRAME_H
#define GN_SERVER_ROOM_FRAME_H

#include "common/error.h"
#include "proto/attr.h"
#include "server/light/state.h"
#include "server/render/render.h"
#include "server/room/room.h"
#include "server/room/scheduler.h"

/** Picture sizes whose buffers are kept: as many as a room's viewers usually have. */
#define GN_FRAME_KEPT_SIZES 4

/** Keeps what frames share. Thread-safety: unsafe. */
struct gn_frame_maker;

/** What is to be known of a frame that was made. */
struct gn_frame_outcome {
    enum gn_msg_drop_reason reason; // UNSPECIFIED: a result
    double busy_ms;
    double vga_ms;                     // busy_ms scaled by pixels to 640 x 480
    int wanted_lights;                 // that the viewers' budgets leave room for; 0: all
    bool is_refined;                   // a view held still: its times say nothing of others
    const struct gn_image8 *composite; // of the last view; the maker's until the next frame
    struct gn_error error;             // where there is a reason
};

/** options and scene are borrowed until destroy. Returns 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_frame_maker_create(const struct gn_room_options *options,
                                      const struct gn_scene *scene,
                                      struct gn_frame_maker **out_maker,
                                      struct gn_error *out_error);
/** Ends the frame at hand, and all later ones, soon: they are dropped. NULL-safe. Thread-safety:
 * safe, at any time until destroy. */
void gn_frame_maker_cancel(struct gn_frame_maker *maker);
/** NULL-safe; nulls *maker. */
void gn_frame_maker_destroy(struct gn_frame_maker **maker);

/**
 * The frames made from now on show the scene's movable objects at poses[n_movable]. On failure, 0
 * being success, they show them where they were.
 */
GN_MUST_USE int gn_frame_maker_pose(struct gn_frame_maker *maker, const struct gn_pose *poses,
                                    struct gn_error *out_error);

/**
 * Makes the job's result: fills job->answer and its payload, but does not post it. With a reason in
 * *out_outcome the answer is untouched. Takes memory only where a size is new.
 */
void gn_frame_maker_make(struct gn_frame_maker *maker, struct gn_frame_job *job,
                         struct gn_lighting_state *light, struct gn_frame_outcome *out_outcome);

#endif
