/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Between wire.c, wire_walk.c, wire_check.c and wire_text.c only. */
#ifndef GN_PROTO_WIRE_INTERNAL_H
#define GN_PROTO_WIRE_INTERNAL_H

#include "proto/wire.h"

/** Write the reason and return -EDOM. fault may be NULL. */
GN_PRINTF(2, 3) int gn_wire_refuse(struct gn_wire_fault *fault, const char *format, ...);

/**
 * Every field of the message and of the messages in it: floats finite, enums in range, strings
 * ended, UTF-8 and without control characters, counts within their arrays. Returns 0 or -EDOM.
 */
int gn_wire_walk(const struct gn_wire_info *info, const void *msg, struct gn_wire_fault *fault);

/** What each message means: ranges, what needs what, and the payload's length. After
 * gn_wire_walk(). Returns 0 or -EDOM. */
int gn_wire_check(uint16_t type, const void *msg, uint32_t payload_bytes,
                  struct gn_wire_fault *fault);

/** Fill in the defaults of a message that gn_wire_check() has passed. */
void gn_wire_set_defaults(uint16_t type, void *msg);

#endif
