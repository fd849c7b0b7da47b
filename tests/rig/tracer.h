/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's path tracer: what a camera would see of the room, with and without the virtual objects
 * really in it, with direct light alone and with bounces. Written apart from server/render: the two
 * judge each other.
 *
 * A diffuse point sends  albedo / pi * sum over lights L max(0, n_shading . w) V / pdf; V is tried
 * from the smooth surface that the vertex normals tell of. Bright light is sampled by importance
 * (environment.h); the dim rest is what the path runs into when it leaves in proportion to the
 * cosine. A mirror, glass and the reflection of a ggx surface (gloss.h) continue the path and are
 * no bounce. Of near light (emitters.h) each diffuse point takes one chosen point; so a path that
 * runs into an emitter takes its light only where no diffuse point came before: seen by the camera
 * or in a mirror.
 */
#ifndef GN_TESTS_RIG_TRACER_H
#define GN_TESTS_RIG_TRACER_H

#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "tests/rig/environment.h"
#include "tests/rig/room.h"
#include "tests/rig/view.h"

#define GN_RIG_MAX_BOUNCES 8

/** The pictures that one rendering makes from the same paths. */
enum gn_rig_picture {
    GN_RIG_BACKGROUND = 0,     // without the virtual objects, direct light
    GN_RIG_BACKGROUND_BOUNCES, // without, all bounces
    GN_RIG_TRUTH,              // with them, direct light
    GN_RIG_TRUTH_BOUNCES,      // with them, all bounces
    GN_RIG_PICTURES
};

struct gn_rig_render_options {
    int bounces;    // [0, GN_RIG_MAX_BOUNCES], default 0
    int batches;    // independent estimates a pixel, [2, 64], default 8: error bars need several
    int batch_size; // paths in each, a power of two, [1, 4096], default 16
    uint64_t seed;  // default 0
    int frame;      // makes the noise of the frames of a sequence independent
};

/** Mean radiance and its standard error, from the spread of the batches. Owned. */
struct gn_rig_pictures {
    struct gn_image mean[GN_RIG_PICTURES];  // [height][width][3]
    struct gn_image error[GN_RIG_PICTURES]; // [height][width][3]
    struct gn_image object;                 // [height][width][1], share covered by virtual objects
};

/**
 * Renders through a box filter of one pixel. Where a path meets no virtual object, background and
 * truth are the same sample to the bit. The same bits on one thread and on many.
 * Returns 0, -EINVAL (options), -ENOMEM. Thread-safety: safe.
 */
GN_MUST_USE int gn_rig_render(const struct gn_rig_room *room, const struct gn_rig_environment *env,
                              const struct gn_rig_view *view,
                              const struct gn_rig_render_options *options, struct gn_pool *pool,
                              struct gn_rig_pictures *out_pictures, struct gn_error *out_error);

/** Frees the pictures and zeroes *pictures. */
void gn_rig_pictures_finish(struct gn_rig_pictures *pictures);

#endif
