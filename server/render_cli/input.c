/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/device_json.h"
#include "common/image_file.h"
#include "common/json.h"
#include "server/light/blend.h"
#include "server/light/map_geometry.h"
#include "server/render_cli/cli.h"

/** --env-params, with what the command line says besides. */
static int read_params(const struct gn_cli_request *request, struct gn_probe_setup *setup,
                       bool *out_has_response, struct gn_error *out_error)
{
    struct gn_json root = {0};
    int ret = gn_json_load_file(request->env_params, &root, out_error);
    if (ret < 0)
        return ret;
    // The file may leave out the projection where the command line has it, which counts anyway.
    if (request->has_projection &&
        json_object_set_new(root.value, "projection",
                            json_string(gn_projection_get_name(request->projection))) < 0)
        ret = gn_error_set(out_error, -ENOMEM, "%s: out of memory", request->env_params);
    if (ret == 0 && request->has_world_from_env && gn_json_has(&root, "orientation"))
        ret = gn_json_refuse(&root, "orientation", out_error,
                             "--world-from-env says it, too: leave one out");
    *out_has_response = gn_json_has(&root, "response");
    if (ret == 0)
        ret = gn_probe_setup_read_json(&root, setup, out_error);
    gn_json_finish(&root);
    return ret;
}

static int read_setup(const struct gn_cli_request *request, struct gn_probe_setup *setup,
                      bool *out_has_response, struct gn_error *out_error)
{
    gn_probe_setup_init(setup);
    *out_has_response = false;
    int ret = 0;
    if (request->env_params)
        ret = read_params(request, setup, out_has_response, out_error);
    else if (request->has_projection)
        setup->projection.type = request->projection;
    if (request->has_world_from_env)
        memcpy(setup->world_from_probe.rotation, request->world_from_env,
               sizeof(request->world_from_env));
    return ret;
}

/** The size of the picture must be what the parameters say, where they say it. */
static int init_projection(const struct gn_cli_request *request, const struct gn_image *image,
                           struct gn_projection *projection, struct gn_error *out_error)
{
    if ((projection->width && projection->width != image->width) ||
        (projection->height && projection->height != image->height))
        return gn_error_set(out_error, -EINVAL, "%s: %d x %d pixels, but %s says %d x %d",
                            request->env, image->width, image->height, request->env_params,
                            projection->width, projection->height);
    projection->width = image->width;
    projection->height = image->height;
    const char *reason = NULL;
    if (gn_projection_init(projection, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "%s: the projection does not fit: %s", request->env,
                            reason);
    return 0;
}

/** Says so where the global model does nothing: a probe whose place is wrong looks past all. */
static void note_model(const struct gn_cli_request *request, const struct gn_lighting_state *state)
{
    const struct gn_map_geometry *geometry = state->map->geometry;
    if (geometry && geometry->n_covered == 0)
        fprintf(stderr,
                "gnomon-render: note: %s: the global model changes nothing, from [%g, %g, %g] m "
                "the probe sees no real object: is \"position\" in --env-params its place?\n",
                request->env, geometry->position[0], geometry->position[1], geometry->position[2]);
}

/** Of one probe. */
static int read_probe(const struct gn_cli_request *request, const struct gn_scene *scene,
                      const struct gn_render_needs *needs, struct gn_pool *pool,
                      struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    static const int code_max[] = {0, 255, 65535}; // of enum gn_image_kind
    struct gn_image_file file = {0};
    struct gn_image image = {0};
    struct gn_probe_setup setup;
    struct gn_error reason = {0};
    bool has_response = false;
    *out_state = NULL;
    int ret = read_setup(request, &setup, &has_response, out_error);
    if (ret == 0)
        ret = gn_image_read_file(request->env, &file, out_error);
    if (ret < 0)
        goto out;
    if (file.kind != GN_IMAGE_LINEAR && !has_response) {
        ret = gn_error_set(out_error, -EINVAL,
                           "%s: holds codes, not light: --env-params must give their \"response\"",
                           request->env);
        goto out;
    }
    bool is_12_bit = file.kind == GN_IMAGE_CODES16 && setup.is_12_bit;
    ret = gn_image_file_to_float(&file, is_12_bit ? 4095 : 0, &image);
    if (ret < 0) {
        ret = gn_error_set(out_error, ret, "%s: out of memory", request->env);
        goto out;
    }
    ret = init_projection(request, &image, &setup.projection, out_error);
    if (ret < 0)
        goto out;
    gn_probe_mask_fill(setup.masks, setup.n_masks, image.data, image.width, image.height,
                       image.channels, GN_PROBE_MASK_F32);
    struct gn_environment_frame frame = {
        .codes = &image,
        .code_max = is_12_bit ? 4095 : code_max[file.kind],
        .projection = setup.projection,
        .response = setup.response,
    };
    memcpy(frame.world_from_probe, setup.world_from_probe.rotation, sizeof(frame.world_from_probe));
    memcpy(frame.position, setup.world_from_probe.translation, sizeof(frame.position));
    struct gn_light_options light = request->light;
    light.no_sh = needs->why_no_sh && !request->report && !request->irradiance_map;
    light.want_pyramid = !needs->why_no_pyramid;
    light.no_lights = needs->why_no_lights && !request->light_map;
    const struct gn_radiance_map_options map = {.model =
                                                    scene->model == GN_MODEL_GLOBAL ? scene : NULL};
    ret = gn_lighting_state_create(&frame, &map, &light, pool, out_state, &reason);
    if (ret < 0)
        (void)gn_error_set(out_error, ret, "%s: %s", request->env, reason.text);
    else
        note_model(request, *out_state);
out:
    gn_image_finish(&image);
    gn_image_file_finish(&file);
    return ret;
}

/** The other probes of --more-envs, behind the n that are there; *list is written over. */
static int read_more(const struct gn_cli_request *request, const struct gn_scene *scene,
                     const struct gn_render_needs *needs, struct gn_pool *pool, char *list,
                     struct gn_lighting_state **states, int *n, struct gn_error *out_error)
{
    char *rest = NULL;
    for (char *item = strtok_r(list, ",", &rest); item; item = strtok_r(NULL, ",", &rest)) {
        struct gn_cli_request other = *request;
        char *params = strchr(item, '=');
        if (!params || params == item || !params[1])
            return gn_error_set(out_error, -EINVAL,
                                "--more-envs: '%s' is not a picture and its parameters, ENV=PARAMS",
                                item);
        if (*n == GN_PROBES_MAX)
            return gn_error_set(out_error, -EINVAL, "--more-envs: more than %d probes in all",
                                GN_PROBES_MAX);
        *params = '\0';
        other.env = item;
        other.env_params = params + 1;
        other.has_world_from_env = false;
        int ret = read_probe(&other, scene, needs, pool, &states[*n], out_error);
        if (ret < 0)
            return ret;
        ++*n;
    }
    return 0;
}

int gn_cli_read_light(const struct gn_cli_request *request, const struct gn_scene *scene,
                      const struct gn_render_needs *needs, struct gn_pool *pool,
                      struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    struct gn_lighting_state *states[GN_PROBES_MAX] = {0};
    char *list = NULL;
    int n = 1;
    *out_state = NULL;
    int ret = read_probe(request, scene, needs, pool, &states[0], out_error);
    if (ret == 0 && request->more_envs) {
        list = strdup(request->more_envs);
        ret = list ? read_more(request, scene, needs, pool, list, states, &n, out_error)
                   : gn_error_set(out_error, -ENOMEM, "--more-envs: out of memory");
    }
    if (ret == 0 && (ret = gn_lighting_state_join(states, n, 0, out_state)) < 0)
        (void)gn_error_set(out_error, ret, "the probes' light: out of memory");
    for (int i = 0; i < n; i++)
        gn_lighting_state_unref(&states[i]);
    free(list);
    return ret;
}

/** One channel three times; three as they are. */
static int expand(struct gn_image *image)
{
    if (image->channels == 3)
        return 0;
    struct gn_image out = {0};
    int ret = gn_image_init(&out, image->width, image->height, 3);
    if (ret < 0)
        return ret;
    size_t n = (size_t)image->width * (size_t)image->height;
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            out.data[3 * i + (size_t)k] = image->data[i * (size_t)image->channels];
    }
    gn_image_finish(image);
    *image = out;
    return 0;
}

