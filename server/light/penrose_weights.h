/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Lights of importance samples: how much of the map's power each stands for.
 */
#ifndef GN_SERVER_LIGHT_PENROSE_WEIGHTS_H
#define GN_SERVER_LIGHT_PENROSE_WEIGHTS_H

#include "server/light/map_samples.h"
#include "server/light/method.h"

/** Kind of the ids of samples: above all that regions have. */
#define GN_PENROSE_LIGHT_ID (UINT64_C(1) << 63)

/**
 * Adds a light for each sample.
 *   equal: the same power for each, in the mean colour of the 3 x 3 texels about it; then balanced,
 *     channel by channel, to the part of the sphere that the map shows;
 *   density: L / density = L (power / Y) of the sample's texel; the sum is left as it falls;
 *   partition: the sum of L dOmega, and its centroid, over the texels whose nearest sample it is.
 *     Samples of one texel share. Exact per channel.
 * The same bits whatever the pool's size. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_penrose_weigh_samples(const struct gn_light_input *input,
                                         const struct gn_map_samples *samples,
                                         struct gn_light_list *list);

#endif
