/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The file that says in which direction lamps are.
 */
#ifndef GN_CLIENT_CMD_CALIBRATE_CALIBRATE_LAMPS_H
#define GN_CLIENT_CMD_CALIBRATE_CALIBRATE_LAMPS_H

#include "client/capture/file.h"
#include "common/error.h"
#include "proto/attr.h"

#define GN_LAMPS_MAX 256

struct gn_lamp {
    char picture[GN_FILE_NAME_BYTES]; // that shows it; "*": all
    double dir_world[3];              // unit
};

/**
 * Reads a line PICTURE X Y Z for each lamp, the way to it; blank lines and those that begin with #
 * are skipped. out_lamps has GN_LAMPS_MAX. Returns how many, at least 1, or -EINVAL, -E2BIG, or
 * gn_file_read_text's, and a sentence that names the line.
 */
GN_MUST_USE int gn_lamps_read_file(const char *path, struct gn_lamp *out_lamps,
                                   struct gn_error *out_error);

#endif
