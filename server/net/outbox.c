/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/net/outbox.h"

#include <errno.h>
#include <stddef.h>

/** Turns the oldest result into a DROPPED, in its place. */
static void drop_oldest_result(struct gn_outbox *outbox)
{
    for (struct gn_note *n = outbox->first; n; n = n->next) {
        if (n->type != GN_WIRE_RESULT)
            continue;
        gn_note_set_dropped(n, n->body.result.id, GN_MSG_DROP_REASON_OVERLOAD,
                            "the connection takes results more slowly than they are made");
        outbox->n_results--;
        outbox->n_dropped++;
        return;
    }
}

/** Does the note say anew what the old one says? A lighting state only of the same probe. */
static bool is_newer(const struct gn_note *note, const struct gn_note *old)
{
    return note->type == old->type &&
           (note->type != GN_WIRE_LIGHTING_STATE ||
            note->body.lighting_state.probe == old->body.lighting_state.probe);
}

/** Puts the note in the place of a waiting one of its kind. False: there is none. */
static bool replace_older(struct gn_outbox *outbox, struct gn_mailbox *mailbox,
                          struct gn_note *note)
{
    struct gn_note *before = NULL;
    for (struct gn_note *n = outbox->first; n; before = n, n = n->next) {
        if (!is_newer(note, n))
            continue;
        note->next = n->next;
        if (before)
            before->next = note;
        else
            outbox->first = note;
        if (outbox->last == n)
            outbox->last = note;
        gn_mailbox_recycle(mailbox, &n);
        return true;
    }
    return false;
}

int gn_outbox_put(struct gn_outbox *outbox, struct gn_mailbox *mailbox, struct gn_note *note)
{
    if ((note->type == GN_WIRE_LIGHTING_STATE || note->type == GN_WIRE_STATISTICS) &&
        replace_older(outbox, mailbox, note))
        return 0;
    if (outbox->n_messages >= GN_OUTBOX_MAX_MESSAGES)
        return -ENOBUFS;
    if (note->type == GN_WIRE_RESULT) {
        if (outbox->n_results >= GN_OUTBOX_MAX_RESULTS)
            drop_oldest_result(outbox);
        outbox->n_results++;
    }
    note->next = NULL;
    if (outbox->last)
        outbox->last->next = note;
    else
        outbox->first = note;
    outbox->last = note;
    outbox->n_messages++;
    return 0;
}

struct gn_note *gn_outbox_take(struct gn_outbox *outbox)
{
    struct gn_note *note = outbox->first;
    if (!note)
        return NULL;
    outbox->first = note->next;
    if (!outbox->first)
        outbox->last = NULL;
    outbox->n_messages--;
    outbox->n_results -= note->type == GN_WIRE_RESULT;
    note->next = NULL;
    return note;
}

void gn_outbox_clear(struct gn_outbox *outbox, struct gn_mailbox *mailbox)
{
    struct gn_note *note;
    while ((note = gn_outbox_take(outbox)))
        gn_mailbox_recycle(mailbox, &note);
}
