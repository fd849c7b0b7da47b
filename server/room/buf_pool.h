/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Payload blocks that come back when their last reader lets go, so that a stream of results of one
 * size takes no memory after the first few.
 */
#ifndef GN_SERVER_ROOM_BUF_POOL_H
#define GN_SERVER_ROOM_BUF_POOL_H

#include <stddef.h>

#include "common/buf.h"
#include "proto/attr.h"

/** Blocks kept at most. */
#define GN_BUF_POOL_KEPT 8

/** Thread-safety: safe. */
struct gn_buf_pool;

GN_MUST_USE int gn_buf_pool_create(struct gn_buf_pool **out_pool);
/** Blocks still out outlive it and free themselves. NULL-safe; nulls *pool. */
void gn_buf_pool_destroy(struct gn_buf_pool **pool);

/** A block of len bytes, not zeroed, with one reference. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_buf_pool_get(struct gn_buf_pool *pool, size_t len, struct gn_buf **out_buf);

#endif
