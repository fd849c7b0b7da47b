/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/text.h"

#include <ctype.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "proto/utf8.h"

void gn_text_clean(char *text)
{
    while (*text != '\0') {
        size_t n = gn_utf8_get_character_bytes(text);
        if (n == 0)
            *text++ = '?';
        else
            text += n;
    }
}

int gn_text_get_distance(const char *a, const char *b)
{
    int row[64];
    int n_b = (int)strnlen(b, 63);
    int n_a = (int)strnlen(a, 63);
    for (int j = 0; j <= n_b; j++)
        row[j] = j;
    for (int i = 1; i <= n_a; i++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= n_b; j++) {
            bool is_same = tolower((unsigned char)a[i - 1]) == tolower((unsigned char)b[j - 1]);
            int replace = diagonal + (is_same ? 0 : 1);
            int insert = row[j - 1] + 1;
            diagonal = row[j];
            row[j] = row[j] + 1;
            if (insert < row[j])
                row[j] = insert;
            if (replace < row[j])
                row[j] = replace;
        }
    }
    return row[n_b];
}

void gn_text_suggest(const char *name, const char *candidate, const char **best)
{
    int allowed = (int)strnlen(name, 9) / 3;
    allowed = allowed < 1 ? 1 : allowed;
    int distance = gn_text_get_distance(name, candidate);
    if (distance <= allowed && (*best == NULL || distance < gn_text_get_distance(name, *best)))
        *best = candidate;
}
