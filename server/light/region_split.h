/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Cuts a region of the sphere, given as weighted points in polar coordinates, into parts.
 */
#ifndef GN_SERVER_LIGHT_REGION_SPLIT_H
#define GN_SERVER_LIGHT_REGION_SPLIT_H

#include <stdbool.h>
#include <stdint.h>

#include "server/light/partition_plan.h"

#define GN_NO_RUN UINT32_MAX

/** Texels side by side, or a sample. */
struct gn_split_item {
    float polar[2]; // theta, phi
    float weight;   // >= 0; only ratios matter
    uint32_t texel; // the first
    uint32_t n;     // of consecutive ones; 1 for a sample
    uint32_t run;   // that they are, of the plan's; or GN_NO_RUN: one texel of some run
};

/** How to cut. */
struct gn_split_options {
    int64_t n_parts;    // wanted, >= 1
    bool is_midpoint;   // cut in the middle of the longer side; else at the median of the weight
    bool is_two_strips; // halve once, then strips of each half; else halve again and again
};

/** Takes one part that is not empty. path: a leading 1, then a bit for each cut, 1: above it. */
typedef void (*gn_split_part_fn)(void *context, const struct gn_split_item *items, int n,
                                 uint64_t path);

/** Reorders items. Calls part at most min(n_parts, n) times, in a fixed order. */
void gn_region_split(struct gn_split_item *items, int n, const struct gn_polar_box *box,
                     const struct gn_split_options *options, gn_split_part_fn part, void *context);

#endif
