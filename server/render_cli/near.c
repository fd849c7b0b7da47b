/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The scene's own light: lamps, emissive meshes, a still picture on a screen. */
#include <errno.h>
#include <string.h>

#include "common/image_file.h"
#include "server/light/emitters.h"
#include "server/render_cli/cli.h"

/** --emission NAME=FILE: codes are sRGB, EXR and Radiance linear. */
static int lay_picture(const char *argument, struct gn_emitters *emitters,
                       struct gn_error *out_error)
{
    const char *file = strchr(argument, '=');
    char name[GN_SCENE_MAX_STREAM + 1] = "";
    struct gn_image_file read = {0};
    struct gn_image image = {0};
    if (!file || file - argument > GN_SCENE_MAX_STREAM || !file[1])
        return gn_error_set(out_error, -EINVAL, "--emission %s: NAME=FILE is right", argument);
    memcpy(name, argument, (size_t)(file - argument));
    file++;
    int stream = gn_emitters_find_stream(emitters, name);
    if (stream < 0)
        return gn_error_set(out_error, -EINVAL,
                            "--emission %s: the scene has no emission_stream \"%s\"", argument,
                            name);
    int ret = gn_image_read_file(file, &read, out_error);
    if (ret == 0 && (ret = gn_image_file_to_float(&read, 0, &image)) < 0)
        (void)gn_error_set(out_error, ret, "%s: out of memory", file);
    if (ret == 0 && read.kind != GN_IMAGE_LINEAR) {
        const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
        gn_response_to_radiance(&srgb, image.data, (long)image.width * image.height);
    }
    if (ret == 0)
        ret = gn_emitters_set_picture(emitters, stream, &image, out_error);
    gn_image_finish(&image);
    gn_image_file_finish(&read);
    return ret;
}

int gn_cli_make_light(const struct gn_cli_request *request, const struct gn_scene *scene,
                      const struct gn_render_needs *needs, struct gn_pool *pool,
                      struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    const struct gn_emitter_options options = {.n_pieces = request->n_emitter_pieces};
    struct gn_emitters *emitters = NULL;
    struct gn_emission *emission = NULL;
    struct gn_lighting_state *state = NULL;
    *out_state = NULL;
    int ret = gn_emitters_create(scene, &options, &emitters, out_error);
    if (ret == 0 && request->emission)
        ret = lay_picture(request->emission, emitters, out_error);
    if (ret < 0)
        goto out;
    emission = gn_emitters_get_emission(emitters);
    if (request->env)
        ret = gn_cli_read_light(request, scene, needs, pool, &state, out_error);
    else if (emission)
        ret = gn_lighting_state_create_dark(emission, &request->light, 0, &state, out_error);
    else
        ret = gn_error_set(out_error, -EINVAL,
                           "%s: has no lamp and nothing that sends light: --env must give it",
                           request->scene);
    if (ret == 0 && (ret = gn_lighting_state_set_emission(state, emission)) < 0)
        (void)gn_error_set(out_error, ret, "%s: out of memory", request->scene);
    if (ret == 0) {
        *out_state = state;
        state = NULL;
    }
out:
    gn_lighting_state_unref(&state);
    gn_emission_unref(&emission);
    gn_emitters_destroy(&emitters);
    return ret;
}
