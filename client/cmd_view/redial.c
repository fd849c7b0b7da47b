/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_view/redial.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "common/thread.h"

struct gn_redial {
    struct gn_cmd_link link;
    struct gn_thread thread;
    atomic_bool is_done;     // atomic: release in run(), acquire in gn_redial_is_done()
    atomic_bool is_given_up; // atomic: set by the owner, read by the thread
    // owner: the thread, until it is joined
    struct gn_client *client;
    struct gn_error error;
    int err;
};

static void run(void *context)
{
    struct gn_redial *r = context;
    r->err = gn_cmd_connect_as(&r->link, &r->client, &r->error);
    atomic_store_explicit(&r->is_done, true, memory_order_release);
}

int gn_redial_start(const struct gn_cmd_link *link, struct gn_redial **out_redial,
                    struct gn_error *out_error)
{
    *out_redial = NULL;
    struct gn_redial *r = calloc(1, sizeof(*r));
    if (!r)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    r->link = *link;
    r->link.is_given_up = &r->is_given_up;
    int err = gn_thread_start(&r->thread, "gn-redial", run, r);
    if (err) {
        free(r);
        return gn_error_set(out_error, err, "no thread to connect with");
    }
    *out_redial = r;
    return 0;
}

bool gn_redial_is_done(const struct gn_redial *redial)
{
    return atomic_load_explicit(&redial->is_done, memory_order_acquire);
}

void gn_redial_give_up(struct gn_redial *redial)
{
    atomic_store(&redial->is_given_up, true);
}

int gn_redial_finish(struct gn_redial **redial, struct gn_client **out_client,
                     struct gn_error *out_error)
{
    struct gn_redial *r = *redial;
    *redial = NULL;
    gn_thread_join(&r->thread);
    *out_client = r->client;
    *out_error = r->error;
    int err = r->err;
    free(r);
    return err;
}
