/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's near light: lamps and the triangles of objects that send light. Written apart from
 * server/light: light is sent by points chosen evenly over the emitters' surfaces, and that is all.
 */
#ifndef GN_TESTS_RIG_EMITTERS_H
#define GN_TESTS_RIG_EMITTERS_H

#include <stdbool.h>

#include "common/error.h"
#include "proto/attr.h"

#define GN_RIG_MAX_LAMPS 4

/** A lamp: a sphere that sends alike all around, not seen and in nobody's way. */
struct gn_rig_lamp {
    double position[3];  // m
    double intensity[3]; // W/sr
    double radius;       // m, 0: a point
    bool is_virtual;
};

/** One triangle that sends emission from the side where it is seen counter-clockwise. */
struct gn_rig_emitter {
    double corners[3][3]; // m, world
    double normal[3];     // unit, to the side that sends
    double area;          // m^2
    double emission[3];   // W/(sr m^2)
    bool is_virtual;
};

/** Thread-safety: immutable after the last add. */
struct gn_rig_emitters {
    int n;
    struct gn_rig_emitter *list; // [n], owned
    double *cdf;                 // [n] of area times the channels' sum, rising; owned
};

/** Light of one chosen point. */
struct gn_rig_near_sample {
    double dir[3];   // unit, to the light
    double distance; // m
    double given[3]; // irradiance at normal incidence over the point's density, W/m^2
    bool is_virtual;
};

/** Adds a triangle; its normal and area are filled in. 0 or -ENOMEM. */
GN_MUST_USE int gn_rig_emitters_add(struct gn_rig_emitters *emitters,
                                    const struct gn_rig_emitter *emitter);
/** Frees all and zeroes. */
void gn_rig_emitters_finish(struct gn_rig_emitters *emitters);

/** A triangle in proportion to its flux, a point evenly on it. False: it sends nothing there. */
bool gn_rig_emitters_sample(const struct gn_rig_emitters *emitters, const double point[static 3],
                            const double uv[static 2], struct gn_rig_near_sample *out_sample);
/** A point evenly on the lamp's sphere. False: it sends nothing there. */
bool gn_rig_lamp_sample(const struct gn_rig_lamp *lamp, const double point[static 3],
                        const double uv[static 2], struct gn_rig_near_sample *out_sample);

#endif
