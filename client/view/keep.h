/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What a person at the window keeps: single pictures, and recordings (record.h), each in a folder
 * of its own. Names have the time, so that nothing is overwritten. Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_VIEW_KEEP_H
#define GN_CLIENT_VIEW_KEEP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "client/lib/gnomon.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

struct gn_keep;

/** dir: where all goes, an existing folder; NULL: the working folder. Returns 0, or -ENOMEM or
 * -ENAMETOOLONG and a sentence. */
GN_MUST_USE int gn_keep_create(const char *dir, struct gn_keep **out_keep,
                               struct gn_error *out_error);
/** Ends a recording. NULL-safe; nulls *keep. */
void gn_keep_destroy(struct gn_keep **keep);

/** Writes the picture of that frame, and where it is to text. Returns 0, -ENODATA (no picture yet),
 * or another negative errno, and a sentence. */
GN_MUST_USE int gn_keep_picture(struct gn_keep *keep, uint64_t id, const struct gn_image8 *picture,
                                char *text, size_t size, struct gn_error *out_error);

/** Begins a recording, or ends it; what was done goes to text. Returns 0, or a negative errno and a
 * sentence. */
GN_MUST_USE int gn_keep_toggle(struct gn_keep *keep, char *text, size_t size,
                               struct gn_error *out_error);
bool gn_keep_is_recording(const struct gn_keep *keep);

/** Adds a result to the recording, if there is one. Returns 0, or a negative errno and a sentence:
 * the recording has ended then. */
GN_MUST_USE int gn_keep_add(struct gn_keep *keep, const struct gn_msg_result *result,
                            const uint8_t *payload, double latency_ms, struct gn_error *out_error);

#endif
