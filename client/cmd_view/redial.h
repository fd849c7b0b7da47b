/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Connecting in a thread of its own, for a program that must not stand still meanwhile.
 */
#ifndef GN_CLIENT_CMD_VIEW_REDIAL_H
#define GN_CLIENT_CMD_VIEW_REDIAL_H

#include <stdbool.h>

#include "client/cmd.h"

/** Owner: who started it. */
struct gn_redial;

/** Starts to connect. What link points to is borrowed until finish. Returns 0, or -ENOMEM or
 * -EAGAIN and a sentence. */
GN_MUST_USE int gn_redial_start(const struct gn_cmd_link *link, struct gn_redial **out_redial,
                                struct gn_error *out_error);

/** Has it come to an end, one way or the other? Does not wait. */
bool gn_redial_is_done(const struct gn_redial *redial);

/** It is not wanted any more: it ends soon, with -EINTR unless it had an answer already. */
void gn_redial_give_up(struct gn_redial *redial);

/** Waits for the end and nulls *redial. Returns as gn_cmd_connect. */
GN_MUST_USE int gn_redial_finish(struct gn_redial **redial, struct gn_client **out_client,
                                 struct gn_error *out_error);

#endif
