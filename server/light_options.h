/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The light's options as gnomond and gnomon-render both name them.
 */
#ifndef GN_SERVER_LIGHT_OPTIONS_H
#define GN_SERVER_LIGHT_OPTIONS_H

#include "common/options.h"
#include "proto/attr.h"
#include "server/light/state.h"

/**
 * Reads "light-rings" and its like, of section and name as in gn_options_get_int; method and number
 * are the caller's, filled in before. Refuses what is not at its default and would have no effect
 * with the method. Returns 0, or -EINVAL and a sentence.
 */
GN_MUST_USE int gn_light_options_read(const struct gn_options *options, const char *section,
                                      const char *name, struct gn_light_options *light,
                                      struct gn_error *out_error);

#endif
