/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/buf.h"

#include <errno.h>
#include <stdlib.h>

static void release_heap(struct gn_buf *buf)
{
    free(buf->data);
    free(buf);
}

int gn_buf_create(size_t len, struct gn_buf **out)
{
    *out = NULL;
    struct gn_buf *buf = malloc(sizeof(*buf));
    uint8_t *data = malloc(len ? len : 1);
    if (!buf || !data) {
        free(buf);
        free(data);
        return -ENOMEM;
    }
    gn_buf_init(buf, data, len, release_heap, NULL);
    *out = buf;
    return 0;
}

void gn_buf_init(struct gn_buf *buf, uint8_t *data, size_t len, gn_buf_release_fn release,
                 void *user)
{
    buf->data = data;
    buf->len = len;
    buf->release = release;
    buf->user = user;
    atomic_init(&buf->refs, 1);
}

struct gn_buf *gn_buf_ref(struct gn_buf *buf)
{
    if (buf)
        atomic_fetch_add_explicit(&buf->refs, 1, memory_order_relaxed);
    return buf;
}

void gn_buf_unref(struct gn_buf **buf)
{
    if (!buf || !*buf)
        return;
    struct gn_buf *b = *buf;
    *buf = NULL;
    if (atomic_fetch_sub_explicit(&b->refs, 1, memory_order_acq_rel) == 1)
        b->release(b);
}
