/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One interface for all methods that make lights of a radiance map; each is a file of its own.
 */
#ifndef GN_SERVER_LIGHT_METHOD_H
#define GN_SERVER_LIGHT_METHOD_H

#include "server/light/lights.h"
#include "server/light/scratch.h"

/** What a method works from. Borrowed during the call. */
struct gn_light_input {
    const struct gn_radiance_map *map;
    const struct gn_light_settings *settings;
    const struct gn_partition_plan *plan;     // base division and the cells of the fill
    const struct gn_lighting_state *previous; // the stream's last state, or NULL
    // Of the last frame. NULL: of other settings, or of another plan that the method's marks are
    // of.
    const struct gn_light_memory *remembered;
    struct gn_light_memory *memory; // for the next frame, zeroed: the method may fill it
    struct gn_scratch *scratch;     // working memory, given back after the call
    struct gn_pool *pool;           // may be NULL
};

/**
 * Adds the lights of the map to the list, the fill's included, and fills in what the figures say of
 * it. Each light's id is its own within the list, and the same in the next frame where the method
 * means the same light. The same bits whatever the pool's size. Returns 0 or -ENOMEM.
 */
typedef int gn_light_make(const struct gn_light_input *input, struct gn_light_list *list,
                          struct gn_light_figures *figures);

/** One method. */
struct gn_light_maker {
    const char *name;
    gn_light_make *make;
    bool is_of_world; // what it remembers is of the world's cells: a probe may turn
};

/** NULL for a bad method. Static. */
const struct gn_light_maker *gn_light_maker_get(enum gn_light_method method);

/** The paper's partition, in any reading (partition.c). */
gn_light_make gn_partition_make_lights;
/** The importance samples themselves, of equal power (penrose_lights.c). */
gn_light_make gn_penrose_make_lights;
/** Well spread points, put where the energy is (inversion.c). */
gn_light_make gn_inversion_make_lights;
/** Leaves of a tree that changes where the light does (quadtree.c). */
gn_light_make gn_quadtree_make_lights;
/** Regions of equal energy, cut in half again and again (median_cut.c). */
gn_light_make gn_median_cut_make_lights;
/** Regions of as little spread as can be (variance.c). */
gn_light_make gn_variance_make_lights;

#endif
