/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Variance minimisation: the region whose energy is most spread out, e - |g|^2 / e with e the sum
 * of Y dOmega and g of Y dOmega d, is cut where the larger of its parts' spreads is least. A lamp
 * stays whole until its own spread is the largest. Source: Viriyothai and Debevec, "Variance
 * Minimization Light Probe Sampling", 2009.
 */
#include <math.h>

#include "server/light/grid_cut.h"

static double get_variance(const double sum[static 4])
{
    return fmax(sum[0] - (sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]) / sum[0], 0);
}

static double get_cost(const double near[static 4], const double far[static 4])
{
    return fmax(get_variance(near), get_variance(far));
}

int gn_variance_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                            struct gn_light_figures *figures)
{
    static const struct gn_grid_cutter cutter = {get_variance, get_cost, .is_median = false};
    (void)figures;
    return gn_grid_cut(input, &cutter, list);
}
