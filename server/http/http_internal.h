/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The documents behind the HTTP door, for the files of this folder only. All run in the HTTP
 * thread.
 */
#ifndef GN_SERVER_HTTP_HTTP_INTERNAL_H
#define GN_SERVER_HTTP_HTTP_INTERNAL_H

#include <stddef.h>

#include "common/jpeg.h"
#include "server/http/http.h"

/** Most sessions that a document lists per room. */
#define GN_HTTP_MAX_SESSIONS 128

/** A document. data is malloc'ed and the caller's; type is static. */
struct gn_document {
    void *data;
    size_t size;
    const char *type;
};

/** What documents are made from. */
struct gn_http_view {
    struct gn_http_options options; // copied
    int64_t start_ns;
    struct gn_jpeg *jpeg; // owner: HTTP thread
};

/** JSON of everything. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_http_make_status(const struct gn_http_view *view, struct gn_document *out);
/** JSON, and whether clients are served: not before the start is over, nor from the stop on.
 * Whether a room has light is told, and does not count. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_http_make_ready(const struct gn_http_view *view, bool *out_is_ready,
                                   struct gn_document *out);
/** Prometheus text format 0.0.4. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_http_make_metrics(const struct gn_http_view *view, struct gn_document *out);
/** JPEG of the room's last composite. Returns 0, -ENOENT (none yet), or another negative errno. */
GN_MUST_USE int gn_http_make_composite(struct gn_http_view *view, struct gn_room *room,
                                       struct gn_document *out);
/** JPEG of the room's light map with its lights. Returns as gn_http_make_composite(). */
GN_MUST_USE int gn_http_make_light(struct gn_http_view *view, struct gn_room *room,
                                   struct gn_document *out);

#endif
