/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The shadow of a frame the obvious way, to measure the renderer against: for each pixel and each
 * light above its surface one gn_rt_is_occluded() on the same trees. What the pixels see is found
 * beforehand and is not in its time. Everything else is as a careful programmer would have it:
 * arrays in the order of use, lights' numbers read once, no ray below the horizon, sums in
 * registers or in an array that stays in the cache, all threads. See render.h for the shadow
 * factor.
 */
#ifndef GN_TESTS_BENCH_PERFORMANCE_NAIVE_H
#define GN_TESTS_BENCH_PERFORMANCE_NAIVE_H

#include "server/render/render.h"

/** Which loop is outside. */
enum gn_naive_order { GN_NAIVE_PIXELS_OUTER, GN_NAIVE_LIGHTS_OUTER, GN_NAIVE_ORDERS };

/** What real objects do in the sums. */
enum gn_naive_real {
    GN_NAIVE_NO_REAL,       // the paper's reading: only virtual objects hide lights
    GN_NAIVE_REAL_FIRST,    // the sums as written: a ray at real objects for each light; at
                            // virtual ones where that one got through
    GN_NAIVE_REAL_WHERE_CUT // at virtual ones first; at real ones only from pixels that lose a
                            // light, since the others' factor is 1 whatever those hide
};

/** A pixel that sees a diffuse real surface. */
struct gn_naive_receiver {
    float org[3], shading[3], geometric[3];
    int pixel;
};

struct gn_naive_light {
    float dir[3], irradiance[3];
};

/** One frame's. */
struct gn_naive {
    const struct gn_rt *rt; // borrowed
    struct gn_pool *pool;   // borrowed
    enum gn_naive_order order;
    enum gn_naive_real real;
    bool is_unweighted; // the paper's sums, without the cosine
    int n_receivers, n_lights;
    struct gn_naive_receiver *receivers; // [n_receivers], by rows of the picture
    struct gn_naive_light *lights;       // [n_lights]
    float floor[3];                      // sums up to this are no light
    struct gn_naive_scratch *scratches;  // [workers]
    float *shadow;                       // [h][w][3], the caller's, all 1 before
    uint64_t n_rays;                     // of the last run
};

/** The receivers of the camera's pixel centres and the state's lights. 0 or -ENOMEM. */
GN_MUST_USE int gn_naive_init(struct gn_naive *naive, const struct gn_scene *scene,
                              struct gn_pool *pool, const struct gn_camera *camera,
                              const struct gn_lighting_state *light);
void gn_naive_finish(struct gn_naive *naive);
/** Fills the receivers' pixels of shadow. */
void gn_naive_run(struct gn_naive *naive, float *shadow);

#endif
