/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The lighting state: everything rendering knows of the light, one immutable published object.
 */
#ifndef GN_SERVER_LIGHT_STATE_H
#define GN_SERVER_LIGHT_STATE_H

#include <stdint.h>

#include "server/light/radiance_map.h"

/** Most lights a state may hold. */
#define GN_LIGHTS_MAX 4096

/** A distant light. */
struct gn_light {
    float dir_world[3];   // unit, towards the light
    float angular_radius; // rad, 0: a point at infinity
    float irradiance[3];  // RGB at normal incidence, W/m^2
};

/** How lights are made from the map. */
enum gn_light_method {
    GN_LIGHT_PARTITION_ENERGY = 0, // the default; regions keep their energy
    GN_LIGHT_PARTITION_SEED = 1,   // the paper's literal partition
    GN_LIGHT_PENROSE = 2,          // the hierarchical importance samples themselves, equal power
    GN_LIGHT_METHOD_COUNT
};

enum gn_partition_metric {
    GN_METRIC_DEFAULT = 0,
    GN_METRIC_POW2 = 1,
    GN_METRIC_TWICE = 2,
    GN_METRIC_LOG2 = 3
};

/** Options; all-zero is the default of the method. */
struct gn_light_options {
    enum gn_light_method method;
    int n_lights;  // wanted number where the method can aim, [1, GN_LIGHTS_MAX]; default 64
    int rings;     // base division; default 4 (energy) or 8 (seed)
    int sectors;   // default 12 (energy) or 24 (seed)
    int max_ls;    // the paper's maxLS; default 8
    int n_samples; // Penrose samples under the partition; default 16 per base region
    enum gn_partition_metric metric; // default log2 (energy) or 2^k (seed)
    bool no_sh;                      // leave the SH irradiance out
};

/** Published by the light thread, read by all. Thread-safety: immutable after create; shared (ref).
 */
struct gn_lighting_state {
    int references;              // atomic
    struct gn_radiance_map *map; // shared (ref), never NULL
    bool has_sh;
    double sh[9][3]; // L_lm of the radiance in world axes, order 00 1-1 10 11 2-2 2-1 20 21 22
    int n_lights;
    struct gn_light *lights; // [n_lights], owned; by falling luminance
    double
        total_irradiance[3]; // sum over map of L dOmega, W/m^2 (what the lights should add up to)
    uint64_t sequence;       // of the environment frame
    int64_t capture_time_ns;
    int64_t published_time_ns;
    double ms_map, ms_sh, ms_lights; // time spent, ms
};

/** Makes a state from a frame. Returns 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_lighting_state_create(const struct gn_environment_frame *frame,
                                         const struct gn_radiance_map_options *map_options,
                                         const struct gn_light_options *options,
                                         struct gn_pool *pool, struct gn_lighting_state **out_state,
                                         struct gn_error *out_error);
struct gn_lighting_state *gn_lighting_state_ref(struct gn_lighting_state *state);
/** NULL-safe; nulls *state. */
void gn_lighting_state_unref(struct gn_lighting_state **state);

/** "partition", "seed", "penrose"; NULL for a bad method. */
const char *gn_light_method_get_name(enum gn_light_method method);
/** The method of that name, or -EINVAL. */
GN_MUST_USE int gn_light_method_from_name(const char *name, enum gn_light_method *out_method);

#endif
