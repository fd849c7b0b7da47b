/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/net/session.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/log.h"
#include "server/net/hello.h"
#include "server/net/session_notes.h"

GN_LOG_TOPIC("net");

/** Bytes and messages handed to the connection before the next is: more would only be kept, out of
 * the outbox's reach. */
#define WRITE_AHEAD_BYTES ((size_t)64 << 10)
#define WRITE_AHEAD_MESSAGES 16
/** Messages read in one go. Their answers come by the mailbox only after it: what is read beyond
 * the outbox's room would cost the session, and memory without bound before that. */
#define READ_MESSAGES 32

/** Who comes and goes does not hide who misbehaves. */
static struct gn_log_limiter arrivals = {.burst = 50, .interval_ns = 10 * GN_NS_PER_S};

enum gn_session_action gn_session_get_action(enum gn_session_state state, enum gn_msg_role role,
                                             uint16_t type)
{
    if (state == GN_SESSION_HELLO)
        return type == GN_WIRE_HELLO ? GN_SESSION_OPEN_UP
               : type == GN_WIRE_BYE ? GN_SESSION_LEAVE
                                     : GN_SESSION_REFUSE;
    if (state != GN_SESSION_OPEN)
        return GN_SESSION_REFUSE;
    switch (type) {
    case GN_WIRE_PING:
    case GN_WIRE_PONG:
        return GN_SESSION_SERVE;
    case GN_WIRE_BYE:
        return GN_SESSION_LEAVE;
    case GN_WIRE_ENVIRONMENT_FRAME:
        return role == GN_MSG_ROLE_PROBE ? GN_SESSION_SERVE : GN_SESSION_REFUSE;
    case GN_WIRE_EMITTER_FRAME:
        return role == GN_MSG_ROLE_SCREEN ? GN_SESSION_SERVE : GN_SESSION_REFUSE;
    case GN_WIRE_POSE:
        return role == GN_MSG_ROLE_VIEWER || role == GN_MSG_ROLE_TRACKER ? GN_SESSION_SERVE
                                                                         : GN_SESSION_REFUSE;
    case GN_WIRE_CAMERA:
    case GN_WIRE_FRAME:
        return role == GN_MSG_ROLE_VIEWER ? GN_SESSION_SERVE : GN_SESSION_REFUSE;
    default:
        return GN_SESSION_REFUSE;
    }
}

int gn_session_create(struct gn_session_host *host, int fd, const char *peer, int64_t now_ns,
                      struct gn_session **out_session)
{
    *out_session = NULL;
    struct gn_session *s = calloc(1, sizeof(*s));
    const struct gn_conn_options options = {.receive = GN_WIRE_TO_SERVER, .fd = fd};
    int rc = s ? gn_conn_create(&options, &s->conn) : -ENOMEM;
    if (rc < 0) {
        close(fd);
        free(s);
        return rc;
    }
    gn_conn_set_max_payload(s->conn, 0);
    s->host = host;
    s->heard_ns = s->moved_ns = now_ns;
    s->deadline_ns = now_ns + host->hello_timeout_ns;
    snprintf(s->peer, sizeof(s->peer), "%s", peer);
    *out_session = s;
    return 0;
}

void gn_session_destroy(struct gn_session **session)
{
    struct gn_session *s = *session;
    if (!s)
        return;
    gn_room_leave(&s->member);
    gn_outbox_clear(&s->outbox, s->host->mailbox);
    gn_conn_destroy(&s->conn);
    free(s);
    *session = NULL;
}

static void open_up(struct gn_session *s, const struct gn_msg_hello *hello, int64_t now_ns)
{
    struct gn_hello_answer answer;
    struct gn_note *note = gn_session_get_note(s);
    if (!note)
        return;
    int rc = gn_hello_answer(s->host, hello, s->peer, &answer, &note->body.welcome);
    if (rc < 0) {
        gn_mailbox_recycle(s->host->mailbox, &note);
        gn_session_fail(s, answer.code, GN_WIRE_HELLO, 0, answer.error.text, now_ns);
        return;
    }
    note->type = GN_WIRE_WELCOME;
    s->state = GN_SESSION_OPEN;
    s->id = answer.session_id;
    s->role = hello->role;
    s->room = answer.room;
    s->member = answer.member;
    s->want_statistics = hello->want_statistics;
    gn_conn_set_max_payload(s->conn, answer.max_payload_bytes);
    gn_session_put_note(s, note);
    gn_log_limited(&arrivals, GN_LOG_INFO, "%s: session %llu: %s in room %s as %s", s->peer,
                   (unsigned long long)s->id, hello->client_name,
                   gn_room_get_options(s->room)->name,
                   s->role == GN_MSG_ROLE_PROBE     ? "probe"
                   : s->role == GN_MSG_ROLE_SCREEN  ? "screen"
                   : s->role == GN_MSG_ROLE_TRACKER ? "tracker"
                                                    : "viewer");
}

