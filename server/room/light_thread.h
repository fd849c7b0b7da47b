/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The inside of the light thread, for its files only: light_thread.c takes work and makes light of
 * it, light_join.c makes it the room's, light_tell.c tells the sessions. All but ..._locked take
 * the room's lock themselves. Owner thread: light.
 */
#ifndef GN_SERVER_ROOM_LIGHT_THREAD_H
#define GN_SERVER_ROOM_LIGHT_THREAD_H

#include "proto/wire.h"
#include "server/room/room_internal.h"

/** Sessions that a lighting state goes to, and whether any wants its map. */
struct gn_subscribers {
    uint64_t ids[GN_ROOM_MAX_SUBSCRIBERS];
    bool want_map[GN_ROOM_MAX_SUBSCRIBERS];
    int n;
    bool any_map, any_plain;
};

/** Lists the subscribers that know the states there are, or those that are to be told of them all,
 * who then count as told. */
void gn_subscribers_take_locked(struct gn_room *room, bool newcomers, struct gn_subscribers *out)
    GN_REQUIRES(room->mu);
/** Sends them the state, with its map where they want it; where there is no memory the log says
 * so. */
void gn_subscribers_tell(struct gn_room *room, const struct gn_lighting_state *state,
                         const struct gn_subscribers *subscribers);
/** Tells those who know the probe's states that its light has gone. */
void gn_subscribers_tell_gone(struct gn_room *room, const struct gn_reached *probe);

/** Tells the sender what is wrong with its ENVIRONMENT_FRAME or EMITTER_FRAME. */
void gn_light_refuse(struct gn_room *room, uint64_t session_id, enum gn_wire_type type,
                     uint64_t sequence, int code, const char *sentence);

/** From one picture to the near light of its stream's emitters: the map stays. Takes the job. */
void gn_light_show_picture(struct gn_room *room, struct gn_screen_decoder *decoder,
                           struct gn_emitter_job *job);
/** Makes the light of all probes the room's, and the scene's own with it. */
void gn_light_join(struct gn_room *room);
/** Whether the light of that stream is in the room's. */
bool gn_light_is_reached_locked(const struct gn_room *room, uint64_t stream) GN_REQUIRES(room->mu);
/** Lets go of n references. */
void gn_light_unref_all(struct gn_lighting_state **lights, int n);

#endif
