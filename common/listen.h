/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Listening sockets, and addresses as text. Thread-safety: safe.
 */
#ifndef GN_COMMON_LISTEN_H
#define GN_COMMON_LISTEN_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/socket.h>

#include "common/error.h"
#include "common/options.h"
#include "proto/attr.h"

/** Longest "[ADDRESS]:PORT", NUL included. */
#define GN_LISTEN_TEXT_BYTES 64

/**
 * A listening TCP socket, non-blocking, on the first address of host that is loopback. what names
 * the door in errors ("--listen"). Port 0 picks one. out_text: where it listens.
 * Returns the socket, or a negative errno and a sentence: -EACCES (host is not a loopback address),
 * -EADDRINUSE, -EADDRNOTAVAIL (no such host), ...
 */
GN_MUST_USE int gn_listen_loopback(const char *what, const struct gn_address *address, int backlog,
                                   char out_text[static GN_LISTEN_TEXT_BYTES],
                                   struct gn_error *out_error);

/** "127.0.0.1:80" or "[::1]:80"; "?" for other families. */
void gn_listen_format(const struct sockaddr *address, socklen_t len,
                      char out_text[static GN_LISTEN_TEXT_BYTES]);

#endif
