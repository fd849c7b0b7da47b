/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the methods that make lights of a map share: the sums over a patch of the sphere, the light
 * that stands for it, and the list they fill.
 */
#ifndef GN_SERVER_LIGHT_LIGHTS_H
#define GN_SERVER_LIGHT_LIGHTS_H

#include "proto/attr.h"
#include "server/light/partition_plan.h"
#include "server/light/state.h"

struct gn_grid_plan;   // server/light/grid.h
struct gn_light_input; // server/light/method.h
struct gn_scratch;     // server/light/scratch.h

/** Sums over texels, in double. A value; zeroed: empty. */
struct gn_patch {
    double irradiance[3]; // of L dOmega
    double energy;        // of Y dOmega
    double toward[3];     // of Y dOmega d
    double own_spread;    // of Y dOmega (dOmega / 4 pi): 1 - |mean direction| within the texels
    double solid_angle;   // of dOmega
    int n_lit;            // texels with light
    // Where the light starts.
    bool is_placed;   // of a map with geometry (global model)
    double nearness;  // of Y dOmega / distance
    double normal[3]; // of Y dOmega n, n the surface's, to the probe's side
};

/** Adds one texel of the map. */
void gn_patch_add_texel(struct gn_patch *patch, const struct gn_radiance_map *map, uint32_t texel);
/** Adds n texels from the first on: up to rounding, 1e-6, the same sums, and much faster. */
void gn_patch_add_run(struct gn_patch *patch, const struct gn_radiance_map *map, uint32_t first,
                      uint32_t n);
/** Adds another patch. */
void gn_patch_add(struct gn_patch *patch, const struct gn_patch *other);
/**
 * The light of a patch: its irradiance from its energy's centroid, as wide as the disc of even
 * radiance whose mean direction is as long, 1 - |mean| = (1 - cos angular_radius) / 2. Its distance
 * is |mean direction| / mean(1 / distance), which for any part of a plane lies on that plane.
 * False for a black patch.
 */
bool gn_patch_get_light(const struct gn_patch *patch, struct gn_light *out_light);

/**
 * Ids: the kind in the upper four bits, the method's own number below; samples have the highest
 * bit. A list's ids differ.
 */
#define GN_LIGHT_ID_REGION (UINT64_C(1) << 60)
#define GN_LIGHT_ID_DARK (UINT64_C(2) << 60)
#define GN_LIGHT_ID_FILL (UINT64_C(3) << 60)

/** A list that grows. Zeroed but for the scratch: empty. Thread-safety: unsafe. */
struct gn_light_list {
    int n, capacity;
    struct gn_light *lights;    // of the scratch
    struct gn_scratch *scratch; // borrowed
};
/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_light_list_add(struct gn_light_list *list, const struct gn_light *light);
/** One light for each cell that the map does not show, of the map's fill; ids of the kind fill. */
GN_MUST_USE int gn_light_list_add_fill(struct gn_light_list *list,
                                       const struct gn_radiance_map *map,
                                       const struct gn_partition_plan *plan, int *out_n);

/**
 * The options with each default of their method filled in, and what follows from them. Compared
 * byte by byte: zero it before use.
 */
struct gn_light_settings {
    enum gn_light_method method;
    unsigned literal; // the readings in effect
    enum gn_partition_metric metric;
    struct gn_division division;
    int max_ls;
    int n_samples;
    int n_aim; // 0: none
    enum gn_light_weights weights;
    bool relaxed;
    bool has_discs;
};

/**
 * What a method keeps of one frame for the next of the stream, so that its decisions have
 * hysteresis. Only methods know what their figures and marks mean. Zeroed: nothing kept.
 */
struct gn_light_memory {
    _Atomic int more_references;       // besides the first
    struct gn_light_settings settings; // that it was kept under
    double figure[4];
    int n_marks;
    uint64_t *marks;           // [n_marks], owned
    struct gn_grid_plan *grid; // shared (ref), may be NULL: fits any settings
};
/*
 * What lights are counted against, the power of a sample or the luminance of a light, is kept from
 * frame to frame, so that what changes in one place changes lights there only. It follows when it
 * no longer fits, by an exponential of time constant 1 s, and at once where it is off by more than
 * a factor of 4.
 */

/** Whether it fits: count_ratio, lights met over lights wanted, lies in [3/4, 5/4]. */
bool gn_light_is_count_kept(double count_ratio);
/** How much of the way to the new it goes in the time since the last frame: [0, 1). */
double gn_light_get_share(const struct gn_light_input *input);
/** The unit to use, of the one kept and the one that fits this frame. */
double gn_light_follow(const struct gn_light_input *input, double kept, double fresh,
                       double count_ratio);

/** Both share it. */
struct gn_light_memory *gn_light_memory_ref(struct gn_light_memory *memory);
/** Drops a reference. NULL-safe; nulls *memory. */
void gn_light_memory_unref(struct gn_light_memory **memory);

/** Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_light_settings_init(struct gn_light_settings *settings,
                                       const struct gn_light_options *options,
                                       const struct gn_radiance_map *map,
                                       struct gn_error *out_error);

#endif
