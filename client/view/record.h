/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What a viewer leaves on disk: one picture per result, and view.json with every receipt
 * (docs/frames.md). Receipts go to the disk as they come: a long run takes no more memory.
 */
#ifndef GN_CLIENT_VIEW_RECORD_H
#define GN_CLIENT_VIEW_RECORD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "client/lib/gnomon.h"
#include "common/error.h"
#include "proto/attr.h"

struct gn_record;

/**
 * Creates the folder where it is missing, removes the view.json of an earlier run and begins a new
 * one, which appears, whole, at gn_record_close. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_record_open(const char *dir, struct gn_record **out, struct gn_error *out_error);

/**
 * Writes NAME.png (or NAME.jpg, as it came) and notes the receipt. latency_ms: from sending the
 * frame to having the result. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_record_add_result(struct gn_record *record, const char *name,
                                     const struct gn_msg_result *result, const uint8_t *payload,
                                     double latency_ms, struct gn_error *out_error);

/** Notes a frame that was dropped. Returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_record_add_dropped(struct gn_record *record, const char *name,
                                      const struct gn_msg_dropped *dropped,
                                      struct gn_error *out_error);

/**
 * Completes view.json and frees. n_sent frames were sent; is_complete: the replay came to its end;
 * counts: of a live source, or NULL.
 * NULL-safe; nulls *record. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_record_close(struct gn_record **record, long n_sent, bool is_complete,
                                const struct gn_source_counts *counts, struct gn_error *out_error);

#endif
