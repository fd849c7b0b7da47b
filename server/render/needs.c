/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/render.h"

#define DIFFUSE_BITS (1u << GN_MATERIAL_DIFFUSE | 1u << GN_MATERIAL_GGX)

/* Rough enough to see more than one direction of the map. */
static bool is_rough(const struct gn_material *material)
{
    return material->type == GN_MATERIAL_GGX ||
           (material->type == GN_MATERIAL_GLASS && material->roughness > 0);
}

static const char *why_no_pyramid(const struct gn_scene *scene)
{
    for (int i = 0; i < scene->n_objects; i++) {
        const struct gn_scene_object *object = &scene->objects[i];
        const struct gn_mesh *mesh = &object->mesh;
        if (object->role != GN_RT_VIRTUAL)
            continue;
        if (object->has_material && is_rough(&object->material))
            return NULL;
        for (int m = 0; !object->has_material && mesh->material && m < mesh->n_materials; m++) {
            if (is_rough(&mesh->materials[m].factors))
                return NULL;
        }
    }
    return "no glossy material among the virtual objects";
}

void gn_render_get_needs(const struct gn_scene *scene, const struct gn_render_options *options,
                         struct gn_render_needs *out_needs)
{
    bool has_real = scene->n_real_triangles > 0;
    // What is lit: a surface that is drawn, or a real one that a drawn one shows in itself.
    bool lights_surfaces =
        (scene->virtual_materials & DIFFUSE_BITS) || (scene->virtual_materials && has_real);
    bool throws_shadows = !options->no_shadow && scene->n_virtual_triangles > 0 && has_real;
    bool by_map = options->shading == GN_SHADING_IRRADIANCE;
    *out_needs = (struct gn_render_needs){.why_no_pyramid = why_no_pyramid(scene)};
    if (options->quality == GN_QUALITY_REFERENCE) {
        out_needs->why_no_lights = out_needs->why_no_sh =
            "the reference takes each texel as a light";
        return;
    }
    if (!(lights_surfaces && !by_map) && !throws_shadows)
        out_needs->why_no_lights =
            scene->n_virtual_triangles == 0 ? "the scene has no virtual object"
            : lights_surfaces               ? "irradiance shading, and no shadow asked for"
                                            : "nothing is lit by lights or throws a shadow";
    if (!(lights_surfaces && by_map))
        out_needs->why_no_sh = scene->n_virtual_triangles == 0 ? "the scene has no virtual object"
                               : by_map                        ? "no surface is lit"
                                        : "surfaces are shaded by the lights";
}
