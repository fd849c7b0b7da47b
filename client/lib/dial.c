/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/lib/dial.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/clock.h"

/** Wait until connecting has succeeded or failed. Returns 0 or a negative errno. */
static int wait_connected(int fd, int64_t deadline_ns)
{
    for (;;) {
        int64_t left = deadline_ns - gn_clock_get_monotonic_ns();
        if (left <= 0)
            return -ETIMEDOUT;
        int64_t ms = left / GN_NS_PER_MS + 1;
        struct pollfd p = {.fd = fd, .events = POLLOUT};
        int n = poll(&p, 1, ms > 60000 ? 60000 : (int)ms);
        if (n < 0 && errno != EINTR)
            return -errno;
        if (n <= 0)
            continue;
        int err = 0;
        socklen_t len = sizeof(err);
        if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &err, &len) < 0)
            return -errno;
        return -err;
    }
}

static int dial_address(const struct addrinfo *address, int64_t deadline_ns, int *out_fd)
{
    int fd = socket(address->ai_family, address->ai_socktype, address->ai_protocol);
    if (fd < 0)
        return -errno;
    int err = 0, on = 1;
    int flags = fcntl(fd, F_GETFL);
    if (flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0 ||
        fcntl(fd, F_SETFD, FD_CLOEXEC) < 0 ||
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on)) < 0)
        err = -errno;
    else if (connect(fd, address->ai_addr, address->ai_addrlen) < 0)
        err = errno == EINPROGRESS || errno == EINTR ? wait_connected(fd, deadline_ns) : -errno;
    if (err) {
        close(fd);
        return err;
    }
    *out_fd = fd;
    return 0;
}

int gn_dial(const char *host, uint16_t port, int64_t deadline_ns, int *out_fd,
            struct gn_wire_fault *why)
{
    char service[8];
    snprintf(service, sizeof(service), "%u", port);
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV};
    struct addrinfo *addresses = NULL;
    int lookup = getaddrinfo(host, service, &hints, &addresses);
    if (lookup != 0) {
        snprintf(why->text, sizeof(why->text), "%.80s port %u: %s", host, port,
                 gai_strerror(lookup));
        return -EHOSTUNREACH;
    }
    int err = -EHOSTUNREACH;
    for (const struct addrinfo *a = addresses; a && err; a = a->ai_next)
        err = dial_address(a, deadline_ns, out_fd);
    freeaddrinfo(addresses);
    if (err)
        snprintf(why->text, sizeof(why->text), "%.80s port %u: %s", host, port, strerror(-err));
    return err;
}

void gn_dial_close(int fd)
{
    close(fd);
}
