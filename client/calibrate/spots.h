/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Bright spots and bright circles in a picture: lamps in a fisheye, a fisheye's image circle, a
 * mirror ball. Thread-safety: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_SPOTS_H
#define GN_CLIENT_CALIBRATE_SPOTS_H

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

#define GN_SPOTS_MAX 32

/** A lamp as seen: the centre of its light, below a pixel. */
struct gn_spot {
    double xy[2];
    double light; // sum of what lies above the spot's surroundings
    int n_pixels;
};

/**
 * The brightest spots of linear light, brightest first: connected pixels (8 neighbours) above
 * `share` of the picture's largest value, their centre weighted by the light above that bound.
 * Spots of more than a tenth of the picture's pixels are none. light: 1 channel. Returns their
 * number, at most max <= GN_SPOTS_MAX, or -ENOMEM.
 */
GN_MUST_USE int gn_spots_find(const struct gn_image *light, double share, int max,
                              struct gn_spot *out_spots);

/** A circle. */
struct gn_circle {
    double center[2]; // px
    double radius;    // px
    double rms;       // px, of the points' distances to it
    int n_points;     // that lie on it
};

/**
 * The circle through most points xy[n][2]: random triples (seeded), then least squares over those
 * within tolerance px, twice. Returns 0, or -EDOM and a sentence where fewer than a third lie on
 * one.
 */
GN_MUST_USE int gn_circle_fit(const double *xy, int n, double tolerance,
                              struct gn_circle *out_circle, struct gn_error *out_error);

/**
 * The outline of the disc of light in a dark surround, a fisheye's image circle: along 360 rays
 * from the centre of light, where the codes fall below half of what lies inside, and then exactly
 * where the light does: codes of a log sensor rise a pixel and more outside a blurred rim. codes,
 * light (linear, the same picture): 1 channel. Returns 0, or -EDOM and a sentence.
 */
GN_MUST_USE int gn_circle_find_disc(const struct gn_image *codes, const struct gn_image *light,
                                    struct gn_circle *out_circle, struct gn_error *out_error);

/**
 * The outline of a mirror ball near `guess`: the steepest change of the codes along 720 rays from
 * its centre, between 0.7 and 1.3 of its radius. The ball's surround must differ from what it
 * mirrors at its rim over at least a third of the outline. Returns 0, or -EDOM and a sentence.
 */
GN_MUST_USE int gn_circle_find_ball(const struct gn_image *codes, const struct gn_circle *guess,
                                    struct gn_circle *out_circle, struct gn_error *out_error);

#endif
