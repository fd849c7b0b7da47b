/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#define _GNU_SOURCE // sched_getaffinity, CPU_COUNT

#include "common/thread.h"

#include <assert.h>
#include <errno.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <sys/prctl.h>
#include <time.h>

#include "common/clock.h"

/* A failing lock is a bug of ours (a lock that was never initialised, an unlock by a stranger). */
static void must(int result)
{
    assert(result == 0);
    (void)result;
}

int gn_mutex_init(struct gn_mutex *mutex)
{
    return -pthread_mutex_init(&mutex->pthread, NULL);
}

void gn_mutex_finish(struct gn_mutex *mutex)
{
    must(pthread_mutex_destroy(&mutex->pthread));
}

void gn_mutex_lock(struct gn_mutex *mutex) GN_NO_THREAD_SAFETY_ANALYSIS
{
    must(pthread_mutex_lock(&mutex->pthread));
}

void gn_mutex_unlock(struct gn_mutex *mutex) GN_NO_THREAD_SAFETY_ANALYSIS
{
    must(pthread_mutex_unlock(&mutex->pthread));
}

int gn_cond_init(struct gn_cond *cond)
{
    pthread_condattr_t attr;
    int ret = pthread_condattr_init(&attr);
    if (ret != 0)
        return -ret;
    ret = pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    if (ret == 0)
        ret = pthread_cond_init(&cond->pthread, &attr);
    pthread_condattr_destroy(&attr);
    return -ret;
}

void gn_cond_finish(struct gn_cond *cond)
{
    must(pthread_cond_destroy(&cond->pthread));
}

void gn_cond_signal(struct gn_cond *cond)
{
    must(pthread_cond_signal(&cond->pthread));
}

void gn_cond_broadcast(struct gn_cond *cond)
{
    must(pthread_cond_broadcast(&cond->pthread));
}

void gn_cond_wait(struct gn_cond *cond, struct gn_mutex *mutex)
{
    must(pthread_cond_wait(&cond->pthread, &mutex->pthread));
}

bool gn_cond_wait_until(struct gn_cond *cond, struct gn_mutex *mutex, int64_t deadline_ns)
{
    if (deadline_ns <= gn_clock_get_monotonic_ns())
        return false;
    struct timespec deadline = {.tv_sec = (time_t)(deadline_ns / GN_NS_PER_S),
                                .tv_nsec = (long)(deadline_ns % GN_NS_PER_S)};
    int ret = pthread_cond_timedwait(&cond->pthread, &mutex->pthread, &deadline);
    assert(ret == 0 || ret == ETIMEDOUT);
    return ret == 0;
}

static void *run_thread(void *context)
{
    struct gn_thread *thread = context;
    prctl(PR_SET_NAME, thread->name);
    thread->fn(thread->context);
    return NULL;
}

int gn_thread_start(struct gn_thread *thread, const char *name, gn_thread_fn fn, void *context)
{
    *thread = (struct gn_thread){.fn = fn, .context = context, .is_started = true};
    snprintf(thread->name, sizeof(thread->name), "%s", name);

    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int ret = pthread_create(&thread->pthread, NULL, run_thread, thread);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (ret != 0)
        *thread = (struct gn_thread){0};
    return -ret;
}

void gn_thread_join(struct gn_thread *thread)
{
    if (!thread->is_started)
        return;
    must(pthread_join(thread->pthread, NULL));
    *thread = (struct gn_thread){0};
}

int gn_thread_get_cpu_count(void)
{
    cpu_set_t set;
    CPU_ZERO(&set);
    if (sched_getaffinity(0, sizeof(set), &set) != 0)
        return 1;
    int n = CPU_COUNT(&set);
    return n < 1 ? 1 : n;
}
