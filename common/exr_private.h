/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What exr.c (OpenEXRCore), exr_write.c and exr_by_name.c (OpenEXR's RGBA interface) share. */
#ifndef GN_COMMON_EXR_PRIVATE_H
#define GN_COMMON_EXR_PRIVATE_H

#include <openexr.h>

#include "common/error.h"
#include "common/exr.h"

/** What the callbacks of one context work on; its user data. */
struct gn_exr_stream {
    const uint8_t *data;           // reading
    uint64_t size;                 // bytes, reading
    struct gn_file_writer *writer; // writing
    struct gn_error message;       // the first that OpenEXR told
};

/** exr_error_handler_cb_t: keeps the first message. */
void gn_exr_keep_message(exr_const_context_t context, exr_result_t code, const char *message);

/** Formats "<doing> <what>: <OpenEXR's message or the code's>"; returns the errno for the code. */
int gn_exr_set_error(const struct gn_exr_stream *stream, exr_result_t code, const char *doing,
                     struct gn_error *out_error);

/**
 * Reads the default R, G, B or Y of a file whose header was checked, by name. info is what that
 * header says.
 */
GN_MUST_USE int gn_exr_read_by_name(const char *path, const struct gn_exr_info *info,
                                    struct gn_image *out_image, bool *out_saturated,
                                    struct gn_error *out_error);

#endif
