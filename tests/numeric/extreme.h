/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Stages at extreme places: a stage put together about the origin in metres is taken to a scale and
 * a pose as a whole, with its camera and lights, and rendered by every way that must not matter.
 */
#ifndef GN_TESTS_NUMERIC_EXTREME_H
#define GN_TESTS_NUMERIC_EXTREME_H

#include "tests/stage.h"

/** Where a stage stands: its own coordinates times scale, then the pose. */
struct gn_extreme_place {
    double scale;
    struct gn_pose pose;
};

/** In the middle of the world, at the scale. */
struct gn_extreme_place gn_extreme_at_scale(double scale);
/** Turned by no nice angle about no nice axis, and that many of its sizes (m before the scale) away
 * from the origin. */
struct gn_extreme_place gn_extreme_away(double scale, double sizes);

/** The largest step between coordinates of a stage of about 4 sizes that far away, in its sizes. */
double gn_extreme_get_step(double sizes);

/** Before commit: takes all objects there. */
void gn_extreme_move_objects(struct gn_test_stage *stage, const struct gn_extreme_place *place);
/** As gn_test_stage_aim with the eye and target there. */
void gn_extreme_aim(struct gn_test_stage *stage, const struct gn_extreme_place *place, int side,
                    double focal, const double eye[static 3], const double target[static 3]);
/** A white sky, brighter to one side and with a sun 35 degrees up, that turns with the place; a map
 * of 2 height x height texels, height a multiple of 8, and 32 lights from it. */
void gn_extreme_set_sky(struct gn_test_stage *stage, const struct gn_extreme_place *place,
                        int height);
/** n distant lights with directions of the stage's own, at most 64. */
void gn_extreme_set_lights(struct gn_test_stage *stage, const struct gn_extreme_place *place,
                           const struct gn_light *lights, int n);

/** One picture: what is rendered, and the name for messages. */
struct gn_extreme_view {
    struct gn_test_stage *stage;
    const struct gn_scene *posed; // NULL: the stage's own
    const struct gn_layers *layers;
    enum gn_quality quality;
    const char *quality_name;
};

/**
 * Renders in all three qualities and calls judge (may be NULL) with each picture. Fails where a bit
 * of a picture depends on the plan's rules (all_passes) or on one or three threads, or where a
 * number is not finite or out of range (depth may be infinite). options: quality and all_passes are
 * not read; NULL: defaults.
 */
void gn_extreme_check(struct gn_test_stage *stage, const struct gn_scene *posed,
                      const struct gn_render_options *options,
                      void (*judge)(void *context, const struct gn_extreme_view *view),
                      void *context);

#endif
