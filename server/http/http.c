/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/http/http.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <microhttpd.h>

#include "common/clock.h"
#include "common/listen.h"
#include "common/log.h"
#include "common/thread.h"
#include "server/http/guard.h"
#include "server/http/http_internal.h"
#include "server/http/page.h"

GN_LOG_TOPIC("http");

/** Memory of one connection: the longest request line and headers that are read. */
#define CONNECTION_BYTES ((size_t)16 << 10)

/** A connection and what it owes. */
struct visitor {
    int fd;             // -1: free
    int64_t overdue_ns; // when it is closed, unless a request is whole before
};

struct gn_http {
    struct gn_http_view view;
    char address[GN_LISTEN_TEXT_BYTES];
    int listen_fd;
    struct MHD_Daemon *daemon; // owns listen_fd once it runs
    struct gn_mutex mu;
    struct visitor *visitors; // [max_connections], guarded by mu
};

static void append_headers(struct MHD_Response *response, const char *type)
{
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
    MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL, "no-store");
    MHD_add_response_header(response, "X-Content-Type-Options", "nosniff");
    MHD_add_response_header(response, "Cross-Origin-Resource-Policy", "same-origin");
    MHD_add_response_header(response, "Content-Security-Policy",
                            "default-src 'none'; img-src 'self'; connect-src 'self'; "
                            "style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
                            "frame-ancestors 'none'");
}

static enum MHD_Result queue(struct MHD_Connection *connection, unsigned status,
                             struct MHD_Response *response, const char *type)
{
    if (!response)
        return MHD_NO;
    append_headers(response, type);
    if (status == MHD_HTTP_METHOD_NOT_ALLOWED)
        MHD_add_response_header(response, MHD_HTTP_HEADER_ALLOW, "GET, HEAD");
    enum MHD_Result rc = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return rc;
}

/** A static text. */
static enum MHD_Result say(struct MHD_Connection *connection, unsigned status, const char *type,
                           const char *text)
{
    union {
        const char *in;
        void *out;
    } static_text = {text}; // the library does not write to persistent memory
    return queue(
        connection, status,
        MHD_create_response_from_buffer(strlen(text), static_text.out, MHD_RESPMEM_PERSISTENT),
        type);
}

/** A document that was made, or why not. */
static enum MHD_Result give(struct MHD_Connection *connection, unsigned status, int rc,
                            struct gn_document *document)
{
    if (rc == -ENOENT)
        return say(connection, MHD_HTTP_NOT_FOUND, "text/plain; charset=utf-8",
                   "There is no such picture yet: ask again.\n");
    if (rc < 0)
        return say(connection, MHD_HTTP_INTERNAL_SERVER_ERROR, "text/plain; charset=utf-8",
                   "The document could not be made.\n");
    struct MHD_Response *response =
        MHD_create_response_from_buffer(document->size, document->data, MHD_RESPMEM_MUST_FREE);
    if (!response)
        free(document->data);
    return queue(connection, status, response, document->type);
}

/** /api/v1/rooms/NAME/composite.jpg and light.jpg. */
static enum MHD_Result give_picture(struct gn_http *http, struct MHD_Connection *connection,
                                    const char *rest)
{
    const struct gn_http_options *o = &http->view.options;
    const char *slash = strchr(rest, '/');
    struct gn_room *room = NULL;
    for (int i = 0; slash && i < o->n_rooms && !room; i++) {
        const char *name = gn_room_get_options(o->rooms[i])->name;
        if (strlen(name) == (size_t)(slash - rest) &&
            memcmp(name, rest, (size_t)(slash - rest)) == 0)
            room = o->rooms[i];
    }
    struct gn_document document = {0};
    if (room && strcmp(slash, "/composite.jpg") == 0)
        return give(connection, MHD_HTTP_OK, gn_http_make_composite(&http->view, room, &document),
                    &document);
    if (room && strcmp(slash, "/light.jpg") == 0)
        return give(connection, MHD_HTTP_OK, gn_http_make_light(&http->view, room, &document),
                    &document);
    return say(connection, MHD_HTTP_NOT_FOUND, "text/plain; charset=utf-8",
               room ? "A room has composite.jpg and light.jpg.\n" : "There is no such room.\n");
}

