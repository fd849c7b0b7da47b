/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <stdio.h>
#include <string.h>

#include "client/vision/markers.h"

int gn_marker_find_dictionary(const char *name, size_t name_bytes)
{
    const char *at = GN_MARKER_DICTIONARIES;
    for (int index = 0;; index++) {
        size_t size = strcspn(at, "|");
        if (size == name_bytes && memcmp(at, name, size) == 0)
            return index;
        if (!at[size])
            return -1;
        at += size + 1;
    }
}

void gn_marker_print_name(int dictionary, char *out, size_t out_bytes)
{
    const char *at = GN_MARKER_DICTIONARIES;
    for (int i = 0; i < dictionary && *at; i++) {
        at += strcspn(at, "|");
        at += *at == '|';
    }
    snprintf(out, out_bytes, "%.*s", dictionary < 0 ? 0 : (int)strcspn(at, "|"), at);
}
