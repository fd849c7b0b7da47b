/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What partition.c (sums, samples, lights), partition_count.c (how many lights each region gets),
 * partition_parts.c (where they are) and partition_max.c share. Not for others. Memory is of the
 * frame's scratch.
 */
#ifndef GN_SERVER_LIGHT_PARTITION_INTERNAL_H
#define GN_SERVER_LIGHT_PARTITION_INTERNAL_H

#include "server/light/map_samples.h"
#include "server/light/method.h"
#include "server/light/patch_run.h"
#include "server/light/region_split.h"

/** One base region, or a cell of the dark ones. */
struct gn_region {
    struct gn_patch patch; // its texels
    double mean;           // MLR
    double log_mean;       // log2 of it
    bool is_bright;
    int64_t n_parts; // lights wanted, 0 or more
    int n_items;     // what can be told apart in it: lit texels, or samples
    int first_slot;  // of its lights
    int n_slots;
    size_t first_item; // of its texels, where it is cut by them
    uint32_t n_runs;
};

/** One map's partition on the way. */
struct gn_partition {
    const struct gn_light_input *input;
    const struct gn_radiance_map *map;
    const struct gn_light_settings *settings;
    const struct gn_partition_plan *plan;
    struct gn_region *regions; // [n_regions + n_dark_cells]: behind them what bright ones leave
    int n_regions;             // cells included
    struct gn_run_sums sums;   // of the plan's runs
    bool needs_samples;
    struct gn_map_samples samples;
    uint32_t *sample_start;      // [n_regions + 1] into sample_items
    struct gn_split_item *items; // runs and texels of what is cut, or samples by region
    double mean;                 // MLEM, of this map; after counting the one measured against
    double log_unit;             // log2 of the luminance of one light, after counting
    const uint64_t *marks;       // of the last frame, where it decided; or NULL
    double max;                  // maxLumiEM, for the linear metrics
    struct gn_light *slots;
    bool *is_lit; // of slots
};

static inline bool gn_partition_is_literal(const struct gn_partition *p, unsigned reading)
{
    return (p->settings->literal & reading) != 0;
}

static inline double gn_partition_get_luminance(const struct gn_partition *p, uint32_t texel)
{
    return gn_luminance(p->map->radiance.data + 3 * (size_t)texel);
}

/**
 * The largest luminance after a mean over 5 x 5 texels that show something, as the sphere goes on
 * beyond a border (at a cube's corner three faces meet, and there are fewer): one hot texel does
 * not decide for all. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_partition_get_smoothed_max(const struct gn_radiance_map *map,
                                              struct gn_scratch *scratch, double *out_max);

/**
 * Decides which regions are bright and how many parts each is cut into: is_bright and n_parts. The
 * dark ones are merged into cells, a light each; with the metric log2 a cell that holds more light
 * than the light of a bright region is cut as well, by its light per mean region. In a stream
 * decisions have hysteresis: what they are measured against is kept while the number of lights
 * fits, and each stays while it is within 5 %. The linear metrics, whose number cannot be asked
 * for, decide anew in each frame.
 */
void gn_partition_count_lights(struct gn_partition *p, struct gn_light_figures *figures);
/** Cuts the regions: fills their slots. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_partition_split_regions(struct gn_partition *p);
/** What the next frame is to know. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_partition_remember(const struct gn_partition *p, struct gn_light_memory *memory);

#endif
