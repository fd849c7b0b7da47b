/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A stage for tests and benchmarks of the renderer: a scene put together object by object, a
 * lat-long map painted by hand, a camera that looks at a point. What fails ends the test.
 */
#ifndef GN_TESTS_STAGE_H
#define GN_TESTS_STAGE_H

#include "server/render/render.h"

#define GN_TEST_STAGE_MAX 96

/** Caller's memory; zero it, add, commit, render, finish. */
struct gn_test_stage {
    struct gn_scene_object *objects; // until commit
    int n_objects;
    struct gn_scene *scene;
    struct gn_pool *pool; // owned
    struct gn_renderer *renderer;
    double world_from_probe[4]; // of maps to be set; all 0: the identity
    struct gn_radiance_map *map;
    struct gn_light *lights;
    struct gn_lighting_state state; // of map and lights
    struct gn_camera camera;
    struct gn_layers layers;
    struct gn_render_report report;
};

/** Adds an object at (x, y, z) with albedo, diffuse or mirror; takes the mesh. */
void gn_test_stage_add(struct gn_test_stage *stage, enum gn_rt_set role, struct gn_mesh mesh,
                       double x, double y, double z, enum gn_material_type type,
                       const float albedo[static 3]);
/** Makes scene and renderer. n_threads 0: no pool. */
void gn_test_stage_commit(struct gn_test_stage *stage, int n_threads);
/** A lat-long map from rgb(context, world direction of the texel's centre). Replaces the old one.
 */
void gn_test_stage_set_map(struct gn_test_stage *stage, int width, int height,
                           void (*paint)(void *context, const double dir[static 3],
                                         float out_rgb[static 3]),
                           void *context);
/** Lights from the map: one for each block of side x side texels that is not black, at the
 * energy's centroid. */
void gn_test_stage_set_lights_from_map(struct gn_test_stage *stage, int side);
/** n given lights. */
void gn_test_stage_set_lights(struct gn_test_stage *stage, const struct gn_light *lights, int n);
/** w x h px, focal length f px, from eye to target, z up (x up where it looks along z). */
void gn_test_stage_aim(struct gn_test_stage *stage, int width, int height, double focal,
                       const double eye[static 3], const double target[static 3]);
/** Renders into stage->layers and report; failure ends the test. */
void gn_test_stage_render(struct gn_test_stage *stage, const struct gn_render_options *options);
void gn_test_stage_finish(struct gn_test_stage *stage);

/** The world point of z = height that the pixel's centre sees; no distortion. */
void gn_test_stage_get_point(const struct gn_test_stage *stage, double x_px, double y_px,
                             double height, double out_point[static 3]);

/** A regular n-gon of the radius in z = 0, normal +z. */
struct gn_mesh gn_test_make_disc(float radius, int n);
/** The box [-x/2, x/2] x [-y/2, y/2] x [-z/2, z/2]. */
struct gn_mesh gn_test_make_box(float x, float y, float z);

#endif
