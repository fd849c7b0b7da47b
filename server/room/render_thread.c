/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The render thread: the viewers' newest frames, in turn, to results. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "common/log.h"
#include "server/room/frame.h"
#include "server/room/room_internal.h"

GN_LOG_TOPIC("room");

/** Where movable objects stand, as the frame maker has them. */
struct poses {
    uint64_t version;
    struct gn_pose *poses; // [n_movable], the room's
};

/** One turn: the frame, the light it is rendered in, and whether somebody looks. */
struct turn {
    enum gn_scheduler_verdict verdict;
    struct gn_frame_job job;
    struct gn_lighting_state *light; // a reference; NULL: none
    bool is_looked_at;
    bool has_moved; // since the last turn
};

/**
 * The sequence that frames may wait for: each probe counts its own, and the one that began last is
 * meant, a replay's say. While it has not lit the room, no sequence has been reached; where there
 * is none any light's counts.
 */
static uint64_t get_light_sequence_locked(struct gn_room *room) GN_REQUIRES(room->mu)
{
    if (!room->light)
        return 0;
    uint64_t newest = gn_probes_get_newest(&room->probes);
    for (int i = 0; i < room->n_reached; i++) {
        if (room->reached[i].stream == newest)
            return room->reached[i].sequence;
    }
    return newest ? 0 : room->light->sequence;
}

/** Waits for a frame whose turn it is. False: the room stops. */
static bool wait_for_turn(struct gn_room *room, struct poses *poses, struct turn *out)
{
    struct gn_snapshot *unseen = NULL;
    out->verdict = GN_SCHEDULER_NOTHING;
    out->light = NULL;
    out->has_moved = false;
    gn_mutex_lock(&room->mu);
    while (!room->is_stopping) {
        int64_t now_ns = gn_clock_get_monotonic_ns(), deadline_ns;
        struct gn_scheduler_light light = {room->light != NULL, get_light_sequence_locked(room),
                                           gn_probes_is_owing(&room->probes)};
        out->verdict = gn_scheduler_take(room->scheduler, now_ns, light, &out->job, &deadline_ns);
        if (out->verdict != GN_SCHEDULER_NOTHING) {
            out->light = room->light ? gn_lighting_state_ref(room->light) : NULL;
            out->has_moved = room->poses.version != poses->version;
            if (out->has_moved)
                memcpy(poses->poses, room->poses.poses,
                       (size_t)room->scene->n_movable * sizeof(*poses->poses));
            poses->version = room->poses.version;
            out->is_looked_at =
                room->composite_asked_ns > 0 && now_ns - room->composite_asked_ns < GN_ROOM_LOOK_NS;
            if (!out->is_looked_at) {
                unseen = room->composite;
                room->composite = NULL;
            }
            break;
        }
        if (deadline_ns == INT64_MAX)
            gn_cond_wait(&room->render_wake, &room->mu);
        else
            (void)gn_cond_wait_until(&room->render_wake, &room->mu, deadline_ns);
    }
    gn_mutex_unlock(&room->mu);
    gn_snapshot_unref(&unseen);
    return out->verdict != GN_SCHEDULER_NOTHING;
}

/** A copy of the composite for who looks; NULL where there is no memory: then they see none. */
static struct gn_snapshot *make_snapshot(const struct gn_frame_outcome *outcome, uint64_t frame_id)
{
    struct gn_snapshot *s = calloc(1, sizeof(*s));
    if (!s)
        return NULL;
    const struct gn_image8 *from = outcome->composite;
    if (gn_image8_init(&s->image, from->width, from->height, from->channels) < 0) {
        free(s);
        return NULL;
    }
    memcpy(s->image.data, from->data,
           (size_t)from->width * (size_t)from->height * (size_t)from->channels);
    atomic_init(&s->references, 1);
    s->frame_id = frame_id;
    s->time_ns = gn_clock_get_monotonic_ns();
    return s;
}

