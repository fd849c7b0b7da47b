/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/pool.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

#include "common/thread.h"

#define MAX_WORKERS 256

struct worker {
    struct gn_pool *pool;
    int index;
    struct gn_thread thread;
};

/*
 * A run hands out tickets, one per helper that could be of use. A helper that wakes takes a ticket
 * and items until none is left. When the caller finds no item left it tears up the tickets that
 * nobody took, so that it waits only for helpers at work and never for one that has yet to wake.
 */
struct gn_pool {
    int n_workers;          // immutable after create; the caller included
    struct worker *workers; // [n_workers - 1]; owned
    struct gn_mutex turn;   // held by the caller of gn_pool_run; taken before mu
    struct gn_mutex mu;
    struct gn_cond wake;   // tickets > 0 or is_stopping
    struct gn_cond done;   // n_helping == 0
    int tickets;           // guarded by mu
    int n_helping;         // guarded by mu
    bool is_stopping;      // guarded by mu
    gn_pool_item_fn item;  // guarded by mu; fixed while n_helping > 0
    void *context;         // as item
    int n_items;           // as item
    atomic_long next_item; // atomic: only counts; mu publishes what the items wrote
};

/* Takes items until none is left. The run's fields are fixed meanwhile, so mu is not needed. */
static void do_items(struct gn_pool *pool, int worker)
{
    for (;;) {
        long i = atomic_fetch_add_explicit(&pool->next_item, 1, memory_order_relaxed);
        if (i >= pool->n_items)
            return;
        pool->item(pool->context, (int)i, worker);
    }
}

static void run_worker(void *context)
{
    struct worker *worker = context;
    struct gn_pool *pool = worker->pool;
    gn_mutex_lock(&pool->mu);
    for (;;) {
        while (!pool->is_stopping && pool->tickets == 0)
            gn_cond_wait(&pool->wake, &pool->mu);
        if (pool->is_stopping)
            break;
        pool->tickets--;
        pool->n_helping++;
        gn_mutex_unlock(&pool->mu);
        do_items(pool, worker->index);
        gn_mutex_lock(&pool->mu);
        pool->n_helping--;
        if (pool->n_helping == 0)
            gn_cond_signal(&pool->done);
    }
    gn_mutex_unlock(&pool->mu);
}

/* Stops and joins the first n_started helpers, and frees everything. */
static void stop(struct gn_pool *pool, int n_started)
{
    gn_mutex_lock(&pool->mu);
    pool->is_stopping = true;
    gn_cond_broadcast(&pool->wake);
    gn_mutex_unlock(&pool->mu);
    for (int i = 0; i < n_started; i++)
        gn_thread_join(&pool->workers[i].thread);
    gn_cond_finish(&pool->done);
    gn_cond_finish(&pool->wake);
    gn_mutex_finish(&pool->mu);
    gn_mutex_finish(&pool->turn);
    free(pool->workers);
    free(pool);
}

/* All four or none. */
static int init_locks(struct gn_pool *pool)
{
    int ret = gn_mutex_init(&pool->turn);
    if (ret < 0)
        return ret;
    ret = gn_mutex_init(&pool->mu);
    if (ret < 0)
        goto finish_turn;
    ret = gn_cond_init(&pool->wake);
    if (ret < 0)
        goto finish_mu;
    ret = gn_cond_init(&pool->done);
    if (ret == 0)
        return 0;

    gn_cond_finish(&pool->wake);
finish_mu:
    gn_mutex_finish(&pool->mu);
finish_turn:
    gn_mutex_finish(&pool->turn);
    return ret;
}

int gn_pool_create(int n_threads, struct gn_pool **out_pool)
{
    *out_pool = NULL;
    if (n_threads < 0 || n_threads > MAX_WORKERS)
        return -EINVAL;
    if (n_threads == 0)
        n_threads = gn_thread_get_cpu_count();
    if (n_threads > MAX_WORKERS)
        n_threads = MAX_WORKERS;

    struct gn_pool *pool = calloc(1, sizeof(*pool));
    if (pool == NULL)
        return -ENOMEM;
    pool->n_workers = n_threads;
    pool->workers = calloc((size_t)n_threads, sizeof(*pool->workers));
    int ret = pool->workers == NULL ? -ENOMEM : init_locks(pool);
    if (ret < 0) {
        free(pool->workers);
        free(pool);
        return ret;
    }
    for (int i = 0; i < n_threads - 1; i++) {
        struct worker *worker = &pool->workers[i];
        worker->pool = pool;
        worker->index = i;
        ret = gn_thread_start(&worker->thread, "gn-pool", run_worker, worker);
        if (ret < 0) {
            stop(pool, i);
            return ret;
        }
    }
    *out_pool = pool;
    return 0;
}

void gn_pool_destroy(struct gn_pool **pool)
{
    if (*pool == NULL)
        return;
    stop(*pool, (*pool)->n_workers - 1);
    *pool = NULL;
}

int gn_pool_get_size(const struct gn_pool *pool)
{
    return pool == NULL ? 1 : pool->n_workers;
}

void gn_pool_run(struct gn_pool *pool, int n_items, gn_pool_item_fn item, void *context)
{
    if (pool == NULL) {
        for (int i = 0; i < n_items; i++)
            item(context, i, 0);
        return;
    }
    if (n_items <= 0)
        return;
    int n_helpers = pool->n_workers - 1;
    if (n_items - 1 < n_helpers)
        n_helpers = n_items - 1;

    gn_mutex_lock(&pool->turn);
    gn_mutex_lock(&pool->mu);
    pool->item = item;
    pool->context = context;
    pool->n_items = n_items;
    atomic_store_explicit(&pool->next_item, 0, memory_order_relaxed);
    pool->tickets = n_helpers;
    if (n_helpers > 0)
        gn_cond_broadcast(&pool->wake);
    gn_mutex_unlock(&pool->mu);

    do_items(pool, pool->n_workers - 1);

    gn_mutex_lock(&pool->mu);
    pool->tickets = 0;
    while (pool->n_helping > 0)
        gn_cond_wait(&pool->done, &pool->mu);
    gn_mutex_unlock(&pool->mu);
    gn_mutex_unlock(&pool->turn);
}
