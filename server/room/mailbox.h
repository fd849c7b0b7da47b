/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What rooms have to say to their sessions: messages on their way from the rooms' threads to the
 * one that owns the sockets. The nodes are used again, so that a running room allocates none.
 */
#ifndef GN_SERVER_ROOM_MAILBOX_H
#define GN_SERVER_ROOM_MAILBOX_H

#include <stdint.h>

#include "common/buf.h"
#include "proto/attr.h"
#include "proto/wire.h"

/** One message to one session. Has one owner at a time; lists of them hang on next. */
struct gn_note {
    struct gn_note *next;
    uint64_t session_id;        // sessions are never numbered twice: a late note finds nobody
    uint16_t type;              // enum gn_wire_type
    union gn_wire_message body; // of that type
    struct gn_buf *payload;     // owned reference; may be NULL
};

/** Thread-safety: safe. */
struct gn_mailbox;

GN_MUST_USE int gn_mailbox_create(struct gn_mailbox **out_mailbox);
/** Frees all notes that were given back or posted. NULL-safe; nulls *mailbox. */
void gn_mailbox_destroy(struct gn_mailbox **mailbox);

/** An eventfd that can be read while notes wait. Owned by the mailbox. */
int gn_mailbox_get_fd(const struct gn_mailbox *mailbox);

/** A blank note, body zeroed. Returns 0 or -ENOMEM. It must be posted or recycled. */
GN_MUST_USE int gn_mailbox_get_blank(struct gn_mailbox *mailbox, struct gn_note **out_note);

/** Sends the note off; it is the mailbox's from now on. */
void gn_mailbox_post(struct gn_mailbox *mailbox, struct gn_note *note);

/** All notes that wait, in the order they were posted; NULL: none. They are the caller's. */
struct gn_note *gn_mailbox_take_all(struct gn_mailbox *mailbox);

/** Gives a note back, its payload too. NULL-safe; nulls *note. */
void gn_mailbox_recycle(struct gn_mailbox *mailbox, struct gn_note **note);

/** Makes the note the DROPPED of frame id; lets go of its payload. Not posted. */
void gn_note_set_dropped(struct gn_note *note, uint64_t id, enum gn_msg_drop_reason reason,
                         const char *sentence);

/** Makes the note an ERROR that is not fatal, about a message of the given type and id. */
void gn_note_set_error(struct gn_note *note, enum gn_msg_error_code code, uint16_t about_type,
                       uint64_t about_id, const char *sentence);

#endif
