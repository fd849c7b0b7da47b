/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What a room remembers of each viewer's frames: the controller of their quality, and the error
 * that was found in the last ones, at a part of the pixels in each. Owner: the render thread.
 *
 * The number of lights that a budget leaves time for is a wish to the light thread, which makes its
 * next light in the number that the viewers want most; meanwhile, and for viewers who want fewer,
 * the renderer merges what there is. Lights made in a number are better than lights merged to it,
 * but making them waits for the probe's next frame.
 */
#ifndef GN_SERVER_ROOM_PACE_H
#define GN_SERVER_ROOM_PACE_H

#include "server/render/budget.h"
#include "server/room/room.h"
#include "server/room/scheduler.h"

/** One viewer's. */
struct gn_pace {
    uint64_t session_id; // 0: free
    uint64_t used;       // the frame that used it last
    struct gn_budget budget;
    bool no_virtual, no_shadow; // its last frame: what was spared is not to be learnt from
    int n_wanted;               // lights of each probe for its last frame; 0: all there can be
    // Of the last frames of this setting and size, by view and part of the pixels.
    struct gn_budget_setting setting;
    int width, height;
    struct gn_error_sums sums[GN_LIMIT_VIEWS][GN_ERROR_PARTS];
    uint64_t n_asked; // such frames
};

/** All viewers'; zeroed at first. */
struct gn_paces {
    uint64_t n_frames;
    struct gn_pace paces[GN_ROOM_MAX_VIEWERS];
};

/** One frame of a viewer. */
struct gn_pace_turn {
    struct gn_pace *pace;
    double budget_ms;                 // 0: none
    struct gn_budget_choice choice;   // where there is one; else the setting is zeroed
    struct gn_budget_outcome outcome; // sums over the views
    int part;                         // of the pixels that are asked for the error
};

/** Chooses what the job is rendered with, by the shorter of its budget and the room's. A viewer
 * that has rested longest is forgotten for a new one. */
void gn_pace_begin(struct gn_paces *paces, const struct gn_room_options *options,
                   const struct gn_frame_job *job, const struct gn_lighting_state *light,
                   struct gn_pace_turn *out_turn);
/** That, to each view's options. */
void gn_pace_set_options(const struct gn_pace_turn *turn, struct gn_render_options *options);
/** What a view took. */
void gn_pace_put_report(struct gn_pace_turn *turn, int view, const struct gn_render_report *report);
/** The frame is ready: the rest of its receipt, whose times are there. */
void gn_pace_end(struct gn_pace_turn *turn, const struct gn_frame_job *job, double busy_ms,
                 struct gn_msg_receipt *receipt);

/** Lights that the viewers of late have wanted most; 0: all that there can be. */
int gn_paces_get_wanted(const struct gn_paces *paces);

#endif
