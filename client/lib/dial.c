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

/** Wait until connecting has succeeded or failed. Returns 0 or a negative errno. */
static int wait_connected(const struct gn_client *client, int fd, int64_t deadline_ns)
{
    int err = 0, n = gn_client_wait_fd(client, fd, POLLOUT, deadline_ns);
    socklen_t len = sizeof(err);
    if (n <= 0)
        return n ? n : -ETIMEDOUT;
    if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &err, &len) < 0)
        return -errno;
    return -err;
}

static int dial_address(const struct gn_client *client, const struct addrinfo *address,
                        int64_t deadline_ns, int *out_fd)
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
        err = errno == EINPROGRESS || errno == EINTR ? wait_connected(client, fd, deadline_ns)
                                                     : -errno;
    if (err) {
        close(fd);
        return err;
    }
    *out_fd = fd;
    return 0;
}

int gn_dial(struct gn_client *client, const char *host, uint16_t port, int *out_fd)
{
    struct gn_wire_fault *why = &client->fault;
    int64_t deadline_ns = gn_client_get_deadline(client->timeout_ms);
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
    for (const struct addrinfo *a = addresses; a && err && err != -EINTR; a = a->ai_next)
        err = dial_address(client, a, deadline_ns, out_fd);
    freeaddrinfo(addresses);
    if (err)
        snprintf(why->text, sizeof(why->text), "%.80s port %u: %s", host, port, strerror(-err));
    return err;
}

void gn_dial_close(int fd)
{
    close(fd);
}
