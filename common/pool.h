/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A pool of worker threads that run one loop at a time, item by item, the caller among them.
 * Used for tiles of pictures and rows of maps; nothing here allocates after create.
 */
#ifndef GN_COMMON_POOL_H
#define GN_COMMON_POOL_H

#include "proto/attr.h"

struct gn_pool;

/** Does item `item` of [0, n_items). `worker` in [0, gn_pool_get_size()) indexes per-worker
 * scratch. */
typedef void (*gn_pool_item_fn)(void *context, int item, int worker);

/**
 * Starts n_threads - 1 threads (the caller of gn_pool_run is the last worker). n_threads 0: one per
 * processor this process may run on; [0, 256]. Returns 0, -EINVAL, -ENOMEM, -EAGAIN.
 */
GN_MUST_USE int gn_pool_create(int n_threads, struct gn_pool **out_pool);

/** Joins the threads. NULL-safe; nulls *pool. No gn_pool_run may be under way. */
void gn_pool_destroy(struct gn_pool **pool);

/** Number of workers, the caller of gn_pool_run included; >= 1. Thread-safety: safe. */
int gn_pool_get_size(const struct gn_pool *pool);

/**
 * Runs item(context, i, worker) once for each i in [0, n_items) and returns when all are done.
 * Which worker does which item is not determined: a result must not depend on it. Calls from
 * several threads take turns. A NULL pool runs everything in the caller, as worker 0. Not
 * reentrant: an item must not call gn_pool_run on the same pool. Thread-safety: safe.
 */
void gn_pool_run(struct gn_pool *pool, int n_items, gn_pool_item_fn item, void *context);

#endif
