/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomond's configuration: the table of all options, and what the parts are made from it.
 */
#ifndef GN_SERVER_CONFIG_H
#define GN_SERVER_CONFIG_H

#include "common/error.h"
#include "common/options.h"
#include "proto/attr.h"
#include "server/net/net.h"
#include "server/room/room.h"

/** The table, the help's words. deploy/gnomond.conf.example is printed from it. */
extern const struct gn_program gn_gnomond_program;

/**
 * Fills the options of the i-th room but for pool and mailbox. A relative scene path counts from
 * the configuration file's folder, on the command line from the working folder; it is written to
 * out_scene_path, which *out_room borrows. Returns 0, or -ENAMETOOLONG and a sentence.
 */
GN_MUST_USE int gn_config_get_room(const struct gn_options *options, int i,
                                   char out_scene_path[static 4096],
                                   struct gn_room_options *out_room, struct gn_error *out_error);

/** Fills address, name, limits and timeouts. Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_config_get_net(const struct gn_options *options, struct gn_net_options *out_net,
                                  struct gn_error *out_error);

#endif