static enum MHD_Result route(struct gn_http *http, struct MHD_Connection *connection,
                             const char *url)
{
    static const char rooms[] = "/api/v1/rooms/";
    struct gn_document document = {0};
    if (strcmp(url, "/") == 0)
        return say(connection, MHD_HTTP_OK, "text/html; charset=utf-8", gn_http_page);
    if (strcmp(url, "/healthz") == 0)
        return say(connection, MHD_HTTP_OK, "text/plain; charset=utf-8", "alive\n");
    if (strcmp(url, "/readyz") == 0) {
        bool is_ready = false;
        int rc = gn_http_make_ready(&http->view, &is_ready, &document);
        return give(connection, is_ready ? MHD_HTTP_OK : MHD_HTTP_SERVICE_UNAVAILABLE, rc,
                    &document);
    }
    if (strcmp(url, "/api/v1/status") == 0)
        return give(connection, MHD_HTTP_OK, gn_http_make_status(&http->view, &document),
                    &document);
    if (strcmp(url, "/metrics") == 0)
        return give(connection, MHD_HTTP_OK, gn_http_make_metrics(&http->view, &document),
                    &document);
    if (strncmp(url, rooms, sizeof(rooms) - 1) == 0)
        return give_picture(http, connection, url + sizeof(rooms) - 1);
    return say(connection, MHD_HTTP_NOT_FOUND, "text/plain; charset=utf-8",
               "Here are /, /api/v1/status, /api/v1/rooms/NAME/composite.jpg, "
               "/api/v1/rooms/NAME/light.jpg, /metrics, /healthz and /readyz.\n");
}

static enum MHD_Result handle_request(void *context, struct MHD_Connection *connection,
                                      const char *url, const char *method, const char *version,
                                      const char *upload, size_t *upload_size, void **state)
{
    static char seen; // its address marks a request whose headers were seen
    struct gn_http *http = context;
    (void)version;
    (void)upload;
    (void)upload_size;
    if (strcmp(method, MHD_HTTP_METHOD_GET) != 0 && strcmp(method, MHD_HTTP_METHOD_HEAD) != 0)
        return say(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "text/plain; charset=utf-8",
                   "GET and HEAD are all there is.\n");
    if (!*state) { // the headers: an answer may be given before the body, but not amid it
        *state = &seen;
        const char *length = MHD_lookup_connection_value(connection, MHD_HEADER_KIND,
                                                         MHD_HTTP_HEADER_CONTENT_LENGTH);
        if ((length && strcmp(length, "0") != 0) ||
            MHD_lookup_connection_value(connection, MHD_HEADER_KIND,
                                        MHD_HTTP_HEADER_TRANSFER_ENCODING))
            return say(connection, MHD_HTTP_CONTENT_TOO_LARGE, "text/plain; charset=utf-8",
                       "A request here has no body.\n");
        return MHD_YES;
    }
    const char *host =
        MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST);
    const char *origin =
        MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_ORIGIN);
    if (!gn_guard_is_host(host) || !gn_guard_is_origin(origin))
        return say(connection, MHD_HTTP_FORBIDDEN, "text/plain; charset=utf-8",
                   "Only pages of this host may ask, and only by the names 127.0.0.1, localhost "
                   "and [::1].\n");
    return route(http, connection, url);
}

/** What a request owes from now on: to be whole in time. */
static void restart_clock(struct gn_http *http, int fd, int64_t overdue_ns)
{
    gn_mutex_lock(&http->mu);
    for (int i = 0; i < http->view.options.max_connections; i++) {
        if (http->visitors[i].fd == fd)
            http->visitors[i].overdue_ns = overdue_ns;
    }
    gn_mutex_unlock(&http->mu);
}

static int get_fd(struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info =
        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    return info ? info->connect_fd : -1;
}

