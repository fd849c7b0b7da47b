/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A TCP connection to a host by name, with a deadline. */
#ifndef GN_CLIENT_LIB_DIAL_H
#define GN_CLIENT_LIB_DIAL_H

#include <stdint.h>

#include "client/lib/client.h"
#include "proto/attr.h"

/**
 * Try each address of the host in turn until one answers. The socket is non-blocking, with
 * TCP_NODELAY and close-on-exec. Within the client's timeout_ms, which the look-up of the name does
 * not heed. Returns 0, -EHOSTUNREACH (no such host), -ETIMEDOUT, -EINTR (given up), or the last
 * address's errno; the client's fault says host, port and reason.
 */
GN_MUST_USE int gn_dial(struct gn_client *client, const char *host, uint16_t port, int *out_fd);

void gn_dial_close(int fd);

#endif
