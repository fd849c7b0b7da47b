/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A TCP connection to a host by name, with a deadline. */
#ifndef GN_CLIENT_LIB_DIAL_H
#define GN_CLIENT_LIB_DIAL_H

#include <stdint.h>

#include "proto/attr.h"
#include "proto/wire.h"

/**
 * Try each address of the host in turn until one answers. The socket is non-blocking, with
 * TCP_NODELAY and close-on-exec. deadline_ns: own monotonic clock; the look-up of the name does not
 * heed it. Returns 0, -EHOSTUNREACH (no such host), -ETIMEDOUT, or the last address's errno; why
 * says host, port and reason. Thread-safety: safe.
 */
GN_MUST_USE int gn_dial(const char *host, uint16_t port, int64_t deadline_ns, int *out_fd,
                        struct gn_wire_fault *why);

void gn_dial_close(int fd);

#endif
