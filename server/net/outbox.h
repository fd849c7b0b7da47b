/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What waits to be sent to one peer, bounded. A peer that reads slowly loses its oldest results,
 * each answered by the DROPPED that takes its place; of each probe's lighting states and of
 * statistics only the newest waits.
 */
#ifndef GN_SERVER_NET_OUTBOX_H
#define GN_SERVER_NET_OUTBOX_H

#include "proto/attr.h"
#include "server/room/mailbox.h"

/** Results that wait at most; one more makes the oldest DROPPED (overload). */
#define GN_OUTBOX_MAX_RESULTS 2
/** Messages that wait before the session's own are no longer read. */
#define GN_OUTBOX_BUSY_MESSAGES 64
/** Messages that wait at most: one more and the peer is given up. */
#define GN_OUTBOX_MAX_MESSAGES 256

/** Zero it before use. Thread-safety: owner thread (net). */
struct gn_outbox {
    struct gn_note *first, *last;
    int n_messages;
    int n_results;
    uint64_t n_dropped; // results that were made DROPPED, since the start
};

/**
 * Puts a note in; it is the outbox's. What is replaced goes back to the mailbox.
 * Returns 0, or -ENOBUFS: the outbox is full and the note stays the caller's.
 */
GN_MUST_USE int gn_outbox_put(struct gn_outbox *outbox, struct gn_mailbox *mailbox,
                              struct gn_note *note);
/** The oldest note, the caller's; NULL: none. */
struct gn_note *gn_outbox_take(struct gn_outbox *outbox);
/** Gives all notes back to the mailbox. */
void gn_outbox_clear(struct gn_outbox *outbox, struct gn_mailbox *mailbox);

#endif
