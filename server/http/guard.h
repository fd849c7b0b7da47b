/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Who may ask. A web page anywhere can make a browser send requests to 127.0.0.1; what it cannot do
 * is make the browser name this host in Host, or hide where the page came from in Origin.
 */
#ifndef GN_SERVER_HTTP_GUARD_H
#define GN_SERVER_HTTP_GUARD_H

#include <stdbool.h>

/**
 * True where the value of Host (may be NULL: there is none) names a loopback host: 127.0.0.1,
 * localhost or [::1], with or without a port. Thread-safety: safe.
 */
bool gn_guard_is_host(const char *host);

/** True where Origin (may be NULL: not from a page of another site) is a page of such a host. */
bool gn_guard_is_origin(const char *origin);

#endif
