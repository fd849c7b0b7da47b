/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the programs share that photograph markers for tests.
 */
#ifndef GN_TESTS_E2E_SHEETS_H
#define GN_TESTS_E2E_SHEETS_H

#include "client/track/bodies.h"
#include "tests/rig/marker_picture.h"

/** A sheet with the markers of a body whose markers lie in its z = 0, upright. Returns how many. */
int gn_test_print_sheet(const struct gn_bodies *bodies, int body, struct gn_rig_sheet *out);

/** "name": [16 numbers] and what ends it, to standard output. */
void gn_test_print_matrix(const char *name, const double m[static 16], const char *end);

#endif
