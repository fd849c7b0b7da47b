/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One connection's session as a state machine. What may come in which state (EMITTER_FRAME as
 * ENVIRONMENT_FRAME, a screen's; of POSE CAMERA FRAME a tracker's is POSE):
 *
 *   state    | HELLO         | PING PONG | BYE  | ENVIRONMENT_FRAME | POSE CAMERA FRAME | other
 *   ---------+---------------+-----------+------+-------------------+-------------------+------
 *   HELLO    | OPEN, WELCOME | error     | gone | error             | error             | error
 *   OPEN     | error         | PONG, -   | gone | a probe's         | a viewer's        | error
 *   CLOSING  | nothing is read any more
 *
 * "error": an ERROR with code and sentence, then CLOSING. In HELLO a HELLO that is refused goes the
 * same way. Too long without what is due (HELLO, any whole message, room in the peer's buffers)
 * also ends in CLOSING. CLOSING writes what waits, shuts the connection down, and is gone when the
 * peer has closed too, or after GN_SESSION_LINGER_NS.
 */
#ifndef GN_SERVER_NET_SESSION_H
#define GN_SERVER_NET_SESSION_H

#include <stdbool.h>
#include <stdint.h>

#include "common/clock.h"
#include "common/conn.h"
#include "server/net/outbox.h"
#include "server/room/room.h"

/** How long a closed session waits for its last words to be read. */
#define GN_SESSION_LINGER_NS (1 * GN_NS_PER_S)

enum gn_session_state {
    GN_SESSION_HELLO = 0, // connected, HELLO is due
    GN_SESSION_OPEN,
    GN_SESSION_CLOSING,
    GN_SESSION_GONE, // to be destroyed
    GN_SESSION_STATE_COUNT
};

/** What the state table says of a message. */
enum gn_session_action {
    GN_SESSION_REFUSE = 0, // ERROR, CLOSING
    GN_SESSION_OPEN_UP,    // look at HELLO
    GN_SESSION_SERVE,      // deal with it
    GN_SESSION_LEAVE,      // BYE: gone
};

/** The table above. role: of an open session. Thread-safety: safe. */
enum gn_session_action gn_session_get_action(enum gn_session_state state, enum gn_msg_role role,
                                             uint16_t type);

/** What sessions share. Borrowed; owner: the net thread. */
struct gn_session_host {
    struct gn_room *const *rooms; // [n_rooms], the first is the one without a name
    int n_rooms;
    struct gn_mailbox *mailbox;
    const char *server_name;
    int64_t hello_timeout_ns, idle_timeout_ns, stall_timeout_ns; // > 0; idle 0: never
    uint64_t last_session_id;
    struct gn_transport_figures *figures; // counted here, read by who owns it
};

/** Thread-safety: owner thread (net). */
struct gn_session {
    enum gn_session_state state;
    struct gn_session_host *host;
    struct gn_conn *conn; // owned
    struct gn_outbox outbox;
    char peer[64];
    uint64_t id;                    // 0 until OPEN
    enum gn_msg_role role;          // where OPEN
    struct gn_room *room;           // where OPEN
    struct gn_room_session *member; // where OPEN
    bool want_statistics;
    bool is_shut;        // CLOSING: all is written and our side is shut
    int64_t deadline_ns; // HELLO: of the greeting; CLOSING: of the end
    int64_t heard_ns;    // the last whole message
    int64_t pinged_ns;   // the last PING since; 0: none
    int64_t moved_ns;    // when the peer last took a byte, or there was nothing to take
    uint32_t watched;    // epoll's events, as last set
};

/** Takes a connected, non-blocking socket; it is closed on failure too. */
GN_MUST_USE int gn_session_create(struct gn_session_host *host, int fd, const char *peer,
                                  int64_t now_ns, struct gn_session **out_session);
/** Leaves the room and closes. NULL-safe; nulls *session. */
void gn_session_destroy(struct gn_session **session);

/** The socket can be read: deals with what is there, up to GN_CONN_READ_BYTES
 * and some messages. */
void gn_session_read(struct gn_session *session, int64_t now_ns);
/** Writes what waits, as far as the socket takes it. */
void gn_session_write(struct gn_session *session, int64_t now_ns);
/** Looks at the deadlines. */
void gn_session_check_time(struct gn_session *session, int64_t now_ns);
/** When gn_session_check_time() is next due; INT64_MAX: never. */
int64_t gn_session_get_deadline(const struct gn_session *session);

/** A note of the session's room; it is the session's from now on. */
void gn_session_take_note(struct gn_session *session, struct gn_note *note);
/** Says an ERROR and closes. about_type 0: the connection. */
void gn_session_fail(struct gn_session *session, enum gn_msg_error_code code, uint16_t about_type,
                     uint64_t about_id, const char *sentence, int64_t now_ns);
/** Says BYE and closes. */
void gn_session_bye(struct gn_session *session, enum gn_msg_bye_reason reason, const char *sentence,
                    int64_t now_ns);
/** STATISTICS, to who asked for them. */
void gn_session_send_statistics(struct gn_session *session);

/** What to wait for. Reading stops while too much waits to be sent. */
bool gn_session_wants_read(const struct gn_session *session);
bool gn_session_wants_write(const struct gn_session *session);

#endif
