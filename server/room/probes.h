/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The probes that light a room: a slot for each, with its unread frame (the newest wins) and the
 * state of its last one. The light thread takes frames from them in turn, so that a quick probe
 * does not starve a slow one. A probe that has left keeps its slot only while no other has lit the
 * room. Thread-safety: unsafe; the room's lock is held for every call.
 */
#ifndef GN_SERVER_ROOM_PROBES_H
#define GN_SERVER_ROOM_PROBES_H

#include "common/buf.h"
#include "proto/attr.h"
#include "proto/wire.h"
#include "server/light/state.h"
#include "server/room/figures.h"

/** An environment frame as it waits. */
struct gn_environment_job {
    uint64_t session_id;
    struct gn_msg_environment_frame frame;
    struct gn_buf *payload; // owned reference
};

/** One probe. */
struct gn_probe {
    uint64_t session_id; // 0: a free slot
    bool has_left;       // its session has ended
    bool has_frame;
    struct gn_environment_job job;   // where has_frame
    uint64_t turn;                   // when its last frame was taken
    struct gn_lighting_state *light; // a reference: of its last frame, of itself alone; NULL: none
    uint64_t n_lit;                  // frames that gave light
    int64_t lit_ns;                  // when the last one did
    struct gn_time_window interval;  // ms between them
};

/** All-zero: none. */
struct gn_probes {
    struct gn_probe slots[GN_PROBES_MAX];
    uint64_t turn;
};

/** Drops all frames and lights. */
void gn_probes_finish(struct gn_probes *probes);
/**
 * The frame waits, in place of the probe's unread one, which goes to *out_superseded (else zeroed).
 * Returns 0, 1 (there was one), or -EUSERS: all slots are other probes'; the job stays the
 * caller's.
 */
GN_MUST_USE int gn_probes_put(struct gn_probes *probes, const struct gn_environment_job *job,
                              struct gn_environment_job *out_superseded);
/** The longest untaken of those that wait; of probes that have lit the room before only where
 * all. False: none. The job is the caller's; *out_light: a reference to the probe's last light, for
 * its first frame that of a probe that has left, or NULL. */
bool gn_probes_take(struct gn_probes *probes, bool all, struct gn_environment_job *out_job,
                    struct gn_lighting_state **out_light);
/** True where a frame waits. */
bool gn_probes_has_frame(const struct gn_probes *probes);
/**
 * The state is the probe's light now, and those of probes that have left go, to out_old[*out_n],
 * which the caller unrefs. The reference is taken, also where the probe has left (its light counts
 * then only if no other has any).
 */
void gn_probes_set_light(struct gn_probes *probes, uint64_t session_id,
                         struct gn_lighting_state *light, int64_t now_ns,
                         struct gn_lighting_state *out_old[static GN_PROBES_MAX], int *out_n);
/** Another state of the same frame takes the old one's place, and its reference. Returns what is
 * the caller's to unref: the old one, or, where the old one is no probe's light any more, the
 * other. */
struct gn_lighting_state *gn_probes_replace_light(struct gn_probes *probes,
                                                  const struct gn_lighting_state *old,
                                                  struct gn_lighting_state *light);
/** The session has ended. Where other probes have lit the room its frame and light go, and the
 * light is the caller's to unref; else they stay, and NULL is returned. */
struct gn_lighting_state *gn_probes_leave(struct gn_probes *probes, uint64_t session_id);
/** References to all lights, in the order of the slots; *out_newest: which was made last. Returns
 * their number. */
int gn_probes_get_lights(const struct gn_probes *probes,
                         struct gn_lighting_state *out_lights[static GN_PROBES_MAX],
                         int *out_newest);
/** What can be read of the probes that have lit the room. Returns their number. */
int gn_probes_get_figures(const struct gn_probes *probes,
                          struct gn_probe_figures out_figures[static GN_PROBES_MAX]);

#endif
