/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The probes that light a room: a slot for each, with its unread frame (the newest wins) and the
 * state of its last one. The light thread takes frames from them in turn, so that a quick probe
 * does not starve a slow one. A probe that has left keeps its slot, and with it what it sent last,
 * only while no probe that is still there has lit the room. What goes is handed out, to be freed
 * once the lock is given back. Thread-safety: unsafe; the room's lock is held for every call but
 * gn_probe_finish().
 */
#ifndef GN_SERVER_ROOM_PROBES_H
#define GN_SERVER_ROOM_PROBES_H

#include "common/buf.h"
#include "proto/attr.h"
#include "proto/wire.h"
#include "server/light/state.h"
#include "server/room/figures.h"

struct gn_worked_frame; // same_frame.h

/** An environment frame as it waits. */
struct gn_environment_job {
    uint64_t session_id;
    struct gn_msg_environment_frame frame;
    struct gn_buf *payload; // owned reference
};

/** One probe. All-zero: none. */
struct gn_probe {
    uint64_t session_id; // 0: a free slot
    bool has_left;       // its session has ended
    bool has_frame;
    bool is_at_work;               // a frame of it was taken, and neither lit the room nor refused
    bool is_owed;                  // a viewer came while its frame rested; not shown since
    bool was_refused;              // it has not lit the room, and a frame of it could not
    struct gn_environment_job job; // where has_frame
    uint64_t turn;                 // when its last frame was taken
    uint64_t began;                // its place in the order of those that began; 0: not counted
    struct gn_lighting_state *light; // a reference: of its last frame, of itself alone; NULL: none
    struct gn_worked_frame *worked;  // owned: the frame its light was made from; NULL: taken, none
    uint64_t n_lit;                  // frames that gave light
    int64_t lit_ns;                  // when the last one did
    struct gn_time_window interval;  // ms between them
};

/** All-zero: none. */
struct gn_probes {
    struct gn_probe slots[GN_PROBES_MAX];
    uint64_t turn, n_begun;
};

/** A frame to be worked on. */
struct gn_probe_work {
    struct gn_environment_job job;
    struct gn_lighting_state *light; // a reference: the probe's last light, for its first frame
                                     // that of a probe that has left, or NULL
    struct gn_worked_frame *worked;  // owned, the probe's; NULL: none
};

/** Frees what was handed out. A zeroed one is fine. */
void gn_probe_finish(struct gn_probe *probe);
/** Drops all frames and lights. */
void gn_probes_finish(struct gn_probes *probes);
/**
 * The frame waits, in place of the probe's unread one, which goes to *out_old (else zeroed).
 * is_new: no frame of its session came before; then it is the newest probe, until a frame of it is
 * refused. A probe that lit nothing and was refused gives its slot up to another (*out_old, too).
 * Returns 0, 1 (an unread frame has gone), or -EUSERS: all slots are other probes'; the job stays
 * the caller's.
 */
GN_MUST_USE int gn_probes_put(struct gn_probes *probes, const struct gn_environment_job *job,
                              bool is_new, struct gn_probe *out_old);
/** A frame of the probe whose last turn is longest ago; of probes that have lit the room before
 * only where all. False: none. Either gn_probes_set_light() or gn_probes_refuse() must follow. */
bool gn_probes_take(struct gn_probes *probes, bool all, struct gn_probe_work *out_work);
/** True where a frame waits. */
bool gn_probes_has_frame(const struct gn_probes *probes);
/**
 * The state is the probe's light now, made from the worked frame (or NULL), and the last light and
 * probes that have left go, to out_old[*out_n]. Both are taken. False: the probe has left and
 * others have lit the room: they go instead.
 */
bool gn_probes_set_light(struct gn_probes *probes, uint64_t session_id,
                         struct gn_lighting_state *light, struct gn_worked_frame *worked,
                         int64_t now_ns, struct gn_probe out_old[static GN_PROBES_MAX], int *out_n);
/** The frame that was taken could not be used. Takes the worked frame back (or NULL), or hands it
 * on where the probe has left. */
void gn_probes_refuse(struct gn_probes *probes, uint64_t session_id, struct gn_worked_frame *worked,
                      struct gn_probe *out_old);
/** Another state of the same frame takes the old one's place, and its reference. Returns what is
 * the caller's to unref: the old one, or, where the old one is no probe's light any more, the
 * other. */
struct gn_lighting_state *gn_probes_replace_light(struct gn_probes *probes,
                                                  const struct gn_lighting_state *old,
                                                  struct gn_lighting_state *light);
/** The session has ended. Where probes that are still there have lit the room all of it goes, to
 * *out_old (else zeroed); where not, its light stays, or the frame that is to give light. */
void gn_probes_leave(struct gn_probes *probes, uint64_t session_id, struct gn_probe *out_old);
/** A viewer has come after a time without: the frames that rest now are owed to it. */
void gn_probes_owe(struct gn_probes *probes);
/** The probe's light is shown. */
void gn_probes_settle(struct gn_probes *probes, uint64_t session_id);
/** True while a frame that is owed gave no light and was not refused. */
bool gn_probes_is_owing(const struct gn_probes *probes);
/** The session that began last of those that light the room or still may: whose frames were
 * refused counts from when it lights the room. 0: none. */
uint64_t gn_probes_get_newest(const struct gn_probes *probes);
/** References to all lights, in the order of the slots; *out_newest: which was made last. Returns
 * their number. */
int gn_probes_get_lights(const struct gn_probes *probes,
                         struct gn_lighting_state *out_lights[static GN_PROBES_MAX],
                         int *out_newest);
/** Sessions of the other probes whose light is from the same place as this one's. Returns their
 * number. */
int gn_probes_find_same_place(const struct gn_probes *probes, uint64_t session_id,
                              uint64_t out_ids[static GN_PROBES_MAX]);
/** What can be read of the probes that have lit the room, but for rate_hz: its median is made of
 * the intervals, in ms, without the lock. Returns their number. */
int gn_probes_get_figures(const struct gn_probes *probes,
                          struct gn_probe_figures out_figures[static GN_PROBES_MAX],
                          struct gn_time_window out_intervals[static GN_PROBES_MAX]);

#endif
