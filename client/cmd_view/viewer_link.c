/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How the viewer comes to its server: at the start, and, with a window, after it was lost.
 */
#include <errno.h>
#include <stdio.h>
#include <time.h>

#include "client/cmd_view/redial.h"
#include "client/cmd_view/viewer.h"
#include "common/clock.h"
#include "common/text.h"

/** From one try to connect to the next; it doubles. */
#define FIRST_PAUSE_NS (250 * GN_NS_PER_MS)
#define LAST_PAUSE_NS (2 * GN_NS_PER_S)
/** Of each step of such a try. */
#define REDIAL_TIMEOUT_MS 2000

/** Pumps until then, or until the redial is done. 0 or -EINTR. */
static int pause_until(struct gn_viewer *v, int64_t until_ns, const struct gn_redial *redial)
{
    const struct timespec tick = {.tv_nsec = GN_SHOW_TICK_MS * GN_NS_PER_MS};
    while (redial ? !gn_redial_is_done(redial) : gn_clock_get_monotonic_ns() < until_ns) {
        if (gn_cmd_is_interrupted() || !gn_viewer_pump(v))
            return -EINTR;
        nanosleep(&tick, NULL);
    }
    return 0;
}

/** What was out will not come back: each is noted as dropped. */
static int give_up_pending(struct gn_viewer *v, struct gn_error *out_error)
{
    int err = 0;
    for (int i = 0; i < GN_VIEWER_MAX_OUTSTANDING; i++) {
        struct gn_viewer_pending *p = &v->pending[i];
        const struct gn_msg_dropped dropped = {.id = p->id,
                                               .reason = GN_MSG_DROP_REASON_SESSION_ENDED,
                                               .sentence = "the server was lost"};
        if (p->id && v->record && !err)
            err = gn_record_add_dropped(v->record, p->name, &dropped, out_error);
        v->n_lost += p->id != 0;
        p->id = 0;
    }
    v->n_outstanding = 0;
    return err;
}

/** One try. 0, -EINTR, or why it failed. */
static int dial(struct gn_viewer *v, struct gn_error *out_error)
{
    struct gn_cmd_link link = v->feed.link;
    struct gn_redial *redial = NULL;
    link.timeout_ms = REDIAL_TIMEOUT_MS;
    int err = gn_redial_start(&link, &redial, out_error);
    if (err)
        return err;
    int interrupted = pause_until(v, 0, redial);
    if (interrupted)
        gn_redial_give_up(redial);
    err = gn_redial_finish(&redial, &v->feed.client, out_error);
    if (interrupted)
        gn_client_destroy(&v->feed.client);
    return interrupted ? interrupted : err;
}

/** Waits before the next try, longer each time. 0 or -EINTR. */
static int pause_before(struct gn_viewer *v, int64_t *pause_ns)
{
    int err = pause_until(v, gn_clock_get_monotonic_ns() + *pause_ns, NULL);
    *pause_ns = 2 * *pause_ns < LAST_PAUSE_NS ? 2 * *pause_ns : LAST_PAUSE_NS;
    return err;
}

/** Whether a server may yet come that cannot be reached now; else it is there, and refuses. */
static bool is_absent(int err)
{
    return err == -ECONNREFUSED || err == -ETIMEDOUT || err == -EHOSTUNREACH ||
           err == -ENETUNREACH || err == -EHOSTDOWN || err == -ENETDOWN || err == -ECONNRESET ||
           err == -EPIPE;
}

int gn_viewer_connect(struct gn_viewer *v, struct gn_error *out_error)
{
    const struct gn_cmd_link *link = &v->feed.link;
    const char *server = gn_options_get_string(link->options, NULL, NULL, "server");
    int64_t pause_ns = FIRST_PAUSE_NS;
    char text[320];
    if (!v->show)
        return gn_cmd_connect_as(link, &v->feed.client, out_error);
    snprintf(text, sizeof(text), "waiting for gnomond at %s", server);
    gn_show_set_state(v->show, GN_SHOW_WAITING, text);
    int err = dial(v, out_error);
    if (is_absent(err))
        fprintf(stderr, "%s: %s; waiting for it\n", link->program->name, out_error->text);
    while (is_absent(err)) {
        err = pause_before(v, &pause_ns);
        if (!err)
            err = dial(v, out_error);
    }
    if (err == -EINTR)
        return gn_error_set(out_error, err, "ended before gnomond at %s was there", server);
    gn_show_set_state(v->show, GN_SHOW_LIVE, "");
    return err;
}

int gn_viewer_reconnect(struct gn_viewer *v, int err, struct gn_error *why)
{
    int64_t lost_ns = gn_clock_get_monotonic_ns(), pause_ns = FIRST_PAUSE_NS;
    if (!v->show)
        return err;
    gn_cmd_fail(v->feed.program, why->text);
    gn_client_destroy(&v->feed.client);
    int failed = give_up_pending(v, why);
    if (failed)
        return failed;
    for (err = -ENOTCONN; err;) {
        char text[640];
        snprintf(text, sizeof(text), "server lost, trying again (%s)", why->text);
        gn_show_set_state(v->show, GN_SHOW_TROUBLE, text);
        err = pause_before(v, &pause_ns);
        if (!err)
            err = dial(v, why);
        if (!err)
            err = gn_viewer_send_camera(v, why);
        if (err)
            gn_client_destroy(&v->feed.client);
        if (err == -EINTR)
            return err;
    }
    v->n_reconnected++;
    v->n_dropped_since = 0;
    v->feed.clock_ns = gn_clock_get_monotonic_ns();
    gn_show_set_state(v->show, GN_SHOW_LIVE, "");
    printf("connected again after %.1f s\n", (double)(v->feed.clock_ns - lost_ns) * 1e-9);
    fflush(stdout);
    *why = (struct gn_error){0};
    return 0;
}
