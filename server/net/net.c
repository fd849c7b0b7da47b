/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#define _GNU_SOURCE // accept4
#include "server/net/net.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/listen.h"
#include "common/log.h"
#include "common/thread.h"
#include "server/net/session.h"

GN_LOG_TOPIC("net");

/** Sessions that may be on their way out beside those that max_connections allows. */
#define EXTRA_SESSIONS 16
/** Events of one look, and connections taken in one go. */
#define MAX_EVENTS 64
/** How long nobody is let in after the system ran out of descriptors or memory. */
#define ACCEPT_PAUSE_NS (GN_NS_PER_S / 4)
#define STATISTICS_NS GN_NS_PER_S

struct gn_net {
    struct gn_net_options options;
    int listen_fd, epoll_fd, stop_fd;
    char address[GN_LISTEN_TEXT_BYTES];
    struct gn_thread thread;

    // owner: the net thread
    struct gn_session_host host;
    struct gn_session **sessions; // [n_sessions], room for max_connections + EXTRA_SESSIONS
    int n_sessions;
    bool is_stopping;
    int64_t accept_after_ns; // > 0: the listener is not listened to until then
    int64_t statistics_ns;   // when they were sent last
    struct gn_transport_figures counted;

    struct gn_mutex mu;
    struct gn_transport_figures figures; // guarded by mu: what others may read
};

static int watch(struct gn_net *net, int op, int fd, uint32_t events, void *what)
{
    struct epoll_event event = {.events = events, .data.ptr = what};
    return epoll_ctl(net->epoll_fd, op, fd, &event) < 0 ? -errno : 0;
}

int gn_net_create(const struct gn_net_options *options, struct gn_net **out_net,
                  struct gn_error *out_error)
{
    *out_net = NULL;
    struct gn_net *net = calloc(1, sizeof(*net));
    if (!net)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    net->options = *options;
    net->listen_fd = net->epoll_fd = net->stop_fd = -1;
    int rc = gn_mutex_init(&net->mu);
    if (rc < 0) {
        free(net);
        return gn_error_set(out_error, rc, "no lock: %s", strerror(-rc));
    }
    net->host = (struct gn_session_host){
        .rooms = options->rooms,
        .n_rooms = options->n_rooms,
        .mailbox = options->mailbox,
        .server_name = options->server_name,
        .hello_timeout_ns = options->hello_timeout_ms * GN_NS_PER_MS,
        .idle_timeout_ns = options->idle_timeout_ms * GN_NS_PER_MS,
        .stall_timeout_ns = options->stall_timeout_ms * GN_NS_PER_MS,
        .figures = &net->counted,
    };
    net->sessions =
        calloc((size_t)options->max_connections + EXTRA_SESSIONS, sizeof(struct gn_session *));
    net->listen_fd = gn_listen_loopback("--listen", &options->address, 64, net->address, out_error);
    if (net->listen_fd < 0) {
        rc = net->listen_fd;
        goto out;
    }
    net->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    net->stop_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (!net->sessions || net->epoll_fd < 0 || net->stop_fd < 0) {
        rc = gn_error_set(out_error, -ENOMEM, "no memory or descriptors for the network");
        goto out;
    }
    rc = watch(net, EPOLL_CTL_ADD, net->listen_fd, EPOLLIN, &net->listen_fd);
    if (rc == 0)
        rc = watch(net, EPOLL_CTL_ADD, net->stop_fd, EPOLLIN, &net->stop_fd);
    if (rc == 0)
        rc = watch(net, EPOLL_CTL_ADD, gn_mailbox_get_fd(options->mailbox), EPOLLIN,
                   options->mailbox);
    if (rc < 0) {
        gn_error_set(out_error, rc, "cannot watch the sockets: %s", strerror(-rc));
        goto out;
    }
    *out_net = net;
    return 0;
out:
    gn_net_destroy(&net);
    return rc;
}

void gn_net_destroy(struct gn_net **net)
{
    struct gn_net *n = *net;
    if (!n)
        return;
    gn_net_stop(n);
    if (n->listen_fd >= 0)
        close(n->listen_fd);
    if (n->epoll_fd >= 0)
        close(n->epoll_fd);
    if (n->stop_fd >= 0)
        close(n->stop_fd);
    gn_mutex_finish(&n->mu);
    free(n->sessions);
    free(n);
    *net = NULL;
}

