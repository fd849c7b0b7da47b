/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What sends light in scene.json: emission of materials, and
 *   "lights": [{"type": "point", "position", "intensity", "radius", "role"}].
 */
#include "server/scene/manifest.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

static int read_color(const struct gn_json *item, const char *key, const char *unit,
                      float out[static 3], struct gn_error *out_error)
{
    double rgb[3];
    int ret = gn_json_get_numbers(item, key, 3, rgb, out_error);
    if (ret < 0)
        return ret;
    for (int k = 0; k < 3; k++) {
        if (!(rgb[k] >= 0.0 && rgb[k] <= GN_SCENE_MAX_EMISSION))
            return gn_json_refuse(item, key, out_error,
                                  "%g is outside [0, 1e12] %s, linear Rec.709", rgb[k], unit);
        out[k] = (float)rgb[k];
    }
    return 0;
}

int gn_manifest_read_emission(const struct gn_json *material, struct gn_scene_object *object,
                              struct gn_error *out_error)
{
    int ret = 0;
    if (gn_json_has(material, "emission"))
        ret = read_color(material, "emission", "W/(sr m^2)", object->emission, out_error);
    if (ret < 0)
        return ret;
    if (!gn_json_has(material, "emission_stream")) {
        return gn_json_has(material, "emission_scale")
                   ? gn_json_refuse(material, "emission_scale", out_error,
                                    "it scales a stream's picture: there is no emission_stream")
                   : 0;
    }
    const char *stream = NULL;
    ret = gn_json_get_string(material, "emission_stream", &stream, out_error);
    if (ret < 0)
        return ret;
    if (!stream[0] || strlen(stream) > GN_SCENE_MAX_STREAM)
        return gn_json_refuse(material, "emission_stream", out_error, "a name has 1 to %d bytes",
                              GN_SCENE_MAX_STREAM);
    double scale = 1.0;
    if (gn_json_has(material, "emission_scale"))
        ret = gn_json_get_double(material, "emission_scale", 1e-12, GN_SCENE_MAX_EMISSION, &scale,
                                 out_error);
    if (ret < 0)
        return ret;
    object->emission_scale = (float)scale;
    object->emission_stream = strdup(stream);
    return object->emission_stream
               ? 0
               : gn_error_set(out_error, -ENOMEM, "%s: out of memory", material->file);
}

static int read_light(const struct gn_json *item, struct gn_scene_light *light,
                      struct gn_error *out_error)
{
    static const char *const keys[] = {"type", "position", "intensity", "radius", "role"};
    static const char *const types[] = {"point"};
    static const char *const roles[] = {"real", "virtual"};
    static const enum gn_rt_set role_sets[] = {GN_RT_REAL, GN_RT_VIRTUAL};
    int type = 0;
    int role = 0;
    double radius = 0.0;
    int ret = gn_json_check_keys(item, keys, LENGTH(keys), out_error);
    if (ret == 0)
        ret = gn_json_get_enum(item, "type", types, LENGTH(types), &type, out_error);
    if (ret == 0)
        ret = gn_json_get_numbers(item, "position", 3, light->position, out_error);
    if (ret == 0)
        ret = read_color(item, "intensity", "W/sr", light->intensity, out_error);
    if (ret == 0 && gn_json_has(item, "radius"))
        ret = gn_json_get_double(item, "radius", 0.0, GN_RT_MAX_COORDINATE, &radius, out_error);
    if (ret == 0 && gn_json_has(item, "role"))
        ret = gn_json_get_enum(item, "role", roles, LENGTH(roles), &role, out_error);
    if (ret < 0)
        return ret;
    for (int k = 0; k < 3; k++) {
        if (!(light->position[k] >= -GN_RT_MAX_COORDINATE &&
              light->position[k] <= GN_RT_MAX_COORDINATE))
            return gn_json_refuse(item, "position", out_error, "%g is outside [-1e11, 1e11] m",
                                  light->position[k]);
    }
    light->radius = (float)radius;
    light->role = role_sets[role];
    return 0;
}

int gn_manifest_read_lights(const struct gn_json *root, struct gn_scene_light **out_lights,
                            int *out_n_lights, struct gn_error *out_error)
{
    struct gn_json array = {0};
    *out_lights = NULL;
    *out_n_lights = 0;
    if (!gn_json_has(root, "lights"))
        return 0;
    int ret = gn_json_get_array(root, "lights", 0, GN_SCENE_MAX_LIGHTS, &array, out_error);
    int n = ret < 0 ? 0 : (int)json_array_size(array.value);
    if (ret < 0 || n == 0)
        return ret;
    struct gn_scene_light *lights = calloc((size_t)n, sizeof(*lights));
    if (!lights)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", root->file);
    for (int i = 0; i < n && ret == 0; i++) {
        struct gn_json item = {0};
        ret = gn_json_get_item(&array, (size_t)i, &item, out_error);
        if (ret == 0)
            ret = read_light(&item, &lights[i], out_error);
    }
    if (ret < 0) {
        free(lights);
        return ret;
    }
    *out_lights = lights;
    *out_n_lights = n;
    return 0;
}