static void answer_ping(struct gn_session *s, const struct gn_msg_ping *ping, int64_t now_ns)
{
    struct gn_note *note = gn_session_get_note(s);
    if (!note)
        return;
    note->type = GN_WIRE_PONG;
    note->body.pong.t1_ns = ping->t1_ns;
    note->body.pong.t2_ns = now_ns;
    note->body.pong.t3_ns = now_ns; // set again when it is written
    gn_session_put_note(s, note);
}

/** Deals with a message that an open session may send. */
static void serve(struct gn_session *s, uint16_t type, const union gn_wire_message *m,
                  struct gn_buf *payload, int64_t now_ns)
{
    struct gn_error error = {0};
    int rc = 0;
    uint64_t about_id = 0;
    switch (type) {
    case GN_WIRE_PING:
        answer_ping(s, &m->ping, now_ns);
        break;
    case GN_WIRE_ENVIRONMENT_FRAME:
        about_id = m->environment_frame.sequence;
        rc = gn_room_put_environment(s->member, &m->environment_frame, payload, &error);
        break;
    case GN_WIRE_EMITTER_FRAME:
        about_id = m->emitter_frame.sequence;
        rc = gn_room_put_emitter(s->member, &m->emitter_frame, payload, &error);
        break;
    case GN_WIRE_CAMERA:
        about_id = m->camera.index;
        rc = gn_room_put_camera(s->member, &m->camera, &error);
        break;
    case GN_WIRE_POSE:
        rc = gn_room_put_pose(s->member, &m->pose, &error);
        break;
    case GN_WIRE_FRAME:
        about_id = m->frame.id;
        rc = gn_room_put_frame(s->member, &m->frame, payload, now_ns, &error);
        break;
    default:
        break; // PONG: it was heard
    }
    if (rc == -EDOM)
        gn_session_fail(s, GN_MSG_ERROR_CODE_BAD_VALUE, type, about_id, error.text, now_ns);
    else if (rc == -ENOMEM)
        gn_session_fail(s, GN_MSG_ERROR_CODE_INTERNAL, type, about_id, error.text, now_ns);
    else if (rc < 0)
        gn_session_complain(s,
                            rc == -EUSERS       ? GN_MSG_ERROR_CODE_FULL
                            : rc == -EOPNOTSUPP ? GN_MSG_ERROR_CODE_UNSUPPORTED
                                                : GN_MSG_ERROR_CODE_BAD_VALUE,
                            type, about_id, error.text);
}

static void take_message(struct gn_session *s, const struct gn_conn_message *message,
                         int64_t now_ns)
{
    uint16_t type = message->envelope.type;
    union gn_wire_message m;
    struct gn_wire_fault fault;
    s->heard_ns = now_ns;
    s->pinged_ns = 0;
    enum gn_session_action action = gn_session_get_action(s->state, s->role, type);
    if (action == GN_SESSION_REFUSE) {
        const struct gn_wire_info *info = gn_wire_get_info(type);
        char sentence[160];
        snprintf(sentence, sizeof(sentence), "%s does not belong here: %s",
                 info ? info->name : "this message",
                 s->state == GN_SESSION_HELLO ? "HELLO comes first"
                 : type == GN_WIRE_HELLO      ? "the session is open already"
                 : s->role == GN_MSG_ROLE_PROBE
                     ? "a probe sends ENVIRONMENT_FRAME, PING, PONG and BYE"
                 : s->role == GN_MSG_ROLE_TRACKER ? "a tracker sends POSE, PING, PONG and BYE"
                 : s->role == GN_MSG_ROLE_SCREEN
                     ? "a screen sends EMITTER_FRAME, PING, PONG and BYE"
                     : "a viewer sends CAMERA, POSE, FRAME, PING, PONG and BYE");
        gn_session_fail(s, GN_MSG_ERROR_CODE_UNEXPECTED, type, 0, sentence, now_ns);
        return;
    }
    int rc = gn_conn_decode(message, &m, &fault);
    if (rc < 0) {
        s->host->figures->protocol_errors++;
        gn_session_fail(s, gn_wire_get_error_code(rc), type, 0, fault.text, now_ns);
        return;
    }
    switch (action) {
    case GN_SESSION_OPEN_UP:
        open_up(s, &m.hello, now_ns);
        break;
    case GN_SESSION_LEAVE:
        gn_log_limited(&arrivals, GN_LOG_INFO, "%s: session %llu: BYE", s->peer,
                       (unsigned long long)s->id);
        s->state = GN_SESSION_GONE;
        break;
    default:
        serve(s, type, &m, message->payload, now_ns);
    }
}

