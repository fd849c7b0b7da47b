/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where a GigE Vision camera is, and what it is asked before Aravis may open it.
 */
#ifndef GN_CLIENT_CAPTURE_GIGE_PLACE_H
#define GN_CLIENT_CAPTURE_GIGE_PLACE_H

#include <stdbool.h>

#include "common/error.h"
#include "proto/attr.h"

/** Where a camera was found. */
struct gn_gige_place {
    char id[128];       // Aravis' name of it: maker-serial number
    char address[64];   // of the camera
    char interface[64]; // of ours that reaches it
};

/**
 * Looks for a camera by id, serial number, address, or any. Returns 0, or -ENODEV and a sentence:
 * no such camera, or one at an address that cannot be reached.
 */
GN_MUST_USE int gn_gige_place_find(const char *id, struct gn_gige_place *out_place,
                                   struct gn_error *out_error);

/** Asks the camera at that place for a sign of life, for 100 ms. */
bool gn_gige_place_answers(const struct gn_gige_place *place);

/**
 * Where the camera says that its description (GenICam XML) is: Aravis would read it from any file
 * of this machine and from any web server, and take as much memory as the camera asks for. Returns
 * 0 where it is kept in the camera and has at most 16 MiB; else -EPERM, or -EIO (no answer), and a
 * sentence. A camera that answers otherwise when Aravis asks again is not caught.
 */
GN_MUST_USE int gn_gige_place_check_description(const struct gn_gige_place *place,
                                                struct gn_error *out_error);

#endif
