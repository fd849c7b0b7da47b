/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Working memory of one frame, kept by the stream for the next one: after warm-up a frame takes no
 * large memory from the system, whose pages would have to be mapped and cleared each time.
 *
 * One pile: pieces are taken from its top and all given back together. Where it is too small it
 * grows by another block, and when it is given back the blocks become one, so that the next frame
 * of that size needs no more.
 *
 * A method finds the frame's pile in its input (gn_light_input.scratch, server/light/method.h),
 * takes pieces and frees nothing. What does not live on a frame's pile has the table's to borrow:
 *   struct gn_scratch *s = gn_scratch_borrow(&map->table->scratch);
 *   float *sums = s ? gn_scratch_take(s, n, sizeof(*sums)) : NULL;
 *   ...
 *   gn_scratch_give_back(&map->table->scratch, &s);
 */
#ifndef GN_SERVER_LIGHT_SCRATCH_H
#define GN_SERVER_LIGHT_SCRATCH_H

#include <stddef.h>

#include "proto/attr.h"

/** Most that is kept from frame to frame, bytes; a frame may use more. */
#define GN_SCRATCH_KEEP_MAX ((size_t)512 << 20)

/** Thread-safety: unsafe: take the pieces before work goes to a pool. */
struct gn_scratch;

/** Where a stream keeps its pile between frames; NULL: it has none yet, or it is borrowed. */
typedef _Atomic(struct gn_scratch *) gn_scratch_place;

/** The pile of that place, else a new one. NULL: no memory. Thread-safety: safe. */
struct gn_scratch *gn_scratch_borrow(gn_scratch_place *place);
/**
 * Back, all pieces with it; freed where another one is there by now. Nulls *scratch, which may be
 * NULL. Thread-safety: safe.
 */
void gn_scratch_give_back(gn_scratch_place *place, struct gn_scratch **scratch);
/** Frees what the place keeps. */
void gn_scratch_finish(gn_scratch_place *place);

/** n items of so many bytes each (n may be 0), aligned to a cache line, not cleared. NULL: no
 * memory. The first touch of large pieces in the first frames costs their pages. */
void *gn_scratch_take(struct gn_scratch *scratch, size_t n, size_t item_bytes);
/** The same, cleared. */
void *gn_scratch_take_zeroed(struct gn_scratch *scratch, size_t n, size_t item_bytes);
/**
 * A piece (NULL: a new one) that becomes larger, from n_old to n items: in place where nothing was
 * taken since, else a copy. NULL: no memory; the old one stays as it is.
 */
void *gn_scratch_grow(struct gn_scratch *scratch, void *piece, size_t n_old, size_t n,
                      size_t item_bytes);

#endif