static int copy_codes8(const struct gn_image8 *from, struct gn_image8 *out)
{
    int ret = gn_image8_init(out, from->width, from->height, 3);
    if (ret < 0)
        return ret;
    size_t n = (size_t)from->width * (size_t)from->height;
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < 3; k++)
            out->data[3 * i + k] =
                from->data[i * (size_t)from->channels + (from->channels >= 3 ? k : 0)];
    }
    return 0;
}

int gn_cli_background_read(const char *path, const struct gn_camera *camera,
                           struct gn_cli_background *out_background, struct gn_error *out_error)
{
    struct gn_image_file file = {0};
    struct gn_cli_background background = {0};
    int ret = gn_image_read_file(path, &file, out_error);
    if (ret < 0)
        return ret;
    ret = gn_image_file_to_float(&file, 0, &background.linear);
    if (ret == 0)
        ret = expand(&background.linear);
    if (ret == 0 && file.kind == GN_IMAGE_CODES8)
        ret = copy_codes8(&file.codes8, &background.codes8);
    bool is_linear = file.kind == GN_IMAGE_LINEAR;
    gn_image_file_finish(&file);
    if (ret < 0) {
        ret = gn_error_set(out_error, ret, "%s: out of memory", path);
        goto out;
    }
    const struct gn_image *linear = &background.linear;
    if (linear->width != camera->width || linear->height != camera->height) {
        ret = gn_error_set(out_error, -EINVAL, "%s: %d x %d pixels, but the camera has %d x %d",
                           path, linear->width, linear->height, camera->width, camera->height);
        goto out;
    }
    if (!is_linear)
        gn_response_to_radiance(&camera->response, linear->data,
                                (long)linear->width * linear->height);
    *out_background = background;
    background = (struct gn_cli_background){0};
out:
    gn_cli_background_finish(&background);
    return ret;
}

void gn_cli_background_finish(struct gn_cli_background *background)
{
    gn_image_finish(&background->linear);
    gn_image8_finish(&background->codes8);
}
