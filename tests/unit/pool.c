/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The pool: each item once, by a worker that nobody else is at that time, in any mix of callers.
 */
#include <errno.h>
#include <stdatomic.h>
#include <string.h>

#include "common/pool.h"
#include "common/thread.h"
#include "tests/unit/cmocka_setup.h"

#define MAX_ITEMS 5000
#define MAX_SIZE 8

struct job {
    unsigned char n_done[MAX_ITEMS]; // plain on purpose: TSan sees an item that is done twice
    long per_worker[MAX_SIZE];       // plain on purpose: TSan sees two workers of one index
    int n_workers;
};

static void count_item(void *context, int item, int worker)
{
    struct job *job = context;
    assert_in_range(worker, 0, job->n_workers - 1);
    job->n_done[item]++;
    job->per_worker[worker] += item;
}

static void check_run(struct gn_pool *pool, int n_items)
{
    struct job job;
    memset(&job, 0, sizeof(job));
    job.n_workers = gn_pool_get_size(pool);
    gn_pool_run(pool, n_items, count_item, &job);
    long sum = 0;
    for (int i = 0; i < MAX_ITEMS; i++)
        assert_int_equal(job.n_done[i], i < n_items ? 1 : 0);
    for (int i = 0; i < MAX_SIZE; i++)
        sum += job.per_worker[i];
    assert_int_equal(sum, n_items < 1 ? 0 : (long)n_items * (n_items - 1) / 2);
}

static void test_each_item_once(void **unused)
{
    (void)unused;
    static const int n_items[] = {-1, 0, 1, 2, 3, 7, 64, MAX_ITEMS};
    for (int size = 1; size <= MAX_SIZE; size++) {
        struct gn_pool *pool = NULL;
        assert_int_equal(gn_pool_create(size, &pool), 0);
        assert_int_equal(gn_pool_get_size(pool), size);
        for (int repeat = 0; repeat < 20; repeat++)
            for (size_t i = 0; i < sizeof(n_items) / sizeof(n_items[0]); i++)
                check_run(pool, n_items[i]);
        gn_pool_destroy(&pool);
        assert_null(pool);
    }
}

static void test_null_pool(void **unused)
{
    (void)unused;
    struct gn_pool *none = NULL;
    assert_int_equal(gn_pool_get_size(NULL), 1);
    check_run(NULL, 100);
    gn_pool_destroy(&none);
}

static void test_create_refuses(void **unused)
{
    (void)unused;
    struct gn_pool *pool = (struct gn_pool *)unused;
    assert_int_equal(gn_pool_create(-1, &pool), -EINVAL);
    assert_null(pool);
    assert_int_equal(gn_pool_create(257, &pool), -EINVAL);
    assert_int_equal(gn_pool_create(0, &pool), 0);
    assert_int_equal(gn_pool_get_size(pool), gn_thread_get_cpu_count());
    gn_pool_destroy(&pool);
}

static void run_many(void *context)
{
    for (int i = 0; i < 200; i++)
        check_run(context, i);
}

static void test_callers_take_turns(void **unused)
{
    (void)unused;
    struct gn_thread threads[4] = {0};
    struct gn_pool *pool = NULL;
    assert_int_equal(gn_pool_create(3, &pool), 0);
    for (int i = 0; i < 4; i++)
        assert_int_equal(gn_thread_start(&threads[i], "caller", run_many, pool), 0);
    for (int i = 0; i < 4; i++)
        gn_thread_join(&threads[i]);
    gn_pool_destroy(&pool);
}

static void run_inner(void *context, int item, int worker)
{
    (void)item;
    (void)worker;
    check_run(context, 50);
}

static void test_nested_on_another_pool(void **unused)
{
    (void)unused;
    struct gn_pool *outer = NULL;
    struct gn_pool *inner = NULL;
    assert_int_equal(gn_pool_create(3, &outer), 0);
    assert_int_equal(gn_pool_create(2, &inner), 0);
    gn_pool_run(outer, 20, run_inner, inner);
    gn_pool_destroy(&outer);
    gn_pool_destroy(&inner);
}

struct meeting {
    atomic_int n_present;
    atomic_uint workers; // a bit for each
};

static void meet(void *context, int item, int worker)
{
    struct meeting *meeting = context;
    (void)item;
    atomic_fetch_or(&meeting->workers, 1u << worker);
    atomic_fetch_add(&meeting->n_present, 1);
    while (atomic_load(&meeting->n_present) < 3)
        ;
}

/* Three items that wait for one another end only if three workers, all different, run at once. */
static void test_runs_in_parallel(void **unused)
{
    (void)unused;
    struct gn_pool *pool = NULL;
    assert_int_equal(gn_pool_create(3, &pool), 0);
    for (int i = 0; i < 50; i++) {
        struct meeting meeting = {0};
        gn_pool_run(pool, 3, meet, &meeting);
        assert_int_equal(atomic_load(&meeting.n_present), 3);
        assert_int_equal(atomic_load(&meeting.workers), 7);
    }
    gn_pool_destroy(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_item_once),         cmocka_unit_test(test_null_pool),
        cmocka_unit_test(test_create_refuses),         cmocka_unit_test(test_callers_take_turns),
        cmocka_unit_test(test_nested_on_another_pool), cmocka_unit_test(test_runs_in_parallel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