/** Reading has ended with rc. */
static void end_of_reading(struct gn_session *s, int rc, int64_t now_ns)
{
    struct gn_envelope envelope = gn_conn_get_envelope(s->conn);
    switch (rc) {
    case -ENODATA:
    case -ECONNRESET:
    case -EPIPE:
    case -ETIMEDOUT:
        gn_log_limited(&arrivals, GN_LOG_INFO, "%s: session %llu: the peer is gone: %s", s->peer,
                       (unsigned long long)s->id, gn_conn_get_fault(s->conn));
        s->state = GN_SESSION_GONE;
        break;
    default:
        s->host->figures->protocol_errors++;
        gn_session_fail(s, gn_wire_get_error_code(rc), envelope.type, 0, gn_conn_get_fault(s->conn),
                        now_ns);
    }
}

/** CLOSING: what still comes is thrown away, so that our last words are not lost to a reset. */
static void discard(struct gn_session *s)
{
    char bytes[16384];
    for (int i = 0; i < 64; i++) {
        ssize_t n = recv(gn_conn_get_fd(s->conn), bytes, sizeof(bytes), MSG_DONTWAIT);
        if (n > 0)
            continue;
        if (n == 0 || (errno != EAGAIN && errno != EINTR))
            s->state = GN_SESSION_GONE;
        return;
    }
}

void gn_session_read(struct gn_session *session, int64_t now_ns)
{
    if (session->state == GN_SESSION_CLOSING) {
        discard(session);
        return;
    }
    size_t n_bytes = 0;
    for (int i = 0; i < READ_MESSAGES && n_bytes < GN_CONN_READ_BYTES; i++) {
        if (!gn_session_wants_read(session) || session->state == GN_SESSION_CLOSING)
            break;
        struct gn_conn_message message;
        int rc = gn_conn_read(session->conn, &message);
        if (rc < 0) {
            end_of_reading(session, rc, now_ns);
            break;
        }
        if (rc == 0)
            break;
        size_t bytes = GN_ENVELOPE_BYTES + message.envelope.header_bytes +
                       (size_t)message.envelope.payload_bytes;
        n_bytes += bytes;
        session->host->figures->bytes_in += bytes;
        take_message(session, &message, now_ns);
        gn_buf_unref(&message.payload);
    }
}

/** Hands the next message to the connection. False: there is none, or the session is gone. */
static bool send_next(struct gn_session *s)
{
    struct gn_note *note = gn_outbox_take(&s->outbox);
    if (!note)
        return false;
    if (note->type == GN_WIRE_PONG)
        note->body.pong.t3_ns = gn_clock_get_monotonic_ns();
    struct gn_wire_fault fault = {0};
    size_t before = gn_conn_get_queued_bytes(s->conn);
    int rc = gn_conn_send(s->conn, note->type, &note->body, note->payload, &fault);
    if (rc < 0) // ours to mend: a figure that the wire does not take, or no memory
        gn_log_limited(&gn_session_limiter, GN_LOG_ERROR, "%s: session %llu: cannot send: %s: %s",
                       s->peer, (unsigned long long)s->id, strerror(-rc), fault.text);
    if (rc == -EDOM && note->type == GN_WIRE_RESULT) {
        gn_note_set_dropped(note, note->body.result.id, GN_MSG_DROP_REASON_INTERNAL,
                            "the result could not be written as a message");
        rc = gn_conn_send(s->conn, note->type, &note->body, NULL, &fault);
    }
    s->host->figures->bytes_out += gn_conn_get_queued_bytes(s->conn) - before;
    gn_mailbox_recycle(s->host->mailbox, &note);
    if (rc < 0)
        s->state = GN_SESSION_GONE;
    return rc == 0;
}

