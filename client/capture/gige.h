/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * GigE Vision cameras, through Aravis.
 */
#ifndef GN_CLIENT_CAPTURE_GIGE_H
#define GN_CLIENT_CAPTURE_GIGE_H

#include "client/capture/source.h"

/**
 * Opens a camera and starts it; options->id: its id, serial number or address, or "any". Returns 0,
 * -ENOSYS (built without Aravis), -ENODEV (no such camera), -EBUSY (another program has it), or
 * another negative errno, and a sentence.
 */
GN_MUST_USE int gn_gige_open(const struct gn_live_options *options, struct gn_source **out_source,
                             struct gn_error *out_error);

/** Told of each camera that is found: id, maker and model, address. Borrowed for the call. */
typedef void (*gn_gige_found_fn)(void *context, const char *id, const char *model,
                                 const char *address);

/** Asks the local networks, which takes 1 to 2 s. Returns how many answered, or -ENOSYS. */
int gn_gige_find(gn_gige_found_fn found, void *context);

#endif
