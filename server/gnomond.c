/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The daemon: reads its configuration, starts the parts in order, waits for a signal, stops them in
 * the reverse order.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/file.h"
#include "common/log.h"
#include "common/pool.h"
#include "server/config.h"
#include "server/http/http.h"
#include "server/net/net.h"
#include "server/room/room.h"

GN_LOG_TOPIC("gnomond");

/** Everything that runs. */
struct server {
    struct gn_options *options;
    struct gn_pool *pool;
    struct gn_mailbox *mailbox;
    struct gn_room *rooms[GN_ROOMS_MAX];
    int n_rooms;
    struct gn_net *net;
    struct gn_http *http;
};

static int start_rooms(struct server *s, struct gn_error *error)
{
    int n = gn_options_get_name_count(s->options, "room");
    if (n == 0)
        return gn_error_set(error, -EINVAL,
                            "no room: --config must name a file with a section [room NAME] and its "
                            "scene; --print-config prints one");
    if (n > GN_ROOMS_MAX)
        return gn_error_set(error, -EINVAL, "%d rooms, a server has at most %d", n, GN_ROOMS_MAX);
    for (int i = 0; i < n; i++) {
        char scene_path[4096];
        struct gn_room_options room;
        int rc = gn_config_get_room(s->options, i, scene_path, &room, error);
        if (rc < 0)
            return rc;
        room.pool = s->pool;
        room.mailbox = s->mailbox;
        rc = gn_room_create(&room, &s->rooms[i], error);
        if (rc < 0)
            return rc;
        s->n_rooms++;
    }
    return 0;
}

static void get_transport(void *context, struct gn_transport_figures *out_figures)
{
    gn_net_get_figures(context, out_figures);
}

static int start_doors(struct server *s, struct gn_error *error)
{
    struct gn_net_options net = {.rooms = s->rooms, .n_rooms = s->n_rooms, .mailbox = s->mailbox};
    int rc = gn_config_get_net(s->options, &net, error);
    if (rc == 0)
        rc = gn_net_create(&net, &s->net, error);
    if (rc < 0)
        return rc;
    const struct gn_http_options http = {
        .address = gn_options_get_address(s->options, "server", NULL, "http"),
        .rooms = s->rooms,
        .n_rooms = s->n_rooms,
        .server_name = net.server_name,
        .config = s->options,
        .max_connections = gn_options_get_int(s->options, "server", NULL, "http-connections"),
        .timeout_s = gn_options_get_int(s->options, "server", NULL, "http-timeout-s"),
        .get_transport = get_transport,
        .transport_context = s->net,
    };
    rc = gn_http_create(&http, &s->http, error);
    if (rc < 0)
        return rc;
    rc = gn_net_start(s->net);
    return rc < 0 ? gn_error_set(error, rc, "cannot start the network: %s", strerror(-rc)) : 0;
}

static int write_ready_file(const struct server *s, struct gn_error *error)
{
    const char *path = gn_options_get_string(s->options, NULL, NULL, "ready-file");
    if (!path)
        return 0;
    char text[256];
    int n = snprintf(text, sizeof(text), "listen=%s\nhttp=%s\n", gn_net_get_address(s->net),
                     gn_http_get_address(s->http));
    return gn_file_write(path, text, (size_t)n, error);
}

static int start(struct server *s, struct gn_error *error)
{
    int rc = gn_log_set_filter(gn_options_get_string(s->options, "server", NULL, "log"), error);
    if (rc < 0)
        return rc;
    if (gn_log_start() < 0)
        gn_log(GN_LOG_WARN, "no log thread: lines are written by who has them");
    rc = gn_pool_create(gn_options_get_int(s->options, "server", NULL, "threads"), &s->pool);
    if (rc == 0)
        rc = gn_mailbox_create(&s->mailbox);
    if (rc < 0)
        return gn_error_set(error, rc, "cannot start the threads: %s", strerror(-rc));
    rc = start_rooms(s, error);
    if (rc == 0)
        rc = start_doors(s, error);
    if (rc == 0)
        rc = write_ready_file(s, error);
    return rc;
}

/** Sessions first: they hold places in rooms; then who reads rooms; then the rooms. */
static void stop(struct server *s)
{
    if (s->net)
        gn_net_stop(s->net);
    gn_http_destroy(&s->http);
    gn_net_destroy(&s->net);
    for (int i = 0; i < s->n_rooms; i++)
        gn_room_destroy(&s->rooms[i]);
    gn_mailbox_destroy(&s->mailbox);
    gn_pool_destroy(&s->pool);
    gn_log_stop();
    gn_options_destroy(&s->options);
}

/** Waits for SIGTERM or SIGINT; meanwhile looks after what is overdue. */
static int wait_for_signal(struct server *s, const sigset_t *set)
{
    const struct timespec tick = {.tv_sec = 1};
    for (;;) {
        int signal_number = sigtimedwait(set, NULL, &tick);
        if (signal_number > 0)
            return signal_number;
        if (errno != EAGAIN && errno != EINTR)
            return -errno;
        gn_http_tend(s->http);
    }
}

int main(int argc, char *argv[])
{
    struct server server = {0};
    struct gn_error error = {0};
    if (gn_options_load(&gn_gnomond_program, argc, argv, &server.options, &error) < 0) {
        fprintf(stderr, "gnomond: %s\n", error.text);
        return 2;
    }
    if (gn_options_wants_help(server.options) || gn_options_wants_version(server.options) ||
        gn_options_get_bool(server.options, NULL, NULL, "print-config")) {
        if (gn_options_wants_help(server.options))
            gn_options_print_help(&gn_gnomond_program, stdout);
        else if (gn_options_wants_version(server.options))
            printf("gnomond %s\n", GN_VERSION);
        else
            gn_options_print_example(&gn_gnomond_program, stdout);
        gn_options_destroy(&server.options);
        return fflush(stdout) == 0 ? 0 : 1;
    }

    // Before any thread starts: signals are for sigtimedwait only, a closed pipe is an error code.
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    pthread_sigmask(SIG_BLOCK, &set, NULL);
    signal(SIGPIPE, SIG_IGN);

    int rc = start(&server, &error);
    if (rc == 0) {
        gn_log(GN_LOG_INFO, "gnomond %s: %d rooms, clients at %s, http://%s/", GN_VERSION,
               server.n_rooms, gn_net_get_address(server.net), gn_http_get_address(server.http));
        int signal_number = wait_for_signal(&server, &set);
        gn_log(GN_LOG_INFO, "%s: stopping",
               signal_number > 0 ? strsignal(signal_number) : "sigtimedwait failed");
    }
    stop(&server);
    if (rc < 0)
        fprintf(stderr, "gnomond: %s\n", error.text);
    return rc < 0 ? 1 : 0;
}
