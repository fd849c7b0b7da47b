/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/listen.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static bool is_loopback(const struct sockaddr *address)
{
    if (address->sa_family == AF_INET) {
        struct sockaddr_in in;
        memcpy(&in, address, sizeof(in));
        return (ntohl(in.sin_addr.s_addr) >> 24) == 127;
    }
    if (address->sa_family == AF_INET6) {
        struct sockaddr_in6 in6;
        memcpy(&in6, address, sizeof(in6));
        return IN6_IS_ADDR_LOOPBACK(&in6.sin6_addr);
    }
    return false;
}

void gn_listen_format(const struct sockaddr *address, socklen_t len,
                      char out_text[static GN_LISTEN_TEXT_BYTES])
{
    char host[INET6_ADDRSTRLEN];
    if (address->sa_family == AF_INET && len >= sizeof(struct sockaddr_in)) {
        struct sockaddr_in in;
        memcpy(&in, address, sizeof(in));
        inet_ntop(AF_INET, &in.sin_addr, host, sizeof(host));
        snprintf(out_text, GN_LISTEN_TEXT_BYTES, "%s:%u", host, ntohs(in.sin_port));
    } else if (address->sa_family == AF_INET6 && len >= sizeof(struct sockaddr_in6)) {
        struct sockaddr_in6 in6;
        memcpy(&in6, address, sizeof(in6));
        inet_ntop(AF_INET6, &in6.sin6_addr, host, sizeof(host));
        snprintf(out_text, GN_LISTEN_TEXT_BYTES, "[%s]:%u", host, ntohs(in6.sin6_port));
    } else {
        snprintf(out_text, GN_LISTEN_TEXT_BYTES, "?");
    }
}

static int open_listener(const struct sockaddr *address, socklen_t len, int backlog)
{
    int fd = socket(address->sa_family, SOCK_STREAM, 0);
    if (fd < 0)
        return -errno;
    int one = 1;
    int flags = fcntl(fd, F_GETFL);
    if (fcntl(fd, F_SETFD, FD_CLOEXEC) < 0 || flags < 0 ||
        fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0 ||
        setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one)) < 0 ||
        bind(fd, address, len) < 0 || listen(fd, backlog) < 0) {
        int code = -errno;
        close(fd);
        return code;
    }
    return fd;
}

int gn_listen_loopback(const char *what, const struct gn_address *address, int backlog,
                       char out_text[static GN_LISTEN_TEXT_BYTES], struct gn_error *out_error)
{
    char port[8];
    snprintf(port, sizeof(port), "%u", address->port);
    const struct addrinfo hints = {
        .ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV};
    struct addrinfo *list = NULL;
    int gai = getaddrinfo(address->host, port, &hints, &list);
    if (gai != 0)
        return gn_error_set(out_error, -EADDRNOTAVAIL, "%s %s: %s", what, address->host,
                            gai_strerror(gai));
    const struct addrinfo *at = list;
    while (at && !is_loopback(at->ai_addr))
        at = at->ai_next;
    if (!at) {
        freeaddrinfo(list);
        return gn_error_set(out_error, -EACCES,
                            "%s %s: not a loopback address: this server has no encryption yet and "
                            "listens on 127.0.0.1 or [::1] only",
                            what, address->host);
    }
    char wanted[GN_LISTEN_TEXT_BYTES];
    gn_listen_format(at->ai_addr, at->ai_addrlen, wanted);
    int fd = open_listener(at->ai_addr, at->ai_addrlen, backlog);
    freeaddrinfo(list);
    if (fd == -EADDRINUSE)
        return gn_error_set(
            out_error, fd,
            "%s %s: in use: another program listens there, perhaps an older gnomond: "
            "end it, or give another %s ADDRESS:PORT (port 0 picks one)",
            what, wanted, what);
    if (fd < 0)
        return gn_error_set(out_error, fd, "%s %s: %s", what, wanted, strerror(-fd));
    struct sockaddr_storage bound;
    socklen_t len = sizeof(bound);
    if (getsockname(fd, (struct sockaddr *)&bound, &len) < 0) {
        int code = -errno;
        close(fd);
        return gn_error_set(out_error, code, "%s: %s", what, strerror(-code));
    }
    gn_listen_format((struct sockaddr *)&bound, len, out_text);
    return fd;
}