const char *gn_net_get_address(const struct gn_net *net)
{
    return net->address;
}

void gn_net_get_figures(struct gn_net *net, struct gn_transport_figures *out_figures)
{
    gn_mutex_lock(&net->mu);
    *out_figures = net->figures;
    gn_mutex_unlock(&net->mu);
}

/** What a session waits for, as epoll wants it. */
static uint32_t get_events(const struct gn_session *session)
{
    return (gn_session_wants_read(session) ? (uint32_t)EPOLLIN : 0) |
           (gn_session_wants_write(session) ? (uint32_t)EPOLLOUT : 0);
}

/** Takes one connection in; the socket is ours. */
static void welcome(struct gn_net *net, int fd, const struct sockaddr *address, socklen_t len,
                    int64_t now_ns)
{
    char peer[GN_LISTEN_TEXT_BYTES];
    gn_listen_format(address, len, peer);
    net->counted.accepted++;
    if (net->n_sessions == net->options.max_connections + EXTRA_SESSIONS) {
        close(fd);
        net->counted.refused_full++;
        return;
    }
    int one = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
    struct gn_session *session;
    if (gn_session_create(&net->host, fd, peer, now_ns, &session) < 0)
        return;
    if (watch(net, EPOLL_CTL_ADD, fd, EPOLLIN, session) < 0) {
        gn_session_destroy(&session);
        return;
    }
    session->watched = EPOLLIN;
    net->sessions[net->n_sessions++] = session;
    if (net->n_sessions > net->options.max_connections) {
        net->counted.refused_full++;
        gn_session_fail(session, GN_MSG_ERROR_CODE_FULL, 0, 0,
                        "this server has as many connections as it may: try later", now_ns);
    }
}

static void accept_some(struct gn_net *net, int64_t now_ns)
{
    for (int i = 0; i < MAX_EVENTS; i++) {
        struct sockaddr_storage address;
        socklen_t len = sizeof(address);
        int fd = accept4(net->listen_fd, (struct sockaddr *)&address, &len,
                         SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd >= 0) {
            welcome(net, fd, (struct sockaddr *)&address, len, now_ns);
            continue;
        }
        if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
            static struct gn_log_limiter limiter;
            gn_log_limited(&limiter, GN_LOG_WARN, "cannot let a client in: %s", strerror(errno));
            net->accept_after_ns = now_ns + ACCEPT_PAUSE_NS;
            (void)watch(net, EPOLL_CTL_MOD, net->listen_fd, 0, &net->listen_fd);
        }
        return; // EAGAIN: that was all; a connection that died meanwhile: level-triggered
    }
}

static struct gn_session *find_session(const struct gn_net *net, uint64_t id)
{
    for (int i = 0; i < net->n_sessions; i++) {
        if (net->sessions[i]->id == id)
            return net->sessions[i];
    }
    return NULL;
}

static void deliver_notes(struct gn_net *net)
{
    struct gn_note *note = gn_mailbox_take_all(net->options.mailbox);
    while (note) {
        struct gn_note *next = note->next;
        struct gn_session *session = find_session(net, note->session_id);
        if (session)
            gn_session_take_note(session, note);
        else
            gn_mailbox_recycle(net->options.mailbox, &note);
        note = next;
    }
}

static void publish_figures(struct gn_net *net)
{
    gn_mutex_lock(&net->mu);
    net->figures = net->counted;
    gn_mutex_unlock(&net->mu);
}

static void start_stopping(struct gn_net *net, int64_t now_ns)
{
    uint64_t count;
    if (read(net->stop_fd, &count, sizeof(count)) < 0)
        return;
    net->is_stopping = true;
    net->counted.is_serving = false;
    publish_figures(net); // before any peer is told: it may ask whether we are ready
    net->accept_after_ns = 0;
    (void)epoll_ctl(net->epoll_fd, EPOLL_CTL_DEL, net->listen_fd, NULL);
    for (int i = 0; i < net->n_sessions; i++)
        gn_session_bye(net->sessions[i], GN_MSG_BYE_REASON_SHUTDOWN, "the server stops", now_ns);
}

