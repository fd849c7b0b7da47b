/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Text that is safe to print and to send: what is a character, and what is not.
 */
#ifndef GN_PROTO_UTF8_H
#define GN_PROTO_UTF8_H

#include <stddef.h>

/**
 * Bytes of the well-formed UTF-8 character (RFC 3629) that text starts with; 0 where it is none, a
 * control character or the text's end. text is NUL-terminated. Thread-safety: safe.
 */
size_t gn_utf8_get_character_bytes(const char *text);

#endif
