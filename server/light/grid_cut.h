/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Cutting the energy grid into regions, one light each: rectangles of cells, and below a cell sets
 * of its texels, so that a lamp smaller than a cell can have several lights. The method says which
 * region is cut next, and where; the best first, so that any number of lights is met exactly.
 */
#ifndef GN_SERVER_LIGHT_GRID_CUT_H
#define GN_SERVER_LIGHT_GRID_CUT_H

#include "server/light/grid.h"

/** How a method cuts. Sums of four: energy, energy times direction; all have energy. */
struct gn_grid_cutter {
    double (*get_urgency)(const double sum[static 4]); // the largest region is cut next
    // Of a cut, by what lies on either side: the least is taken.
    double (*get_cost)(const double near[static 4], const double far[static 4]);
    bool is_median; // the cost is least at half of the energy, and cuts cross the longer side;
                    // else all places along both sides are tried
};

/**
 * Adds the lights that are aimed at to the list: fewer only where there are not as many texels with
 * more than 1e-12 of the energy. Ids are those of the cuts that led to a region. 0 or -ENOMEM.
 */
GN_MUST_USE int gn_grid_cut(const struct gn_light_input *input, const struct gn_grid_cutter *cutter,
                            struct gn_light_list *list);

#endif
