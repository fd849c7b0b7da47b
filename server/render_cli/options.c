/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "common/pose.h"
#include "server/light_options.h"
#include "server/render_cli/cli.h"

const char *gn_cli_get_quality_name(enum gn_quality quality)
{
    static const char *const names[] = {"interactive", "seed", "reference"};
    return names[quality];
}

static bool is_set(const struct gn_cli_request *request, const char *key)
{
    return gn_options_is_set(request->options, NULL, NULL, key);
}

/** NULL where it is not set. */
static const char *get_path(const struct gn_cli_request *request, const char *key)
{
    return is_set(request, key) ? gn_options_get_string(request->options, NULL, NULL, key) : NULL;
}

static int get_int(const struct gn_cli_request *request, const char *key)
{
    return gn_options_get_int(request->options, NULL, NULL, key);
}

static int get_enum(const struct gn_cli_request *request, const char *key)
{
    return gn_options_get_enum(request->options, NULL, NULL, key);
}

/** Nine numbers with commas between them, a rotation. */
static int read_rotation(const char *text, double out_quaternion[static 4],
                         struct gn_error *out_error)
{
    double m[16];
    gn_mat4_identity(m);
    const char *rest = text;
    for (int i = 0; i < 9; i++) {
        char *end = NULL;
        double value = strtod(rest, &end);
        if (end == rest || *end != (i < 8 ? ',' : '\0') || !isfinite(value))
            return gn_error_set(out_error, -EINVAL,
                                "--world-from-env: '%s' is not nine numbers with commas between "
                                "them, such as 1,0,0,0,1,0,0,0,1",
                                text);
        m[4 * (i / 3) + i % 3] = value;
        rest = end + 1;
    }
    struct gn_pose pose;
    const char *reason = NULL;
    if (gn_pose_from_matrix(m, &pose, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "--world-from-env: no rotation: %s", reason);
    for (int k = 0; k < 4; k++)
        out_quaternion[k] = pose.rotation[k];
    return 0;
}

static void read_paths(struct gn_cli_request *request)
{
    request->scene = get_path(request, "scene");
    request->env = get_path(request, "env");
    request->emission = get_path(request, "emission");
    if (is_set(request, "emitter-pieces"))
        request->n_emitter_pieces = get_int(request, "emitter-pieces");
    request->env_params = get_path(request, "env-params");
    request->more_envs = get_path(request, "more-envs");
    request->camera = get_path(request, "camera");
    request->background = get_path(request, "background");
    request->out = get_path(request, "out");
    request->report = get_path(request, "report");
    request->light_map = get_path(request, "light-map");
    request->irradiance_map = get_path(request, "irradiance-map");
    request->shadow_png = get_path(request, "shadow-png");
    request->composite_png = get_path(request, "composite-png");
}

static bool get_bool(const struct gn_cli_request *request, const char *key)
{
    return gn_options_get_bool(request->options, NULL, NULL, key);
}

static void read_numbers(struct gn_cli_request *request)
{
    struct gn_render_options *render = &request->render;
    render->quality = (enum gn_quality)get_enum(request, "quality");
    render->shading = (enum gn_shading)get_enum(request, "shading");
    render->estimate_error = true;
    render->bounces = get_int(request, "bounces");
    render->seed = (uint64_t)get_int(request, "seed");
    if (is_set(request, "paths"))
        render->paths_per_pixel = get_int(request, "paths");
    if (render->quality == GN_QUALITY_SEED)
        request->light.method = GN_LIGHT_PARTITION_SEED;
    if (is_set(request, "light-method"))
        request->light.method = (enum gn_light_method)get_enum(request, "light-method");
    if (is_set(request, "lights"))
        request->light.n_lights = get_int(request, "lights");
    if (is_set(request, "refine"))
        request->refine.error = gn_options_get_double(request->options, NULL, NULL, "refine");
    if (is_set(request, "passes"))
        request->refine.max_passes = get_int(request, "passes");
    render->shadow_unweighted = !get_bool(request, "shadow-cosine");
    render->shadow_ignore_real = !get_bool(request, "shadow-real-blockers");
    request->has_projection = is_set(request, "env-projection");
    if (request->has_projection)
        request->projection = (enum gn_projection_type)get_enum(request, "env-projection");
    if (is_set(request, "budget-ms"))
        request->budget_ms = gn_options_get_double(request->options, NULL, NULL, "budget-ms");
    request->n_threads = get_int(request, "threads");
    request->match = gn_options_get_set(request->options, NULL, NULL, "match");
}

static int check_together(const struct gn_cli_request *request, struct gn_error *out_error)
{
    if (request->budget_ms > 0 && request->render.quality != GN_QUALITY_INTERACTIVE)
        return gn_error_set(out_error, -EINVAL,
                            "--budget-ms is for --quality interactive, not for %s, which is what "
                            "it is",
                            gn_cli_get_quality_name(request->render.quality));
    if (request->render.quality != GN_QUALITY_REFERENCE &&
        (request->render.bounces > 0 || is_set(request, "paths")))
        return gn_error_set(out_error, -EINVAL, "--%s is for --quality reference, not for %s",
                            request->render.bounces > 0 ? "bounces" : "paths",
                            gn_cli_get_quality_name(request->render.quality));
    if (request->refine.max_passes > 0 && request->refine.error == 0)
        return gn_error_set(out_error, -EINVAL,
                            "--passes: they are of --refine ERROR, which is not given");
    if (request->refine.error > 0 && request->budget_ms > 0)
        return gn_error_set(out_error, -EINVAL,
                            "--refine and --budget-ms: one ends by error, the other by time");
    if (request->composite_png && !request->background)
        return gn_error_set(out_error, -EINVAL,
                            "--composite-png: there is no composite without --background");
    return 0;
}

int gn_cli_request_init(struct gn_cli_request *request, int argc, char *const argv[],
                        struct gn_error *out_error)
{
    *request = (struct gn_cli_request){0};
    if (gn_options_create(&gn_cli_program, &request->options) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int ret = gn_options_read_arguments(request->options, argc, argv, out_error);
    if (ret < 0 || gn_options_wants_help(request->options) ||
        gn_options_wants_version(request->options))
        return ret;
    ret = gn_options_check(request->options, out_error);
    if (ret < 0)
        return ret;
    read_paths(request);
    read_numbers(request);
    ret = gn_light_options_read(request->options, NULL, NULL, &request->light, out_error);
    if (ret == 0)
        ret = check_together(request, out_error);
    request->has_world_from_env = is_set(request, "world-from-env");
    if (ret == 0 && request->has_world_from_env)
        ret =
            read_rotation(get_path(request, "world-from-env"), request->world_from_env, out_error);
    return ret;
}

void gn_cli_request_finish(struct gn_cli_request *request)
{
    gn_options_destroy(&request->options);
    *request = (struct gn_cli_request){0};
}