static void handle_event(struct gn_net *net, const struct epoll_event *event, int64_t now_ns)
{
    void *what = event->data.ptr;
    if (what == &net->listen_fd) {
        if (!net->is_stopping)
            accept_some(net, now_ns);
    } else if (what == &net->stop_fd) {
        start_stopping(net, now_ns);
    } else if (what == net->options.mailbox) {
        deliver_notes(net);
    } else {
        struct gn_session *session = what;
        if (event->events & (EPOLLIN | EPOLLHUP | EPOLLERR))
            gn_session_read(session, now_ns);
    }
}

static void send_statistics(struct gn_net *net, int64_t now_ns)
{
    if (now_ns - net->statistics_ns < STATISTICS_NS)
        return;
    net->statistics_ns = now_ns;
    for (int i = 0; i < net->n_sessions; i++)
        gn_session_send_statistics(net->sessions[i]);
}

/** After the events: notes, deadlines, writing; who is gone goes. */
static void tend_sessions(struct gn_net *net, int64_t now_ns)
{
    deliver_notes(net);
    send_statistics(net, now_ns);
    for (int i = 0; i < net->n_sessions;) {
        struct gn_session *session = net->sessions[i];
        gn_session_check_time(session, now_ns);
        if (gn_session_wants_write(session))
            gn_session_write(session, now_ns);
        if (session->state == GN_SESSION_GONE) {
            gn_session_destroy(&session); // closing the socket takes it out of epoll
            net->sessions[i] = net->sessions[--net->n_sessions];
            continue;
        }
        uint32_t events = get_events(session);
        if (events != session->watched) {
            session->watched = events;
            (void)watch(net, EPOLL_CTL_MOD, gn_conn_get_fd(session->conn), events, session);
        }
        i++;
    }
    if (net->accept_after_ns > 0 && now_ns >= net->accept_after_ns && !net->is_stopping) {
        net->accept_after_ns = 0;
        (void)watch(net, EPOLL_CTL_MOD, net->listen_fd, EPOLLIN, &net->listen_fd);
    }
    net->counted.connections = net->n_sessions;
    publish_figures(net);
}

/** Milliseconds until something is due; -1: nothing is. */
static int get_timeout_ms(const struct gn_net *net, int64_t now_ns)
{
    int64_t first = net->accept_after_ns > 0 ? net->accept_after_ns : INT64_MAX;
    for (int i = 0; i < net->n_sessions; i++) {
        int64_t due = gn_session_get_deadline(net->sessions[i]);
        if (net->sessions[i]->want_statistics && net->statistics_ns + STATISTICS_NS < due)
            due = net->statistics_ns + STATISTICS_NS;
        first = due < first ? due : first;
    }
    if (first == INT64_MAX)
        return -1;
    int64_t ms = (first - now_ns + GN_NS_PER_MS - 1) / GN_NS_PER_MS;
    return ms < 0 ? 0 : ms > 3600000 ? 3600000 : (int)ms;
}

static void run(void *context)
{
    struct gn_net *net = context;
    struct epoll_event events[MAX_EVENTS];
    int64_t now_ns = gn_clock_get_monotonic_ns();
    while (!net->is_stopping || net->n_sessions > 0) {
        int n = epoll_wait(net->epoll_fd, events, MAX_EVENTS, get_timeout_ms(net, now_ns));
        now_ns = gn_clock_get_monotonic_ns();
        // Sessions are destroyed only after the last event: an event's pointer is good until then.
        for (int i = 0; i < n; i++)
            handle_event(net, &events[i], now_ns);
        tend_sessions(net, now_ns);
    }
}

int gn_net_start(struct gn_net *net)
{
    net->counted.is_serving = true;
    gn_mutex_lock(&net->mu);
    net->figures = net->counted; // before the thread has run: who is told of the start may ask
    gn_mutex_unlock(&net->mu);
    return gn_thread_start(&net->thread, "gn-net", run, net);
}

void gn_net_stop(struct gn_net *net)
{
    uint64_t one = 1;
    if (net->thread.is_started && write(net->stop_fd, &one, sizeof(one)) == sizeof(one))
        gn_thread_join(&net->thread);
}
