/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Small helpers on text that comes from outside: making it fit to print, and finding the name that
 * was meant. Shared by errors, log, options and JSON. Thread-safety of all functions: safe.
 */
#ifndef GN_COMMON_TEXT_H
#define GN_COMMON_TEXT_H

/**
 * Makes text one safe line, in place: control characters and bytes that are not valid UTF-8
 * (RFC 3629) become '?'. An escape sequence of a terminal cannot survive this.
 */
void gn_text_clean(char *text);

/**
 * Number of single-character insertions, deletions and replacements from a to b (Levenshtein),
 * case ignored. Only the first 63 bytes of each count.
 */
int gn_text_get_distance(const char *a, const char *b);

/**
 * Keeps in *best the candidate closest to name, for "did you mean". Start with *best NULL; call
 * once per candidate. Candidates further than a third of name's length (at least 1, at most 3
 * edits) are passed over. The candidate is borrowed.
 */
void gn_text_suggest(const char *name, const char *candidate, const char **best);

#endif
