/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Materials of scene.json. */
#include <errno.h>

#include "server/scene/manifest.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

static const char *const type_names[] = {"diffuse", "mirror", "glass",
                                         "ggx"}; // enum gn_material_type

/** A number that some types have; the others refuse it. */
struct property {
    const char *key;
    unsigned types; // bit 1 << type
    double min, max;
    const char *what;
};

enum { ROUGHNESS, METALLIC, IOR, N_PROPERTIES };

static const struct property properties[N_PROPERTIES] = {
    [ROUGHNESS] = {"roughness", 1u << GN_MATERIAL_GLASS | 1u << GN_MATERIAL_GGX, 0, 1,
                   "0 is smooth, 1 as rough as can be"},
    [METALLIC] = {"metallic", 1u << GN_MATERIAL_GGX, 0, 1, "0 is a dielectric, 1 a metal"},
    [IOR] = {"ior", 1u << GN_MATERIAL_GLASS | 1u << GN_MATERIAL_GGX, 1, GN_MATERIAL_MAX_IOR,
             "index of refraction"},
};

/** Leaves *io_value where the key is absent. */
static int read_property(const struct gn_json *material, const struct property *property, int type,
                         float *io_value, struct gn_error *out_error)
{
    double value = 0;
    if (!gn_json_has(material, property->key))
        return 0;
    if (!(property->types >> type & 1))
        return gn_json_refuse(material, property->key, out_error, "a %s material has none",
                              type_names[type]);
    int ret = gn_json_get_double(material, property->key, property->min, property->max, &value,
                                 out_error);
    if (ret == 0)
        *io_value = (float)value;
    return ret;
}

static int read_albedo(const struct gn_json *material, struct gn_scene_object *object,
                       struct gn_error *out_error)
{
    double albedo[3] = {1.0, 1.0, 1.0};
    int ret = 0;
    if (gn_json_has(material, "albedo"))
        ret = gn_json_get_numbers(material, "albedo", 3, albedo, out_error);
    for (int k = 0; k < 3 && ret == 0; k++) {
        if (!(albedo[k] >= 0.0 && albedo[k] <= 1.0))
            return gn_json_refuse(material, "albedo", out_error,
                                  "%g is outside [0, 1]: reflectance, linear Rec.709", albedo[k]);
        object->material.albedo[k] = (float)albedo[k];
    }
    return ret;
}

int gn_manifest_read_material(const struct gn_json *item, struct gn_scene_object *object,
                              struct gn_error *out_error)
{
    static const char *const keys[] = {"type", "albedo",   "roughness",       "metallic",
                                       "ior",  "emission", "emission_stream", "emission_scale"};
    struct gn_json json = {0};
    struct gn_material *material = &object->material;
    int type = 0;
    if (!gn_json_has(item, "material"))
        return 0;
    int ret = gn_json_get_object(item, "material", &json, out_error);
    if (ret == 0)
        ret = gn_json_check_keys(&json, keys, LENGTH(keys), out_error);
    if (ret == 0)
        ret = gn_json_get_enum(&json, "type", type_names, LENGTH(type_names), &type, out_error);
    if (ret == 0)
        ret = read_property(&json, &properties[ROUGHNESS], type, &material->roughness, out_error);
    if (ret == 0)
        ret = read_property(&json, &properties[METALLIC], type, &material->metallic, out_error);
    if (ret == 0)
        ret = read_property(&json, &properties[IOR], type, &material->ior, out_error);
    if (ret == 0)
        ret = read_albedo(&json, object, out_error);
    if (ret < 0)
        return ret;
    material->type = (enum gn_material_type)type;
    // Diffuse without an albedo: the mesh's own colours.
    object->has_material = gn_json_has(&json, "albedo") || type != GN_MATERIAL_DIFFUSE;
    return gn_manifest_read_emission(&json, object, out_error);
}
