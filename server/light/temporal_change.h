/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where on the sphere light has changed by much at once. Asked of places, not of lights: a region
 * that is divided anew changes its lights, not its light.
 */
#ifndef GN_SERVER_LIGHT_TEMPORAL_CHANGE_H
#define GN_SERVER_LIGHT_TEMPORAL_CHANGE_H

#include <stdbool.h>

/** Overlapping round windows over the whole sphere. */
#define GN_CHANGE_WINDOWS 64

/** Sums of luminance in each window. Zeroed: dark. A value. */
struct gn_change {
    double before[GN_CHANGE_WINDOWS], after[GN_CHANGE_WINDOWS];
    double total_before, total_after;
    double middle[GN_CHANGE_WINDOWS][3]; // unit; set by gn_change_init()
    bool is_changed[GN_CHANGE_WINDOWS];  // set by gn_change_find()
    bool any;
    double
        deviation; // largest difference of a window's sums, as a share of the larger; set by find
};

void gn_change_init(struct gn_change *change);
/** Adds a light's luminance to the sums before, or after. */
void gn_change_add(struct gn_change *change, bool is_after, const double dir[static 3],
                   double luminance);
/**
 * A window has changed where the sums differ by more than a factor of 4 and by more than 2 % of all
 * light (of the brighter moment's).
 */
void gn_change_find(struct gn_change *change);
/** Is the direction in a changed window's middle part? */
bool gn_change_has(const struct gn_change *change, const double dir[static 3]);

#endif
