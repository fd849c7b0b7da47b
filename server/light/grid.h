/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The energy grid: the whole sphere as a square of cells of equal solid angle, each with the exact
 * sums of the texels whose centres it holds and of the fill, so that whatever is made of whole
 * cells has the map's energy. It lies in the world's axes (common/octahedral.h), so that a probe
 * may turn while cells, and lights made of them, stay where they are.
 */
#ifndef GN_SERVER_LIGHT_GRID_H
#define GN_SERVER_LIGHT_GRID_H

#include "server/light/method.h"

/** Most cells of a side. */
#define GN_GRID_SIDE_MAX 256

/** Quarters of the square, a quarter turn of the sky each. */
#define GN_GRID_QUARTERS 4

/** n texels in a row of the map, in one cell. */
struct gn_grid_run {
    uint32_t texel, n, cell;
};

/** Which texels lie in which cell: depends on no pixel. Thread-safety: immutable after create;
 * shared (ref). */
struct gn_grid_plan {
    _Atomic int references;
    struct gn_map_table *table; // shared (ref)
    int side;                   // a power of two
    uint32_t *start;            // [side * side + 1] into run; cells row by row, owned
    struct gn_grid_run *run;    // by cell, owned
    uint32_t quarter_start[GN_GRID_QUARTERS + 1]; // into the following
    struct gn_grid_run *in_order; // by quarter, then by texel: as memory is read fastest, owned
    float (*dir_world)[3];        // [side * side] unit, of the cells' middles, owned
    float (*fill)[4];             // [side * side] sr not shown, and its integral of the direction,
                                  // owned; NULL: all is shown
};
void gn_grid_plan_unref(struct gn_grid_plan **plan);

/** What a cell holds. A value; zeroed: nothing. */
struct gn_grid_cell {
    double irradiance[3]; // of L dOmega
    double energy;        // of Y dOmega
    double toward[3];     // of Y dOmega d
    double own_spread;    // as in struct gn_patch
};

/** Thread-safety: unsafe. */
struct gn_grid {
    struct gn_grid_plan *plan; // borrowed of the memory
    const struct gn_radiance_map *map;
    int side;
    struct gn_grid_cell *cell; // [side * side], row by row, of the input's scratch
};

/**
 * The grid of the input's map; its plan is that of the stream's last frame where it fits, and kept
 * in the input's memory. Same bits whatever the pool's size. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_grid_init(struct gn_grid *grid, const struct gn_light_input *input);

void gn_grid_cell_add(struct gn_grid_cell *cell, const struct gn_grid_cell *other);
/** As gn_patch_get_light. */
bool gn_grid_cell_get_light(const struct gn_grid_cell *cell, struct gn_light *out_light);

/** The sum of cells [x0, x1) x [y0, y1). */
struct gn_grid_cell gn_grid_sum(const struct gn_grid *grid, int x0, int y0, int x1, int y1);

/** Most items of a cell. */
int gn_grid_count_items(const struct gn_grid *grid, int cell);
/** Its lit texels, and its fill, one by one; returns their number. */
int gn_grid_list_items(const struct gn_grid *grid, int cell, struct gn_grid_cell *out_items);

#endif
