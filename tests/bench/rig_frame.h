/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's test scene (section 6) for benchmarks: the rig's room, 814 triangles with the teapot,
 * camera 500 mm from the marker, the lamp room with four lamps on as its 300 x 300 fisheye sees it,
 * and the lights that the paper's partition makes of it at the settings of seed_settings.h. What
 * fails ends the benchmark.
 */
#ifndef GN_TESTS_BENCH_RIG_FRAME_H
#define GN_TESTS_BENCH_RIG_FRAME_H

#include "server/render/render.h"

/** Caller's memory. */
struct gn_bench_rig {
    struct gn_pool *pool;
    struct gn_scene *scene;
    struct gn_renderer *renderer;
    struct gn_layers layers;
    struct gn_render_report report;
    struct gn_camera camera;
    struct gn_image pixels;
    struct gn_environment_frame frame;
};

void gn_bench_rig_init(struct gn_bench_rig *rig, int n_threads);
void gn_bench_rig_finish(struct gn_bench_rig *rig);
/** 4:3, 500 mm from the marker, 35 degrees above the table. */
void gn_bench_rig_aim(struct gn_bench_rig *rig, int width);
/** The lights that these options make; the caller's. */
struct gn_lighting_state *gn_bench_rig_make_light(struct gn_bench_rig *rig,
                                                  const struct gn_light_options *options);
/** The paper's n_lights, one of those of seed_settings.h; the caller's. */
struct gn_lighting_state *gn_bench_rig_make_seed_light(struct gn_bench_rig *rig, int n_lights);
/** One frame into layers and report. */
void gn_bench_rig_render(struct gn_bench_rig *rig, const struct gn_lighting_state *light,
                         const struct gn_render_options *options);

#endif
