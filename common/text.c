/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/text.h"

#include <ctype.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Bytes of the UTF-8 sequence at s, or 0 where it is not one (overlong, surrogate, > U+10FFFF). */
static int utf8_length(const unsigned char *s)
{
    static const uint32_t least[5] = {0, 0, 0x80, 0x800, 0x10000};
    int n = s[0] < 0x80             ? 1
            : (s[0] & 0xe0) == 0xc0 ? 2
            : (s[0] & 0xf0) == 0xe0 ? 3
            : (s[0] & 0xf8) == 0xf0 ? 4
                                    : 0;
    if (n <= 1)
        return n;
    uint32_t code = s[0] & (0x7fu >> n);
    for (int i = 1; i < n; i++) {
        if ((s[i] & 0xc0) != 0x80)
            return 0;
        code = code << 6 | (s[i] & 0x3fu);
    }
    if (code < least[n] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000))
        return 0;
    return n;
}

void gn_text_clean(char *text)
{
    unsigned char *s = (unsigned char *)text;
    while (*s != '\0') {
        int n = utf8_length(s);
        /* U+0080 to U+009F are control characters too, two bytes long. */
        bool is_control = n == 1 ? *s < 0x20 || *s == 0x7f : n == 2 && *s == 0xc2 && s[1] < 0xa0;
        if (n == 0)
            *s = '?';
        else if (is_control)
            memset(s, '?', (size_t)n);
        s += n == 0 ? 1 : n;
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
