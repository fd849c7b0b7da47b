/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/buf_pool.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>

#include "common/thread.h"

/** A block larger than this times what is asked for is not given out: it would only be held. */
#define MAX_SLACK 4

struct block {
    struct gn_buf buf; // buf.user is the block
    struct block *next;
    struct gn_buf_pool *pool;
    size_t capacity;
    // the bytes follow
};

struct gn_buf_pool {
    struct gn_mutex mu;
    struct block *free; // guarded by mu
    int n_free;         // guarded by mu
    size_t n_out;       // guarded by mu
    bool is_closed;     // guarded by mu: the last block that comes back frees the pool
};

int gn_buf_pool_create(struct gn_buf_pool **out_pool)
{
    *out_pool = NULL;
    struct gn_buf_pool *pool = calloc(1, sizeof(*pool));
    if (!pool)
        return -ENOMEM;
    int rc = gn_mutex_init(&pool->mu);
    if (rc < 0) {
        free(pool);
        return rc;
    }
    *out_pool = pool;
    return 0;
}

static void free_pool(struct gn_buf_pool *pool)
{
    gn_mutex_finish(&pool->mu);
    free(pool);
}

static void release(struct gn_buf *buf)
{
    struct block *block = buf->user;
    struct gn_buf_pool *pool = block->pool;
    gn_mutex_lock(&pool->mu);
    pool->n_out--;
    bool is_last = pool->is_closed && pool->n_out == 0;
    if (!pool->is_closed && pool->n_free < GN_BUF_POOL_KEPT) {
        block->next = pool->free;
        pool->free = block;
        pool->n_free++;
        block = NULL;
    }
    gn_mutex_unlock(&pool->mu);
    free(block);
    if (is_last)
        free_pool(pool);
}

void gn_buf_pool_destroy(struct gn_buf_pool **pool)
{
    struct gn_buf_pool *p = *pool;
    if (!p)
        return;
    *pool = NULL;
    gn_mutex_lock(&p->mu);
    struct block *block = p->free;
    p->free = NULL;
    p->is_closed = true;
    bool is_last = p->n_out == 0;
    gn_mutex_unlock(&p->mu);
    while (block) {
        struct block *next = block->next;
        free(block);
        block = next;
    }
    if (is_last)
        free_pool(p);
}

int gn_buf_pool_get(struct gn_buf_pool *pool, size_t len, struct gn_buf **out_buf)
{
    struct block *found = NULL, *stale = NULL;
    gn_mutex_lock(&pool->mu);
    for (struct block **at = &pool->free; *at && !found; at = &(*at)->next) {
        if ((*at)->capacity >= len && (*at)->capacity / MAX_SLACK <= len) {
            found = *at;
            *at = found->next;
            pool->n_free--;
            if (!*at)
                break;
        }
    }
    if (!found && pool->n_free == GN_BUF_POOL_KEPT) { // all of other sizes: one makes room
        stale = pool->free;
        pool->free = stale->next;
        pool->n_free--;
    }
    pool->n_out++;
    gn_mutex_unlock(&pool->mu);
    free(stale);
    if (!found) {
        found = malloc(sizeof(*found) + len);
        if (!found) {
            gn_mutex_lock(&pool->mu);
            pool->n_out--;
            gn_mutex_unlock(&pool->mu);
            return -ENOMEM;
        }
        found->pool = pool;
        found->capacity = len;
    }
    gn_buf_init(&found->buf, (uint8_t *)(found + 1), len, release, found);
    *out_buf = &found->buf;
    return 0;
}
