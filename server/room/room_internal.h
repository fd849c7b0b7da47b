/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The inside of a room, for the files of this folder only. One lock, mu, held for copies of values
 * only: never over rendering, decoding, posting or memory of a size that a peer chose.
 */
#ifndef GN_SERVER_ROOM_ROOM_INTERNAL_H
#define GN_SERVER_ROOM_ROOM_INTERNAL_H

#include "common/clock.h"
#include "common/thread.h"
#include "server/room/frame.h"
#include "server/room/poses.h"
#include "server/room/probes.h"
#include "server/room/room.h"
#include "server/room/scheduler.h"
#include "server/room/screens.h"

/** Somebody who looked at a picture this recently wants the next one. */
#define GN_ROOM_LOOK_NS (5 * GN_NS_PER_S)

/** Most sessions of a room that get lighting states; one more is not let in. */
#define GN_ROOM_MAX_SUBSCRIBERS 64

struct gn_room_session {
    struct gn_room *room;
    struct gn_room_session *next; // guarded by room->mu
    uint64_t id;
    enum gn_msg_role role;
    bool want_lighting_states, want_lighting_maps;
    int slot; // in the scheduler, -1: no viewer

    // owner: the thread that joined
    bool has_camera[GN_LIMIT_VIEWS];
    struct gn_camera cameras[GN_LIMIT_VIEWS];
    bool has_pose;
    struct gn_pose world_from_camera;
    uint64_t last_frame_id, last_environment_sequence, last_emitter_sequence;

    bool was_clipped; // guarded by room->mu: a frame of it was, and the log says so
    bool was_doubled; // guarded by room->mu: another probe was in its place, and the log says so
    bool was_told; // guarded by room->mu: it was sent the lighting states there were, or is about
                   // to be
    struct gn_session_figures figures; // guarded by room->mu
};

/** How far a probe's light has come. */
struct gn_reached {
    uint64_t stream, sequence;
};

struct gn_room {
    struct gn_room_options options; // its strings are those below, or NULL
    char name[64];
    char node[64];
    struct gn_scene *scene;       // owned, immutable
    struct gn_render_needs needs; // what its frames use of a lighting state
    struct gn_frame_maker *maker; // owner: render thread while it runs
    struct gn_pose *render_poses; // [n_movable], owned; owner: render thread while it runs
    struct gn_emitters *emitters; // owned; owner: light thread while it runs
    struct gn_thread light_thread;
    struct gn_thread render_thread;

    struct gn_mutex mu;
    struct gn_cond light_wake;  // a frame has come, or somebody wants light
    struct gn_cond render_wake; // a frame has come, or light
    bool is_stopping;           // guarded by mu, as all below
    struct gn_room_session *sessions;
    int n_viewers, n_probes, n_screens, n_trackers, n_subscribers;
    struct gn_scheduler *scheduler;
    struct gn_probes probes;
    struct gn_screens screens;
    struct gn_poses poses;
    bool is_light_stale;             // a probe has left: the others' lights are to be joined anew;
                                     // or the scene's own light is not shown yet
    bool has_failed_to_complete;     // a light that lacks what somebody could use stays as it is
    struct gn_lighting_state *light; // a reference, of all probes; NULL: none yet
    int wanted_lights;               // that light is made in; 0: as the options say
    int n_reached;                   // probes whose light is in `light`
    struct gn_reached reached[GN_PROBES_MAX];
    int64_t light_asked_ns, composite_asked_ns; // when the page last looked; 0: never
    struct gn_snapshot *composite;              // a reference; NULL: nobody looks
    struct gn_room_figures figures;
    struct gn_time_window latency_ms;
    struct gn_time_window busy_ms;
    struct gn_time_window vga_ms; // busy time scaled to 640 x 480
};

/** Thread functions; context is the room. */
void gn_room_run_light(void *context);
void gn_room_run_render(void *context);

/** Posts the job's answer as DROPPED and counts it; lets go of the job. */
void gn_room_drop(struct gn_room *room, struct gn_frame_job *job, enum gn_msg_drop_reason reason,
                  const char *sentence);

/** The session of that id, or NULL. */
struct gn_room_session *gn_room_find_locked(struct gn_room *room, uint64_t id)
    GN_REQUIRES(room->mu);

#endif
