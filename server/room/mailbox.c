/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/mailbox.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "common/thread.h"

/** Notes kept for the next message; more are freed. */
#define KEPT_NOTES 256

struct gn_mailbox {
    int fd;
    struct gn_mutex mu;
    struct gn_note *first;  // guarded by mu
    struct gn_note **last;  // guarded by mu: where the next note is hung
    struct gn_note *blanks; // guarded by mu
    int n_blanks;           // guarded by mu
};

int gn_mailbox_create(struct gn_mailbox **out_mailbox)
{
    *out_mailbox = NULL;
    struct gn_mailbox *box = calloc(1, sizeof(*box));
    if (!box)
        return -ENOMEM;
    box->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (box->fd < 0) {
        int code = -errno;
        free(box);
        return code;
    }
    int rc = gn_mutex_init(&box->mu);
    if (rc < 0) {
        close(box->fd);
        free(box);
        return rc;
    }
    box->last = &box->first;
    *out_mailbox = box;
    return 0;
}

static void free_list(struct gn_note *note)
{
    while (note) {
        struct gn_note *next = note->next;
        gn_buf_unref(&note->payload);
        free(note);
        note = next;
    }
}

void gn_mailbox_destroy(struct gn_mailbox **mailbox)
{
    struct gn_mailbox *box = *mailbox;
    if (!box)
        return;
    free_list(box->first);
    free_list(box->blanks);
    gn_mutex_finish(&box->mu);
    close(box->fd);
    free(box);
    *mailbox = NULL;
}

int gn_mailbox_get_fd(const struct gn_mailbox *mailbox)
{
    return mailbox->fd;
}

int gn_mailbox_get_blank(struct gn_mailbox *mailbox, struct gn_note **out_note)
{
    gn_mutex_lock(&mailbox->mu);
    struct gn_note *note = mailbox->blanks;
    if (note) {
        mailbox->blanks = note->next;
        mailbox->n_blanks--;
    }
    gn_mutex_unlock(&mailbox->mu);
    if (!note)
        note = malloc(sizeof(*note));
    if (!note)
        return -ENOMEM;
    memset(note, 0, sizeof(*note));
    *out_note = note;
    return 0;
}

void gn_mailbox_post(struct gn_mailbox *mailbox, struct gn_note *note)
{
    note->next = NULL;
    gn_mutex_lock(&mailbox->mu);
    bool was_empty = !mailbox->first;
    *mailbox->last = note;
    mailbox->last = &note->next;
    gn_mutex_unlock(&mailbox->mu);
    // The counter cannot overflow and the write cannot block: one count per time the list fills.
    uint64_t one = 1;
    if (was_empty && write(mailbox->fd, &one, sizeof(one)) < 0)
        return;
}

struct gn_note *gn_mailbox_take_all(struct gn_mailbox *mailbox)
{
    uint64_t count;
    // Read first: a note posted between read and take raises the counter again, for nothing.
    ssize_t n = read(mailbox->fd, &count, sizeof(count));
    (void)n;
    gn_mutex_lock(&mailbox->mu);
    struct gn_note *first = mailbox->first;
    mailbox->first = NULL;
    mailbox->last = &mailbox->first;
    gn_mutex_unlock(&mailbox->mu);
    return first;
}

void gn_mailbox_recycle(struct gn_mailbox *mailbox, struct gn_note **note)
{
    struct gn_note *n = *note;
    if (!n)
        return;
    *note = NULL;
    gn_buf_unref(&n->payload);
    gn_mutex_lock(&mailbox->mu);
    if (mailbox->n_blanks < KEPT_NOTES) {
        n->next = mailbox->blanks;
        mailbox->blanks = n;
        mailbox->n_blanks++;
        n = NULL;
    }
    gn_mutex_unlock(&mailbox->mu);
    free(n);
}

void gn_note_set_dropped(struct gn_note *note, uint64_t id, enum gn_msg_drop_reason reason,
                         const char *sentence)
{
    gn_buf_unref(&note->payload);
    memset(&note->body, 0, sizeof(note->body));
    note->type = GN_WIRE_DROPPED;
    note->body.dropped.id = id;
    note->body.dropped.reason = reason;
    gn_wire_set_string(note->body.dropped.sentence, sizeof(note->body.dropped.sentence), sentence);
}

void gn_note_set_error(struct gn_note *note, enum gn_msg_error_code code, uint16_t about_type,
                       uint64_t about_id, const char *sentence)
{
    gn_buf_unref(&note->payload);
    memset(&note->body, 0, sizeof(note->body));
    note->type = GN_WIRE_ERROR;
    note->body.error.code = code;
    note->body.error.about_type = about_type;
    note->body.error.about_id = about_id;
    note->body.error.version_min = GN_PROTO_VERSION_MIN;
    note->body.error.version_max = GN_PROTO_VERSION_MAX;
    gn_wire_set_string(note->body.error.sentence, sizeof(note->body.error.sentence), sentence);
}
