/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A room: one scene, one lighting state, the sessions that share them. Its light thread makes
 * lighting states from the newest environment frame, its render thread makes results from the
 * viewers' newest frames, in turn. Knows messages, but no sockets: answers leave by a mailbox.
 */
#ifndef GN_SERVER_ROOM_ROOM_H
#define GN_SERVER_ROOM_ROOM_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "server/light/state.h"
#include "server/render/render.h"
#include "server/room/figures.h"
#include "server/room/mailbox.h"

/** Most rooms of one server. */
#define GN_ROOMS_MAX 16

/** What a room is made from. Copied. */
struct gn_room_options {
    const char *name;                   // [1, 63] bytes
    const char *node;                   // the server's name, for LIGHTING_STATE
    const char *scene_path;             // of scene.json
    struct gn_light_options light;      // all-zero: defaults
    struct gn_radiance_map_options map; // all-zero: defaults
    struct gn_emitter_options emitters; // all-zero: defaults
    double environment_noise; // share by which radiance may differ in a frame that counts as the
                              // same, [0, 0.1]; 0: frames that are the same to the byte
    struct gn_render_options render; // quality and seed are each frame's own
    double budget_ms;                // of each frame, [0, 60000]; 0: none, or the frame's own
    bool encoded_multiply;           // the paper's composite: the factor scales codes
    unsigned unmatched;              // of enum gn_match_part: what of the cameras is not matched
    bool refuse_reference;           // frames of reference quality are dropped
    bool no_refining;                // views that hold still are rendered like any
    int max_picture_width, max_picture_height;         // px, [1, GN_LIMIT_SIDE_PX]
    int max_environment_width, max_environment_height; // px, [1, GN_LIMIT_SIDE_PX]
    double holdable_margin;     // share of the measured rate that is promised, (0, 1]
    struct gn_pool *pool;       // borrowed until destroy; may be NULL
    struct gn_mailbox *mailbox; // borrowed until destroy
};

/** Thread-safety: gn_room_join() to gn_room_put_...(): one thread; the rest: safe. */
struct gn_room;
/** One session's place in a room. Owner thread: the one that joined. */
struct gn_room_session;

/** How a session takes part. */
struct gn_room_member {
    uint64_t id;           // > 0, never used again
    enum gn_msg_role role; // PROBE, VIEWER, SCREEN or TRACKER
    const char *name;      // of the client; copied
    const char *peer;      // its address; copied
    bool want_lighting_states;
    bool want_lighting_maps;
    bool want_statistics; // only counted here: gn_room_get_statistics() makes them
};

/** Reads the scene and starts both threads. Returns 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_room_create(const struct gn_room_options *options, struct gn_room **out_room,
                               struct gn_error *out_error);
/** Waits for the frame that is being rendered. All sessions must have left. NULL-safe; nulls. */
void gn_room_destroy(struct gn_room **room);

/** Borrowed until destroy; immutable. */
const struct gn_room_options *gn_room_get_options(const struct gn_room *room);

/** Lets a session in. Returns 0, -EUSERS (full) or -ENOMEM, and a sentence. */
GN_MUST_USE int gn_room_join(struct gn_room *room, const struct gn_room_member *member,
                             struct gn_room_session **out_session, struct gn_error *out_error);
/** Its unread frame is forgotten; what is being rendered is posted and finds nobody. Nulls. */
void gn_room_leave(struct gn_room_session **session);

/**
 * The probe's newest environment frame replaces its unread one. Decoding is left to the light
 * thread, which posts an ERROR where the pixels are bad. payload: the caller's reference stays the
 * caller's. Returns 0, or -EINVAL and a sentence (sizes that do not fit, not built), -EUSERS
 * (GN_PROBES_MAX probes light the room), -EDOM (sequence not rising), -ENOMEM.
 */
GN_MUST_USE int gn_room_put_environment(struct gn_room_session *session,
                                        const struct gn_msg_environment_frame *frame,
                                        struct gn_buf *payload, struct gn_error *out_error);

/**
 * The newest picture of a stream replaces its unread one. Pixels are decoded by the light thread,
 * which posts an ERROR where they are bad, and publishes the light that is there with this near
 * light. payload: as above. Returns 0, -ENOENT and a sentence (no such stream), -EDOM (sequence not
 * rising).
 */
GN_MUST_USE int gn_room_put_emitter(struct gn_room_session *session,
                                    const struct gn_msg_emitter_frame *frame,
                                    struct gn_buf *payload, struct gn_error *out_error);

/** Sets a camera of the session. Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_room_put_camera(struct gn_room_session *session,
                                   const struct gn_msg_camera *camera, struct gn_error *out_error);

/**
 * Of an object: its pose from the next frame on that is begun; one that was captured no later than
 * the object's last is let go (0 all the same). Without a name: the pose that the viewer's views
 * without their own use. Returns 0, or -ENOENT (no such movable object), -EINVAL, -EOPNOTSUPP (a
 * tracker's without a name) and a sentence.
 */
GN_MUST_USE int gn_room_put_pose(struct gn_room_session *session, const struct gn_msg_pose *pose,
                                 struct gn_error *out_error);

/**
 * Takes a frame: from success on it is answered exactly once, by a RESULT or a DROPPED in the
 * mailbox. It replaces the session's unread frame, which is answered DROPPED (superseded).
 * Returns 0, -EDOM and a sentence (id not rising: the session cannot go on), -ENOMEM.
 */
GN_MUST_USE int gn_room_put_frame(struct gn_room_session *session, const struct gn_msg_frame *frame,
                                  struct gn_buf *payload, int64_t received_ns,
                                  struct gn_error *out_error);

/** Frames/s at 640 x 480 that each viewer could count on if there were so many more of them [0, 1];
 * 0: not measured yet. */
double gn_room_get_holdable_fps_with(struct gn_room *room, int more_viewers);

/** STATISTICS of this moment. */
void gn_room_get_statistics(struct gn_room *room, struct gn_msg_statistics *out_statistics);

/** All figures of this moment. */
void gn_room_get_figures(struct gn_room *room, struct gn_room_figures *out_figures);
/** Up to cap sessions' figures; returns how many. */
int gn_room_get_sessions(struct gn_room *room, struct gn_session_figures *out_sessions, int cap);

/** The probes whose light is in the room's; returns how many. */
int gn_room_get_probes(struct gn_room *room,
                       struct gn_probe_figures out_probes[static GN_PROBES_MAX]);

/** Figures of movable objects from the first on; returns how many. */
int gn_room_get_movers(struct gn_room *room, int first, int cap,
                       struct gn_mover_figures *out_movers);

/** The published lighting state, a reference for the caller; NULL: none yet. */
struct gn_lighting_state *gn_room_get_light(struct gn_room *room);

/**
 * The last composite, RGB in its camera's response. The room keeps one only while somebody asks:
 * the first call gives NULL and makes the room keep the next. Copied by the render thread, so a
 * reader never holds a frame up. The reference is the caller's.
 */
struct gn_snapshot *gn_room_get_composite(struct gn_room *room);

#endif
