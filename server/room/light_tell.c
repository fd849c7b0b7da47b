/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/light_thread.h"

#include <errno.h>
#include <string.h>

#include "common/log.h"
#include "server/room/lighting_message.h"

GN_LOG_TOPIC("room");

void gn_subscribers_take_locked(struct gn_room *room, bool newcomers, struct gn_subscribers *out)
{
    memset(out, 0, sizeof(*out));
    for (struct gn_room_session *s = room->sessions; s; s = s->next) {
        if (!s->want_lighting_states || newcomers == s->was_told)
            continue;
        s->was_told = true;
        out->ids[out->n] = s->id;
        out->want_map[out->n++] = s->want_lighting_maps;
        out->any_map = out->any_map || s->want_lighting_maps;
        out->any_plain = out->any_plain || !s->want_lighting_maps;
    }
}

void gn_light_refuse(struct gn_room *room, uint64_t session_id, enum gn_wire_type type,
                     uint64_t sequence, int code, const char *sentence)
{
    bool is_emitter = type == GN_WIRE_EMITTER_FRAME;
    gn_mutex_lock(&room->mu);
    room->figures.environment_refused += !is_emitter;
    room->figures.emitter_refused += is_emitter;
    gn_mutex_unlock(&room->mu);
    static struct gn_log_limiter limiter = {.burst = 50, .interval_ns = GN_NS_PER_S};
    gn_log_limited(&limiter, GN_LOG_DEBUG, "room %s: session %llu: %s %llu refused: %s", room->name,
                   (unsigned long long)session_id, gn_wire_get_info(type)->name,
                   (unsigned long long)sequence, sentence);
    struct gn_note *note;
    if (gn_mailbox_get_blank(room->options.mailbox, &note) < 0)
        return;
    note->session_id = session_id;
    gn_note_set_error(note,
                      code == -ENOMEM ? GN_MSG_ERROR_CODE_INTERNAL : GN_MSG_ERROR_CODE_BAD_VALUE,
                      type, sequence, sentence);
    gn_mailbox_post(room->options.mailbox, note);
}

/** Posts a LIGHTING_STATE of this room to one session. Returns 0 or -ENOMEM. */
static int post_state(struct gn_room *room, uint64_t session_id,
                      const struct gn_msg_lighting_state *body, struct gn_buf *payload)
{
    struct gn_note *note;
    int rc = gn_mailbox_get_blank(room->options.mailbox, &note);
    if (rc < 0)
        return rc;
    struct gn_msg_lighting_state *m = &note->body.lighting_state;
    note->session_id = session_id;
    note->type = GN_WIRE_LIGHTING_STATE;
    *m = *body;
    gn_wire_set_string(m->room, sizeof(m->room), room->name);
    gn_wire_set_string(m->node, sizeof(m->node), room->node);
    note->payload = payload ? gn_buf_ref(payload) : NULL;
    gn_mailbox_post(room->options.mailbox, note);
    return 0;
}

static void warn_not_sent(const struct gn_room *room, uint64_t sequence, int code)
{
    gn_log(GN_LOG_WARN, "room %s: lighting state %llu not sent: %s", room->name,
           (unsigned long long)sequence, strerror(-code));
}

void gn_subscribers_tell(struct gn_room *room, const struct gn_lighting_state *state,
                         const struct gn_subscribers *subscribers)
{
    struct gn_msg_lighting_state bodies[2] = {0}; // without and with the map
    struct gn_buf *payloads[2] = {0};
    int rc = 0;
    if (subscribers->any_plain)
        rc = gn_lighting_message_make(state, false, room->options.pool, &bodies[0], &payloads[0]);
    if (rc == 0 && subscribers->any_map)
        rc = gn_lighting_message_make(state, true, room->options.pool, &bodies[1], &payloads[1]);
    for (int i = 0; rc == 0 && i < subscribers->n; i++) {
        int which = subscribers->want_map[i];
        rc = post_state(room, subscribers->ids[i], &bodies[which], payloads[which]);
    }
    if (rc < 0)
        warn_not_sent(room, state->sequence, rc);
    gn_buf_unref(&payloads[0]);
    gn_buf_unref(&payloads[1]);
}

void gn_subscribers_tell_gone(struct gn_room *room, const struct gn_reached *probe)
{
    struct gn_subscribers subscribers;
    const struct gn_msg_lighting_state body = {
        .sequence = probe->sequence, .probe = probe->stream, .gone = true};
    gn_mutex_lock(&room->mu);
    gn_subscribers_take_locked(room, false, &subscribers);
    gn_mutex_unlock(&room->mu);
    int rc = 0;
    for (int i = 0; rc == 0 && i < subscribers.n; i++)
        rc = post_state(room, subscribers.ids[i], &body, NULL);
    if (rc < 0)
        warn_not_sent(room, probe->sequence, rc);
}
