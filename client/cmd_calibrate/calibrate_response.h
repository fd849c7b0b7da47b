/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The two ways of gnomon calibrate response.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_RESPONSE_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_RESPONSE_H

#include "client/cmd_calibrate/calibrate_series.h"
#include "common/error.h"
#include "common/options.h"
#include "proto/attr.h"

/**
 * From a colour chart that all pictures show; options: those of the command. Prints what it finds
 * and writes --out, --plot, --picture. Returns 0, or a negative errno and a sentence; --out is
 * untouched then.
 */
GN_MUST_USE int gn_calibrate_chart(const struct gn_options *options,
                                   const struct gn_calibrate_series *series,
                                   struct gn_error *out_error);

/** From any still scene in 8 bits, at most GN_STACK_MAX_PICTURES, which it takes out of the series;
 * writes --out and --radiance. */
GN_MUST_USE int gn_calibrate_stack(const struct gn_options *options,
                                   struct gn_calibrate_series *series, struct gn_error *out_error);

#endif
