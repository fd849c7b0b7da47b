/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Hierarchical importance sampling with Penrose tiles and F-codes: a fixed set of points, each with
 * a threshold; a point is a sample where the importance exceeds its threshold. Deterministic, and a
 * rising importance only adds points.
 * Source: Ostromoukhov, Donohue, Jodoin, "Fast Hierarchical Importance Sampling with Blue Noise
 * Properties", SIGGRAPH 2004. Without its table of correction vectors, which is absent: samples
 * stay where the tiles put them.
 */
#ifndef GN_SERVER_LIGHT_PENROSE_H
#define GN_SERVER_LIGHT_PENROSE_H

#include <stdint.h>

#include "proto/attr.h"

/** Samples per unit of importance and domain: N = density * m over a domain where m is constant. */
#define GN_PENROSE_DENSITY 0.10040570794311364

/** Deepest level; the importances it serves end at gn_penrose_fibonacci(90). */
#define GN_PENROSE_LEVEL_MAX 44

/** Tiles A and B are points, C to F golden triangles. */
enum gn_penrose_type {
    GN_PENROSE_A,
    GN_PENROSE_B,
    GN_PENROSE_C,
    GN_PENROSE_D,
    GN_PENROSE_E,
    GN_PENROSE_F
};

/** One tile. Points of the domain; C to F have the corners p1, p2, p3. A value. */
struct gn_penrose_tile {
    enum gn_penrose_type type;
    int direction; // 18 degrees times this, counter-clockwise from +y; [0, 20)
    int level;
    double scale;
    double p1[2];
    uint64_t code;   // value of the F-code: the threshold
    uint8_t pair[3]; // the last three digit pairs, oldest first: 0, 1 (01) or 2 (10)
};

/** One accepted point. */
struct gn_penrose_sample {
    double x, y;   // of the domain, [0, size)
    uint64_t code; // threshold
    int level;     // the one that its importance requires; direction, scale, structure at it
    int direction;
    double scale;
    int structure; // structural index, [0, 20]: the last three digit pairs, weights restarted
};

/** The importance m of a square domain [0, size]^2. Both functions must be pure. */
struct gn_penrose_importance {
    double size; // > 0
    void *context;
    /** m at a point, inside or outside the domain (0 there); >= 0, finite. */
    double (*get_at)(void *context, double x, double y);
    /** A number not below any m in the box; 0 only where all are 0. */
    double (*get_max)(void *context, const double low[static 2], const double high[static 2]);
};

/** F_1 = F_2 = 1; n in [1, 90]. */
uint64_t gn_penrose_fibonacci(int n);
/** The smallest level L with F_(2L+2) > importance; GN_PENROSE_LEVEL_MAX beyond F_90. */
int gn_penrose_get_level(double importance);

/** The tile that covers the domain. */
struct gn_penrose_tile gn_penrose_get_root(double size);
/** Corners p1, p2, p3 of a triangle. */
void gn_penrose_get_corners(const struct gn_penrose_tile *tile, double out_corners[static 3][2]);
/** Splits the tile by the production rules; returns the number of children, [1, 4]. */
int gn_penrose_split(const struct gn_penrose_tile *tile, struct gn_penrose_tile out_children[4]);

/**
 * Calls accept for each sample, in the tiles' own order, until it returns non-zero, which is
 * returned; else 0. Thread-safety: safe where the importance is.
 */
int gn_penrose_sample_domain(const struct gn_penrose_importance *importance,
                             int (*accept)(void *context, const struct gn_penrose_sample *sample),
                             void *context);

#endif
