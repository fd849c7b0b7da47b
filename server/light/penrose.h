/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Hierarchical importance sampling with Penrose tiles and F-codes: a fixed set of points, each with
 * a threshold; a point is a sample where the importance exceeds its threshold. Deterministic, and a
 * rising importance only adds points.
 * Source: Ostromoukhov, Donohue, Jodoin, "Fast Hierarchical Importance Sampling with Blue Noise
 * Properties", SIGGRAPH 2004. The table of correction vectors is our own (penrose_relax.h).
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
    uint64_t path;   // a leading 1, then two bits for each child taken; a point keeps that of its
                     // first tile. Its own down to level 31, deeper by its last 32 steps
    uint8_t pair[3]; // the last three digit pairs, oldest first: 0, 1 (01) or 2 (10)
};

/** One accepted point. */
struct gn_penrose_sample {
    double x, y;                 // of the domain, [0, size): where its tile is
    double importance;           // m there
    struct gn_penrose_tile tile; // at the level that the importance requires
};

/** The importance m of a square domain [0, size]^2. Both functions must be pure. */
struct gn_penrose_importance {
    double size; // > 0
    void *context;
    /** m at a point, inside or outside the domain (0 there); >= 0, finite. */
    double (*get_at)(void *context, double x, double y);
    /** A number not below any m in the box; 0 only where all are 0. */
    double (*get_max)(void *context, const double low[static 2], const double high[static 2]);
    /** Optional: m to compare the point's code with, instead of the importance there. */
    double (*get_threshold)(void *context, const struct gn_penrose_tile *point, double importance);
};

/** Structural and phase indices; the table's sides. */
#define GN_PENROSE_INDICES 21

/**
 * How far a sample is moved for an even importance of its phase, by structural index: along its
 * tile's direction, and along that turned by 90 degrees; in tile scales. 0 where a phase does not
 * have the index. Made by penrose-table.
 */
extern const float gn_penrose_table[GN_PENROSE_INDICES][GN_PENROSE_INDICES][2];

/** F_1 = F_2 = 1; n in [1, 90]. */
uint64_t gn_penrose_fibonacci(int n);
/** The smallest level L with F_(2L+2) > importance; GN_PENROSE_LEVEL_MAX beyond F_90. */
int gn_penrose_get_level(double importance);

/**
 * Where the importance lies between those of its level: the tiling repeats itself level by level,
 * floor(21 (log_(golden^2)(1 + sqrt(5) m) - level)); [0, 20], also beside Fibonacci numbers.
 */
int gn_penrose_get_phase(double importance);
/** The last three digit pairs with weights 1, 2; 3, 5; 8, 13: [0, 20]. */
int gn_penrose_get_structure(const struct gn_penrose_tile *tile);
/** Where the correction, one phase's row of a table, moves the sample. */
void gn_penrose_get_corrected(const struct gn_penrose_sample *sample, const float (*row)[2],
                              double out_position[static 2]);

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
