/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A counted block of bytes: a payload that was received, or one that is on its way to several
 * peers. Filled by one owner, then shared and immutable.
 */
#ifndef GN_COMMON_BUF_H
#define GN_COMMON_BUF_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/attr.h"

struct gn_buf;

/** Called when the last reference goes; frees or recycles buf itself and what it points to. Any
 * thread. */
typedef void (*gn_buf_release_fn)(struct gn_buf *buf);

/** Thread-safety: counting is safe; the bytes are immutable once shared. */
struct gn_buf {
    uint8_t *data;
    size_t len;                // bytes; an owner that has not shared it yet may lower it
    atomic_uint refs;          // atomic: release in unref, acquire before the release function runs
    gn_buf_release_fn release; // never NULL
    void *user;                // for the release function
};

/** A block of len bytes (uninitialised; len may be 0) with one reference. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_buf_create(size_t len, struct gn_buf **out);

/** Set up a caller's struct around a caller's memory, with one reference: for pools and borrowed
 * bytes. */
void gn_buf_init(struct gn_buf *buf, uint8_t *data, size_t len, gn_buf_release_fn release,
                 void *user);

/** One more reference. Returns buf; NULL gives NULL. */
struct gn_buf *gn_buf_ref(struct gn_buf *buf);

/** One reference less; sets *buf to NULL. NULL and pointer to NULL are fine. */
void gn_buf_unref(struct gn_buf **buf);

#endif
