/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pixels of a frame as they lie in memory; for server/light/map_rows.c. */
#ifndef GN_SERVER_LIGHT_MAP_PIXELS_H
#define GN_SERVER_LIGHT_MAP_PIXELS_H

#include "server/light/map_rows.h"

/**
 * Device values [n][3] of the texels from (x, y) on, by the codes' curve where there are any, not
 * yet mended; and what the row has of clipped and largest codes. Whether there is something to
 * mend.
 */
bool gn_map_pixels_fetch(const struct gn_map_reader *reader, int x, int y, int n, float *out,
                         struct gn_map_row *row);

/** Whether a channel of that pixel came in infinite. */
bool gn_map_pixels_is_infinite(const struct gn_map_reader *reader, int x, int y);

#endif
