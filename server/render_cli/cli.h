/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The parts of gnomon-render: options, inputs, outputs, report. Thread-safety of all: main thread.
 */
#ifndef GN_SERVER_RENDER_CLI_CLI_H
#define GN_SERVER_RENDER_CLI_CLI_H

#include <stdbool.h>
#include <stdint.h>

#include "common/camera.h"
#include "common/error.h"
#include "common/image.h"
#include "common/options.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "server/light/state.h"
#include "server/render/budget.h"
#include "server/render/progressive.h"
#include "server/render/render.h"
#include "server/scene/scene.h"

/** gnomon-render's options and help. */
extern const struct gn_program gn_cli_program;

/** What the command line asks for. Strings borrowed from options. */
struct gn_cli_request {
    struct gn_options *options; // owned
    const char *scene, *env, *camera, *out;
    // May be NULL:
    const char *env_params, *more_envs, *background, *report, *light_map, *irradiance_map,
        *shadow_png, *composite_png;
    bool has_projection;
    enum gn_projection_type projection;
    bool has_world_from_env;
    double world_from_env[4]; // quaternion w, x, y, z
    struct gn_light_options light;
    struct gn_render_options render;
    struct gn_progressive_options refine; // error 0: one ordinary picture
    int n_emitter_pieces;                 // 0: the default
    const char *emission;                 // NAME=FILE; may be NULL
    double budget_ms;                     // 0: none
    int n_threads;                        // 0: one per processor
    unsigned match;                       // of enum gn_match_part
};

/**
 * Reads and checks the command line. Returns 0, or a negative errno and a sentence. Where --help or
 * --version was asked for, nothing else is checked.
 */
GN_MUST_USE int gn_cli_request_init(struct gn_cli_request *request, int argc, char *const argv[],
                                    struct gn_error *out_error);
/** A zeroed one is fine. */
void gn_cli_request_finish(struct gn_cli_request *request);

/**
 * Reads the environment picture and makes the lighting state, without what is not needed. What is
 * written counts: a report needs the harmonics, a picture of the light its lights. In the scene's
 * global model, light starts at its real objects: the scene is borrowed until the state is freed.
 */
GN_MUST_USE int gn_cli_read_light(const struct gn_cli_request *request,
                                  const struct gn_scene *scene, const struct gn_render_needs *needs,
                                  struct gn_pool *pool, struct gn_lighting_state **out_state,
                                  struct gn_error *out_error);

/** The light of the environment picture, where there is one, and of the scene's own emitters. */
GN_MUST_USE int gn_cli_make_light(const struct gn_cli_request *request,
                                  const struct gn_scene *scene, const struct gn_render_needs *needs,
                                  struct gn_pool *pool, struct gn_lighting_state **out_state,
                                  struct gn_error *out_error);

/** The camera picture: as linear radiance, and as its codes where it has 8 bits. */
struct gn_cli_background {
    struct gn_image linear;  // [h][w][3]
    struct gn_image8 codes8; // [h][w][3], or zeroed
};

/** Reads the background, which must be of the camera's size. */
GN_MUST_USE int gn_cli_background_read(const char *path, const struct gn_camera *camera,
                                       struct gn_cli_background *out_background,
                                       struct gn_error *out_error);
/** A zeroed one is fine. */
void gn_cli_background_finish(struct gn_cli_background *background);

/** What frames of a run share. Borrowed. */
struct gn_cli_scene {
    const struct gn_scene *scene;
    const struct gn_render_needs *needs;
    struct gn_renderer *renderer;
    const struct gn_camera *camera;
    struct gn_pool *pool;
};

/** How a picture was fitted into its time. */
struct gn_cli_budget {
    int n_frames; // that were rendered for it
    uint64_t n_misses, n_switches;
    int n_lights;                   // to choose from
    struct gn_budget_choice choice; // of the last frame, the one that is written
    double ms;                      // that it took
};

/**
 * Renders the picture until a setting that fits request->budget_ms holds; times are of rendering
 * alone. *light is made anew in the number of lights that is chosen. Returns 0, or a negative errno
 * and a sentence.
 */
GN_MUST_USE int gn_cli_render_within(const struct gn_cli_request *request,
                                     const struct gn_cli_scene *scene,
                                     struct gn_lighting_state **light, struct gn_layers *layers,
                                     struct gn_render_report *out_report,
                                     struct gn_cli_budget *out_budget, struct gn_error *out_error);

/** What is written. Borrowed. */
struct gn_cli_result {
    const struct gn_camera *camera;
    const struct gn_scene *scene;
    const struct gn_lighting_state *light;
    const struct gn_layers *layers;
    const struct gn_cli_background *background; // NULL: none
    const struct gn_render_report *report;
    const struct gn_progressive_figures *refined; // NULL: it was not
    const struct gn_render_needs *needs;
    const struct gn_cli_budget *budget; // NULL: none
    int n_threads;
    uint64_t seed; // of the composite's noise
    double ms_scene, ms_light, ms_total;
};

/** Refuses outputs that cannot be written, share a path or have another format's ending, before
 * anything is rendered. */
GN_MUST_USE int gn_cli_check_outputs(const struct gn_cli_request *request,
                                     struct gn_error *out_error);

/**
 * Writes all that was asked for, each file whole or not at all, the layers last. On failure the
 * files that this call has written are removed.
 */
GN_MUST_USE int gn_cli_write_outputs(const struct gn_cli_request *request,
                                     const struct gn_cli_result *result, struct gn_pool *pool,
                                     struct gn_error *out_error);

/** Writes report.json. */
GN_MUST_USE int gn_cli_write_report(const struct gn_cli_request *request,
                                    const struct gn_cli_result *result, struct gn_error *out_error);

/** "interactive", "seed", "reference". */
const char *gn_cli_get_quality_name(enum gn_quality quality);

#endif
