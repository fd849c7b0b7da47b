/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Median cut: the region with the most energy is cut across its longer side into halves of equal
 * energy, until there are enough. Where halves are exact, that is level by level, and 2^n lights
 * are those of Debevec, "A Median Cut Algorithm for Light Probe Sampling", 2005.
 */
#include <math.h>

#include "server/light/grid_cut.h"

static double get_urgency(const double sum[static 4])
{
    return sum[0];
}

static double get_cost(const double near[static 4], const double far[static 4])
{
    return fabs(near[0] - far[0]);
}

int gn_median_cut_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                              struct gn_light_figures *figures)
{
    static const struct gn_grid_cutter cutter = {get_urgency, get_cost, .is_median = true};
    (void)figures;
    struct gn_grid grid;
    int rc = gn_grid_init(&grid, input);
    if (rc == 0)
        rc = gn_grid_cut(&grid, &cutter, input->settings->n_aim, list);
    gn_grid_finish(&grid);
    return rc;
}
