/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Records a connection of libgnomon as one stream of a recording. */
#ifndef GN_CLIENT_RECORDING_SESSION_H
#define GN_CLIENT_RECORDING_SESSION_H

#include "client/lib/gnomon.h"
#include "common/error.h"
#include "proto/attr.h"

/**
 * From now on, until the client is destroyed, all that it sends and receives but PING and PONG goes
 * to the file, behind its HELLO (as opts ask for it, without token) and its WELCOME (without resume
 * token). A message is written after it has gone, by the thread that sends it. Where the file can
 * take no more, a line on stderr that begins with opts->client_name says so, once, and the session
 * goes on. Returns 0, or a negative errno and a sentence where the file cannot be a recording.
 */
GN_MUST_USE int gn_recording_record_client(const char *path, uint64_t max_bytes,
                                           const struct gn_client_options *opts,
                                           struct gn_client *client, struct gn_error *out_error);

#endif
