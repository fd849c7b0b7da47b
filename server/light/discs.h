/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Small suns as lights of their own, whatever the method: a point of light with a share of the
 * energy casts shadows with a hard edge, and many points on it leave few for the rest. The renderer
 * spreads a disc's rays over it.
 */
#ifndef GN_SERVER_LIGHT_DISCS_H
#define GN_SERVER_LIGHT_DISCS_H

#include "server/light/lights.h"

/**
 * Adds the map's compact lights (compact.h) of up to 0.0175 rad and from a share of 0.05 on to the
 * list; one where the stream's last state, previous, had a disc may be a tenth wider and a fifth
 * weaker, and keeps its identity. *out_rest is what they leave, the caller's; NULL: there are none.
 * Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_discs_take(const struct gn_radiance_map *map,
                              const struct gn_lighting_state *previous, struct gn_pool *pool,
                              struct gn_light_list *list, struct gn_radiance_map **out_rest);

#endif
