/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The pixels of one frame, row by row: from codes or floats as they came in to radiance, mended,
 * counted and summed while the row is still in the cache. Rows know nothing of each other, so that
 * any number of threads gives the same bits.
 */
#ifndef GN_SERVER_LIGHT_MAP_ROWS_H
#define GN_SERVER_LIGHT_MAP_ROWS_H

#include <stdbool.h>

#include "server/light/code_table.h"
#include "server/light/map_table.h"
#include "server/light/radiance_map.h"

/** What one row adds to the figures. */
struct gn_map_row {
    int n_nan, n_inf, n_negative, n_capped, n_clipped, n_out_of_gamut;
    int largest_code; // of integer layouts
    float max_channel;
    double irradiance[3];             // sum of L dOmega
    double upward[3];                 // sum of L max(0, d . axis) dOmega; 0 for whole spheres
    double luminance[GN_MAP_PATCHES]; // sum of Y dOmega over its texels in each patch
};

/** How the rows of one frame are read. */
struct gn_map_reader {
    const struct gn_environment_frame *frame; // borrowed
    const struct gn_map_table *table;         // borrowed
    const struct gn_code_table *codes;        // borrowed; NULL: the response texel by texel
    float *radiance;                          // [height][width][3], borrowed
    bool has_curve;                           // decode texel by texel
    bool has_matrix;
    double matrix[9]; // with the scale
    double scale;
};

/** Fills what follows from frame (which has been checked), table and codes. */
void gn_map_reader_init(struct gn_map_reader *reader);

/** Bytes of one pixel of a raw layout; 0: GN_PIXELS_IMAGE. */
int gn_pixel_layout_get_bytes(enum gn_pixel_layout layout);

/**
 * Reads row y: radiance, 0 where the map shows nothing or a channel is infinite, and *out_row.
 */
void gn_map_row_read(const struct gn_map_reader *reader, int y, struct gn_map_row *out_row);

/** The largest luminance of row y as it is now. */
double gn_map_row_get_max_luminance(const struct gn_map_reader *reader, int y);

/**
 * After all rows are read: gives each texel of row y that has an infinite channel the median, by
 * channel, of its finite neighbours, and sums the row anew.
 */
void gn_map_row_mend(const struct gn_map_reader *reader, int y, struct gn_map_row *row);

#endif
