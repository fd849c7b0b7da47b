/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The scenes of the error benchmark and their pictures, the reference's kept on disk.
 */
#ifndef GN_TESTS_BENCH_ERROR_TIME_SCENES_H
#define GN_TESTS_BENCH_ERROR_TIME_SCENES_H

#include "tests/bench/error_time/maps.h"
#include "tests/stage.h"

#define GN_BENCH_SCENES 2
extern const char *const gn_bench_scene_names[GN_BENCH_SCENES];

/** ball: a sphere over a plane. teapot: the rig's coarse teapot before a real wall, beside a real
 * box, so that real blockers and a second receiver count. */
struct gn_bench_scene {
    const char *name; // static
    struct gn_test_stage stage;
    struct gn_test_stage backdrop; // the real objects alone, shaded: the camera's picture
};

void gn_bench_scene_init(struct gn_bench_scene *scene, int index, int width, int height);
void gn_bench_scene_finish(struct gn_bench_scene *scene);

/** What a frame shows, one ray a pixel. */
struct gn_bench_picture {
    struct gn_image shadow;       // [h][w][3]
    struct gn_image virtual_rgba; // [h][w][4]
    struct gn_image background;   // [h][w][3] radiance of the real scene; the reference's only
};

/** Where references are kept, and how they are made. */
struct gn_bench_cache {
    const char *folder;   // borrowed; NULL: nothing is kept
    struct gn_pool *pool; // may be NULL
    int n_made, n_read;   // counted
    double seconds;       // spent on making
};

/**
 * The texel-exact picture: quality reference with each texel of the map in factor x factor parts of
 * its radiance. Read from the cache where its inputs' hash is there, else made and kept. Returns 0
 * or a negative errno.
 */
GN_MUST_USE int gn_bench_make_reference(struct gn_bench_cache *cache, struct gn_bench_scene *scene,
                                        const struct gn_bench_map *map, int factor,
                                        struct gn_bench_picture *out_picture);
void gn_bench_picture_finish(struct gn_bench_picture *picture);

#endif
