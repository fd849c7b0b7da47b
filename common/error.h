/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * An error's sentence, carried beside its negative errno: what failed, where, why, what would be
 * right. One line, no full stop, shown to people as it is.
 */
#ifndef GN_COMMON_ERROR_H
#define GN_COMMON_ERROR_H

#include "proto/attr.h"

/** A value; zero it before use. Thread-safety: unsafe. */
struct gn_error {
    char text[512]; // NUL-terminated, cut where too long; control characters replaced by '?'
};

/** Formats into *error (may be NULL) and returns code, so that `return gn_error_set(...)` reads
 * well. */
int gn_error_set(struct gn_error *error, int code, const char *format, ...) GN_PRINTF(3, 4);

#endif
