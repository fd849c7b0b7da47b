/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Light in time: short streams of environment frames, 30 a second, through one setting.
 */
#ifndef GN_TESTS_BENCH_ERROR_TIME_SEQUENCE_H
#define GN_TESTS_BENCH_ERROR_TIME_SEQUENCE_H

#include "tests/bench/error_time/scenes.h"
#include "tests/bench/error_time/settings.h"

/** Frames of a stream. */
#define GN_BENCH_FRAMES 12
/** Side of its fisheye, px. */
#define GN_BENCH_STREAM_SIZE 150

/** What one setting makes of the streams of the lamps map. */
struct gn_bench_steadiness {
    int n_lights;        // of the last frame
    double flicker;      // a lamp moves by half a degree a frame, 1 % noise: mean |step of x - step
                         // of r| / mean |step of r| of the shadow factor where any r has a shadow
    double noise_codes;  // nothing moves, 1 % noise: 95th percentile over the picture of the
                         // composite's standard deviation in time, in 8-bit sRGB codes
    int response_frames; // a lamp goes on: frames until the picture has made 90 % of its change
                         // and keeps it; 1: the first one; GN_BENCH_FRAMES: not in the stream
};

/** A lamp that moves, one that rests, one that goes on. */
enum gn_bench_stream { GN_BENCH_MOVING, GN_BENCH_RESTING, GN_BENCH_SWITCHED, GN_BENCH_STREAMS };

/** The streams, and the moving one's references, without noise. */
struct gn_bench_streams {
    struct gn_bench_scene *scene;                                // borrowed
    struct gn_bench_map maps[GN_BENCH_STREAMS][GN_BENCH_FRAMES]; // owned
    struct gn_bench_picture references[GN_BENCH_FRAMES];         // owned
};

/** Makes the references. 0 or a negative errno. */
GN_MUST_USE int gn_bench_streams_init(struct gn_bench_streams *streams,
                                      struct gn_bench_cache *cache, struct gn_bench_scene *scene);
void gn_bench_streams_finish(struct gn_bench_streams *streams);

/** smoothing: s, of gn_light_options. 0 or a negative errno. */
GN_MUST_USE int gn_bench_measure_steadiness(const struct gn_bench_streams *streams,
                                            const struct gn_bench_setting *setting,
                                            double smoothing,
                                            struct gn_bench_steadiness *out_steadiness);

#endif
