/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The environment frames of the error benchmark: painted ones, the rig's lamp room, photographs.
 */
#ifndef GN_TESTS_BENCH_ERROR_TIME_MAPS_H
#define GN_TESTS_BENCH_ERROR_TIME_MAPS_H

#include "server/light/radiance_map.h"

/** A frame with the pixels it borrows. Not to be copied. */
struct gn_bench_map {
    const char *name; // static
    struct gn_image pixels;
    struct gn_environment_frame frame;
};

/** The maps there are, in the order of the tables: painted, the rig's, photographs. factor: into
 * how many parts a side its texels are cut for references; lamps' edges need more than a sky's. */
extern const struct gn_bench_map_kind {
    const char *name;
    int factor; // even
} gn_bench_maps[];
extern const int gn_bench_n_maps;

/** What a painted map changes from frame to frame. All-zero: nothing. */
struct gn_bench_change {
    double turn_deg;  // the first lamp's, about the vertical
    bool is_lamp_off; // the first lamp
    double noise;     // relative standard deviation of each texel's channels
    uint64_t seed;    // of the noise
};

/**
 * Paints or reads the map. lamps: four lamps and a window, a fisheye of that size (0: 300); sun: a
 * sun of 0.6 degrees; overcast: an even sky and a window; rig: the rig's lamp room as its fisheye
 * takes it; others: lat-long pictures NAME.exr of the folder GN_TEST_MAPS or NAME.hdr of
 * GNOMON_DATA. 0, -ENOENT where there is no such picture, another negative errno.
 */
GN_MUST_USE int gn_bench_map_init(const char *name, int size, struct gn_bench_map *out_map);
/** The lamps map of that size, changed. */
GN_MUST_USE int gn_bench_map_init_lamps(int size, const struct gn_bench_change *change,
                                        struct gn_bench_map *out_map);
/** The same radiance at every direction, each texel in factor x factor parts. */
GN_MUST_USE int gn_bench_map_split(const struct gn_bench_map *map, int factor,
                                   struct gn_bench_map *out_map);
void gn_bench_map_finish(struct gn_bench_map *map);

#endif