/** Counts a result, before it is posted: the job's answer is still ours. */
static void count_result(struct gn_room *room, const struct turn *turn,
                         const struct gn_frame_outcome *outcome)
{
    const struct gn_frame_job *job = &turn->job;
    const struct gn_msg_result *result = &job->answer->body.result;
    struct gn_snapshot *snapshot =
        turn->is_looked_at ? make_snapshot(outcome, job->frame.id) : NULL;
    double latency_ms = (double)(gn_clock_get_monotonic_ns() - job->received_ns) * 1e-6;

    gn_mutex_lock(&room->mu);
    struct gn_room_figures *f = &room->figures;
    f->frames_out++;
    gn_time_histogram_add(&f->busy, outcome->busy_ms);
    gn_time_window_add(&room->busy_ms, outcome->busy_ms);
    if (job->frame.quality != GN_MSG_QUALITY_REFERENCE && !outcome->is_refined)
        gn_time_window_add(&room->vga_ms, outcome->vga_ms);
    if (!job->has_waited) { // for light: that is not a slow frame
        gn_time_histogram_add(&f->latency, latency_ms);
        gn_time_window_add(&room->latency_ms, latency_ms);
    }
    if (result->receipt.has_budget) {
        f->budget_frames++;
        f->budget_misses += result->receipt.budget.busy_ms > result->receipt.budget.budget_ms;
    }
    room->wanted_lights = outcome->wanted_lights;
    f->has_receipt = true;
    f->last_receipt = result->receipt;
    f->last_width = (int)result->views[0].width;
    f->last_height = (int)result->views[0].height;
    struct gn_room_session *s = gn_room_find_locked(room, job->answer->session_id);
    if (s) {
        s->figures.frames_out++;
        s->figures.last_latency_ms = latency_ms;
    }
    if (snapshot) {
        struct gn_snapshot *old = room->composite;
        room->composite = snapshot;
        snapshot = old;
    }
    gn_mutex_unlock(&room->mu);
    gn_snapshot_unref(&snapshot);
}

static void take_turn(struct gn_room *room, struct gn_frame_maker *maker, struct turn *turn)
{
    struct gn_frame_job *job = &turn->job;
    if (turn->verdict == GN_SCHEDULER_NO_LIGHT) {
        gn_room_drop(room, job, GN_MSG_DROP_REASON_NO_LIGHTING,
                     job->frame.lighting_wait_ms > 0
                         ? "no probe has lit the room within the frame's lighting_wait_ms"
                         : "no probe has lit the room yet");
        return;
    }
    struct gn_frame_outcome outcome;
    gn_frame_maker_make(maker, job, turn->light, &outcome);
    if (outcome.reason != GN_MSG_DROP_REASON_UNSPECIFIED) {
        gn_room_drop(room, job, outcome.reason, outcome.error.text);
        return;
    }
    count_result(room, turn, &outcome);
    gn_buf_unref(&job->payload);
    gn_mailbox_post(room->options.mailbox, job->answer);
    job->answer = NULL;
}

/** Moves the objects to where they are said to stand. */
static void follow(struct gn_room *room, const struct poses *poses)
{
    static struct gn_log_limiter limiter = {.burst = 5, .interval_ns = 10 * GN_NS_PER_S};
    struct gn_error error = {0};
    if (gn_frame_maker_pose(room->maker, poses->poses, &error) < 0)
        gn_log_limited(&limiter, GN_LOG_WARN, "room %s: objects stay where they are: %s",
                       room->name, error.text);
}

void gn_room_run_render(void *context)
{
    struct gn_room *room = context;
    struct poses poses = {.poses = room->render_poses};
    struct turn turn;
    while (wait_for_turn(room, &poses, &turn)) {
        if (turn.has_moved)
            follow(room, &poses);
        take_turn(room, room->maker, &turn);
        gn_lighting_state_unref(&turn.light);
    }
}