/** libmicrohttpd's timeout starts again with every byte; ours runs from connection or answer on. */
static void handle_connection(void *context, struct MHD_Connection *connection, void **state,
                              enum MHD_ConnectionNotificationCode code)
{
    struct gn_http *http = context;
    (void)state;
    int fd = get_fd(connection);
    int from = code == MHD_CONNECTION_NOTIFY_STARTED ? -1 : fd;
    int64_t overdue_ns = gn_clock_get_monotonic_ns() + http->view.options.timeout_s * GN_NS_PER_S;
    gn_mutex_lock(&http->mu);
    for (int i = 0; i < http->view.options.max_connections; i++) {
        struct visitor *v = &http->visitors[i];
        if (v->fd != from)
            continue;
        v->fd = code == MHD_CONNECTION_NOTIFY_STARTED ? fd : -1;
        v->overdue_ns = overdue_ns;
        break;
    }
    gn_mutex_unlock(&http->mu);
}

static void handle_end(void *context, struct MHD_Connection *connection, void **state,
                       enum MHD_RequestTerminationCode code)
{
    struct gn_http *http = context;
    (void)state;
    (void)code;
    restart_clock(http, get_fd(connection),
                  gn_clock_get_monotonic_ns() + http->view.options.timeout_s * GN_NS_PER_S);
}

void gn_http_tend(struct gn_http *http)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    gn_mutex_lock(&http->mu);
    for (int i = 0; i < http->view.options.max_connections; i++) {
        struct visitor *v = &http->visitors[i];
        if (v->fd >= 0 && now_ns >= v->overdue_ns)
            shutdown(v->fd, SHUT_RDWR); // its owner, the HTTP thread, closes it
    }
    gn_mutex_unlock(&http->mu);
}

static int start_daemon(struct gn_http *http, struct gn_error *error)
{
    const struct gn_http_options *o = &http->view.options;
    http->daemon =
        MHD_start_daemon(MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_EPOLL, 0, NULL, NULL,
                         handle_request, http, MHD_OPTION_LISTEN_SOCKET, http->listen_fd, //
                         MHD_OPTION_CONNECTION_LIMIT, (unsigned)o->max_connections,
                         MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)o->timeout_s, //
                         MHD_OPTION_CONNECTION_MEMORY_LIMIT, CONNECTION_BYTES,  //
                         MHD_OPTION_NOTIFY_CONNECTION, handle_connection, http, //
                         MHD_OPTION_NOTIFY_COMPLETED, handle_end, http,         //
                         MHD_OPTION_END);
    if (!http->daemon)
        return gn_error_set(error, -EIO, "--http %s: the HTTP server did not start", http->address);
    http->listen_fd = -1;
    return 0;
}

int gn_http_create(const struct gn_http_options *options, struct gn_http **out_http,
                   struct gn_error *out_error)
{
    *out_http = NULL;
    struct gn_http *http = calloc(1, sizeof(*http));
    if (!http)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    http->view.options = *options;
    http->view.start_ns = gn_clock_get_monotonic_ns();
    http->listen_fd = -1;
    int rc = gn_mutex_init(&http->mu);
    if (rc < 0) {
        free(http);
        return gn_error_set(out_error, rc, "no lock: %s", strerror(-rc));
    }
    http->visitors = malloc((size_t)options->max_connections * sizeof(*http->visitors));
    if (!http->visitors || gn_jpeg_create(&http->view.jpeg) < 0) {
        rc = gn_error_set(out_error, -ENOMEM, "out of memory");
        goto out;
    }
    for (int i = 0; i < options->max_connections; i++)
        http->visitors[i] = (struct visitor){.fd = -1};
    http->listen_fd = gn_listen_loopback("--http", &options->address, 32, http->address, out_error);
    if (http->listen_fd < 0) {
        rc = http->listen_fd;
        goto out;
    }
    rc = start_daemon(http, out_error);
    if (rc < 0)
        goto out;
    *out_http = http;
    return 0;
out:
    gn_http_destroy(&http);
    return rc;
}

void gn_http_destroy(struct gn_http **http)
{
    struct gn_http *h = *http;
    if (!h)
        return;
    if (h->daemon)
        MHD_stop_daemon(h->daemon);
    if (h->listen_fd >= 0)
        close(h->listen_fd);
    gn_jpeg_destroy(&h->view.jpeg);
    free(h->visitors);
    gn_mutex_finish(&h->mu);
    free(h);
    *http = NULL;
}

const char *gn_http_get_address(const struct gn_http *http)
{
    return http->address;
}
