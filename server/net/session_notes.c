/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/net/session_notes.h"

#include "common/log.h"

GN_LOG_TOPIC("net");

struct gn_log_limiter gn_session_limiter;

/** Nothing is read any more; what waits is written, then the connection ends. */
static void start_closing(struct gn_session *s, int64_t now_ns)
{
    gn_room_leave(&s->member);
    s->state = GN_SESSION_CLOSING;
    s->deadline_ns = now_ns + GN_SESSION_LINGER_NS;
    gn_session_write(s, now_ns);
}

void gn_session_put_note(struct gn_session *s, struct gn_note *note)
{
    if (!gn_session_wants_write(s)) // until now there was nothing that the peer could have taken
        s->moved_ns = gn_clock_get_monotonic_ns();
    if (gn_outbox_put(&s->outbox, s->host->mailbox, note) == 0)
        return;
    gn_mailbox_recycle(s->host->mailbox, &note);
    gn_log_limited(&gn_session_limiter, GN_LOG_WARN,
                   "%s: %d messages wait for a peer that reads none: closed", s->peer,
                   GN_OUTBOX_MAX_MESSAGES);
    s->host->figures->stalled++;
    s->state = GN_SESSION_GONE;
}

void gn_session_take_note(struct gn_session *session, struct gn_note *note)
{
    if (session->state == GN_SESSION_OPEN)
        gn_session_put_note(session, note);
    else
        gn_mailbox_recycle(session->host->mailbox, &note);
}

struct gn_note *gn_session_get_note(struct gn_session *s)
{
    struct gn_note *note;
    if (gn_mailbox_get_blank(s->host->mailbox, &note) == 0)
        return note;
    gn_log_limited(&gn_session_limiter, GN_LOG_ERROR, "%s: out of memory: closed", s->peer);
    s->state = GN_SESSION_GONE;
    return NULL;
}

void gn_session_complain(struct gn_session *s, enum gn_msg_error_code code, uint16_t about_type,
                         uint64_t about_id, const char *sentence)
{
    gn_log_limited(&gn_session_limiter, GN_LOG_DEBUG, "%s: %s", s->peer, sentence);
    struct gn_note *note = gn_session_get_note(s);
    if (!note)
        return;
    gn_note_set_error(note, code, about_type, about_id, sentence);
    gn_session_put_note(s, note);
}

void gn_session_fail(struct gn_session *session, enum gn_msg_error_code code, uint16_t about_type,
                     uint64_t about_id, const char *sentence, int64_t now_ns)
{
    gn_log_limited(&gn_session_limiter, GN_LOG_INFO, "%s: closed: %s", session->peer, sentence);
    struct gn_note *note = gn_session_get_note(session);
    if (!note)
        return;
    gn_note_set_error(note, code, about_type, about_id, sentence);
    note->body.error.fatal = true;
    gn_session_put_note(session, note);
    if (session->state != GN_SESSION_GONE)
        start_closing(session, now_ns);
}

void gn_session_bye(struct gn_session *session, enum gn_msg_bye_reason reason, const char *sentence,
                    int64_t now_ns)
{
    if (session->state == GN_SESSION_GONE || session->state == GN_SESSION_CLOSING)
        return;
    struct gn_note *note = gn_session_get_note(session);
    if (!note)
        return;
    note->type = GN_WIRE_BYE;
    note->body.bye.reason = reason;
    gn_wire_set_string(note->body.bye.sentence, sizeof(note->body.bye.sentence), sentence);
    gn_session_put_note(session, note);
    if (session->state != GN_SESSION_GONE)
        start_closing(session, now_ns);
}

void gn_session_send_statistics(struct gn_session *session)
{
    if (session->state != GN_SESSION_OPEN || !session->want_statistics)
        return;
    struct gn_note *note = gn_session_get_note(session);
    if (!note)
        return;
    note->type = GN_WIRE_STATISTICS;
    gn_room_get_statistics(session->room, &note->body.statistics);
    gn_session_put_note(session, note);
}