void gn_session_write(struct gn_session *session, int64_t now_ns)
{
    const struct gn_conn *conn = session->conn;
    int rc = 1;
    while (session->state != GN_SESSION_GONE) {
        if (gn_conn_get_queued_bytes(conn) < WRITE_AHEAD_BYTES &&
            gn_conn_get_queued_messages(conn) < WRITE_AHEAD_MESSAGES && send_next(session))
            continue;
        size_t before = gn_conn_get_queued_bytes(conn);
        rc = gn_conn_flush(session->conn);
        if (rc < 0) {
            session->state = GN_SESSION_GONE;
            return;
        }
        if (gn_conn_get_queued_bytes(conn) < before)
            session->moved_ns = now_ns;
        if (rc == 0 || session->outbox.n_messages == 0)
            break;
    }
    if (session->state == GN_SESSION_CLOSING && rc == 1 && !session->is_shut) {
        shutdown(gn_conn_get_fd(session->conn), SHUT_WR);
        session->is_shut = true;
    }
}

bool gn_session_wants_read(const struct gn_session *session)
{
    if (session->state == GN_SESSION_CLOSING)
        return true;
    return session->state != GN_SESSION_GONE &&
           session->outbox.n_messages < GN_OUTBOX_BUSY_MESSAGES;
}

bool gn_session_wants_write(const struct gn_session *session)
{
    return session->state != GN_SESSION_GONE &&
           (session->outbox.n_messages > 0 || gn_conn_get_queued_bytes(session->conn) > 0);
}

static void time_out(struct gn_session *s, const char *sentence, int64_t now_ns)
{
    s->host->figures->timeouts++;
    gn_session_fail(s, GN_MSG_ERROR_CODE_TIMEOUT, 0, 0, sentence, now_ns);
}

void gn_session_check_time(struct gn_session *session, int64_t now_ns)
{
    struct gn_session_host *host = session->host;
    if (session->state == GN_SESSION_HELLO && now_ns >= session->deadline_ns) {
        time_out(session, "no whole HELLO came in time", now_ns);
    } else if (session->state == GN_SESSION_CLOSING && now_ns >= session->deadline_ns) {
        session->state = GN_SESSION_GONE;
    } else if (session->state == GN_SESSION_OPEN && gn_session_wants_write(session) &&
               now_ns - session->moved_ns >= host->stall_timeout_ns) {
        gn_log_limited(&gn_session_limiter, GN_LOG_INFO, "%s: session %llu: reads nothing: closed",
                       session->peer, (unsigned long long)session->id);
        host->figures->stalled++;
        session->state = GN_SESSION_GONE;
    } else if (session->state == GN_SESSION_OPEN && host->idle_timeout_ns > 0) {
        int64_t silent_ns = now_ns - session->heard_ns;
        if (silent_ns >= host->idle_timeout_ns) {
            time_out(session, "no whole message came in time: PING keeps a session open", now_ns);
        } else if (silent_ns >= host->idle_timeout_ns / 2 && session->pinged_ns == 0) {
            struct gn_note *note = gn_session_get_note(session);
            if (!note)
                return;
            session->pinged_ns = now_ns;
            note->type = GN_WIRE_PING;
            note->body.ping.t1_ns = now_ns;
            gn_session_put_note(session, note);
            gn_session_write(session, now_ns);
        }
    }
}

int64_t gn_session_get_deadline(const struct gn_session *session)
{
    const struct gn_session_host *host = session->host;
    if (session->state != GN_SESSION_OPEN)
        return session->state == GN_SESSION_GONE ? 0 : session->deadline_ns;
    int64_t first = INT64_MAX;
    if (gn_session_wants_write(session))
        first = session->moved_ns + host->stall_timeout_ns;
    if (host->idle_timeout_ns > 0) {
        int64_t idle = session->heard_ns +
                       (session->pinged_ns ? host->idle_timeout_ns : host->idle_timeout_ns / 2);
        first = idle < first ? idle : first;
    }
    return first;
}
