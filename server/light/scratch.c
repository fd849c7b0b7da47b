/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/scratch.h"

#include <assert.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 64, BLOCK_MIN = 1 << 16 };
/* Bytes; the largest map's pieces are of 1 GiB. */
#define PIECE_MAX ((size_t)1 << 36)

struct block {
    struct block *below; // owned
    size_t capacity, used;
    _Alignas(ALIGNMENT) char data[];
};

struct gn_scratch {
    struct block *top;    // owned; NULL: nothing is there yet
    void *last;           // the piece taken last
    size_t last_capacity; // bytes
};

/* Whole cache lines; SIZE_MAX beyond what a piece may have. */
static size_t get_size(size_t n, size_t item_bytes)
{
    if (item_bytes > 0 && n > PIECE_MAX / item_bytes)
        return SIZE_MAX;
    size_t bytes = n * item_bytes;
    return bytes == 0 ? ALIGNMENT : (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

static struct block *make_block(size_t capacity)
{
    struct block *block = aligned_alloc(ALIGNMENT, sizeof(*block) + capacity);
    if (block)
        *block = (struct block){.capacity = capacity};
    return block;
}

static void free_blocks(struct gn_scratch *scratch)
{
    while (scratch->top) {
        struct block *below = scratch->top->below;
        free(scratch->top);
        scratch->top = below;
    }
}

/* One block with room for what the many had. */
static void merge(struct gn_scratch *scratch)
{
    size_t used = 0;
    for (const struct block *b = scratch->top; b; b = b->below)
        used += b->used;
    scratch->last = NULL;
    if (used > GN_SCRATCH_KEEP_MAX) {
        free_blocks(scratch);
    } else if (scratch->top && scratch->top->below) {
        free_blocks(scratch);
        scratch->top = make_block(used);
    } else if (scratch->top) {
        scratch->top->used = 0;
    }
}

static void destroy(struct gn_scratch *scratch)
{
    if (scratch)
        free_blocks(scratch);
    free(scratch);
}

struct gn_scratch *gn_scratch_borrow(gn_scratch_place *place)
{
    struct gn_scratch *scratch = atomic_exchange_explicit(place, NULL, memory_order_acquire);
    return scratch ? scratch : calloc(1, sizeof(*scratch));
}

void gn_scratch_give_back(gn_scratch_place *place, struct gn_scratch **scratch)
{
    struct gn_scratch *s = *scratch;
    *scratch = NULL;
    if (!s)
        return;
    merge(s);
    destroy(atomic_exchange_explicit(place, s, memory_order_acq_rel));
}

void gn_scratch_finish(gn_scratch_place *place)
{
    destroy(atomic_exchange_explicit(place, NULL, memory_order_acquire));
}

void *gn_scratch_take(struct gn_scratch *scratch, size_t n, size_t item_bytes)
{
    size_t bytes = get_size(n, item_bytes);
    struct block *top = scratch->top;
    if (bytes == SIZE_MAX)
        return NULL;
    if (!top || top->capacity - top->used < bytes) {
        struct block *block = make_block(bytes > BLOCK_MIN ? bytes : BLOCK_MIN);
        if (!block)
            return NULL;
        block->below = top;
        scratch->top = top = block;
    }
    scratch->last = top->data + top->used;
    scratch->last_capacity = bytes;
    top->used += bytes;
    return scratch->last;
}

void *gn_scratch_take_zeroed(struct gn_scratch *scratch, size_t n, size_t item_bytes)
{
    void *piece = gn_scratch_take(scratch, n, item_bytes);
    if (piece)
        memset(piece, 0, n * item_bytes);
    return piece;
}

void *gn_scratch_grow(struct gn_scratch *scratch, void *piece, size_t n_old, size_t n,
                      size_t item_bytes)
{
    assert(n >= n_old);
    size_t bytes = get_size(n, item_bytes);
    struct block *top = scratch->top;
    if (bytes == SIZE_MAX)
        return NULL;
    if (piece && piece == scratch->last &&
        bytes - scratch->last_capacity <= top->capacity - top->used) {
        top->used += bytes - scratch->last_capacity;
        scratch->last_capacity = bytes;
        return piece;
    }
    void *larger = gn_scratch_take(scratch, n, item_bytes);
    if (larger && n_old > 0)
        memcpy(larger, piece, n_old * item_bytes);
    return larger;
}
