/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What can be read off a running room: plain values, copied out under a short lock, so that the
 * status page never makes a frame wait.
 */
#ifndef GN_SERVER_ROOM_FIGURES_H
#define GN_SERVER_ROOM_FIGURES_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "common/image.h"
#include "proto/wire.h"
#include "server/light/state.h"

/** Upper bounds in ms of the histogram's buckets; one more bucket holds what is longer. */
#define GN_FIGURES_BUCKETS 12
extern const double gn_figures_bounds_ms[GN_FIGURES_BUCKETS];

/** Times of a room's frames. */
struct gn_time_histogram {
    uint64_t counts[GN_FIGURES_BUCKETS + 1];
    uint64_t n;
    double sum_ms;
};

/** A room's figures; counters run since it was opened. */
struct gn_room_figures {
    int n_viewers, n_probes, n_screens, n_trackers;
    int n_objects, n_movable, n_real_triangles, n_virtual_triangles;
    uint64_t frames_in, frames_out, frames_dropped;
    uint64_t dropped_by_reason[GN_MSG_DROP_REASON_INTERNAL + 1]; // by enum gn_msg_drop_reason
    uint64_t environment_in, environment_superseded, environment_refused;
    uint64_t emitter_in, emitter_superseded, emitter_refused, emitter_shown;
    uint64_t poses_in, poses_late, poses_refused; // of objects; late: a newer one was there
    int n_near;                                   // near lights of the state
    bool has_environment_waiting;                 // one is unread: nobody in the room needs light
    struct gn_time_histogram latency; // from the last byte received to the answer posted
    struct gn_time_histogram busy;    // the render thread's time
    // Of the last 100 results that did not wait for light, whoever they were for; 0: none yet.
    double latency_p50_ms, latency_p90_ms, latency_p99_ms;
    double busy_p50_ms;
    double holdable_fps_room;   // frames/s at 640 x 480, all viewers together; 0: not measured
    double holdable_fps_viewer; // each one's share
    bool has_light;             // of probes, or of the scene's own lamps
    bool has_capture;           // of probes: only then it has an age
    uint64_t light_sequence, light_published;
    int64_t light_capture_ns; // where has_capture
    int n_lights;
    bool has_sh;      // the irradiance's harmonics are made
    int sh_order;     // 2 or 4
    int n_sh_lights;  // small bright lights kept out of them
    double sh_lambda; // of their window; 0: none
    double sh_min;    // W/m^2, lowest luminance of their irradiance before it
    double light_ms_map, light_ms_sh, light_ms_lights, light_ms_temporal, light_ms_decode;
    uint64_t environment_same; // frames that equalled the last one within the noise
    uint64_t light_without_sh, light_without_lights; // states made without what nobody needed
    struct gn_temporal_figures light_in_time;        // of the last state
    uint64_t light_births, light_deaths, light_snaps, light_holds;
    uint64_t budget_frames, budget_misses; // with a budget; that took longer
    bool has_receipt;
    int last_width, last_height;        // px, first view of the last result
    struct gn_msg_receipt last_receipt; // what was left out of it, and why, among others
};

/** One session's figures. */
struct gn_session_figures {
    uint64_t id;
    enum gn_msg_role role;
    char name[64];
    char peer[64];
    int64_t since_ns;
    uint64_t frames_in, frames_out, frames_dropped, environment_in, poses_in;
    double last_latency_ms; // 0: none yet
};

/** Probes nearer to each other than this are told apart by nobody's ruler, m: two senders of one
 * light, or positions that were never measured. */
#define GN_PROBES_SAME_PLACE_M 0.01

/** What can be read of one probe that has lit the room. */
struct gn_probe_figures {
    uint64_t session_id;
    bool has_left;      // it is gone, but no other has lit the room since
    double position[3]; // m, world
    int n_same_place;   // others that light the room from there: their light is averaged
    uint64_t same_place[GN_PROBES_MAX]; // their sessions
    int n_lights;
    uint64_t sequence; // of its last frame that gave light
    uint64_t n_lit;    // such frames
    int64_t capture_ns;
    int n_clipped;      // texels of that frame at the sensor's rail: brighter than it could say
    int n_mended;       // with a channel that was no light: NaN, infinite, negative
    int n_out_of_gamut; // with a channel that the colour matrix made negative
    double rate_hz; // such frames per second, by the median of the last intervals; 0: not known yet
};

/** Most movable objects whose figures are read at a time. */
#define GN_MOVER_FIGURES_MAX 64
/** What can be read of one movable object. */
struct gn_mover_figures {
    char name[64];
    bool is_virtual;
    uint64_t session_id; // who sent its newest pose
    uint64_t n_poses;    // taken; 0: it stands as in the scene
    int64_t time_ns;     // capture of the newest, server's clock; where n_poses > 0
    double rate_hz;      // by the median of the last intervals between captures; 0: not known yet
    double position[3];  // m, world
};

/** What the network side counts. */
struct gn_transport_figures {
    bool is_serving; // between the network's start and the first word of its stop
    int connections; // open now
    uint64_t accepted, refused_full, protocol_errors, timeouts, stalled;
    uint64_t bytes_in, bytes_out;
};

/** A picture that outlives its frame. Immutable; shared (ref). */
struct gn_snapshot {
    atomic_int references;
    uint64_t frame_id;
    int64_t time_ns;
    struct gn_image8 image;
};
/** NULL-safe; nulls *snapshot. */
void gn_snapshot_unref(struct gn_snapshot **snapshot);

/** Adds one time. */
void gn_time_histogram_add(struct gn_time_histogram *histogram, double ms);

/** The last times, for percentiles. */
#define GN_WINDOW 100
struct gn_time_window {
    double ms[GN_WINDOW];
    int n;    // how many are there
    int next; // where the next goes
};
void gn_time_window_add(struct gn_time_window *window, double ms);
/** The smallest time that share (0, 1] of the window's times do not exceed; 0 where it is empty. */
double gn_time_window_get(const struct gn_time_window *window, double share);

#endif
