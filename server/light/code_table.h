/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What each code of an integer sensor format means: decoded once, kept while the curve stays. */
#ifndef GN_SERVER_LIGHT_CODE_TABLE_H
#define GN_SERVER_LIGHT_CODE_TABLE_H

#include "common/response.h"
#include "proto/attr.h"

/** Thread-safety: immutable after create; shared (ref). */
struct gn_code_table {
    _Atomic int references;
    struct gn_response curve; // without table, matrix, scale
    int code_max;
    float linear[]; // [code_max + 1], of code / code_max
};

/**
 * The table of a response's curve for codes in [0, code_max]: the previous one's reference where it
 * is the same (may be NULL; a response that is itself a table is never taken to be). The response
 * has passed gn_response_check. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_code_table_create(const struct gn_response *response, int code_max,
                                     struct gn_code_table *previous,
                                     struct gn_code_table **out_table);
/** NULL-safe; nulls *table. */
void gn_code_table_unref(struct gn_code_table **table);

#endif
