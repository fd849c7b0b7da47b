/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What a session says to its peer: notes into its outbox. For session.c.
 */
#ifndef GN_SERVER_NET_SESSION_NOTES_H
#define GN_SERVER_NET_SESSION_NOTES_H

#include "common/log.h"
#include "server/net/session.h"

/** For lines that a peer can cause. */
extern struct gn_log_limiter gn_session_limiter;

/** A blank note, or NULL: then the session is gone, as nothing can be said. */
struct gn_note *gn_session_get_note(struct gn_session *s);
/** Takes the note; a peer that reads none makes the session gone. */
void gn_session_put_note(struct gn_session *s, struct gn_note *note);
/** Says an ERROR after which the session goes on. */
void gn_session_complain(struct gn_session *s, enum gn_msg_error_code code, uint16_t about_type,
                         uint64_t about_id, const char *sentence);

#endif
