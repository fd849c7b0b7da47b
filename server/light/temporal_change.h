/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where on the sphere light has changed by much at once. Asked of places, not of lights: a region
 * that is divided anew changes its lights, not its light.
 */
#ifndef GN_SERVER_LIGHT_TEMPORAL_CHANGE_H
#define GN_SERVER_LIGHT_TEMPORAL_CHANGE_H

#include <stdbool.h>

#include "proto/attr.h"
#include "server/light/radiance_map.h"

/** Overlapping round windows over the whole sphere. */
#define GN_CHANGE_WINDOWS 64
/** Their sums of luminance, and that of the whole sphere behind them. */
#define GN_CHANGE_SUMS (GN_CHANGE_WINDOWS + 1)

/** What has changed. A value. */
struct gn_change {
    double middle[GN_CHANGE_WINDOWS][3]; // unit
    bool is_changed[GN_CHANGE_SUMS];
    bool any;
    double deviation; // largest difference of a window's sums, as a share of the larger whole
};

/** Adds light of that luminance, W/m^2, from a unit direction to the sums. */
void gn_change_add(double sums[static GN_CHANGE_SUMS], const double dir[static 3],
                   double luminance);
/** What of the windows depends on a map's table only: which of its patches lie in which. */
struct gn_change_windows;
/** Of a table that has all else but them. Returns 0 or -ENOMEM; *out_windows is NULL then. */
GN_MUST_USE int gn_change_windows_create(const struct gn_map_table *table,
                                         struct gn_change_windows **out_windows);
/** NULL-safe; nulls *windows. */
void gn_change_windows_destroy(struct gn_change_windows **windows);

/**
 * The sums of the light of a map that was made from a frame, its fill included. Of the map alone,
 * so that they do not depend on what else is made of it; in patches (server/light/map_table.h) of
 * about 1/48 of its longer side, W/m^2 of luminance.
 */
void gn_change_measure(const struct gn_radiance_map *map, double out_sums[static GN_CHANGE_SUMS]);
/**
 * A window has changed where the sums differ by more than a factor of 4 and by more than 2 % of all
 * light (of the brighter moment's).
 */
void gn_change_find(struct gn_change *change, const double before[static GN_CHANGE_SUMS],
                    const double after[static GN_CHANGE_SUMS]);
/** Is the direction in a changed window's middle part? */
bool gn_change_has(const struct gn_change *change, const double dir[static 3]);

#endif
